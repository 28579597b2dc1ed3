/* SPDX-License-Identifier: MIT */
/* Subdivision connectivity: found in a given mesh, or made by refining one. */
#ifndef PALP_TOOLS_SEMIREG_H
#define PALP_TOOLS_SEMIREG_H

#include "tools/mesh/mesh.h"

#define NO_PARENT UINT32_MAX

/* The level on which each vertex first appears, and the two ends of the edge that it splits. */
typedef struct {
    uint32_t levels; /* coarsest 0 .. finest levels - 1 */
    uint8_t *level;  /* [vertices] */
    uint32_t (*parent)[2];
} semireg;

/*
 * Undoes one-to-four splits for as long as the connectivity allows, whatever the order of the
 * vertices; a mesh without subdivision connectivity has one level.
 */
semireg semireg_detect(const mesh *m);
void semireg_free(semireg *s);

/* Triangles around each vertex of one level (vertex numbers stay those of the finest mesh). */
typedef struct {
    uint32_t vertices, triangles;
    const uint32_t (*t)[3];
    uint32_t *offset, *around;
} level_mesh;
level_mesh level_mesh_of(const uint32_t (*t)[3], uint32_t triangles, uint32_t vertices);
void level_mesh_free(level_mesh *m);
static inline uint32_t level_valence(const level_mesh *m, uint32_t v) {
    return m->offset[v + 1] - m->offset[v];
}
/* The vertex that follows `w` counter-clockwise in the ring of `v`. */
uint32_t ring_next(const level_mesh *m, uint32_t v, uint32_t w);

/* Splits every triangle in four at the edge midpoints; new vertices are appended in edge order. */
mesh subdivide_midpoint(const mesh *m);

/* One step of Loop's scheme: the same connectivity, smoothed positions. */
mesh subdivide_loop(const mesh *m);

/* Its rules: new vertex `vertex` takes `weight` of old vertex `old`. */
typedef void (*loop_taker)(void *context, uint32_t vertex, uint32_t old, double weight);
void loop_rules(const mesh *m, loop_taker take, void *context);

#endif
