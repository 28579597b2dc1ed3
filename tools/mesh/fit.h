/* SPDX-License-Identifier: MIT */
/* A mesh on the surface that it is to follow. */
#ifndef PALP_TOOLS_FIT_H
#define PALP_TOOLS_FIT_H

#include "tools/mesh/bvh.h"

/*
 * One level being drawn onto the original surface. Each vertex is a particle that lives on that
 * surface and remembers how it faces there: moves are tangential to the surface, not to the mesh,
 * so that folds of the mesh unfold, and a thin part's far side stays out of reach.
 */
typedef struct {
    mesh *m;
    const bvh *surface;
    uint32_t *offset, *ring;
    const uint32_t *across; /* mesh_across */
    double (*facing)[3];
    bool *pinned; /* base vertices and those that hold a feature */
} fit;

/* Moves vertex v along the surface a fraction of the way to the mean of those around it. */
void fit_relax(const fit *f, uint32_t v, double fraction);

/* Each vertex that is not pinned half the way to the mean of those around it, along the surface. */
void fit_relax_all(const fit *f);

/*
 * Tips of ears and fingers lie between vertices. The original vertices that are farthest from the
 * mesh get the nearest mesh vertex each, which then stays there while the others even out.
 */
void fit_reach_features(const fit *f, const mesh *original);

/* Relaxes around flipped triangles and those with a smaller angle, base vertices included, in
 * growing neighbourhoods; unfolds off the surface what is left. */
void fit_repair(const fit *f, double smallest_angle_deg);

typedef struct {
    double distance;
    uint32_t vertex; /* of the original */
} miss;

/* The original vertices farther than that from the mesh, the farthest first, into list[]; returns
 * how many. `among`: only of the first so many that list[] holds; 0: of all. */
uint32_t fit_misses(const fit *f, const mesh *original, double tolerance, miss *list,
                    uint32_t among);

/* The mesh vertex nearest to x that does not face away; UINT32_MAX if there is none. */
uint32_t fit_nearest_vertex(const fit *f, const double x[3], const double facing[3]);

/* Adds to a set of vertices those beside them. */
void fit_spread(const fit *f, bool *set);

/* Whether a triangle faces against the sum of its three neighbours; and how many do. */
bool fit_is_flipped(const mesh *m, const uint32_t *across, uint32_t triangle);
uint32_t mesh_flipped(const mesh *m);

#endif
