/* SPDX-License-Identifier: MIT */
/*
 * Wavelet-transformed, thresholded GF columns (MR 4.4-4.5): fast summation and selective
 * extraction.
 */
#ifndef PALP_GREEN_COLUMNS_H
#define PALP_GREEN_COLUMNS_H

#include "core/green/wavelet.h"

/*
 * details += column_j v (MR 45): `v` has three components, `details` is float[rows][4].
 * Cost: 9 multiply-adds per stored block of the column, read as one straight stream.
 */
void palp_columns_add(const palp_columns *columns, uint32_t j, const float v[3], float *details);

/*
 * The 3x3 block (row-major) of W^-1 column_j at the node whose row is given (MR 39, 43).
 * Cost: one merge of the row with the column: row.count + 8 groups comparisons, 9 multiply-adds a
 * match.
 */
void palp_columns_extract(const palp_columns *columns, uint32_t j, const palp_row *row,
                          float block[9]);

/*
 * The transpose of palp_columns_add: sum = column_j^T x, `x` float[rows][4]. Cost: 9 multiply-adds per
 * stored block.
 */
void palp_columns_dot(const palp_columns *columns, uint32_t j, const float *x, float sum[3]);

/* Stored blocks of column j, padding included. */
static inline uint32_t palp_columns_blocks(const palp_columns *columns, uint32_t j) {
    return (columns->offset[j + 1] - columns->offset[j]) * PALP_LANES;
}

/* The same without the padding: the last group repeats its last row. */
static inline uint32_t palp_columns_stored(const palp_columns *columns, uint32_t j) {
    uint32_t n = palp_columns_blocks(columns, j);
    const uint16_t *index = columns->index + (size_t)columns->offset[j] * PALP_LANES;
    /* at most PALP_LANES: only the last group repeats */
    while (n > 1u && index[n - 1u] == index[n - 2u]) n--;
    return n;
}

#endif
