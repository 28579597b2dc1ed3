/* SPDX-License-Identifier: MIT */
#include "wavelet.h"

#define LANES PALP_FIELD_LANES

/* y += s x on one node */
static void add_scaled(float *restrict y, const float *restrict x, float s) {
    for (uint32_t k = 0; k < LANES; k++) y[k] += s * x[k];
}

/* x_m += sign * sum_a w_ma x_a over the odd slots of one level */
static void predict(const palp_domain *d, float *x, uint32_t level, float sign) {
    for (uint32_t m = d->level_start[level]; m < d->level_start[level + 1]; m++) {
        for (uint32_t k = 0; k < 2; k++) {
            float w = d->predict[2 * m + k];
            uint32_t a = d->parent[2 * m + k];
            if (a < m) add_scaled(x + LANES * m, x + LANES * a, sign * w);
        }
    }
}

/* x_a += sign * sum_m s_am x_m, scattered from the odd slots of one level */
static void update(const palp_domain *d, float *x, uint32_t level, float sign) {
    for (uint32_t m = d->level_start[level]; m < d->level_start[level + 1]; m++) {
        for (uint32_t k = 0; k < 2; k++) {
            float s = d->update[2 * m + k];
            uint32_t a = d->parent[2 * m + k];
            if (a < m) add_scaled(x + LANES * a, x + LANES * m, sign * s);
        }
    }
}

void palp_wavelet_forward(const palp_domain *domain, float *x) {
    for (uint32_t l = domain->levels - 1; l > 0; l--) {
        predict(domain, x, l, -1.0f);
        update(domain, x, l, 1.0f);
    }
}

void palp_wavelet_inverse(const palp_domain *domain, float *x, uint32_t level) {
    for (uint32_t l = 1; l <= level && l < domain->levels; l++) {
        update(domain, x, l, -1.0f);
        predict(domain, x, l, 1.0f);
    }
}

static void mark(palp_row_scratch *s, uint32_t slot, float weight) {
    s->weight[slot] += weight;
    s->mark[slot / 32u] |= 1u << (slot % 32u);
}

/* The next marked slot at or above `from` and below `end`; `end` if there is none. */
static uint32_t next_marked(const palp_row_scratch *s, uint32_t from, uint32_t end) {
    while (from < end) {
        uint32_t word = s->mark[from / 32u] >> (from % 32u);
        if (word != 0u) {
            from += (uint32_t)__builtin_ctz(word);
            return from < end ? from : end;
        }
        from = (from / 32u + 1u) * 32u;
    }
    return end;
}

/* The transpose of one inverse level applied to the marked weights. */
static void row_level(const palp_domain *d, uint32_t level, palp_row_scratch *s) {
    uint32_t first = d->level_start[level];
    uint32_t last = d->level_start[level + 1];
    for (uint32_t m = next_marked(s, first, last); m < last; m = next_marked(s, m + 1, last)) {
        for (uint32_t k = 0; k < 2; k++) {
            float w = d->predict[2 * m + k];
            uint32_t a = d->parent[2 * m + k];
            if (w > 0.0f && a < m) mark(s, a, w * s->weight[m]);
        }
    }
    for (uint32_t a = next_marked(s, 0, first); a < first; a = next_marked(s, a + 1, first)) {
        for (uint32_t c = d->child_offset[a]; c < d->child_offset[a + 1]; c++) {
            uint32_t m = d->child[c];
            if (m < first || m >= last) continue;
            uint32_t side = d->parent[2 * m] == a && d->update[2 * m] > 0.0f ? 0u : 1u;
            float weight = d->update[2 * m + side] * s->weight[a];
            if (d->update[2 * m + side] > 0.0f) mark(s, m, -weight);
        }
    }
}

bool palp_wavelet_row(const palp_domain *domain, uint32_t slot, palp_row_scratch *scratch,
                      palp_row *row, uint32_t capacity) {
    mark(scratch, slot, 1.0f);
    for (uint32_t l = domain->levels - 1; l > 0; l--) row_level(domain, l, scratch);
    uint32_t count = 0;
    for (uint32_t k = next_marked(scratch, 0, domain->slots); k < domain->slots;
         k = next_marked(scratch, k + 1, domain->slots)) {
        if (count < capacity) {
            row->index[count] = (uint16_t)k;
            row->weight[count] = scratch->weight[k];
        }
        count++;
        scratch->weight[k] = 0.0f;
        scratch->mark[k / 32u] &= ~(1u << (k % 32u));
    }
    row->count = count <= capacity ? count : 0u;
    return count <= capacity;
}
