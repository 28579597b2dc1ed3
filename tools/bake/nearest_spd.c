/* SPDX-License-Identifier: MIT */
#include "tools/bake/nearest_spd.h"
#include "tools/solver/dense.h"
#include "tools/solver/eigen.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define BLOCK 16u
#define BLOCKS 10u
#define BASIS (BLOCK * BLOCKS)
#define FIRST_SHIFT 0.05
#define LAST_SHIFT 10.0

/* a := S + shift I */
static void scaled_copy(const double *g, size_t n, size_t stride, const double *root, double shift,
                        double *a) {
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < n; j++) a[i * n + j] = g[i * stride + j] / (root[i] * root[j]);
        a[i * n + i] += shift;
    }
}

/* Factors S + shift I into `a`; whether all pivots were positive. */
static bool factors(const double *g, size_t n, size_t stride, const double *root, double shift,
                    double *a) {
    scaled_copy(g, n, stride, root, shift, a);
    progress_begin("definiteness", (double)n);
    size_t bad = dense_cholesky(a, n, n);
    progress_end();
    return bad == n;
}

/* Krylov basis of (S + shift I)^-1 from a fixed starting block: the lowest eigenvectors of S show
 * first. */
static double *krylov_basis(const double *factor, size_t n) {
    double *q = allocate(n * BASIS, sizeof *q);
    uint64_t seed = 1;
    for (size_t i = 0; i < n; i++) {
        for (size_t c = 0; c < BLOCK; c++) {
            seed = seed * 6364136223846793005ull + 1442695040888963407ull;
            q[i * BASIS + c] = (double)(seed >> 11) / 4503599627370496.0 - 1.0;
        }
    }
    progress_begin("lowest modes", BLOCKS);
    for (size_t b = 0; b < BLOCKS; b++) {
        double *block = q + b * BLOCK;
        if (b > 0) {
            for (size_t i = 0; i < n; i++)
                memcpy(block + i * BASIS, block + i * BASIS - BLOCK, BLOCK * sizeof *q);
            dense_lower_solve(factor, n, n, block, BASIS, BLOCK);
            dense_lower_solve_transposed(factor, n, n, block, BASIS, BLOCK);
        }
        orthonormalise(q, n, BASIS, b * BLOCK, (b + 1) * BLOCK);
        progress_add(1);
    }
    progress_end();
    return q;
}

/* g += (floor - lambda) (root o x)(root o x)^T */
static void raise(double *g, size_t n, size_t stride, const double *root, const double *x,
                  double amount) {
    for (size_t i = 0; i < n; i++) {
        double factor = amount * root[i] * x[i];
        for (size_t j = 0; j < n; j++) g[i * stride + j] += factor * root[j] * x[j];
    }
}

/* Rayleigh-Ritz on the basis; raises every Ritz value of S below the floor. `s` is n x n scratch.
 */
static void raise_lowest(double *g, size_t n, size_t stride, const double *root, const double *q,
                         double *s, definite_report *r) {
    double *product = allocate(n * BASIS, sizeof *product);
    double *small = allocate(BASIS * BASIS, sizeof *small), *v = allocate(BASIS * BASIS, sizeof *v);
    double *transposed = allocate(BASIS * n, sizeof *transposed), *x = allocate(n, sizeof *x);
    double norm = 0, change = 0;
    scaled_copy(g, n, stride, root, 0, s);
    dense_subtract_product(product, BASIS, s, n, q, BASIS, n, BASIS, n);
    for (size_t i = 0; i < n; i++) {
        for (size_t c = 0; c < BASIS; c++) transposed[c * n + i] = -q[i * BASIS + c];
        for (size_t j = 0; j < n; j++) norm += g[i * stride + j] * g[i * stride + j];
    }
    dense_subtract_product(small, BASIS, transposed, n, product, BASIS, BASIS, BASIS, n);
    for (size_t k = 0; k < BASIS * BASIS; k++) small[k] = -small[k];
    for (size_t k = 0; k < BASIS; k++) {
        for (size_t l = 0; l < k; l++) small[k * BASIS + l] = small[l * BASIS + k];
    }
    symmetric_eigen(small, v, BASIS);
    for (size_t k = 0; k < BASIS; k++) {
        double lambda = small[k * BASIS + k];
        if (lambda >= DEFINITE_FLOOR) continue;
        double size2 = 0;
        size_t most = 0;
        for (size_t i = 0; i < n; i++) {
            x[i] = 0;
            for (size_t c = 0; c < BASIS; c++) x[i] += q[i * BASIS + c] * v[c * BASIS + k];
            if (fabs(x[i]) > fabs(x[most])) most = i;
            size2 += root[i] * root[i] * x[i] * x[i];
        }
        raise(g, n, stride, root, x, DEFINITE_FLOOR - lambda);
        change += (DEFINITE_FLOOR - lambda) * size2 * (DEFINITE_FLOOR - lambda) * size2;
        if (r->raised++ == 0 || lambda < r->lowest) {
            r->lowest = lambda;
            r->worst = most;
        }
    }
    r->change = sqrt(change / norm);
    free(x);
    free(transposed);
    free(v);
    free(small);
    free(product);
}

definite_report make_definite(double *g, size_t n, size_t stride) {
    definite_report r = {0};
    double *root = allocate(n, sizeof *root);
    double *a = allocate_aligned(n * n, sizeof *a);
    bool sound = true;
    for (size_t i = 0; i < n; i++) {
        if (!(g[i * stride + i] > 0)) {
            sound = false;
            r.worst = i;
        }
        root[i] = sqrt(fabs(g[i * stride + i]));
    }
    r.definite = sound && factors(g, n, stride, root, 0, a);
    double shift = FIRST_SHIFT;
    bool shifted = false;
    for (; sound && !r.definite && !shifted && shift < LAST_SHIFT; shift *= 3) {
        shifted = factors(g, n, stride, root, shift, a);
    }
    if (shifted && n > BASIS) {
        double *q = krylov_basis(a, n);
        raise_lowest(g, n, stride, root, q, a, &r);
        free(q);
        r.definite = factors(g, n, stride, root, 0, a);
    }
    free(a);
    free(root);
    return r;
}
