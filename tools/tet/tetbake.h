/* SPDX-License-Identifier: MIT */
/* Bakes a dynamic body: tetrahedral meshes at several resolutions and how they hang together. */
#ifndef PALP_TOOLS_TETBAKE_H
#define PALP_TOOLS_TETBAKE_H

#include "tools/bake/body.h"
#include "core/dyna/tets.h"
#include "tools/tet/stuffing.h"

/* What a model file says of it. */
typedef struct {
    uint32_t levels;
    uint32_t nodes[TET_LEVELS];   /* about that many; of meshes that are made here */
    const char *from[TET_LEVELS]; /* or files */
    double damping_s, drag_per_s;
} tet_model;

/* For option tables. */
#define TET_OPTIONS                                                                                \
    {"--tets", -TET_LEVELS}, {"--tets-from", -TET_LEVELS}, {"--damping", 1}, { "--drag", 1 }

/* Takes one of TET_OPTIONS; false if it is another. */
bool tet_option(tet_model *t, const body_spec *body, const argument *a);

/*
 * The finished bytes, to be freed. Prints what was made on `f`; meshes are written beside
 * `save_mesh` (NULL: not).
 */
uint8_t *tet_bake(const tet_model *t, const body_spec *body, const char *save_mesh, FILE *f,
                  size_t *bytes);

/* The same of meshes that are there already, coarse to fine; pinned[l][nodes]. */
uint8_t *tet_assemble(const tetmesh *level, uint8_t *const *pinned, uint32_t levels,
                      const body_spec *body, const tet_model *t, const uint8_t sha[32],
                      uint32_t *joined, size_t *bytes);

#endif
