/* SPDX-License-Identifier: MIT */
/*
 * A body of tetrahedra at several resolutions, opened in place (AD 2.1): independent meshes, coarse
 * to fine, none nested.
 *
 * Between two neighbouring levels nodes form families: some parents of the coarser level, and their
 * children, the nodes of the finer level that lie nearest to one of them. A family splits and
 * merges as one. (The paper's families have one parent each; here parents with too few children to
 * know an affine motion by share a family with a neighbour.) So each parent is also a mean of
 * its family's children that is exact for affine motions, and each node of a finer level lies
 * in a container, a tetrahedron of the next coarser one.
 */
#ifndef PALP_DYNA_TETS_H
#define PALP_DYNA_TETS_H

#include "core/base/status.h"
#include "core/blob/format.h"
#include <stdbool.h>

typedef struct {
    const palp_tets_meta *meta;
    const float *rest_m; /* [nodes][3] */
    const palp_tet_node *node;
    const palp_tet *tet;
    const uint32_t *around_offset, *around;
    const uint32_t *container;     /* [nodes] */
    const float *container_weight; /* [nodes][4] */
    const uint32_t *family;        /* [nodes][2] as a child, as a parent; PALP_NONE */
    const uint32_t *child_offset, *child, *parent_offset, *parent;
    const uint32_t *mean_offset, *mean; /* of nodes that are parents */
    const float *mean_weight;
    const uint32_t *skin_node, *skin_triangle;
    const float *skin_normal;
    const uint32_t *skin_tet;
    const float *skin_weight;
} palp_tets;

/* Whether the blob holds such a body; looks at its header only. */
bool palp_tets_are_here(const void *data, size_t bytes);

/* Opens it with every check that the tick relies on, as palp_blob_open does. The data must stay. */
palp_status palp_tets_open(palp_tets *tets, const void *data, size_t bytes);

#endif
