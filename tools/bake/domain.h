/* SPDX-License-Identifier: MIT */
/* Wavelet domains (MR 4.3): vertex sets in coarse-to-fine order with the filters of one wavelet. */
#ifndef PALP_TOOLS_DOMAIN_H
#define PALP_TOOLS_DOMAIN_H

#include "core/blob/blob.h"
#include "tools/mesh/semireg.h"

typedef enum { WAVELET_LINEAR, WAVELET_BUTTERFLY } wavelet_kind;

typedef struct {
    wavelet_kind kind;
    bool lifted;
} wavelet;

/* Owns the arrays that `view` points to. */
typedef struct {
    palp_domain view;
    uint32_t *node, *level_start, *parent, *child_offset, *child;
    float *predict, *update, *child_weight;
    uint32_t *stencil_offset, *stencil; /* butterfly only */
    float *stencil_weight;
    uint32_t max_row; /* longest row of W^-1 */
} domain_data;

/*
 * The domain of the nodes with fixed[i] == `fixed`. Beyond the border of the free domain the field
 * is taken as zero, which it is at fixed nodes; at the border of the fixed domain weights are
 * renormalised.
 */
domain_data domain_build(const mesh *m, const semireg *s, const uint8_t *fixed, uint32_t which,
                         const double *area, wavelet w);
void domain_free(domain_data *d);

#endif
