/* SPDX-License-Identifier: MIT */
/*
 * Small dense linear algebra on row-major float matrices a[i * stride + k].
 *
 * Symmetric positive definite: C = R^T R with R upper triangular, which makes every inner loop but
 * the back substitution an axpy on a contiguous row: vector code over independent outputs, one
 * fixed order of summation. General: P A = L U with partial pivoting. Costs count multiply-add
 * pairs.
 */
#ifndef PALP_BASE_LINALG_H
#define PALP_BASE_LINALG_H

#include "status.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Terms of a long sum or row that are written out beside each other: then the compiler neither makes
 * a loop of them nor doubles it, and how often it turns is known. */
#define PALP_BESIDE 4u

/* Smallest accepted pivot relative to the diagonal entry that it came from. */
#define PALP_PIVOT_MIN 1e-6f

/*
 * Factors the upper triangle of a (n x n) in place. PALP_ERR_NOT_SPD when a pivot falls below
 * PALP_PIVOT_MIN times its diagonal entry; the upper triangle is then undefined. n^3/6.
 */
palp_status palp_chol_factor(float *a, size_t n, size_t stride);

/*
 * Grows R from n x n to (n+1) x (n+1): `column` holds c_0..c_n, the new column of C, and is
 * destroyed. PALP_ERR_NOT_SPD leaves R as it was. n^2/2.
 */
palp_status palp_chol_append(float *r, size_t n, size_t stride, float *column);

/* b := C^-1 b. n^2. */
void palp_chol_solve(const float *r, size_t n, size_t stride, float *b);

/* The two halves of the solve, b := R^-T b and b := R^-1 b; |R^-T b|^2 = b^T C^-1 b. n^2/2 each. */
void palp_chol_forward(const float *r, size_t n, size_t stride, float *b);
void palp_chol_backward(const float *r, size_t n, size_t stride, float *b);

/* B := R^-T B for the n x m matrix b. n^2 m / 2. */
void palp_chol_forward_many(const float *r, size_t n, size_t stride, float *b, size_t m,
                            size_t b_stride);

/* A^T B for a (k x n) and b (k x m). */
typedef struct {
    const float *a, *b;
    size_t a_stride, b_stride;
    size_t k, n, m;
} palp_product;

/* C -= A^T B for c (n x m); and the same where only tiles that hold part of the upper triangle of C
 * are sure to be right. k n m, or about half. */
void palp_subtract_product(float *c, size_t c_stride, const palp_product *product);
void palp_subtract_product_upper(float *c, size_t c_stride, const palp_product *product);

/*
 * P A = L U in place, row swaps in perm[n]. PALP_ERR_SINGULAR when a pivot falls below
 * PALP_PIVOT_MIN times the largest entry of its row. n^3/3.
 */
palp_status palp_lu_factor(float *a, uint32_t *perm, size_t n, size_t stride);

/* b := A^-1 b from the factors; n^2. */
void palp_lu_solve(const float *lu, const uint32_t *perm, size_t n, size_t stride, float *b);

/*
 * r = b - A x, each entry summed in twice the working precision (error-free products and sums), so
 * that a step of iterative refinement recovers the solution of A to working precision. About 20
 * n^2.
 */
void palp_residual(const float *a, const float *x, const float *b, float *r, size_t n,
                   size_t stride);

#endif
