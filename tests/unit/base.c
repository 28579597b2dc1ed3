/* SPDX-License-Identifier: MIT */
/* core/base against bit-by-bit, libm and double-precision oracles. */
#include "core/base/arena.h"
#include "core/base/crc32c.h"
#include "core/base/frame.h"
#include "core/base/linalg.h"
#include "core/base/real.h"
#include "tests/tap.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define N 40

static uint32_t crc_by_bits(const uint8_t *p, size_t n) {
    uint32_t crc = 0xffffffffu;
    for (size_t i = 0; i < n; i++) {
        crc ^= p[i];
        for (int k = 0; k < 8; k++) crc = (crc >> 1) ^ ((crc & 1u) != 0 ? 0x82f63b78u : 0);
    }
    return ~crc;
}

static void test_crc(void) {
    uint8_t data[256];
    CHECK(palp_crc32c(0, "123456789", 9) == 0xe3069283u, "CRC-32C check value");
    for (int i = 0; i < 256; i++) data[i] = (uint8_t)i;
    CHECK(palp_crc32c(0, data, 256) == crc_by_bits(data, 256),
          "CRC-32C of every byte against the bitwise form");
    CHECK(palp_crc32c(palp_crc32c(0, data, 100), data + 100, 156) == crc_by_bits(data, 256),
          "CRC-32C continues");
}

static void test_sincos(void) {
    double worst = 0;
    for (int i = -100000; i <= 100000; i++) {
        float x = (float)i * 1e-4f, s, c;
        palp_sincos(x, &s, &c);
        worst =
            fmax(worst, fmax(fabs((double)s - sin((double)x)), fabs((double)c - cos((double)x))));
    }
    AT_MOST(worst, 3e-7, "sine and cosine, |x| <= 10, against libm");
    CHECK(!palp_is_finite(NAN) && !palp_is_finite(-INFINITY) && palp_is_finite(3e38f),
          "finite by bits");
}

/* Solves in double by Gauss-Jordan with full row search. */
static void solve_double(const double *a, const double *b, double *x, int n) {
    double *w = malloc(sizeof(double) * (size_t)(n * (n + 1)));
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < n; k++) w[i * (n + 1) + k] = a[i * n + k];
        w[i * (n + 1) + n] = b[i];
    }
    for (int j = 0; j < n; j++) {
        int best = j;
        for (int i = j; i < n; i++) {
            if (fabs(w[i * (n + 1) + j]) > fabs(w[best * (n + 1) + j])) best = i;
        }
        for (int k = 0; k <= n; k++) {
            double t = w[j * (n + 1) + k];
            w[j * (n + 1) + k] = w[best * (n + 1) + k];
            w[best * (n + 1) + k] = t;
        }
        for (int i = 0; i < n; i++) {
            if (i == j) continue;
            double f = w[i * (n + 1) + j] / w[j * (n + 1) + j];
            for (int k = j; k <= n; k++) w[i * (n + 1) + k] -= f * w[j * (n + 1) + k];
        }
    }
    for (int i = 0; i < n; i++) x[i] = w[i * (n + 1) + n] / w[i * (n + 1) + i];
    free(w);
}

static double relative(const float *x, const double *exact, int n) {
    double error = 0, norm = 0;
    for (int i = 0; i < n; i++) {
        error += ((double)x[i] - exact[i]) * ((double)x[i] - exact[i]);
        norm += exact[i] * exact[i];
    }
    return sqrt(error / norm);
}

/* A well-conditioned symmetric positive definite matrix, exact in both precisions. */
static void make_spd(double *a, int n, uint64_t *seed) {
    for (int i = 0; i < n; i++) {
        for (int k = 0; k <= i; k++) {
            double v = (double)(float)(tap_random(seed) * 0.5);
            a[i * n + k] = a[k * n + i] = i == k ? (double)(float)(0.5 * n + v) : v;
        }
    }
}

static void test_cholesky(void) {
    static float r[N * N], c[N], x[N];
    static double a[N * N], b[N], exact[N];
    uint64_t seed = 7;
    make_spd(a, N, &seed);
    for (int i = 0; i < N; i++) b[i] = (double)(float)tap_random(&seed);
    for (int i = 0; i < N * N; i++) r[i] = (float)a[i];
    for (int i = 0; i < N; i++) x[i] = (float)b[i];
    CHECK(palp_chol_factor(r, N, N) == PALP_OK, "Cholesky factors");
    palp_chol_solve(r, N, N, x);
    solve_double(a, b, exact, N);
    AT_MOST(relative(x, exact, N), 1e-5, "Cholesky solve, n = %d, against Gauss-Jordan in double",
            N);

    for (size_t n = 0; n < N; n++) { /* grown from nothing */
        for (size_t i = 0; i <= n; i++) c[i] = (float)a[n * N + i];
        if (palp_chol_append(r, n, N, c) != PALP_OK) CHECK(false, "append of row %zu", n);
    }
    for (int i = 0; i < N; i++) x[i] = (float)b[i];
    palp_chol_solve(r, N, N, x);
    AT_MOST(relative(x, exact, N), 1e-5, "Cholesky after %d appends", N);

    float bad[4] = {1, 2, 2, 1};
    CHECK(palp_chol_factor(bad, 2, 2) == PALP_ERR_NOT_SPD, "an indefinite matrix is refused");
    float twin[4] = {1, 1, 1, 1}, column[2] = {1, 1};
    CHECK(palp_chol_factor(twin, 2, 2) == PALP_ERR_NOT_SPD, "a singular matrix is refused");
    twin[0] = 1;
    CHECK(palp_chol_append(twin, 1, 2, column) == PALP_ERR_NOT_SPD, "a repeated column is refused");
}

/* R^-T B and C - A^T B, sizes that fill tiles and that do not, against double precision. */
static void test_blocks(void) {
    static const size_t sizes[4][3] = {{1, 1, 1}, {18, 30, 18}, {33, 47, 21}, {40, 64, 64}};
    for (int t = 0; t < 4; t++) {
        size_t k = sizes[t][0], m = sizes[t][1], n = sizes[t][2];
        uint64_t seed = 11;
        double *spd = malloc(k * k * sizeof *spd);
        float *r = malloc(k * k * sizeof *r), *b = malloc(k * m * sizeof *b);
        float *a = malloc(k * n * sizeof *a), *c = malloc(n * m * sizeof *c);
        float *before = malloc(n * m * sizeof *before), *given = malloc(k * m * sizeof *given);
        make_spd(spd, (int)k, &seed);
        for (size_t i = 0; i < k * k; i++) r[i] = (float)spd[i];
        for (size_t i = 0; i < k * m; i++) given[i] = b[i] = (float)tap_random(&seed);
        for (size_t i = 0; i < k * n; i++) a[i] = (float)tap_random(&seed);
        for (size_t i = 0; i < n * m; i++) before[i] = c[i] = (float)tap_random(&seed);
        (void)palp_chol_factor(r, k, k);
        palp_chol_forward_many(r, k, k, b, m, m);
        double worst = 0, off = 0;
        for (size_t i = 0; i < k; i++) { /* R^T B = what was given */
            for (size_t j = 0; j < m; j++) {
                double sum = -(double)given[i * m + j];
                for (size_t e = 0; e <= i; e++) sum += (double)r[e * k + i] * (double)b[e * m + j];
                worst = fmax(worst, fabs(sum));
            }
        }
        const palp_product product = {
            .a = a, .b = b, .a_stride = n, .b_stride = m, .k = k, .n = n, .m = m};
        palp_subtract_product(c, m, &product);
        for (size_t i = 0; i < n; i++) {
            for (size_t j = 0; j < m; j++) {
                double sum = (double)before[i * m + j] - (double)c[i * m + j];
                for (size_t e = 0; e < k; e++) sum -= (double)a[e * n + i] * (double)b[e * m + j];
                off = fmax(off, fabs(sum));
            }
        }
        AT_MOST(worst, 1e-5, "R^T (R^-T B) = B for %zu x %zu", k, m);
        AT_MOST(off, 1e-5, "C - A^T B for %zu x %zu, %zu deep", n, m, k);
        if (n == m) {
            palp_subtract_product_upper(before, m, &product);
            double differ = 0;
            for (size_t i = 0; i < n; i++) {
                for (size_t j = i; j < m; j++)
                    differ = fmax(differ, fabs((double)before[i * m + j] - (double)c[i * m + j]));
            }
            AT_MOST(differ, 0, "its upper triangle alone has the same bits");
        }
        void *owned[] = {spd, r, b, a, c, before, given};
        for (size_t i = 0; i < 7; i++) free(owned[i]);
    }
}

static void test_lu(void) {
    static float lu[N * N], keep[N * N], x[N], r[N], step[N], rhs[N];
    static double a[N * N], b[N], exact[N];
    static uint32_t perm[N];
    uint64_t seed = 11;
    for (int i = 0; i < N * N; i++) {
        keep[i] = lu[i] = (float)tap_random(&seed);
        a[i] = (double)lu[i];
    }
    for (int i = 0; i < N; i++) {
        rhs[i] = x[i] = (float)tap_random(&seed);
        b[i] = (double)x[i];
    }
    CHECK(palp_lu_factor(lu, perm, N, N) == PALP_OK, "LU factors");
    palp_lu_solve(lu, perm, N, N, x);
    solve_double(a, b, exact, N);
    double before = relative(x, exact, N);
    AT_MOST(before, 1e-3, "LU solve of a random matrix");
    for (int k = 0; k < 2; k++) {
        palp_residual(keep, x, rhs, r, N, N);
        memcpy(step, r, sizeof step);
        palp_lu_solve(lu, perm, N, N, step);
        for (int i = 0; i < N; i++) x[i] += step[i];
    }
    AT_MOST(relative(x, exact, N), 1.2e-7, "the same after two refinements");
    memset(lu, 0, sizeof lu);
    CHECK(palp_lu_factor(lu, perm, N, N) == PALP_ERR_SINGULAR,
          "a singular matrix is refused by LU");
}

static void test_rotations(void) {
    const float sound[9] = {0, -1, 0, 1, 0, 0, 0, 0, 1}, mirror[9] = {1, 0, 0, 0, 1, 0, 0, 0, -1},
                flat[9] = {1, 1, 1, 0, 0, 0, 0, 0, 0},
                sheared[9] = {1, 0.2f, 0, 0, 0.98f, 0, 0, 0, 1},
                long_one[9] = {1.1f, 0, 0, 0, 1, 0, 0, 0, 1},
                none[9] = {NAN, 0, 0, 0, 1, 0, 0, 0, 1};
    CHECK(palp_is_rotation(sound) && !palp_is_rotation(mirror) && !palp_is_rotation(flat) &&
              !palp_is_rotation(sheared) && !palp_is_rotation(long_one) && !palp_is_rotation(none),
          "a turn is a rotation; mirrors, rank one, shear, stretch and NaN are none");
}

static void test_room(void) {
    palp_arena a = {0};
    (void)palp_take_rows(&a, SIZE_MAX / 8, 9, 4);
    CHECK(a.used == SIZE_MAX, "more rows than the address space holds: no block is large enough");
    a = (palp_arena){0};
    (void)palp_take_rows(&a, 3, SIZE_MAX / 2, 4);
    CHECK(a.used == SIZE_MAX, "nor is one for rows that are longer than that");
    a = (palp_arena){0};
    (void)palp_take_rows(&a, 3, 5, 4);
    CHECK(a.used == 64, "3 rows of 5 floats take %zu bytes", a.used);
}

int main(void) {
    test_crc();
    test_sincos();
    test_cholesky();
    test_blocks();
    test_lu();
    for (int i = 0; i < PALP_STATUS_COUNT; i++) {
        if (strlen(palp_status_text((palp_status)i)) < 2) CHECK(false, "status %d has no text", i);
    }
    CHECK(strcmp(palp_status_text((palp_status)999), "unknown status") == 0,
          "unknown status has a text");
    test_room();
    test_rotations();
    return tap_done();
}
