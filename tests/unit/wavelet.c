/* SPDX-License-Identifier: MIT */
/* Wavelet transforms, columns and field against their definitions in double precision. */
#include "tests/models.h"
#include "tests/tap.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

static baked sample;

static void test_round_trip(void) {
    const palp_domain *d = &sample.blob.domain[PALP_FREE];
    size_t n = (size_t)d->slots * PALP_FIELD_LANES;
    float *x = allocate(n, sizeof *x), *y = allocate(n, sizeof *y);
    uint64_t seed = 3;
    double worst = 0;
    for (size_t i = 0; i < n; i++) x[i] = y[i] = i % 4 == 3 ? 0 : (float)tap_random(&seed);
    palp_wavelet_forward(d, y);
    palp_wavelet_inverse(d, y, d->levels - 1);
    for (size_t i = 0; i < n; i++) worst = fmax(worst, fabs((double)(x[i] - y[i])));
    AT_MOST(worst, 2e-6, "inverse undoes forward, %u slots, %u levels", d->slots, d->levels);
    free(x);
    free(y);
}

/* Each detail of an odd slot with both parents adds a function whose integral, by nodal areas,
 * vanishes. */
static void test_vanishing_moment(void) {
    const palp_domain *d = &sample.blob.domain[PALP_FREE];
    float *x = allocate((size_t)d->slots * PALP_FIELD_LANES, sizeof *x);
    double worst = 0;
    for (uint32_t m = d->level_start[1]; m < d->slots; m++) {
        double sum = 0, size = 0;
        memset(x, 0, (size_t)d->slots * PALP_FIELD_LANES * sizeof *x);
        x[PALP_FIELD_LANES * m] = 1;
        palp_wavelet_inverse(d, x, d->levels - 1);
        for (uint32_t i = 0; i < d->slots; i++) {
            double v = sample.area[d->node[i]] * (double)x[PALP_FIELD_LANES * i];
            sum += v;
            size += fabs(v);
        }
        if (d->update[2 * m] > 0 || d->update[2 * m + 1] > 0) worst = fmax(worst, fabs(sum) / size);
    }
    AT_MOST(worst, 1e-5, "lifted wavelets have one vanishing moment");
    free(x);
}

/* The row of every slot reproduces the full inverse transform; the truncated inverse reproduces its
 * coarse part. */
static void test_rows(void) {
    const palp_domain *d = &sample.blob.domain[PALP_FREE];
    size_t n = (size_t)d->slots * PALP_FIELD_LANES;
    float *detail = allocate(n, sizeof *detail), *full = allocate(n, sizeof *full);
    palp_row_scratch scratch = {allocate(d->slots, sizeof(float)),
                                allocate((d->slots + 31) / 32, sizeof(uint32_t))};
    palp_row row = {.index = allocate(d->slots, sizeof(uint16_t)),
                    .weight = allocate(d->slots, sizeof(float))};
    uint64_t seed = 5;
    double worst = 0;
    bool ascending = true, fits = true;
    for (size_t i = 0; i < n; i++) full[i] = detail[i] = i % 4 == 3 ? 0 : (float)tap_random(&seed);
    palp_wavelet_inverse(d, full, d->levels - 1);
    for (uint32_t s = 0; s < d->slots; s++) {
        double sum[3] = {0};
        fits = palp_wavelet_row(d, s, &scratch, &row, sample.blob.meta->max_row) && fits;
        for (uint32_t k = 0; k < row.count; k++) {
            ascending = ascending && (k == 0 || row.index[k] > row.index[k - 1]);
            for (uint32_t c = 0; c < 3; c++) {
                sum[c] +=
                    (double)row.weight[k] * (double)detail[PALP_FIELD_LANES * row.index[k] + c];
            }
        }
        for (uint32_t c = 0; c < 3; c++)
            worst = fmax(worst, fabs(sum[c] - (double)full[PALP_FIELD_LANES * s + c]));
    }
    AT_MOST(worst, 3e-6, "selective reconstruction of each of %u slots equals the full inverse",
            d->slots);
    CHECK(fits, "every row fits max_row");
    CHECK(ascending, "rows are in ascending order");
    CHECK(!palp_wavelet_row(d, d->slots - 1, &scratch, &row, 1) && row.count == 0,
          "a row that does not fit is refused");
    free(detail);
    free(full);
}

/* Extraction of every block of the compressed matrix equals inverse transforming whole columns. */
static void test_extract(const baked *b, const char *name, double limit) {
    const palp_domain *d = &b->blob.domain[PALP_FREE];
    const palp_columns *c = &b->blob.columns[PALP_FREE][PALP_FREE];
    size_t n = (size_t)d->slots * PALP_FIELD_LANES;
    float *x = allocate(n, sizeof *x);
    palp_row_scratch scratch = {allocate(d->slots, sizeof(float)),
                                allocate((d->slots + 31) / 32, sizeof(uint32_t))};
    palp_row *rows = allocate(d->slots, sizeof *rows);
    double worst = 0, against_exact = 0, size = 0;
    for (uint32_t s = 0; s < d->slots; s++) {
        rows[s] = (palp_row){.index = allocate(b->blob.meta->max_row, 2),
                             .weight = allocate(b->blob.meta->max_row, 4)};
        (void)palp_wavelet_row(d, s, &scratch, &rows[s], b->blob.meta->max_row);
    }
    for (uint32_t j = 0; j < d->slots; j += 7) {
        for (uint32_t k = 0; k < 3; k++) {
            const float unit[3] = {k == 0, k == 1, k == 2};
            memset(x, 0, n * sizeof *x);
            palp_columns_add(c, j, unit, x);
            palp_wavelet_inverse(d, x, d->levels - 1);
            for (uint32_t i = 0; i < d->slots; i++) {
                float block[9];
                palp_columns_extract(c, j, &rows[i], block);
                for (uint32_t e = 0; e < 3; e++) {
                    double v = (double)x[PALP_FIELD_LANES * i + e];
                    double exact = greens_row(&b->g, d->node[i], e)[3 * d->node[j] + k];
                    worst = fmax(worst, fabs((double)block[3 * e + k] - v));
                    against_exact = fmax(against_exact, fabs(v - exact));
                    size = fmax(size, fabs(exact));
                }
            }
        }
    }
    AT_MOST(worst / size, 1e-6, "%s: extraction equals the inverse transform of whole columns",
            name);
    AT_MOST(against_exact / size, limit, "%s: columns against the matrix that was compressed",
            name);
    for (uint32_t s = 0; s < d->slots; s++) {
        free(rows[s].index);
        free(rows[s].weight);
    }
    free(rows);
    free(x);
}

/* Updates with coherence end where a sum from scratch ends, and equal the dense matrix. */
static void test_field(void) {
    const palp_blob *b = &sample.blob;
    palp_field f, fresh;
    size_t bytes = palp_field_memsize(b);
    palp_load load[12];
    uint64_t seed = 9;
    CHECK(palp_field_init(&f, b, allocate_aligned(bytes, 1), bytes) == PALP_OK,
          "the field opens in %zu bytes", bytes);
    CHECK(palp_field_init(&fresh, b, allocate_aligned(bytes, 1), bytes - 1) == PALP_ERR_MEMORY,
          "and not in one less");
    (void)palp_field_init(&fresh, b, allocate_aligned(bytes, 1), bytes);
    for (int step = 0; step < 300; step++) {
        for (uint32_t i = 0; i < 12; i++) {
            uint32_t slot = (i * 31 + (uint32_t)(step / 3 % 5) * 7) % b->domain[PALP_FREE].slots;
            load[i] = (palp_load){
                {b->meta->levels - 1, slot},
                {(float)tap_random(&seed), (float)tap_random(&seed), (float)tap_random(&seed)}};
        }
        palp_field_update(&f, load, 12 - (uint32_t)step % 4);
    }
    palp_field_update(&f, load, 12);
    palp_field_update(&fresh, load, 12);
    const float *x = palp_field_reconstruct(&f, 99);
    const float *y = palp_field_reconstruct(&fresh, 99);
    double drift = 0, dense = 0, size = 0;
    for (uint32_t s = 0; s < b->domain[PALP_FREE].slots; s++) {
        for (uint32_t k = 0; k < 3; k++) {
            double exact = 0;
            for (int i = 0; i < 12; i++) {
                const double *row = greens_row(&sample.g, b->domain[PALP_FREE].node[s], k) +
                                    3 * b->domain[PALP_FREE].node[load[i].at.slot];
                exact += row[0] * (double)load[i].force_N.x + row[1] * (double)load[i].force_N.y +
                         row[2] * (double)load[i].force_N.z;
            }
            drift = fmax(drift, fabs((double)(x[4 * s + k] - y[4 * s + k])));
            dense = fmax(dense, fabs(exact - (double)y[4 * s + k]));
            size = fmax(size, fabs(exact));
        }
    }
    AT_MOST(drift / size, 2e-5, "300 coherent updates against a fresh sum");
    AT_MOST(dense / size, 5e-6, "fast summation against the dense matrix at epsilon 0");
    palp_field_pin(&fresh, b->domain[PALP_FREE].node[load[0].at.slot], (palp_vec3){0, 0, 1},
                   0.125f);
    uint32_t slot = load[0].at.slot;
    AT_MOST(fabs((double)fresh.field[4 * slot + 2] - 0.125), 1e-7,
            "a pinned node has exactly its value");
    /* Level of detail: the coarse part of a truncated inverse is what one more forward level
     * leaves. */
    float *coarse = allocate(4 * (size_t)b->domain[PALP_FREE].slots, sizeof *coarse);
    uint32_t l = b->meta->levels - 2;
    memcpy(coarse, palp_field_reconstruct(&fresh, l),
           4 * b->domain[PALP_FREE].level_start[l + 1] * sizeof *coarse);
    const float *fine = palp_field_reconstruct(&fresh, l + 1);
    double away = 0;
    for (uint32_t s = 0; s < b->domain[PALP_FREE].level_start[l + 1]; s++) {
        for (uint32_t k = 0; k < 3; k++)
            away = fmax(away, fabs((double)(coarse[4 * s + k] - fine[4 * s + k])));
    }
    AT_MOST(away / size, 0.2, "a coarser level of detail is near the finest at its nodes");
}

int main(void) {
    progress_quiet(1);
    sample = model_bake(model_sphere(3), -0.7, 0, false, false);
    test_round_trip();
    test_vanishing_moment();
    test_rows();
    test_extract(&sample, "epsilon 0, f32", 1e-6);
    test_field();
    baked thin = model_bake(model_sphere(3), -0.7, 0.05, false, false);
    test_extract(&thin, "epsilon 0.05, f32", 0.05);
    AT_MOST((double)thin.blob.meta->rms_error, 0.02, "RMS error (MR 70) at epsilon 0.05");
    double nodes = thin.blob.meta->domain_nodes[PALP_FREE];
    CHECK(nodes * nodes / (double)thin.blob.meta->free_blocks > 6.5,
          "compression %.2f at epsilon 0.05, at least 6.5 on 537 nodes",
          nodes * nodes / (double)thin.blob.meta->free_blocks);
    baked half = model_bake(model_sphere(3), -0.7, 0, false, true);
    test_extract(&half, "epsilon 0, f16", 2e-3);
    return tap_done();
}
