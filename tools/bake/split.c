/* SPDX-License-Identifier: MIT */
#include "tools/bake/split.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include "tools/bake/half.h"
#include "tools/solver/wide.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define RMS_SHARE 0.4 /* of epsilon: about what wavelet columns have */
#define HALVINGS 8

typedef struct {
    const split_body *body;
    const compress_options *options;
    size_t modes;
    double *left, *right; /* [slots][3][modes] U, and S U */
    double *own;          /* [slots] norms of the nodes' own blocks */
    double limit2; /* squared: of a miss that is not stored, over the mean of both own blocks */
    double *norm2; /* [slots] of whole columns */
    double (
        *left2)[HALVINGS]; /* [slots] of what a column would miss with epsilon halved so often */
    stored_column *out;
    double *own_error; /* [slots] of them, squared */
} corrections;

static double norm2_of(const double block[9]) {
    double sum = 0;
    for (size_t e = 0; e < 9; e++) sum += block[e] * block[e];
    return sum;
}

/* Displacement of slot i by forces on slot j, and the transpose of the converse: both are in the
 * matrix. */
static void exact_block(const corrections *c, size_t i, size_t j, double block[9]) {
    const uint32_t *node = c->body->free->node;
    for (size_t e = 0; e < 9; e++) {
        const double *row = greens_row(c->body->g, node[i], e / 3),
                     *back = greens_row(c->body->g, node[j], e % 3);
        block[e] = 0.5 * (row[3 * (size_t)node[j] + e % 3] + back[3 * (size_t)node[i] + e / 3]);
    }
}

static void point_kernel(const corrections *c, size_t i, size_t j, double block[9]) {
    const split_body *b = c->body;
    const uint32_t k = b->free->node[i], l = b->free->node[j];
    memset(block, 0, 9 * sizeof *block);
    if (i != j && v_distance(b->m->x[k], b->m->x[l]) > 0)
        half_space_point(b->m->x[k], b->m->x[l], b->normal[k], b->normal[l], b->material, block);
}

/* Eight sums side by side: modes are a multiple of it. */
static inline double along_modes(const double *u, const double *v, size_t modes) {
    double lane[PALP_MODE_LANES] = {0}, sum = 0;
    for (size_t a = 0; a < modes; a += PALP_MODE_LANES) {
        for (size_t k = 0; k < PALP_MODE_LANES; k++) lane[k] += u[a + k] * v[a + k];
    }
    for (size_t k = 0; k < PALP_MODE_LANES; k++) sum += lane[k];
    return sum;
}

/* G less what half-space and modes make of it. */
static inline void missed_block(const corrections *c, size_t i, size_t j, const double exact[9],
                                double block[9]) {
    point_kernel(c, i, j, block);
    for (size_t e = 0; e < 9; e++)
        block[e] = exact[e] - block[e] -
                   along_modes(c->left + (3 * i + e / 3) * c->modes,
                               c->right + (3 * j + e % 3) * c->modes, c->modes);
}

/* Squared, over the mean of both nodes' own blocks. */
static double miss_of(const corrections *c, size_t i, size_t j, const double missed[9]) {
    return i == j ? HUGE_VAL : norm2_of(missed) / (c->own[i] * c->own[j]);
}

static void measure_own(void *context, size_t j) {
    corrections *c = context;
    double exact[9];
    exact_block(c, j, j, exact);
    c->own[j] = sqrt(norm2_of(exact));
}

WIDE static void measure_column(void *context, size_t j) {
    corrections *c = context;
    for (uint32_t i = 0; i < c->body->free->slots; i++) {
        double exact[9], missed[9];
        exact_block(c, i, j, exact);
        missed_block(c, i, j, exact, missed);
        const double miss = miss_of(c, i, j, missed);
        c->norm2[j] += norm2_of(exact);
        double limit2 = c->options->epsilon * c->options->epsilon;
        for (size_t k = 0; k < HALVINGS; k++, limit2 /= 4) {
            if (miss <= limit2) c->left2[j][k] += norm2_of(missed);
        }
    }
}

/* Epsilon, halved until the RMS error is in proportion to it. */
static double choose_limit(corrections *c) {
    const uint32_t slots = c->body->free->slots;
    double limit = c->options->epsilon, norm2 = 0;
    parallel_for(slots, measure_column, c);
    for (uint32_t j = 0; j < slots; j++) norm2 += c->norm2[j];
    for (size_t k = 0; k < HALVINGS; k++, limit /= 2) {
        double left2 = 0;
        for (uint32_t j = 0; j < slots; j++) left2 += c->left2[j][k];
        if (sqrt(left2 / norm2) <= RMS_SHARE * c->options->epsilon) break;
    }
    return limit;
}

static float largest_entry(const float (*block)[9], uint32_t count) {
    float most = 0;
    for (size_t i = 0; i < 9 * (size_t)count; i++) most = fmaxf(most, fabsf(block[i / 9][i % 9]));
    return most;
}

/* Divides the blocks by their scale and rounds them as they are stored. */
static void round_column(const corrections *c, stored_column *s) {
    const float most = largest_entry((const float(*)[9])s->block, s->count);
    s->scale = c->options->half && most > 0 ? most : 1.0f;
    for (size_t i = 0; i < 9 * (size_t)s->count; i++) {
        float *v = &s->block[i / 9][i % 9];
        *v /= s->scale;
        if (c->options->half) *v = from_half(to_half(*v));
    }
}

/* The blocks of a column that are stored, and what all others miss: the column's errors and the worst
 * block. */
WIDE static double choose_blocks(const corrections *c, size_t j, stored_column *s,
                                 double *largest) {
    const uint32_t slots = c->body->free->slots;
    uint16_t *index = allocate(slots, sizeof *index);
    float(*block)[9] = allocate(slots, sizeof *block);
    double worst = 0;
    for (uint32_t i = 0; i < slots; i++) {
        double exact[9], missed[9];
        exact_block(c, i, j, exact);
        missed_block(c, i, j, exact, missed);
        const double norm2 = norm2_of(exact);
        s->norm2 += norm2;
        *largest = fmax(*largest, norm2);
        if (miss_of(c, i, j, missed) <= c->limit2) {
            s->error2 += norm2_of(missed);
            worst = fmax(worst, norm2_of(missed));
            continue;
        }
        for (size_t e = 0; e < 9; e++) block[s->count][e] = (float)missed[e];
        index[s->count++] = (uint16_t)i;
    }
    s->index = allocate(s->count, sizeof *s->index);
    s->block = allocate(s->count, sizeof *s->block);
    memcpy(s->index, index, s->count * sizeof *index);
    memcpy(s->block, block, s->count * sizeof *block);
    free(index);
    free(block);
    return worst;
}

static void make_column(void *context, size_t j) {
    corrections *c = context;
    stored_column *s = &c->out[j];
    double largest = 0, worst = choose_blocks(c, j, s, &largest);
    round_column(c, s);
    for (uint32_t at = 0; at < s->count; at++) {
        double exact[9], missed[9];
        exact_block(c, s->index[at], j, exact);
        missed_block(c, s->index[at], j, exact, missed);
        for (size_t e = 0; e < 9; e++) missed[e] -= (double)(s->scale * s->block[at][e]);
        s->error2 += norm2_of(missed);
        worst = fmax(worst, norm2_of(missed));
        if (s->index[at] == j) c->own_error[j] = norm2_of(missed);
    }
    s->worst = largest > 0 ? sqrt(worst / largest) : 0;
    progress_add(1);
}

/* All of the response to gravity. */
static void make_gravity(corrections *c) {
    const palp_domain *d = c->body->free;
    const size_t first = 3 * (size_t)c->body->g->nodes;
    stored_column *s = &c->out[d->slots];
    s->count = d->slots;
    s->index = allocate(d->slots, sizeof *s->index);
    s->block = allocate(d->slots, sizeof *s->block);
    for (uint32_t i = 0; i < d->slots; i++) {
        s->index[i] = (uint16_t)i;
        for (size_t e = 0; e < 9; e++)
            s->block[i][e] = (float)greens_row(c->body->g, d->node[i], e / 3)[first + e % 3];
    }
    round_column(c, s);
}

/* The modes as they are stored, slot by slot. */
static void read_modes(corrections *c) {
    const split_body *b = c->body;
    const regular_data *r = b->regular;
    const double unit = 1 / (double)PALP_MODE_UNIT;
    c->modes = r->modes;
    c->left = allocate(3 * (size_t)b->free->slots * c->modes, sizeof *c->left);
    c->right = allocate(3 * (size_t)b->free->slots * c->modes, sizeof *c->right);
    for (size_t i = 0; i < b->free->slots; i++) {
        for (size_t k = 0; k < 3 * c->modes; k++) {
            const double u = unit * (double)r->vector[3 * b->free->node[i] * c->modes + k];
            c->left[3 * i * c->modes + k] = u;
            c->right[3 * i * c->modes + k] = (double)r->value[k % c->modes] * u;
        }
    }
}

split_data split_build(const split_body *body, const compress_options *options) {
    const uint32_t slots = body->free->slots, columns = slots + (body->g->gravity ? 1u : 0u);
    split_data d = {.worst_column = 0};
    corrections c = {.body = body,
                     .options = options,
                     .own = allocate(slots, sizeof *c.own),
                     .own_error = allocate(slots, sizeof *c.own_error),
                     .norm2 = allocate(slots, sizeof *c.norm2),
                     .left2 = allocate(slots, sizeof *c.left2),
                     .out = allocate(columns, sizeof *c.out)};
    read_modes(&c);
    parallel_for(slots, measure_own, &c);
    const double limit = choose_limit(&c);
    c.limit2 = limit * limit;
    progress_begin("corrections", slots);
    parallel_for(slots, make_column, &c);
    progress_end();
    if (body->g->gravity) make_gravity(&c);
    for (uint32_t j = 0; j < slots; j++) {
        d.worst_column = fmax(d.worst_column, sqrt(c.out[j].error2 / c.out[j].norm2));
        d.worst_own = fmax(d.worst_own, sqrt(c.own_error[j]) / c.own[j]);
    }
    d.columns = columns_pack(c.out, columns, slots, slots, options);
    void *owned[] = {c.left, c.right, c.own, c.own_error, c.norm2, c.left2, c.out};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    return d;
}
