/* SPDX-License-Identifier: MIT */
/* Eigenpairs of small dense symmetric matrices in double precision. */
#ifndef PALP_TOOLS_EIGEN_H
#define PALP_TOOLS_EIGEN_H

#include <stddef.h>

/*
 * Cyclic Jacobi rotations on a (n x n, row-major), which ends up diagonal with the eigenvalues in
 * no order; v (n x n) holds the eigenvectors in its columns. Cost: about 10 sweeps of 6 n^3.
 */
void symmetric_eigen(double *a, double *v, size_t n);

/* Makes columns [first, last) of q (n rows, row-major) orthonormal to all before them and to each
 * other, by Gram and Schmidt, twice for safety; a column of zeros stays. 4 n (last^2 - first^2). */
void orthonormalise(double *q, size_t n, size_t stride, size_t first, size_t last);

#endif
