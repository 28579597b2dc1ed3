/* SPDX-License-Identifier: MIT */
/* Wavelet-transformed, thresholded GF columns (MR 4.4-4.5), in the form in which the blob holds
 * them. */
#ifndef PALP_TOOLS_COMPRESS_H
#define PALP_TOOLS_COMPRESS_H

#include "tools/bake/domain.h"

/*
 * Dense block columns: column j is the three matrix columns from first[j] on; rows run over all
 * nodes, three each. The first `counted` columns enter errors and counts, later ones (gravity) do
 * not.
 */
typedef struct {
    const double *m;
    size_t width;
    const size_t *first; /* [columns] */
    uint32_t columns, counted;
} gf_source;

/*
 * THRESHOLD_COLUMN is MR 31-33: a detail is dropped below epsilon_l times the largest block of its
 * own column. THRESHOLD_GLOBAL measures every column against the same amplitude, the root mean
 * square of those maxima, which for a given number of blocks lowers the RMS error (MR 70).
 */
typedef enum { THRESHOLD_COLUMN, THRESHOLD_GLOBAL } threshold_rule;

typedef struct {
    double epsilon;
    threshold_rule rule;
    bool half;
    bool measure_only; /* errors and counts, no stored columns */
    bool scalar;       /* store the first entry of each block only */
} compress_options;

/* The stored part of one block column, rows ascending. */
typedef struct {
    uint32_t count;
    uint16_t *index;
    float scale; /* blocks hold value / scale */
    float (*block)[9];
    double error2, norm2,
        worst; /* squared Frobenius sums; largest block error over largest block */
} stored_column;

typedef struct {
    palp_columns view;
    uint32_t *offset;
    uint16_t *index, *half;
    float *value, *scale;
    uint64_t blocks;     /* stored blocks of the counted columns, without padding */
    uint32_t max_groups; /* longest counted column */
    double rms, max;     /* MR 70 and 71 against the matrix that came in, counted columns */
} columns_data;

/* Transforms and thresholds. Rows of the fixed domain are stored as tractions: `area` is that of
 * the nodes then, NULL for the free domain. */
columns_data columns_build(const gf_source *source, const domain_data *row, const double *area,
                           compress_options options);

/* Columns with these blocks, their errors and counts those of the first `counted`; what the columns own
 * is freed. */
columns_data columns_pack(stored_column *column, uint32_t columns, uint32_t counted, uint32_t rows,
                          const compress_options *options);
void columns_free(columns_data *d);

#endif
