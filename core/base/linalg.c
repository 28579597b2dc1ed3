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

/* Four floats that never meet one another: every target, with or without vector registers, gives
 * the same bits. */
typedef float lanes4 __attribute__((vector_size(16), aligned(4)));
#define TILE 4u /* vectors per tile */

static lanes4 *lanes(float *p) { return (lanes4 *)(void *)p; }
static lanes4 lanes_at(const float *p) { return *(const lanes4 *)(const void *)p; }

/*
 * One tile of C -= A^T B, two rows high: c points at it, a at the two columns of A, b at the tile's
 * columns of B, both of k rows. Held in registers over all of those rows, so that B is read twice
 * less often than it is used.
 */
static void subtract_tile(float *c, size_t c_stride, const float *a, size_t a_stride,
                          const float *b, size_t b_stride, size_t k) {
    lanes4 sum[2][TILE];
    for (size_t t = 0; t < TILE; t++) {
        sum[0][t] = *lanes(c + 4u * t);
        sum[1][t] = *lanes(c + c_stride + 4u * t);
    }
    for (size_t i = 0; i < k; i++) {
        float s = a[i * a_stride], u = a[i * a_stride + 1u];
        for (size_t t = 0; t < TILE; t++) {
            lanes4 x = lanes_at(b + i * b_stride + 4u * t);
            sum[0][t] -= s * x;
            sum[1][t] -= u * x;
        }
    }
    for (size_t t = 0; t < TILE; t++) {
        *lanes(c + 4u * t) = sum[0][t];
        *lanes(c + c_stride + 4u * t) = sum[1][t];
    }
}

/* The same for columns j..n-1, fewer than a tile, of `rows` rows. */
static void eliminate_rest(float *a, size_t stride, size_t i, size_t rows, size_t j, size_t n) {
    for (size_t r = i; r < i + rows; r++) {
        for (size_t k = 0; k < i; k++)
            axpy_minus(a + r * stride + j, a + k * stride + j, a[k * stride + r], n - j);
    }
}

/* Divides row i by the root of its pivot, which must be more than rounding of what it came from. */
static palp_status finish_row(float *a, size_t stride, size_t i, size_t n) {
    float *row = a + i * stride;
    float diagonal = row[i], removed = 0.0f;
    for (size_t k = 0; k < i; k++) removed += a[k * stride + i] * a[k * stride + i];
    if (!(diagonal > PALP_PIVOT_MIN * (diagonal + removed))) return PALP_ERR_NOT_SPD;
    float pivot = palp_sqrt(diagonal);
    float inverse = 1.0f / pivot;
    row[i] = pivot;
    for (size_t k = i + 1; k < n; k++) row[k] *= inverse;
    return PALP_OK;
}

palp_status palp_chol_factor(float *a, size_t n, size_t stride) {
    for (size_t i = 0; i < n; i += 2) {
        size_t rows = i + 1 < n ? 2 : 1, j = i;
        for (; rows == 2 && j + 4u * TILE <= n; j += 4u * TILE)
            subtract_tile(a + i * stride + j, stride, a + i, stride, a + j, stride, i);
        eliminate_rest(a, stride, i, rows, j, n);
        if (finish_row(a, stride, i, n) != PALP_OK) return PALP_ERR_NOT_SPD;
        if (rows == 1) break;
        const float *above = a + i * stride;
        axpy_minus(a + (i + 1) * stride + i + 1, above + i + 1, above[i + 1], n - i - 1);
        if (finish_row(a, stride, i + 1, n) != PALP_OK) return PALP_ERR_NOT_SPD;
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

/* Row i of C, and the one below it, from column j on. */
static void subtract_rows(float *c, size_t c_stride, const palp_product *p, size_t i, size_t j) {
    const size_t rows = i + 1u < p->n ? 2u : 1u;
    for (; rows == 2u && j + 4u * TILE <= p->m; j += 4u * TILE)
        subtract_tile(c + i * c_stride + j, c_stride, p->a + i, p->a_stride, p->b + j, p->b_stride,
                      p->k);
    for (size_t row = i; row < i + rows && j < p->m; row++) {
        for (size_t e = 0; e < p->k; e++)
            axpy_minus(c + row * c_stride + j, p->b + e * p->b_stride + j,
                       p->a[e * p->a_stride + row], p->m - j);
    }
}

void palp_subtract_product(float *c, size_t c_stride, const palp_product *product) {
    for (size_t i = 0; i < product->n; i += 2u) subtract_rows(c, c_stride, product, i, 0u);
}

void palp_subtract_product_upper(float *c, size_t c_stride, const palp_product *product) {
    const size_t width = 4u * TILE;
    for (size_t i = 0; i < product->n; i += 2u)
        subtract_rows(c, c_stride, product, i, i / width * width);
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
