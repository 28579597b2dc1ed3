/* SPDX-License-Identifier: MIT */
/* Meshes and blobs that tests make for themselves, in memory. */
#ifndef PALP_TESTS_MODELS_H
#define PALP_TESTS_MODELS_H

#include "core/palp.h"
#include "tools/bake/build.h"
#include "tools/tet/tetbake.h"
#include "tools/zone/zonebake.h"

/* Unit sphere: an icosahedron split `levels` times, vertices coarse to fine. */
mesh model_sphere(uint32_t levels);
/* Box of edge `size`, `n` x `n` squares per face, each cut in two. */
mesh model_box(double size, uint32_t n);

/*
 * The surface of `count` cubes of edge `size`, n x n squares per face; *cell (to be freed) says
 * which cube each triangle belongs to.
 */
mesh model_voxels(const int (*cube)[3], uint32_t count, double size, uint32_t n, uint32_t **cell);

/* A multizone model baked in memory from a body and the lines of a model file, and the meshes of
 * its zones. */
typedef struct {
    palp_zones *zones;
    mesh part[PALP_MAX_ZONES];
    uint8_t *bytes;
    size_t size;
} zoned;
zoned model_zones(const mesh *body, const char *lines, double epsilon);

/* It posed at rest, with seams up to a level. */
palp_assembly *model_assembly(const palp_zones *zones, uint32_t finest);

/* A file of labels, one per triangle: the name of its cell. The path stays until the next call. */
char *model_labels(const uint32_t *cell, uint32_t triangles, const char *const *name);

typedef struct {
    mesh m;
    uint8_t *fixed;
    double *area;
    double (*normal)[3];
    bem_material material;
    greens g; /* as baked: raw or enforced */
    domains d;
    palp_blob blob;
    uint8_t *bytes;
    size_t size;
} baked;

/* Fixes the vertices with z at most `below` and bakes in memory. */
baked model_bake(mesh m, double below, double epsilon, bool raw, bool half);
/* The same in split form (core/green/split.h). */
baked model_bake_split(mesh m, double below, double epsilon, bool half);
/* The same for display and feeling, of another material. */
baked model_bake_young(mesh m, double below, double young_Pa);
/* The same with dense tables of the coarse constraint levels up to that many bytes. */
baked model_bake_tables(mesh m, double below, double epsilon, bool raw, bool half,
                        double table_bytes);

/* A dynamic body of such meshes, coarse to fine, pinned where x is at most `below`. */
typedef struct {
    tetmesh level[TET_LEVELS];
    uint32_t levels;
    palp_tets tets;
    uint8_t *bytes;
    size_t size;
} dynamic_body;
dynamic_body model_dynamic_body(const tetmesh *level, uint32_t levels, double below, double young,
                                double poisson, double damping_s);
/* It at rest, in ticks of tick_s; memory is never released. */
palp_dyna *model_dyna(const palp_tets *tets, palp_material material, float tick_s,
                      palp_vec3 gravity);
/* Splits every family down to `level`. */
void model_refine(palp_dyna *dyna, uint32_t level);

/* Sets the CRCs of a blob right after a change. */
void model_seal(uint8_t *bytes);

#endif
