/* SPDX-License-Identifier: MIT */
#include "linalg.h"
#include "apart.h"
#include "axpy.h"
#include "real.h"

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

/* b := R^-T b */
static inline void forward(const float *r, size_t n, size_t stride, float *b) {
    for (size_t j = 0; j < n; j++) {
        const float *row = r + j * stride;
        b[j] /= row[j];
        axpy_minus(b + j + 1, row + j + 1, b[j], n - j - 1);
    }
}

palp_status palp_chol_append(float *r, size_t n, size_t stride, float *column) {
    float diagonal = column[n];
    forward(r, n, stride, column);
    const float pivot = minus_dot(diagonal, column, column, n);
    if (!(pivot > PALP_PIVOT_MIN * diagonal)) return PALP_ERR_NOT_SPD;
    for (size_t i = 0; i < n; i++) r[i * stride + n] = column[i];
    r[n * stride + n] = palp_sqrt(pivot);
    return PALP_OK;
}

void palp_chol_forward(const float *r, size_t n, size_t stride, float *b) {
    forward(r, n, stride, b);
}

void palp_chol_backward(const float *r, size_t n, size_t stride, float *b) {
    for (size_t j = n; j-- > 0;) {
        const float *row = r + j * stride;
        b[j] = minus_dot(b[j], row + j + 1, b + j + 1, n - j - 1) / row[j];
    }
}

void palp_chol_solve(const float *r, size_t n, size_t stride, float *b) {
    forward(r, n, stride, b);
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
