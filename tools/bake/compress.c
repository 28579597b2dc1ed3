/* SPDX-License-Identifier: MIT */
#include "tools/bake/compress.h"
#include "core/green/columns.h"
#include "tools/bake/half.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define LANES PALP_FIELD_LANES

typedef struct {
    const gf_source *source;
    const domain_data *row;
    const double *area;
    compress_options options;
    double amplitude; /* THRESHOLD_GLOBAL */
    double *largest;  /* [columns] largest transformed block, for that */
    stored_column *out;
} compression;

/* Entry (i, k) of the 3x3 block of row slot and column j, as a traction on the fixed domain. */
static double exact_entry(const compression *c, uint32_t slot, size_t first_column, size_t i,
                          size_t k) {
    size_t node = c->row->node[slot];
    double v = c->source->m[(3 * node + i) * c->source->width + first_column + k];
    return c->area != NULL ? v / c->area[node] : v;
}

static double block_norm(const float *field, uint32_t slots, uint32_t slot) {
    double sum = 0;
    for (uint32_t k = 0; k < 3; k++) {
        const float *x = field + ((size_t)k * slots + slot) * LANES;
        for (uint32_t i = 0; i < 3; i++) sum += (double)x[i] * (double)x[i];
    }
    return sqrt(sum);
}

static double largest_block(const float *field, uint32_t slots) {
    double largest = 0;
    for (uint32_t i = 0; i < slots; i++) {
        double norm = block_norm(field, slots, i);
        if (norm > largest) largest = norm;
    }
    return largest;
}

static void threshold(const compression *c, const float *field, stored_column *s) {
    const palp_domain *d = &c->row->view;
    double amplitude =
        c->options.rule == THRESHOLD_GLOBAL ? c->amplitude : largest_block(field, d->slots);
    s->index = allocate(d->slots, sizeof *s->index);
    s->block = allocate(d->slots, sizeof *s->block);
    for (uint32_t l = 0; l < d->levels; l++) {
        double limit =
            l == 0 ? 0 : c->options.epsilon * ldexp(1.0, (int)l - (int)d->levels + 1) * amplitude;
        for (uint32_t i = d->level_start[l]; i < d->level_start[l + 1]; i++) {
            if (block_norm(field, d->slots, i) < limit) continue;
            s->index[s->count] = (uint16_t)i;
            for (uint32_t e = 0; e < 9; e++) {
                float v = field[((size_t)(e % 3) * d->slots + i) * LANES + e / 3] / s->scale;
                s->block[s->count][e] = c->options.half ? from_half(to_half(v)) : v;
            }
            s->count++;
        }
    }
}

static void measure(const compression *c, size_t first_column, float *field, stored_column *s) {
    const palp_domain *d = &c->row->view;
    size_t lane_block = (size_t)d->slots * LANES;
    memset(field, 0, 3 * lane_block * sizeof *field);
    for (uint32_t i = 0; i < s->count; i++) {
        for (uint32_t e = 0; e < 9; e++) {
            field[(e % 3) * lane_block + (size_t)s->index[i] * LANES + e / 3] =
                s->scale * s->block[i][e];
        }
    }
    for (uint32_t k = 0; k < 3; k++) palp_wavelet_inverse(d, field + k * lane_block, d->levels - 1);
    double largest = 0, worst = 0;
    for (uint32_t i = 0; i < d->slots; i++) {
        double error2 = 0, norm2 = 0;
        for (uint32_t e = 0; e < 9; e++) {
            double exact = exact_entry(c, i, first_column, e / 3, e % 3);
            double got = (double)field[(e % 3) * lane_block + (size_t)i * LANES + e / 3];
            error2 += (got - exact) * (got - exact);
            norm2 += exact * exact;
        }
        s->error2 += error2;
        s->norm2 += norm2;
        if (norm2 > largest) largest = norm2;
        if (error2 > worst) worst = error2;
    }
    s->worst = largest > 0 ? sqrt(worst / largest) : 0;
}

static float column_scale(const compression *c, const float *field) {
    float largest = 0;
    if (!c->options.half) return 1.0f;
    for (size_t i = 0; i < 3 * (size_t)c->row->view.slots * LANES; i++) {
        if (fabsf(field[i]) > largest) largest = fabsf(field[i]);
    }
    return largest > 0 ? largest : 1.0f;
}

/* The transformed column, one field for each of its three directions. */
static float *transformed(const compression *c, size_t j) {
    const palp_domain *d = &c->row->view;
    size_t lane_block = (size_t)d->slots * LANES;
    float *field = allocate(3 * lane_block, sizeof *field);
    for (uint32_t i = 0; i < d->slots; i++) {
        for (uint32_t e = 0; e < 9; e++) {
            field[(e % 3) * lane_block + (size_t)i * LANES + e / 3] =
                (float)exact_entry(c, i, c->source->first[j], e / 3, e % 3);
        }
    }
    for (uint32_t k = 0; k < 3; k++) palp_wavelet_forward(d, field + k * lane_block);
    return field;
}

static void measure_amplitude(void *context, size_t j) {
    compression *c = context;
    float *field = transformed(c, j);
    c->largest[j] = largest_block(field, c->row->view.slots);
    free(field);
}

static void compress_column(void *context, size_t j) {
    compression *c = context;
    float *field = transformed(c, j);
    c->out[j].scale = column_scale(c, field);
    threshold(c, field, &c->out[j]);
    measure(c, c->source->first[j], field, &c->out[j]);
    free(field);
    if (c->options.measure_only) { /* they would be many */
        free(c->out[j].index);
        free(c->out[j].block);
        c->out[j].index = NULL;
        c->out[j].block = NULL;
    }
    progress_add(1);
}

/* Lane by lane into groups; the last group repeats the last row with zero blocks. */
static void pack_column(columns_data *d, uint32_t j, const stored_column *s, bool half) {
    size_t entries = d->view.entries;
    for (uint32_t i = 0; i < palp_columns_blocks(&d->view, j); i++) {
        size_t at = (size_t)d->offset[j] * PALP_LANES + i;
        d->index[at] = s->index[i < s->count ? i : s->count - 1];
        for (size_t e = 0; e < entries; e++) {
            size_t to = (at / PALP_LANES * entries + e) * PALP_LANES + at % PALP_LANES;
            float v = i < s->count ? s->block[i][e] : 0.0f;
            if (half) d->half[to] = to_half(v);
            if (!half) d->value[to] = v;
        }
    }
}

/* Root mean square of the counted columns' largest blocks. */
static double common_amplitude(compression *c) {
    double sum = 0;
    c->largest = allocate(c->source->columns, sizeof *c->largest);
    parallel_for(c->source->columns, measure_amplitude, c);
    for (uint32_t j = 0; j < c->source->counted; j++) sum += c->largest[j] * c->largest[j];
    free(c->largest);
    return sqrt(sum / c->source->counted);
}

static void fill_columns(columns_data *d, const stored_column *column, bool half) {
    uint32_t n = d->view.columns;
    size_t groups = d->offset[n];
    d->index = allocate(groups * PALP_LANES, sizeof *d->index);
    size_t values = groups * d->view.entries * PALP_LANES;
    if (half) d->half = allocate(values, sizeof *d->half);
    if (!half) d->value = allocate(values, sizeof *d->value);
    d->view.offset = d->offset;
    d->view.index = d->index;
    d->view.value = d->value;
    d->view.half = d->half;
    d->view.scale = d->scale;
    for (uint32_t j = 0; j < n; j++) pack_column(d, j, &column[j], half);
}

columns_data columns_pack(stored_column *column, uint32_t columns, uint32_t counted, uint32_t rows,
                          const compress_options *options) {
    columns_data d = {.view.columns = columns, .view.rows = rows};
    d.view.entries = options->scalar ? 1 : 9;
    d.offset = allocate(columns + 1u, sizeof *d.offset);
    d.scale = allocate(columns, sizeof *d.scale);
    double error2 = 0, norm2 = 0;
    for (uint32_t j = 0; j < columns; j++) {
        const stored_column *s = &column[j];
        uint32_t groups = (s->count + PALP_LANES - 1) / PALP_LANES;
        d.offset[j + 1] = d.offset[j] + groups;
        d.scale[j] = s->scale;
        if (j >= counted) continue;
        d.blocks += s->count;
        if (groups > d.max_groups) d.max_groups = groups;
        error2 += s->error2;
        norm2 += s->norm2;
        d.max = fmax(d.max, s->worst);
    }
    d.rms = norm2 > 0 ? sqrt(error2 / norm2) : 0;
    if (!options->measure_only) fill_columns(&d, column, options->half);
    for (uint32_t j = 0; j < columns; j++) {
        free(column[j].index);
        free(column[j].block);
    }
    return d;
}

columns_data columns_build(const gf_source *source, const domain_data *row, const double *area,
                           compress_options options) {
    uint32_t n = source->columns;
    compression c = {.source = source,
                     .row = row,
                     .area = area,
                     .options = options,
                     .out = allocate(n, sizeof *c.out)};
    if (options.rule == THRESHOLD_GLOBAL) c.amplitude = common_amplitude(&c);
    progress_begin("wavelet compression", n);
    parallel_for(n, compress_column, &c);
    progress_end();
    columns_data d = columns_pack(c.out, n, source->counted, row->view.slots, &options);
    free(c.out);
    return d;
}

void columns_free(columns_data *d) {
    void *owned[] = {d->offset, d->index, d->half, d->value, d->scale};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
}
