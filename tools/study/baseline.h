/* SPDX-License-Identifier: MIT */
/* What one would do without wavelets: other compressions of the dense free-free block, each at a
 * given RMS error (MR 70). */
#ifndef PALP_TOOLS_BASELINE_H
#define PALP_TOOLS_BASELINE_H

#include <stddef.h>
#include <stdint.h>

/* G as [3 n][3 n], rows and columns by node, nodes at x. */
typedef struct {
    const double *g;
    size_t n;
    const double (*x)[3];
} baseline_matrix;

typedef struct {
    double compression; /* dense bytes over stored bytes */
    double rms;
    double
        work; /* multiply-adds of one product with every column loaded, over the dense product's */
    double work_patch; /* of one with 40 neighbouring columns loaded, over the dense one's */
} baseline_result;

/* The largest 3x3 blocks, the rest dropped; index of two bytes per block. */
baseline_result baseline_truncated(const baseline_matrix *m, double rms);

/* All of it in IEEE half precision, scaled by the largest entry of each column. */
baseline_result baseline_half(const baseline_matrix *m);

/* Block low rank of a symmetric matrix: nodes in clusters of at most `leaf`, each pair of clusters
 * dense or as U V^T, whichever is smaller, by cross approximation with full pivoting; of each pair and its
 * transpose one. */
baseline_result baseline_low_rank(const baseline_matrix *m, size_t leaf, double rms);

/*
 * Nested bases (H2) of a symmetric matrix: a binary tree of clusters down to `leaf` nodes; pairs that
 * are apart by `apart` times the radius of the larger one are coupled through bases, V_a S_ab V_b^T, nearer
 * leaves are dense. A cluster's basis holds the left singular vectors of its rows in all that it or its
 * ancestors are coupled with whose singular values exceed `drop`; that of a parent is made of its children's.
 */
baseline_result baseline_nested(const baseline_matrix *m, size_t leaf, double apart, double drop);

/* Sorts nodes along an axis. Not from several threads at once. */
void baseline_sort(const baseline_matrix *m, size_t *node, size_t count, int axis);

/* 40 columns around the first node. */
#define BASELINE_PATCH 40

#endif
