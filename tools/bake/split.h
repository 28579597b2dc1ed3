/* SPDX-License-Identifier: MIT */
/*
 * What half-space and modes miss of the Green's functions (core/green/split.h): the corrections D
 * that are worth storing.
 *
 * The miss of a pair of nodes is stored where its Frobenius norm exceeds a limit times the
 * geometric mean of both nodes' own blocks, and for every node with itself. The limit is epsilon,
 * halved until the RMS error of all is at most 0.4 epsilon.
 */
#ifndef PALP_TOOLS_SPLIT_H
#define PALP_TOOLS_SPLIT_H

#include "tools/bake/compress.h"
#include "tools/bake/greens.h"
#include "tools/bake/half_space.h"
#include "tools/bake/regular.h"

typedef struct {
    const mesh *m;
    double (*normal)[3];
    half_space_material material;
    const greens *g; /* columns are the nodes; reciprocity enforced */
    const palp_domain *free;
    const regular_data *regular; /* as it will be stored */
} split_body;

typedef struct {
    columns_data columns; /* rms and max are those of B + U S U^T + D against G */
    double worst_column;  /* largest RMS error of one column */
    double worst_own;     /* largest error of a node's own block, of its norm */
} split_data;

/* Threaded; the same bits on any number of threads. Cost: about 300 multiply-adds per pair and 5
 * modes. */
split_data split_build(const split_body *body, const compress_options *options);

#endif
