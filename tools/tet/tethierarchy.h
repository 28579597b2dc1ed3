/* SPDX-License-Identifier: MIT */
/* How meshes of different resolutions of one body hang together (AD 2.1 to 2.3). */
#ifndef PALP_TOOLS_TETHIERARCHY_H
#define PALP_TOOLS_TETHIERARCHY_H

#include "tools/tet/tetmesh.h"

/* A place among tetrahedra: corner weights, exact for affine motions unless the place is so far
 * outside that they were drawn in. */
typedef struct {
    uint32_t tet;
    double weight[4];
} tet_place;

/* Where each of the points lies in m: in the tetrahedron of which it is least outside. */
tet_place *tet_places(const tetmesh *m, double (*x)[3], uint32_t count);

/* Families between a coarser mesh and the next finer one. */
typedef struct {
    uint32_t families;
    uint32_t *of_parent, *of_child; /* family of each node */
    uint32_t *mean_offset, *mean;   /* children that stand for each parent */
    double *mean_weight;
    uint32_t joined; /* parents that share a family with another */
} tet_families;

tet_families tet_families_build(const tetmesh *coarse, const tetmesh *fine);
void tet_families_free(tet_families *f);

#endif
