/* SPDX-License-Identifier: MIT */
/* What works in tiles that stay in registers: Cholesky factors and products (linalg.h). */
#include "axpy.h"
#include "real.h"

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
