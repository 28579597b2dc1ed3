/* SPDX-License-Identifier: MIT */
/* Wavelet domains and thresholded GF columns (MR 4.3-4.5), in the form in which the blob holds
 * them. */
#ifndef PALP_TOOLS_COMPRESS_H
#define PALP_TOOLS_COMPRESS_H

#include "core/blob/blob.h"
#include "greens.h"
#include "semireg.h"

/* Owns the arrays that `view` points to. */
typedef struct {
    palp_domain view;
    uint32_t *node, *level_start, *parent, *child_offset, *child;
    float *predict, *update;
    uint32_t max_row; /* longest row of W^-1 */
} domain_data;

/*
 * The domain of the nodes with fixed[i] == `fixed`. Beyond the border of the free domain the field
 * is taken as zero, which it is at fixed nodes; at the border of the fixed domain weights are
 * renormalised.
 */
domain_data domain_build(const mesh *m, const semireg *s, const uint8_t *fixed, uint32_t which,
                         const double *area, bool lifted);

typedef struct {
    palp_columns view;
    uint32_t *offset;
    uint16_t *index, *half;
    float *value, *scale;
    uint64_t blocks;     /* stored blocks without padding and without the gravity column */
    uint32_t max_groups; /* longest column, gravity apart */
    double rms, max;     /* MR 70 and 71 against the matrix that came in, gravity apart */
} columns_data;

/*
 * Transforms and thresholds the block (row domain, column domain) of `g`; a free column domain gets
 * the gravity response as its last column. Rows of fixed nodes are stored as tractions.
 */
columns_data columns_build(const greens *g, const domain_data *row, const domain_data *column,
                           uint32_t row_domain, uint32_t column_domain, const double *area,
                           double epsilon, bool half);

#endif
