/* SPDX-License-Identifier: MIT */
/*
 * Dense linear algebra in double precision, row-major a[i * stride + k], threaded.
 *
 * Products are accumulated in the order of k in fixed slices, whatever the vector width or the
 * number of threads, and without fused multiply-adds: results are the same bits everywhere.
 */
#ifndef PALP_TOOLS_DENSE_H
#define PALP_TOOLS_DENSE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* C (m x n) -= A (m x k) B (k x n). */
void dense_subtract_product(double *c, size_t c_stride, const double *a, size_t a_stride,
                            const double *b, size_t b_stride, size_t m, size_t n, size_t k);

/* The lower triangle of C (n x n) -= X^T X, X (k x n); above the diagonal C is not defined after. */
void dense_subtract_gram(double *c, size_t c_stride, const double *x, size_t x_stride, size_t n,
                         size_t k);

/*
 * A = L L^T: L in the lower triangle of A, of which nothing else is read; above it A is not defined
 * after. Returns n, or the index of the first pivot that is not positive. Cost: n^3 / 3 flops.
 */
size_t dense_cholesky(double *a, size_t n, size_t stride);

/* B (n x m) := L^-1 B, L^-T B */
void dense_lower_solve(const double *l, size_t n, size_t stride, double *b, size_t b_stride,
                       size_t m);
void dense_lower_solve_transposed(const double *l, size_t n, size_t stride, double *b,
                                  size_t b_stride, size_t m);

/*
 * P A = L U in place (recursive, partial pivoting); perm[j] is the row swapped with row j. Returns
 * n, or the index of the first pivot that is zero.
 */
size_t dense_lu(double *a, size_t n, size_t stride, uint32_t *perm);

/* B (n x m) := A^-1 B from the factors. */
void dense_lu_solve(const double *lu, size_t n, size_t stride, const uint32_t *perm, double *b,
                    size_t b_stride, size_t m);

#endif
