/* SPDX-License-Identifier: MIT */
#include "tools/solver/dense.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SLICE 256   /* k is summed in slices of this length */
#define ROW_TILE 96 /* rows of C per work item; a multiple of every kernel height */
#define LEAF 16     /* recursion ends at this width */

/* ---- the kernel: acc (height x width) = sum_k a_strip[k][height] b_strip[k][width] ---- */

#define DEFINE_KERNEL(name, bytes, rows, vectors, attribute)                                       \
    typedef double name##_vector __attribute__((vector_size(bytes), aligned(8)));                  \
    attribute static void name(const double *a, const double *b, size_t k, double *c,              \
                               size_t stride) {                                                    \
        enum { LANES = (bytes) / 8 };                                                              \
        name##_vector sum[rows][vectors] = {0};                                                    \
        for (size_t p = 0; p < k; p++, a += (rows), b += (vectors)*LANES) {                        \
            name##_vector row[vectors];                                                            \
            for (int j = 0; j < (vectors); j++) row[j] = *(const name##_vector *)(b + j * LANES);  \
            for (int i = 0; i < (rows); i++) {                                                     \
                for (int j = 0; j < (vectors); j++) sum[i][j] += a[i] * row[j];                    \
            }                                                                                      \
        }                                                                                          \
        for (int i = 0; i < (rows); i++) {                                                         \
            for (int j = 0; j < (vectors); j++) {                                                  \
                *(name##_vector *)(c + (size_t)i * stride + (size_t)j * LANES) -= sum[i][j];       \
            }                                                                                      \
        }                                                                                          \
    }

typedef void (*kernel_function)(const double *a, const double *b, size_t k, double *c,
                                size_t stride);
typedef struct {
    size_t height, width;
    kernel_function run;
} kernel;

#if defined(__x86_64__)
DEFINE_KERNEL(kernel_avx512, 64, 8, 2, __attribute__((target("avx512f"))))
DEFINE_KERNEL(kernel_avx2, 32, 4, 2, __attribute__((target("avx2"))))
#endif
DEFINE_KERNEL(kernel_plain, 16, 4, 2, )

static kernel pick_kernel(void) {
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx512f")) return (kernel){8, 16, kernel_avx512};
    if (__builtin_cpu_supports("avx2")) return (kernel){4, 8, kernel_avx2};
#endif
    return (kernel){4, 4, kernel_plain};
}

/* ---- product ---- */

/* Element (i, k) stands at i * row + k * step: a matrix or its transpose. */
typedef struct {
    const double *at;
    size_t row, step;
} view;

typedef struct {
    kernel kernel;
    double *c;
    view a, b;
    size_t c_stride, m, n, k;
    double *packed; /* B slice: strips of `width` columns, zero-padded */
} product;

static void pack_strip(void *context, size_t strip) {
    product *p = context;
    size_t width = p->kernel.width;
    size_t first = strip * width;
    size_t valid = p->n - first < width ? p->n - first : width;
    double *to = p->packed + strip * width * p->k;
    for (size_t k = 0; k < p->k; k++, to += width) {
        const double *from = p->b.at + k * p->b.row + first * p->b.step;
        for (size_t j = 0; j < valid; j++) to[j] = from[j * p->b.step];
        memset(to + valid, 0, (width - valid) * sizeof *to);
    }
}

static void pack_rows(const product *p, size_t row, size_t rows, double *to) {
    size_t height = p->kernel.height;
    for (size_t strip = 0; strip < rows; strip += height) {
        for (size_t k = 0; k < p->k; k++) {
            for (size_t i = 0; i < height; i++) {
                *to++ =
                    strip + i < rows ? p->a.at[(row + strip + i) * p->a.row + k * p->a.step] : 0.0;
            }
        }
    }
}

/* One kernel call at the edge of C goes through a full-size copy. */
static void run_edge(const product *p, const double *a, const double *b, size_t row, size_t column,
                     size_t rows, size_t columns) {
    double tile[16 * 16] = {0};
    double *c = p->c + row * p->c_stride + column;
    for (size_t i = 0; i < rows; i++)
        memcpy(tile + i * 16, c + i * p->c_stride, columns * sizeof *c);
    p->kernel.run(a, b, p->k, tile, 16);
    for (size_t i = 0; i < rows; i++)
        memcpy(c + i * p->c_stride, tile + i * 16, columns * sizeof *c);
}

static void multiply_rows(void *context, size_t item) {
    const product *p = context;
    size_t height = p->kernel.height;
    size_t width = p->kernel.width;
    size_t row = item * ROW_TILE;
    size_t rows = p->m - row < ROW_TILE ? p->m - row : ROW_TILE;
    double *packed = allocate_aligned((ROW_TILE + 16) * p->k, sizeof *packed);
    pack_rows(p, row, rows, packed);
    for (size_t column = 0; column < p->n; column += width) {
        size_t columns = p->n - column < width ? p->n - column : width;
        const double *b = p->packed + column * p->k;
        for (size_t i = 0; i < rows; i += height) {
            size_t tall = rows - i < height ? rows - i : height;
            const double *a = packed + i * p->k;
            if (tall == height && columns == width) {
                p->kernel.run(a, b, p->k, p->c + (row + i) * p->c_stride + column, p->c_stride);
            } else {
                run_edge(p, a, b, row + i, column, tall, columns);
            }
        }
    }
    free(packed);
}

/* C (m x n) -= A (m x k) B (k x n) */
static void subtract(double *c, size_t c_stride, view a, view b, size_t m, size_t n, size_t k) {
    if (m == 0 || n == 0 || k == 0) return;
    kernel best = pick_kernel();
    size_t strips = (n + best.width - 1) / best.width;
    double *packed =
        allocate_aligned(strips * best.width * (k < SLICE ? k : SLICE), sizeof *packed);
    for (size_t first = 0; first < k; first += SLICE) {
        size_t depth = k - first < SLICE ? k - first : SLICE;
        product p = {.kernel = best,
                     .c = c,
                     .a = {a.at + first * a.step, a.row, a.step},
                     .b = {b.at + first * b.row, b.row, b.step},
                     .c_stride = c_stride,
                     .m = m,
                     .n = n,
                     .k = depth,
                     .packed = packed};
        bool large = (double)m * (double)n * (double)depth > 2e6;
        size_t items = (m + ROW_TILE - 1) / ROW_TILE;
        if (large) {
            parallel_for(strips, pack_strip, &p);
            parallel_for(items, multiply_rows, &p);
        } else {
            for (size_t i = 0; i < strips; i++) pack_strip(&p, i);
            for (size_t i = 0; i < items; i++) multiply_rows(&p, i);
        }
    }
    free(packed);
}

void dense_subtract_product(double *c, size_t c_stride, const double *a, size_t a_stride,
                            const double *b, size_t b_stride, size_t m, size_t n, size_t k) {
    subtract(c, c_stride, (view){a, a_stride, 1}, (view){b, b_stride, 1}, m, n, k);
}

/* The lower triangle of C (n x n) -= A A^T; what stands above it near the diagonal is overwritten.
 * Halves down to a few row tiles, with the square below the diagonal in between. */
static void subtract_square(double *c, size_t stride, view a, size_t n, size_t k) {
    if (n <= 4 * ROW_TILE) {
        subtract(c, stride, a, (view){a.at, a.step, a.row}, n, n, k);
        return;
    }
    size_t half = n / 2 / ROW_TILE * ROW_TILE;
    view low = {a.at + half * a.row, a.row, a.step};
    subtract_square(c, stride, a, half, k);
    subtract(c + half * stride, stride, low, (view){a.at, a.step, a.row}, n - half, half, k);
    subtract_square(c + half * stride + half, stride, low, n - half, k);
}

void dense_subtract_gram(double *c, size_t c_stride, const double *x, size_t x_stride, size_t n,
                         size_t k) {
    subtract_square(c, c_stride, (view){x, 1, x_stride}, n, k);
}

/* ---- triangular solves on blocks of right-hand sides ---- */

/* B := L^-1 B, L lower triangular (n x n) with `unit` diagonal or its own */
static void solve_lower(const double *l, size_t stride, double *b, size_t b_stride, size_t n,
                        size_t m, bool unit) {
    if (n <= LEAF) {
        for (size_t i = 0; i < n; i++) {
            for (size_t k = 0; k < i; k++) {
                double factor = l[i * stride + k];
                for (size_t j = 0; j < m; j++) b[i * b_stride + j] -= factor * b[k * b_stride + j];
            }
            double pivot = l[i * stride + i];
            for (size_t j = 0; j < m && !unit; j++) b[i * b_stride + j] /= pivot;
        }
        return;
    }
    size_t half = n / 2;
    solve_lower(l, stride, b, b_stride, half, m, unit);
    dense_subtract_product(b + half * b_stride, b_stride, l + half * stride, stride, b, b_stride,
                           n - half, m, half);
    solve_lower(l + half * stride + half, stride, b + half * b_stride, b_stride, n - half, m, unit);
}

/* B := U^-1 B, U upper triangular (n x n), or the transpose of a lower one */
static void solve_upper(view u, double *b, size_t b_stride, size_t n, size_t m) {
    if (n <= LEAF) {
        for (size_t i = n; i-- > 0;) {
            for (size_t k = i + 1; k < n; k++) {
                double factor = u.at[i * u.row + k * u.step];
                for (size_t j = 0; j < m; j++) b[i * b_stride + j] -= factor * b[k * b_stride + j];
            }
            double pivot = u.at[i * (u.row + u.step)];
            for (size_t j = 0; j < m; j++) b[i * b_stride + j] /= pivot;
        }
        return;
    }
    size_t half = n / 2;
    view corner = {u.at + half * (u.row + u.step), u.row, u.step};
    view right = {u.at + half * u.step, u.row, u.step};
    solve_upper(corner, b + half * b_stride, b_stride, n - half, m);
    subtract(b, b_stride, right, (view){b + half * b_stride, b_stride, 1}, half, m, n - half);
    solve_upper(u, b, b_stride, half, m);
}

/* ---- factorisation ---- */

static void swap_rows(double *a, size_t stride, size_t n, size_t i, size_t k) {
    if (i == k) return;
    for (size_t j = 0; j < n; j++) {
        double t = a[i * stride + j];
        a[i * stride + j] = a[k * stride + j];
        a[k * stride + j] = t;
    }
}

/* Brings the pivot of column j to its place; false when it is unusable. */
static bool place_pivot(double *a, size_t n, size_t stride, uint32_t *perm, size_t j) {
    size_t best = j;
    for (size_t i = j + 1; i < n; i++) {
        if (fabs(a[i * stride + j]) > fabs(a[best * stride + j])) best = i;
    }
    perm[j] = (uint32_t)best;
    swap_rows(a, stride, n, j, best);
    return fabs(a[j * stride + j]) > 0;
}

/* Factors columns [first, last) below row `first`; whole rows are swapped at once. */
static size_t factor_leaf(double *a, size_t n, size_t stride, uint32_t *perm, size_t first,
                          size_t last) {
    for (size_t j = first; j < last; j++) {
        if (!place_pivot(a, n, stride, perm, j)) return j;
        double pivot = a[j * stride + j];
        for (size_t i = j + 1; i < n; i++) {
            double factor = a[i * stride + j] /= pivot;
            for (size_t k = j + 1; k < last; k++) a[i * stride + k] -= factor * a[j * stride + k];
        }
    }
    return n;
}

static size_t factor_columns(double *a, size_t n, size_t stride, uint32_t *perm, size_t first,
                             size_t last) {
    if (last - first <= LEAF) {
        size_t bad = factor_leaf(a, n, stride, perm, first, last);
        progress_add((double)(last - first) * (double)(n - first) * (double)(n - first));
        return bad;
    }
    size_t middle = first + (last - first) / 2;
    size_t bad = factor_columns(a, n, stride, perm, first, middle);
    if (bad < n) return bad;
    double *right = a + first * stride + middle;
    solve_lower(a + first * stride + first, stride, right, stride, middle - first, last - middle,
                true);
    dense_subtract_product(a + middle * stride + middle, stride, a + middle * stride + first,
                           stride, right, stride, n - middle, last - middle, middle - first);
    return factor_columns(a, n, stride, perm, middle, last);
}

size_t dense_lu(double *a, size_t n, size_t stride, uint32_t *perm) {
    return factor_columns(a, n, stride, perm, 0, n);
}

void dense_lu_solve(const double *lu, size_t n, size_t stride, const uint32_t *perm, double *b,
                    size_t b_stride, size_t m) {
    for (size_t i = 0; i < n; i++) swap_rows(b, b_stride, m, i, perm[i]);
    solve_lower(lu, stride, b, b_stride, n, m, true);
    solve_upper((view){lu, stride, 1}, b, b_stride, n, m);
}

/* ---- Cholesky ---- */

/* X (m x n) := X L^-T, L lower triangular */
static void solve_right(const double *l, size_t stride, double *x, size_t x_stride, size_t n,
                        size_t m) {
    if (n <= LEAF) {
        for (size_t i = 0; i < m; i++) {
            double *row = x + i * x_stride;
            for (size_t j = 0; j < n; j++) {
                double sum = row[j];
                for (size_t k = 0; k < j; k++) sum -= row[k] * l[j * stride + k];
                row[j] = sum / l[j * stride + j];
            }
        }
        return;
    }
    size_t half = n / 2;
    solve_right(l, stride, x, x_stride, half, m);
    subtract(x + half, x_stride, (view){x, x_stride, 1}, (view){l + half * stride, 1, stride}, m,
             n - half, half);
    solve_right(l + half * stride + half, stride, x + half, x_stride, n - half, m);
}

static size_t cholesky_leaf(double *a, size_t n, size_t stride) {
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j <= i; j++) {
            double sum = a[i * stride + j];
            for (size_t k = 0; k < j; k++) sum -= a[i * stride + k] * a[j * stride + k];
            if (j < i) {
                a[i * stride + j] = sum / a[j * stride + j];
            } else if (sum > 0) {
                a[i * stride + i] = sqrt(sum);
            } else {
                return i;
            }
        }
    }
    return n;
}

size_t dense_cholesky(double *a, size_t n, size_t stride) {
    if (n <= LEAF) {
        progress_add((double)n);
        return cholesky_leaf(a, n, stride);
    }
    size_t half = n / 2;
    double *low = a + half * stride, *corner = low + half;
    size_t bad = dense_cholesky(a, half, stride);
    if (bad < half) return bad;
    solve_right(a, stride, low, stride, half, n - half);
    subtract_square(corner, stride, (view){low, stride, 1}, n - half, half);
    return half + dense_cholesky(corner, n - half, stride);
}

void dense_lower_solve(const double *l, size_t n, size_t stride, double *b, size_t b_stride,
                       size_t m) {
    solve_lower(l, stride, b, b_stride, n, m, false);
}

void dense_lower_solve_transposed(const double *l, size_t n, size_t stride, double *b,
                                  size_t b_stride, size_t m) {
    solve_upper((view){l, 1, stride}, b, b_stride, n, m);
}
