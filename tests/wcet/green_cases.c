/* SPDX-License-Identifier: MIT */
#include "tests/wcet/cases.h"

typedef float (*green_bound)(const palp_prices *price, const palp_blob *blob, uint32_t a,
                             uint32_t b);

static float of_row(const palp_prices *p, const palp_blob *blob, uint32_t a, uint32_t b) {
    (void)b;
    return palp_cost_row(p, blob, a);
}
static float of_extract(const palp_prices *p, const palp_blob *blob, uint32_t a, uint32_t b) {
    return palp_cost_extract(p, blob, a, b);
}
static float of_add(const palp_prices *p, const palp_blob *blob, uint32_t a, uint32_t b) {
    (void)b;
    return palp_cost_add(p, blob, a);
}
static float of_inverse(const palp_prices *p, const palp_blob *blob, uint32_t a, uint32_t b) {
    (void)b;
    return palp_cost_inverse(p, blob, a);
}

static float of_split_add(const palp_prices *p, const palp_blob *blob, uint32_t a, uint32_t b) {
    (void)b;
    return palp_cost_split_add(p, blob, a);
}
static float of_split_modes(const palp_prices *p, const palp_blob *blob, uint32_t a, uint32_t b) {
    (void)b;
    return palp_cost_split_modes(p, blob, a);
}

typedef struct {
    const cases *c;
    green_bound bound;
    const palp_blob *blob;
    uint32_t a, b;
} question;

static float answer(const void *context, uint32_t k) {
    const question *q = context;
    palp_prices price = cases_price(q->c, k);
    return q->bound(&price, q->blob, q->a, q->b);
}

static void tell(cases *c, const char *name, uint32_t level, green_bound bound,
                 const palp_blob *blob, uint32_t a, uint32_t b, uint64_t counted) {
    const question q = {c, bound, blob, a, b};
    cases_tell(c, name, level, answer, &q, counted);
}

/* A force on slot j, and modes on the first `some` slots. */
static void count_split(cases *c, const palp_blob *blob, uint32_t j, uint32_t some, float *field) {
    const uint32_t level = blob->meta->constraint_level;
    const palp_columns *columns = &blob->level[level].columns;
    const float f[3] = {1.0f, -2.0f, 3.0f};
    float load[PALP_MAX_MODES] = {0.0f};
    uint64_t before = instructions();
    palp_split_add(blob, j, f, load, field);
    uint64_t after = instructions();
    tell(c, "split_add", level, of_split_add, blob, columns->offset[j + 1u] - columns->offset[j], 0,
         after - before);
    before = instructions();
    palp_split_add_modes(blob, load, some, field);
    after = instructions();
    tell(c, "split_modes", level, of_split_modes, blob, some, 0, after - before);
}

void cases_of_green(cases *c, const palp_blob *blob, uint64_t seed, uint32_t rounds) {
    dice d = {seed};
    size_t used = c->used;
    const palp_meta *m = blob->meta;
    const palp_domain *dom = &blob->domain[PALP_FREE];
    uint32_t slots = dom->slots, level = m->constraint_level;
    const palp_columns *columns = &blob->level[level].columns;
    palp_row_scratch scratch = {.weight = cases_take(c, slots * sizeof(float)),
                                .mark = cases_take(c, (slots + 31u) / 32u * sizeof(uint32_t))};
    palp_row row = {.index = cases_take(c, m->max_row * sizeof(uint16_t)),
                    .weight = cases_take(c, m->max_row * sizeof(float))};
    float *field = cases_take(c, (size_t)slots * PALP_FIELD_LANES * sizeof(float)), block[9];
    for (uint32_t i = 0; i < slots; i++) scratch.weight[i] = 0.0f;
    for (uint32_t i = 0; i < (slots + 31u) / 32u; i++) scratch.mark[i] = 0;
    for (uint32_t i = 0; i < slots * PALP_FIELD_LANES; i++) field[i] = 0.0f;
    for (uint32_t i = 0; i < rounds; i++) {
        uint32_t slot = dice_below(&d, blob->level[level].nodes);
        uint32_t j = dice_below(&d, columns->columns > 0u ? columns->columns : 1u);
        uint64_t before = instructions();
        (void)palp_basis_row(blob, (palp_basis){level, slot}, &scratch, &row, m->max_row);
        uint64_t after = instructions();
        tell(c, "row", level, of_row, blob, row.count, 0, after - before);
        if (columns->columns == 0u) continue;
        uint32_t groups = columns->offset[j + 1u] - columns->offset[j];
        before = instructions();
        palp_columns_extract(columns, j, &row, block);
        after = instructions();
        tell(c, "extract", level, of_extract, blob, row.count, groups, after - before);
        const float v[3] = {block[0], 1.0f, dice_float(&d)};
        before = instructions();
        palp_columns_add(columns, j, v, field);
        after = instructions();
        tell(c, "add", level, of_add, blob, groups, 0, after - before);
        if (palp_blob_has(blob, PALP_META_SPLIT))
            count_split(c, blob, j < slots ? j : 0u, 1u + dice_below(&d, slots), field);
        uint32_t l = dice_below(&d, m->levels);
        before = instructions();
        palp_wavelet_inverse(dom, field, l);
        after = instructions();
        tell(c, "inverse", l, of_inverse, blob, l, 0, after - before);
    }
    c->used = used;
}
