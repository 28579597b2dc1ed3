/* SPDX-License-Identifier: MIT */
/* The split form of the Green's functions against the dense ones that were baked, in double. */
#include "core/green/field.h"
#include "core/green/half_space.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include "tests/models.h"
#include "tests/tap.h"
#include "tools/solver/dense.h"
#include <stdlib.h>
#include <string.h>

static baked exact, stored; /* every pair corrected, in floats; epsilon 0.05, in halves */

/* Displacement of slot i along axis r by a unit force on slot j along c. */
static double dense_entry(const baked *b, uint32_t i, uint32_t r, uint32_t j, uint32_t c) {
    const uint32_t *node = b->blob.domain[PALP_FREE].node;
    return greens_row(&b->g, node[i], r)[3 * (size_t)node[j] + c];
}

static palp_row single(uint16_t *index, float *weight, uint32_t slot) {
    *index = (uint16_t)slot;
    *weight = 1;
    return (palp_row){1, index, weight};
}

static void block_of(const baked *b, uint32_t i, uint32_t j, float block[9]) {
    uint16_t index[2];
    float weight[2];
    const palp_row row = single(index, weight, i), column = single(index + 1, weight + 1, j);
    palp_split_between(&b->blob, &row, &column, block);
}

static double norm_of(const double block[9]) {
    double sum = 0;
    for (int e = 0; e < 9; e++) sum += block[e] * block[e];
    return sqrt(sum);
}

/* All entries, their RMS error, that of the nodes' own, and what epsilon promises of each. */
static void test_blocks(const baked *b, double own_limit, double promised, const char *what) {
    const uint32_t n = b->blob.domain[PALP_FREE].slots;
    double *own = allocate(n, sizeof *own), error2 = 0, all2 = 0, worst_own = 0, worst = 0;
    bool symmetric = true;
    for (uint32_t pass = 0; pass < 2; pass++) { /* own blocks first */
        for (uint32_t i = 0; i < n; i++) {
            for (uint32_t j = pass == 0 ? i : 0; j <= (pass == 0 ? i : n - 1); j++) {
                float block[9], back[9];
                double wanted[9], off[9];
                block_of(b, i, j, block);
                block_of(b, j, i, back);
                for (uint32_t e = 0; e < 9; e++) {
                    wanted[e] = dense_entry(b, i, e / 3, j, e % 3);
                    off[e] = (double)block[e] - wanted[e];
                    const double skew = (double)(block[e] - back[3 * (e % 3) + e / 3]);
                    symmetric = symmetric && fabs(skew) <= 1e-3 * norm_of(wanted) + 1e-12;
                }
                if (pass == 0) {
                    own[i] = norm_of(wanted);
                    worst_own = fmax(worst_own, norm_of(off) / own[i]);
                    continue;
                }
                error2 += norm_of(off) * norm_of(off);
                all2 += norm_of(wanted) * norm_of(wanted);
                worst = fmax(worst, norm_of(off) / sqrt(own[i] * own[j]));
            }
        }
    }
    AT_MOST(worst_own, own_limit, "%s: every node's own block", what);
    AT_MOST(worst, promised, "%s: every block, of the mean of both nodes' own", what);
    const double rms = sqrt(error2 / all2), said = (double)b->blob.meta->rms_error;
    AT_MOST(fabs(rms - said), 1e-5 + 0.02 * said, "%s: the RMS error is what bake says, %.2g", what,
            said);
    CHECK(symmetric, "%s: symmetric", what);
    free(own);
}

/* A field of several loads is the sum of the blocks; coarser levels are its prefix. */
static void test_field(const baked *b) {
    const palp_domain *d = &b->blob.domain[PALP_FREE];
    palp_field field;
    const size_t bytes = palp_field_memsize(&b->blob);
    void *memory = allocate_aligned(bytes, 1);
    CHECK(palp_field_init(&field, &b->blob, memory, bytes) == PALP_OK, "a field opens");
    palp_load load[4];
    double *sum = allocate(3 * (size_t)d->slots, sizeof *sum), worst = 0, largest = 0;
    for (uint32_t k = 0; k < 4; k++) {
        load[k] = (palp_load){{d->levels - 1, (37 * k + 5) % d->slots},
                              {0.3f * (float)k - 0.2f, 1, -0.5f * (float)k}};
        const float f[3] = {load[k].force_N.x, load[k].force_N.y, load[k].force_N.z};
        for (uint32_t i = 0; i < d->slots; i++) {
            float block[9];
            block_of(b, i, load[k].at.slot, block);
            for (uint32_t e = 0; e < 9; e++)
                sum[3 * i + e / 3] += (double)block[e] * (double)f[e % 3];
        }
    }
    palp_field_update(&field, load, 2);
    palp_field_update(&field, load, 4);
    const float *u = palp_field_reconstruct(&field, d->levels - 1);
    for (uint32_t i = 0; i < 3 * d->slots; i++) {
        largest = fmax(largest, fabs(sum[i]));
        worst = fmax(worst, fabs((double)u[PALP_FIELD_LANES * (i / 3) + i % 3] - sum[i]));
    }
    AT_MOST(worst / largest, 2e-6, "the field of four loads is the sum of their blocks");
    const uint32_t some = d->level_start[1];
    float *whole = allocate(PALP_FIELD_LANES * (size_t)some, sizeof *whole);
    memcpy(whole, u, PALP_FIELD_LANES * (size_t)some * sizeof *whole);
    const float *coarse = palp_field_reconstruct(&field, 0);
    CHECK(memcmp(whole, coarse, PALP_FIELD_LANES * (size_t)some * sizeof *whole) == 0,
          "on a coarser level its nodes are where they were");
    const palp_load on_hat = {{0, 0}, {1, 2, 3}};
    palp_field_update(&field, &on_hat, 1);
    u = palp_field_reconstruct(&field, d->levels - 1);
    worst = 0;
    for (uint32_t i = 0; i < PALP_FIELD_LANES * d->slots; i++)
        worst = fmax(worst, fabs((double)u[i]));
    AT_MOST(worst / largest, 1e-6,
            "loads on coarse hats are not held, and taken off it is at rest");
    float *one = allocate(PALP_FIELD_LANES * (size_t)d->slots, sizeof *one);
    const float unit[3] = {0, 0, 1};
    palp_nodal_response(&b->blob, 7, unit, one);
    worst = 0;
    for (uint32_t i = 0; i < d->slots; i++) {
        float block[9];
        block_of(b, i, 7, block);
        for (uint32_t k = 0; k < 3; k++)
            worst = fmax(worst, fabs((double)(one[PALP_FIELD_LANES * i + k] - block[3 * k + 2])));
    }
    AT_MOST(worst / largest, 2e-6, "a nodal response is a column of blocks");
    free(sum);
    free(whole);
    free(one);
    free(memory);
}

/* Between two hats of coarse levels: R G R^T in double. */
static void test_hats(const baked *b) {
    const palp_domain *d = &b->blob.domain[PALP_FREE];
    palp_row_scratch scratch = {allocate(d->slots, sizeof(float)),
                                allocate((d->slots + 31) / 32, sizeof(uint32_t))};
    palp_row row[2];
    for (uint32_t k = 0; k < 2; k++)
        row[k] = (palp_row){.index = allocate(d->slots, sizeof(uint16_t)),
                            .weight = allocate(d->slots, sizeof(float))};
    double worst = 0, sums = 0;
    for (uint32_t k = 0; k < 12; k++) {
        const palp_basis basis[2] = {{k % d->levels, k % 5}, {(k / 3) % d->levels, (3 * k) % 7}};
        double wanted[9] = {0}, sum = 0;
        float block[9];
        for (uint32_t s = 0; s < 2; s++)
            CHECK(palp_basis_weights(&b->blob, basis[s], &scratch, &row[s], d->slots),
                  "weights of [%u,%u]", basis[s].level, basis[s].slot);
        palp_split_between(&b->blob, &row[0], &row[1], block);
        for (uint32_t i = 0; i < row[0].count; i++) {
            sum += (double)row[0].weight[i];
            for (uint32_t j = 0; j < row[1].count; j++) {
                for (uint32_t e = 0; e < 9; e++)
                    wanted[e] += (double)row[0].weight[i] * (double)row[1].weight[j] *
                                 dense_entry(b, row[0].index[i], e / 3, row[1].index[j], e % 3);
            }
        }
        sums = fmax(sums, fabs(sum - 1));
        for (uint32_t e = 0; e < 9; e++)
            worst = fmax(worst, fabs((double)block[e] - wanted[e]) / norm_of(wanted));
    }
    AT_MOST(sums, 1e-6, "weights under a hat sum to one");
    AT_MOST(worst, 2e-5, "compliance between hats of any levels");
    CHECK(!palp_basis_weights(&b->blob, (palp_basis){0, 0}, &scratch, &row[0], 1) &&
              row[0].count == 0,
          "weights that do not fit are refused");
}

/* <W^-1 x, y> = <x, W^-T y>, and the same of columns. */
static void test_transposes(const baked *b) {
    const palp_domain *d = &b->blob.domain[PALP_FREE];
    const palp_columns *c = &b->blob.columns[PALP_FREE][PALP_FIXED];
    const size_t n = PALP_FIELD_LANES * (size_t)d->slots;
    float *x = allocate(n, sizeof *x), *y = allocate(n, sizeof *y), *v = allocate(n, sizeof *v);
    uint64_t seed = 11;
    double left = 0, right = 0, size = 0;
    for (size_t i = 0; i < n; i++) {
        x[i] = i % 4 == 3 ? 0 : (float)tap_random(&seed);
        y[i] = i % 4 == 3 ? 0 : (float)tap_random(&seed);
    }
    memcpy(v, x, n * sizeof *v);
    palp_wavelet_inverse(d, v, d->levels - 1);
    for (size_t i = 0; i < n; i++) left += (double)v[i] * (double)y[i];
    memcpy(v, y, n * sizeof *v);
    palp_wavelet_adjoint(d, v);
    for (size_t i = 0; i < n; i++) {
        right += (double)x[i] * (double)v[i];
        size += fabs((double)x[i] * (double)v[i]);
    }
    AT_MOST(fabs(left - right) / size, 1e-7, "the adjoint of the inverse transform");
    double worst = 0, most = 0;
    for (uint32_t j = 0; j < c->columns; j++) {
        const float unit[3] = {1, -2, 0.5f};
        float sum[3];
        memset(v, 0, n * sizeof *v);
        palp_columns_add(c, j, unit, v);
        palp_columns_dot(c, j, y, sum);
        left = 0;
        for (size_t i = 0; i < n; i++) left += (double)v[i] * (double)y[i];
        right = (double)(sum[0] - 2 * sum[1] + 0.5f * sum[2]);
        worst = fmax(worst, fabs(left - right));
        most = fmax(most, fabs(left));
    }
    AT_MOST(worst / most, 1e-5, "a column times a field is the transpose of adding it");
    free(x);
    free(y);
    free(v);
}

/* Off the load a half-space is Boussinesq's: the settlement of its own surface. */
static void test_kernel(void) {
    const float nu = 0.3f;
    const palp_vec3 up = {0, 0, 1}, r = {0.02f, 0, 0}, pull = {0, 0, 1};
    const palp_vec3 u = palp_half_space_displacement(nu, r, up, pull);
    AT_MOST(fabs((double)u.z - 0.7 / 0.02) / 35, 1e-6, "(1 - nu) / r along a pull on the surface");
    AT_MOST(fabs((double)u.x - 0.2 / 0.02) / 10, 1e-6, "(1 - 2 nu) / 2 r away from it");
    const palp_vec3 none = palp_half_space_displacement(nu, (palp_vec3){0, 0, 0}, up, pull);
    CHECK(!(palp_norm(none) > 0), "nothing at the load itself");
}

/* All free nodes displaced at once can be solved for. */
static void test_definite(const baked *b, const char *what) {
    const size_t n = b->blob.domain[PALP_FREE].slots;
    double *c = allocate_aligned(9 * n * n, sizeof *c);
    for (uint32_t i = 0; i < n; i++) {
        for (uint32_t j = 0; j <= i; j++) {
            float block[9];
            block_of(b, i, j, block);
            for (size_t e = 0; e < 9; e++)
                c[(3 * i + e / 3) * 3 * n + 3 * j + e % 3] =
                    c[(3 * j + e % 3) * 3 * n + 3 * i + e / 3] = (double)block[e];
        }
    }
    CHECK(dense_cholesky(c, 3 * n, 3 * n) == 3 * n, "%s: positive definite with all of %zu nodes",
          what, n);
    free(c);
}

int main(void) {
    progress_quiet(1);
    exact = model_bake_split(model_sphere(2), -0.7, 1e-9, false);
    stored = model_bake_split(model_sphere(2), -0.7, 0.05, true);
    test_kernel();
    test_blocks(&exact, 2e-6, 2e-6, "every pair corrected");
    test_blocks(&stored, 1e-3, 0.0501, "epsilon 0.05");
    CHECK(stored.size * 5 < exact.size, "%zu bytes instead of %zu", stored.size, exact.size);
    test_field(&stored);
    test_field(&exact);
    test_hats(&exact);
    test_transposes(&exact);
    test_definite(&stored, "epsilon 0.05");
    return tap_done();
}
