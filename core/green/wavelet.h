/* SPDX-License-Identifier: MIT */
/*
 * The lifted linear wavelet transform on a vertex domain (MR 4.3).
 *
 * Fields are float[slots][4]: x, y, z and a lane that stays zero, so that one node is one vector
 * register. In place; one fixed order of operations. Level by level,
 *
 *   forward, l = L..1     predict  x_m -= sum_a w_ma x_a     update  x_a += sum_m s_am x_m
 *   inverse, l = 1..L     update   x_a -= sum_m s_am x_m     predict x_m += sum_a w_ma x_a
 *
 * where m runs over the odd slots of level l and a over the (at most two) parents of m in the
 * domain; a butterfly wavelet predicts from the up to ten or so slots of its stencil instead.
 * Unlifted transforms are the same with s = 0.
 */
#ifndef PALP_GREEN_WAVELET_H
#define PALP_GREEN_WAVELET_H

#include "core/blob/blob.h"

#define PALP_FIELD_LANES 4u

/* x := W x. 4 lanes, 8 multiply-adds per odd slot and lane. */
void palp_wavelet_forward(const palp_domain *domain, float *x);

/*
 * x := W^-1 x up to level `level` (0..levels-1): the first level_start[level + 1] slots hold the
 * field on that level, which is the coarser level of detail of MR 9.1; later slots keep their
 * details.
 */
void palp_wavelet_inverse(const palp_domain *domain, float *x, uint32_t level);

/*
 * x := W^-T x of a linear wavelet: with loads on the nodes in x, what the details of a column are to be
 * multiplied with. Cost as palp_wavelet_inverse.
 */
void palp_wavelet_adjoint(const palp_domain *domain, float *x);

/*
 * One row of W^-1 (the operator E^T W^-1 of MR 5.3): the field at `slot` equals
 * sum_k weight[k] detail[index[k]], indices ascending.
 */
typedef struct {
    uint32_t count;
    uint16_t *index;
    float *weight;
} palp_row;

/* Scratch of palp_wavelet_row: weights[slots] and marks[(slots + 31) / 32], zero between calls. */
typedef struct {
    float *weight;
    uint32_t *mark;
} palp_row_scratch;

/*
 * Walks the tree from `slot` down to level 0 and writes its row; `row` has room for `capacity`
 * entries. Returns false, and a row of count 0, if it needs more. Cost: levels * slots / 32 words
 * scanned and one multiply-add per tree edge touched; at most meta.max_row entries.
 */
bool palp_wavelet_row(const palp_domain *domain, uint32_t slot, palp_row_scratch *scratch,
                      palp_row *row, uint32_t capacity);

/*
 * The same for a weighted mean of several nodes: palp_row_mark adds weights to `scratch`,
 * palp_row_next finds the marked slots in ascending order (`end` if none is left), and
 * palp_row_finish turns what is marked into the row and clears the scratch; palp_row_collect does
 * so without W^-1: the row has the weights as they were marked.
 */
void palp_row_mark(palp_row_scratch *scratch, uint32_t slot, float weight);
uint32_t palp_row_next(const palp_row_scratch *scratch, uint32_t from, uint32_t end);
bool palp_row_finish(const palp_domain *domain, palp_row_scratch *scratch, palp_row *row,
                     uint32_t capacity);
bool palp_row_collect(uint32_t slots, palp_row_scratch *scratch, palp_row *row, uint32_t capacity);

#endif
