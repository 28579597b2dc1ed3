/* SPDX-License-Identifier: MIT */
#include "compress.h"
#include "core/green/columns.h"
#include "parallel.h"
#include "util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define LANES PALP_FIELD_LANES

/* ---- domain ---- */

static void order_slots(domain_data *d, const mesh *m, const semireg *s, const uint8_t *fixed,
                        uint32_t which, uint32_t *slot_of) {
    uint32_t n = 0;
    for (uint32_t l = 0; l < s->levels; l++) {
        d->level_start[l] = n;
        for (uint32_t i = 0; i < m->vertices; i++) {
            if (s->level[i] != l || (fixed[i] != 0) != (which == PALP_FIXED)) continue;
            slot_of[i] = n;
            d->node[n++] = i;
        }
    }
    d->level_start[s->levels] = n;
}

static void predict_weights(domain_data *d, const semireg *s, const uint32_t *slot_of,
                            bool renormalise) {
    for (uint32_t m = d->level_start[1 % (s->levels + 1)]; s->levels > 1 && m < d->view.slots;
         m++) {
        const uint32_t *parent = s->parent[d->node[m]];
        bool present[2] = {slot_of[parent[0]] != NO_PARENT, slot_of[parent[1]] != NO_PARENT};
        float weight = renormalise && present[0] != present[1] ? 1.0f : 0.5f;
        for (uint32_t k = 0; k < 2; k++) {
            d->parent[2 * m + k] = present[k] ? slot_of[parent[k]] : 0;
            d->predict[2 * m + k] = present[k] ? weight : 0.0f;
        }
    }
}

/* I is carried from fine to coarse with the same predictor, so that each wavelet's integral
 * vanishes. */
static void update_weights(domain_data *d, const double *area) {
    double *integral = allocate(d->view.slots, sizeof *integral);
    for (uint32_t i = 0; i < d->view.slots; i++) integral[i] = area[d->node[i]];
    for (uint32_t l = d->view.levels - 1; l > 0; l--) {
        uint32_t first = d->level_start[l], last = d->level_start[l + 1];
        for (uint32_t m = first; m < last; m++) {
            for (uint32_t k = 0; k < 2; k++) {
                integral[d->parent[2 * m + k]] += (double)d->predict[2 * m + k] * integral[m];
            }
        }
        for (uint32_t m = first; m < last; m++) {
            int parents = (d->predict[2 * m] > 0) + (d->predict[2 * m + 1] > 0);
            for (uint32_t k = 0; k < 2; k++) {
                if (!(d->predict[2 * m + k] > 0)) continue;
                d->update[2 * m + k] =
                    (float)(integral[m] / (parents * integral[d->parent[2 * m + k]]));
            }
        }
    }
    free(integral);
}

static void list_children(domain_data *d) {
    uint32_t n = d->view.slots;
    for (int pass = 0; pass < 2; pass++) {
        uint32_t *at = allocate(n, sizeof *at);
        for (uint32_t m = 0; m < n; m++) {
            for (uint32_t k = 0; k < 2; k++) {
                if (!(d->predict[2 * m + k] > 0)) continue;
                uint32_t a = d->parent[2 * m + k];
                if (pass == 0) d->child_offset[a + 1]++;
                if (pass == 1) d->child[d->child_offset[a] + at[a]++] = m;
            }
        }
        free(at);
        if (pass == 1) break;
        for (uint32_t i = 0; i < n; i++) d->child_offset[i + 1] += d->child_offset[i];
        d->child = allocate(d->child_offset[n], sizeof *d->child);
    }
}

static uint32_t longest_row(const palp_domain *view) {
    palp_row_scratch scratch = {allocate(view->slots, sizeof(float)),
                                allocate((view->slots + 31) / 32, sizeof(uint32_t))};
    palp_row row = {.index = allocate(view->slots, sizeof(uint16_t)),
                    .weight = allocate(view->slots, sizeof(float))};
    uint32_t longest = 1;
    for (uint32_t i = 0; i < view->slots; i++) {
        (void)palp_wavelet_row(view, i, &scratch, &row, view->slots);
        if (row.count > longest) longest = row.count;
    }
    free(scratch.weight);
    free(scratch.mark);
    free(row.index);
    free(row.weight);
    return longest;
}

domain_data domain_build(const mesh *m, const semireg *s, const uint8_t *fixed, uint32_t which,
                         const double *area, bool lifted) {
    domain_data d = {.view.levels = s->levels};
    uint32_t *slot_of = allocate(m->vertices, sizeof *slot_of);
    memset(slot_of, 0xff, m->vertices * sizeof *slot_of);
    for (uint32_t i = 0; i < m->vertices; i++)
        d.view.slots += (fixed[i] != 0) == (which == PALP_FIXED);
    uint32_t n = d.view.slots;
    d.node = allocate(n, sizeof *d.node);
    d.level_start = allocate(s->levels + 1u, sizeof *d.level_start);
    d.parent = allocate(2 * (size_t)n, sizeof *d.parent);
    d.predict = allocate(2 * (size_t)n, sizeof *d.predict);
    d.update = allocate(2 * (size_t)n, sizeof *d.update);
    d.child_offset = allocate(n + 1u, sizeof *d.child_offset);
    order_slots(&d, m, s, fixed, which, slot_of);
    predict_weights(&d, s, slot_of, which == PALP_FIXED);
    if (lifted) update_weights(&d, area);
    list_children(&d);
    d.view = (palp_domain){.slots = n,
                           .levels = s->levels,
                           .node = d.node,
                           .level_start = d.level_start,
                           .parent = d.parent,
                           .predict = d.predict,
                           .update = d.update,
                           .child_offset = d.child_offset,
                           .child = d.child};
    d.max_row = longest_row(&d.view);
    free(slot_of);
    return d;
}

/* ---- columns ---- */

/* The stored part of one block column. */
typedef struct {
    uint32_t count;
    uint16_t *index;
    float scale; /* blocks hold value / scale */
    float (*block)[9];
    double error2, norm2,
        worst; /* squared Frobenius sums; largest block error over largest block */
} stored_column;

typedef struct {
    const greens *g;
    const domain_data *row, *column;
    uint32_t row_domain;
    const double *area;
    double epsilon;
    bool half;
    stored_column *out;
} compression;

/* Entry (i, k) of the 3x3 block of row slot and column j, as a traction on the fixed domain. */
static double exact_entry(const compression *c, uint32_t slot, size_t first_column, size_t i,
                          size_t k) {
    uint32_t node = c->row->node[slot];
    double v = greens_row(c->g, node, i)[first_column + k];
    return c->row_domain == PALP_FIXED ? v / c->area[node] : v;
}

static double block_norm(const float *field, uint32_t slots, uint32_t slot) {
    double sum = 0;
    for (uint32_t k = 0; k < 3; k++) {
        const float *x = field + ((size_t)k * slots + slot) * LANES;
        for (uint32_t i = 0; i < 3; i++) sum += (double)x[i] * (double)x[i];
    }
    return sqrt(sum);
}

/* Nearest IEEE half (ties to even); |x| <= 1 here, so no overflow. */
static uint16_t to_half(float x) {
    double scaled = fabs((double)x);
    uint16_t sign = signbit(x) != 0 ? 0x8000u : 0u;
    int exponent;
    (void)frexp(scaled, &exponent);
    if (exponent < -13 || !(scaled > 0)) exponent = -13;
    double mantissa =
        nearbyint(ldexp(scaled, 11 - exponent)); /* 1024..2048, or less when subnormal */
    uint32_t bits = (uint32_t)((exponent + 13) << 10) + (uint32_t)mantissa;
    return (uint16_t)(sign | bits);
}

static float from_half(uint16_t h) {
    int exponent = (h >> 10) & 31;
    double m = h & 1023;
    double v = exponent == 0 ? ldexp(m, -24) : ldexp(m + 1024, exponent - 25);
    return (float)((h & 0x8000u) != 0 ? -v : v);
}

static void threshold(const compression *c, const float *field, stored_column *s) {
    const palp_domain *d = &c->row->view;
    double largest = 0;
    for (uint32_t i = 0; i < d->slots; i++) {
        double norm = block_norm(field, d->slots, i);
        if (norm > largest) largest = norm;
    }
    s->index = allocate(d->slots, sizeof *s->index);
    s->block = allocate(d->slots, sizeof *s->block);
    for (uint32_t l = 0; l < d->levels; l++) {
        double limit = l == 0 ? 0 : c->epsilon * ldexp(1.0, (int)l - (int)d->levels + 1) * largest;
        for (uint32_t i = d->level_start[l]; i < d->level_start[l + 1]; i++) {
            if (block_norm(field, d->slots, i) < limit) continue;
            s->index[s->count] = (uint16_t)i;
            for (uint32_t e = 0; e < 9; e++) {
                float v = field[((size_t)(e % 3) * d->slots + i) * LANES + e / 3] / s->scale;
                s->block[s->count][e] = c->half ? from_half(to_half(v)) : v;
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
    if (!c->half) return 1.0f;
    for (size_t i = 0; i < 3 * (size_t)c->row->view.slots * LANES; i++) {
        if (fabsf(field[i]) > largest) largest = fabsf(field[i]);
    }
    return largest > 0 ? largest : 1.0f;
}

static void compress_column(void *context, size_t j) {
    compression *c = context;
    const palp_domain *d = &c->row->view;
    size_t lane_block = (size_t)d->slots * LANES;
    float *field = allocate(3 * lane_block, sizeof *field);
    bool gravity = j == c->column->view.slots;
    size_t first_column = 3 * (size_t)(gravity ? c->g->nodes : c->column->node[j]);
    for (uint32_t i = 0; i < d->slots; i++) {
        for (uint32_t e = 0; e < 9; e++) {
            field[(e % 3) * lane_block + (size_t)i * LANES + e / 3] =
                (float)exact_entry(c, i, first_column, e / 3, e % 3);
        }
    }
    for (uint32_t k = 0; k < 3; k++) palp_wavelet_forward(d, field + k * lane_block);
    c->out[j].scale = column_scale(c, field);
    threshold(c, field, &c->out[j]);
    measure(c, first_column, field, &c->out[j]);
    free(field);
    progress_add(1);
}

/* Lane by lane into groups; the last group repeats the last row with zero blocks. */
static void pack_column(columns_data *d, uint32_t j, const stored_column *s, bool half) {
    for (uint32_t i = 0; i < palp_columns_blocks(&d->view, j); i++) {
        size_t at = (size_t)d->offset[j] * PALP_LANES + i;
        d->index[at] = s->index[i < s->count ? i : s->count - 1];
        for (uint32_t e = 0; e < 9; e++) {
            size_t to = at / PALP_LANES * PALP_GROUP_VALUES + e * PALP_LANES + at % PALP_LANES;
            float v = i < s->count ? s->block[i][e] : 0.0f;
            if (half) d->half[to] = to_half(v);
            if (!half) d->value[to] = v;
        }
    }
}

columns_data columns_build(const greens *g, const domain_data *row, const domain_data *column,
                           uint32_t row_domain, uint32_t column_domain, const double *area,
                           double epsilon, bool half) {
    bool gravity = g->gravity && column_domain == PALP_FREE;
    uint32_t nodes = column->view.slots;
    uint32_t n = nodes + (gravity ? 1u : 0u);
    columns_data d = {.view.columns = n, .view.rows = row->view.slots};
    compression c = {.g = g,
                     .row = row,
                     .column = column,
                     .row_domain = row_domain,
                     .area = area,
                     .epsilon = epsilon,
                     .half = half,
                     .out = allocate(n, sizeof *c.out)};
    progress_begin("wavelet compression", n);
    parallel_for(n, compress_column, &c);
    progress_end();
    d.offset = allocate(n + 1u, sizeof *d.offset);
    d.scale = allocate(n, sizeof *d.scale);
    double error2 = 0, norm2 = 0;
    for (uint32_t j = 0; j < n; j++) {
        const stored_column *s = &c.out[j];
        uint32_t groups = (s->count + PALP_LANES - 1) / PALP_LANES;
        d.offset[j + 1] = d.offset[j] + groups;
        d.scale[j] = s->scale;
        if (j == nodes) break;
        d.blocks += s->count;
        if (groups > d.max_groups) d.max_groups = groups;
        error2 += s->error2;
        norm2 += s->norm2;
        d.max = fmax(d.max, s->worst);
    }
    d.rms = norm2 > 0 ? sqrt(error2 / norm2) : 0;
    size_t groups = d.offset[n];
    d.index = allocate(groups * PALP_LANES, sizeof *d.index);
    if (half) d.half = allocate(groups * PALP_GROUP_VALUES, sizeof *d.half);
    if (!half) d.value = allocate(groups * PALP_GROUP_VALUES, sizeof *d.value);
    d.view = (palp_columns){.columns = n,
                            .rows = row->view.slots,
                            .offset = d.offset,
                            .index = d.index,
                            .value = d.value,
                            .half = d.half,
                            .scale = d.scale};
    for (uint32_t j = 0; j < n; j++) {
        pack_column(&d, j, &c.out[j], half);
        free(c.out[j].index);
        free(c.out[j].block);
    }
    free(c.out);
    return d;
}
