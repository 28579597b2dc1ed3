/* SPDX-License-Identifier: MIT */
#include "linalg.h"
#include "apart.h"
#include "real.h"

/* y[0..n) -= s * x[0..n) */
static void axpy_minus(float *restrict y, const float *restrict x, float s, size_t n) {
    const size_t whole = n / PALP_BESIDE;
    for (size_t q = 0; q < whole; q++) {
        for (size_t e = 0; e < PALP_BESIDE; e++)
            y[PALP_BESIDE * q + e] -= s * x[PALP_BESIDE * q + e];
    }
    for (size_t k = PALP_BESIDE * whole; k < n; k++) y[k] -= s * x[k]; /* at most 3 */
}

/* sum - x . y, one product after another. */
static float minus_dot(float sum, const float *x, const float *y, size_t n) {
    const size_t whole = n / PALP_BESIDE;
    for (size_t q = 0; q < whole; q++) {
        for (size_t e = 0; e < PALP_BESIDE; e++)
            sum -= x[PALP_BESIDE * q + e] * y[PALP_BESIDE * q + e];
    }
    for (size_t k = PALP_BESIDE * whole; k < n; k++) sum -= x[k] * y[k]; /* at most 3 */
    return sum;
}

/*
 * Floats that never meet one another: every target, with or without vector registers, gives the same
 * bits. A tile is as large as its registers hold beside what is read: TILE columns in vectors of WIDTH,
 * ROWS rows. What is left of its columns goes by NARROW.
 */
#if defined(__AVX__)
#define WIDTH 8u
#define TILE 16u
#elif defined(__SSE2__) || defined(__ARM_NEON) || defined(__wasm_simd128__)
#define WIDTH 4u
#define TILE 12u
#elif defined(__ARM_FEATURE_MVE)
#define WIDTH 4u
#define TILE 4u
#else /* no vectors: made of them by the compiler, a tile would live in memory */
#define WIDTH 1u
#define TILE 4u
#endif
#define ROWS 4u
#define WIDE (TILE / WIDTH) /* vectors of a tile */
#if WIDTH > 1
#define NARROW 4u
typedef float lanes __attribute__((vector_size(4 * WIDTH), aligned(4)));
typedef float narrow __attribute__((vector_size(4 * NARROW), aligned(4)));
#else
#define NARROW 1u
typedef float lanes, narrow;
#endif

static lanes *lanes_of(float *p) { return (lanes *)(void *)p; }
static lanes lanes_at(const float *p) { return *(const lanes *)(const void *)p; }

/*
 * One tile of C -= A^T B, ROWS rows high: c points at it, a at the columns of A, b at the tile's
 * columns of B, both of k rows. Held in registers over all of those rows, so that B is read ROWS times
 * less often than it is used.
 */
static void subtract_tile(float *c, size_t c_stride, const float *a, size_t a_stride,
                          const float *b, size_t b_stride, size_t k) {
    lanes sum[ROWS][WIDE];
    for (size_t r = 0; r < ROWS; r++) {
        for (size_t t = 0; t < WIDE; t++) sum[r][t] = *lanes_of(c + r * c_stride + WIDTH * t);
    }
    for (size_t i = 0; i < k; i++) {
        lanes x[WIDE];
        for (size_t t = 0; t < WIDE; t++) x[t] = lanes_at(b + i * b_stride + WIDTH * t);
        for (size_t r = 0; r < ROWS; r++) {
            const float s = a[i * a_stride + r];
            for (size_t t = 0; t < WIDE; t++) {
                const lanes taken = s * x[t];
                sum[r][t] -= taken;
            }
        }
    }
    for (size_t r = 0; r < ROWS; r++) {
        for (size_t t = 0; t < WIDE; t++) *lanes_of(c + r * c_stride + WIDTH * t) = sum[r][t];
    }
}

/* The same of NARROW columns. */
static void subtract_narrow(float *c, const float *a, const float *b, size_t stride, size_t k) {
    narrow sum[ROWS];
    for (size_t r = 0; r < ROWS; r++) sum[r] = *(narrow *)(void *)(c + r * stride);
    for (size_t i = 0; i < k; i++) {
        const narrow x = *(const narrow *)(const void *)(b + i * stride);
        for (size_t r = 0; r < ROWS; r++) {
            const narrow taken = a[i * stride + r] * x;
            sum[r] -= taken;
        }
    }
    for (size_t r = 0; r < ROWS; r++) *(narrow *)(void *)(c + r * stride) = sum[r];
}

/* c -= a . b over k rows. */
static void subtract_entry(float *c, const float *a, const float *b, size_t stride, size_t k) {
    float sum = *c;
    for (size_t i = 0; i < k; i++) sum -= a[i * stride] * b[i * stride];
    *c = sum;
}

/* Takes the i rows above out of the `rows` rows from i on, at most ROWS: whole tiles, narrow ones, and
 * what is left of both entry by entry. */
static void eliminate_rows(float *a, size_t stride, size_t i, size_t rows, size_t n) {
    size_t j = i;
    for (; rows == ROWS && j + TILE <= n; j += TILE)
        subtract_tile(a + i * stride + j, stride, a + i, stride, a + j, stride, i);
    for (; rows == ROWS && j + NARROW <= n; j += NARROW)
        subtract_narrow(a + i * stride + j, a + i, a + j, stride, i);
    for (; j < n; j++) {
        for (size_t r = i; r < i + rows; r++)
            subtract_entry(a + r * stride + j, a + r, a + j, stride, i);
    }
}

/* Divides row i by the root of its pivot, which must be more than rounding of the entry that it came from. */
static palp_status finish_row(float *a, size_t stride, size_t i, size_t n, float entry) {
    float *row = a + i * stride;
    const float diagonal = row[i];
    if (!(diagonal > PALP_PIVOT_MIN * entry)) return PALP_ERR_NOT_SPD;
    float pivot = palp_sqrt(diagonal);
    float inverse = 1.0f / pivot;
    row[i] = pivot;
    for (size_t k = i + 1; k < n; k++) row[k] *= inverse;
    return PALP_OK;
}

palp_status palp_chol_factor(float *a, size_t n, size_t stride) {
    for (size_t i = 0; i < n; i += ROWS) {
        const size_t rows = n - i < ROWS ? n - i : ROWS;
        float entry[ROWS] = {0.0f};
        for (size_t r = 0; r < rows; r++) entry[r] = a[(i + r) * (stride + 1)];
        eliminate_rows(a, stride, i, rows, n);
        for (size_t r = i; r < i + rows; r++) {
            const float *row = a + r * stride;
            if (finish_row(a, stride, r, n, entry[r - i]) != PALP_OK) return PALP_ERR_NOT_SPD;
            for (size_t below = r + 1; below < i + rows; below++)
                axpy_minus(a + below * stride + below, row + below, row[below], n - below);
        }
    }
    return PALP_OK;
}

palp_status palp_chol_append(float *r, size_t n, size_t stride, float *column) {
    float diagonal = column[n];
    palp_chol_forward(r, n, stride, column);
    const float pivot = minus_dot(diagonal, column, column, n);
    if (!(pivot > PALP_PIVOT_MIN * diagonal)) return PALP_ERR_NOT_SPD;
    for (size_t i = 0; i < n; i++) r[i * stride + n] = column[i];
    r[n * stride + n] = palp_sqrt(pivot);
    return PALP_OK;
}

void palp_chol_forward(const float *r, size_t n, size_t stride, float *b) {
    for (size_t j = 0; j < n; j++) {
        const float *row = r + j * stride;
        b[j] /= row[j];
        axpy_minus(b + j + 1, row + j + 1, b[j], n - j - 1);
    }
}

void palp_chol_backward(const float *r, size_t n, size_t stride, float *b) {
    for (size_t j = n; j-- > 0;) {
        const float *row = r + j * stride;
        b[j] = minus_dot(b[j], row + j + 1, b + j + 1, n - j - 1) / row[j];
    }
}

void palp_chol_solve(const float *r, size_t n, size_t stride, float *b) {
    palp_chol_forward(r, n, stride, b);
    palp_chol_backward(r, n, stride, b);
}

void palp_chol_forward_many(const float *r, size_t n, size_t stride, float *b, size_t m,
                            size_t b_stride) {
    for (size_t i = 0; i < n; i++) {
        float *row = b + i * b_stride;
        float inverse = 1.0f / r[i * stride + i];
        for (size_t j = 0; j < m; j++) row[j] *= inverse;
        for (size_t k = i + 1u; k < n; k++) axpy_minus(b + k * b_stride, row, r[i * stride + k], m);
    }
}

/* The ROWS rows of C from i on, or what is left of them, from column j on. */
static void subtract_rows(float *c, size_t c_stride, const palp_product *p, size_t i, size_t j) {
    const size_t rows = p->n - i < ROWS ? p->n - i : ROWS;
    for (; rows == ROWS && j + TILE <= p->m; j += TILE)
        subtract_tile(c + i * c_stride + j, c_stride, p->a + i, p->a_stride, p->b + j, p->b_stride,
                      p->k);
    for (size_t row = i; row < i + rows && j < p->m; row++) {
        for (size_t e = 0; e < p->k; e++)
            axpy_minus(c + row * c_stride + j, p->b + e * p->b_stride + j,
                       p->a[e * p->a_stride + row], p->m - j);
    }
}

void palp_subtract_product(float *c, size_t c_stride, const palp_product *product) {
    for (size_t i = 0; i < product->n; i += ROWS) subtract_rows(c, c_stride, product, i, 0u);
}

void palp_subtract_product_upper(float *c, size_t c_stride, const palp_product *product) {
    for (size_t i = 0; i < product->n; i += ROWS)
        subtract_rows(c, c_stride, product, i, i / TILE * TILE);
}

/* The row from j on whose entry in column j is largest. */
PALP_APART static size_t pivot_row(const float *a, size_t n, size_t stride, size_t j) {
    size_t best = j;
    for (size_t i = j + 1; i < n; i++) {
        if (palp_abs(a[i * stride + j]) > palp_abs(a[best * stride + j])) best = i;
    }
    return best;
}

/* Swaps two rows; returns the largest entry of what is the first then. */
static float swap_rows(float *row, float *other, size_t n) {
    float largest = 0.0f;
    for (size_t k = 0; k < n; k++) {
        const float t = row[k];
        row[k] = other[k];
        other[k] = t;
        largest = palp_max(largest, palp_abs(row[k]));
    }
    return largest;
}

palp_status palp_lu_factor(float *a, uint32_t *perm, size_t n, size_t stride) {
    for (size_t j = 0; j < n; j++) {
        const size_t best = pivot_row(a, n, stride, j);
        perm[j] = (uint32_t)best;
        float *row = a + j * stride;
        const float largest = swap_rows(row, a + best * stride, n);
        if (!(palp_abs(row[j]) > PALP_PIVOT_MIN * largest)) return PALP_ERR_SINGULAR;
        for (size_t i = j + 1; i < n; i++) {
            float *target = a + i * stride;
            target[j] /= row[j];
            axpy_minus(target + j + 1, row + j + 1, target[j], n - j - 1);
        }
    }
    return PALP_OK;
}

void palp_lu_solve(const float *lu, const uint32_t *perm, size_t n, size_t stride, float *b) {
    for (size_t j = 0; j < n; j++) {
        float t = b[perm[j]];
        b[perm[j]] = b[j];
        b[j] = t;
    }
    for (size_t i = 0; i < n; i++) {
        for (size_t k = 0; k < i; k++) b[i] -= lu[i * stride + k] * b[k];
    }
    for (size_t i = n; i-- > 0;) {
        for (size_t k = i + 1; k < n; k++) b[i] -= lu[i * stride + k] * b[k];
        b[i] /= lu[i * stride + i];
    }
}

/* Splits x into two halves of 12 bits whose products are exact (Dekker). */
static void split(float x, float *hi, float *lo) {
    float t = 4097.0f * x;
    *hi = t - (t - x);
    *lo = x - *hi;
}

void palp_residual(const float *a, const float *x, const float *b, float *r, size_t n,
                   size_t stride) {
    for (size_t i = 0; i < n; i++) {
        float sum = b[i];
        float error = 0.0f;
        for (size_t k = 0; k < n; k++) {
            float u = -a[i * stride + k];
            float product = u * x[k];
            float uh, ul, xh, xl;
            split(u, &uh, &ul);
            split(x[k], &xh, &xl);
            float tail = ((uh * xh - product) + uh * xl + ul * xh) + ul * xl;
            float next = sum + product;
            float virtual_part = next - sum;
            error += ((sum - (next - virtual_part)) + (product - virtual_part)) + tail;
            sum = next;
        }
        r[i] = sum + error;
    }
}
