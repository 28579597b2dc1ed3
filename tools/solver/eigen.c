/* SPDX-License-Identifier: MIT */
#include "tools/solver/eigen.h"
#include <math.h>
#include <string.h>

#define JACOBI_SWEEPS 30

void symmetric_eigen(double *a, double *v, size_t n) {
    memset(v, 0, n * n * sizeof *v);
    for (size_t i = 0; i < n; i++) v[i * n + i] = 1;
    for (int sweep = 0; sweep < JACOBI_SWEEPS; sweep++) {
        for (size_t p = 0; p + 1 < n; p++) {
            for (size_t q = p + 1; q < n; q++) {
                double off = a[p * n + q];
                if (fabs(off) < 1e-300) continue;
                double theta = (a[q * n + q] - a[p * n + p]) / (2 * off);
                double t = (theta >= 0 ? 1 : -1) / (fabs(theta) + sqrt(theta * theta + 1));
                double c = 1 / sqrt(t * t + 1), s = t * c;
                for (size_t k = 0; k < n; k++) {
                    double x = a[k * n + p], y = a[k * n + q];
                    a[k * n + p] = c * x - s * y;
                    a[k * n + q] = s * x + c * y;
                }
                for (size_t k = 0; k < n; k++) {
                    double x = a[p * n + k], y = a[q * n + k];
                    a[p * n + k] = c * x - s * y;
                    a[q * n + k] = s * x + c * y;
                    x = v[k * n + p];
                    y = v[k * n + q];
                    v[k * n + p] = c * x - s * y;
                    v[k * n + q] = s * x + c * y;
                }
            }
        }
    }
}

void orthonormalise(double *q, size_t n, size_t stride, size_t first, size_t last) {
    for (size_t c = first; c < last; c++) {
        for (int pass = 0; pass < 2; pass++) {
            for (size_t p = 0; p < c; p++) {
                double dot = 0;
                for (size_t i = 0; i < n; i++) dot += q[i * stride + p] * q[i * stride + c];
                for (size_t i = 0; i < n; i++) q[i * stride + c] -= dot * q[i * stride + p];
            }
        }
        double norm = 0;
        for (size_t i = 0; i < n; i++) norm += q[i * stride + c] * q[i * stride + c];
        norm = norm > 0 ? sqrt(norm) : 1;
        for (size_t i = 0; i < n; i++) q[i * stride + c] /= norm;
    }
}
