/* SPDX-License-Identifier: MIT */
#include "wavelet.h"

#define LANES PALP_FIELD_LANES

/* y += s x on one node */
static void add_scaled(float *restrict y, const float *restrict x, float s) {
    for (uint32_t k = 0; k < LANES; k++) y[k] += s * x[k];
}

/* The same with the stencils of a butterfly wavelet. */
static void predict_by_stencil(const palp_domain *d, float *x, uint32_t level, float sign) {
    for (uint32_t m = d->level_start[level]; m < d->level_start[level + 1]; m++) {
        for (uint32_t k = d->stencil_offset[m]; k < d->stencil_offset[m + 1]; k++)
            add_scaled(x + LANES * m, x + LANES * d->stencil[k], sign * d->stencil_weight[k]);
    }
}

/* x_m += sign * sum_a w_ma x_a over the odd slots of one level */
static void predict(const palp_domain *d, float *x, uint32_t level, float sign) {
    if (d->stencil_offset != NULL) {
        predict_by_stencil(d, x, level, sign);
        return;
    }
    for (uint32_t m = d->level_start[level]; m < d->level_start[level + 1]; m++) {
        float *y = x + LANES * m;
        const float *p = x + LANES * d->parent[2 * m], *q = x + LANES * d->parent[2 * m + 1];
        float v = sign * d->predict[2 * m], w = sign * d->predict[2 * m + 1];
        float sum[LANES];
        for (uint32_t k = 0; k < LANES; k++) sum[k] = y[k] + v * p[k] + w * q[k];
        for (uint32_t k = 0; k < LANES; k++) y[k] = sum[k];
    }
}

/* x_a += sign * sum_m s_am x_m: each slot gathers from its children that are odd on the level, in
 * ascending order. */
static void update(const palp_domain *d, float *x, uint32_t level, float sign) {
    uint32_t first = d->level_start[level], last = d->level_start[level + 1];
    for (uint32_t a = 0; a < first; a++) {
        uint32_t c = d->child_offset[a], end = d->child_offset[a + 1];
        float *y = x + LANES * a;
        float sum[LANES];
        /* at most children */
        while (c < end && d->child[c] < first) c++;
        for (uint32_t k = 0; k < LANES; k++) sum[k] = y[k];
        for (; c < end && d->child[c] < last; c++) {
            const float *z = x + LANES * d->child[c];
            float s = sign * d->child_weight[c];
            for (uint32_t k = 0; k < LANES; k++) sum[k] += s * z[k];
        }
        for (uint32_t k = 0; k < LANES; k++) y[k] = sum[k];
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

/* Each odd slot gives its parents their shares of it. */
static void predict_back(const palp_domain *d, float *x, uint32_t level) {
    for (uint32_t m = d->level_start[level]; m < d->level_start[level + 1]; m++) {
        for (uint32_t k = 0; k < 2; k++)
            add_scaled(x + LANES * d->parent[2 * m + k], x + LANES * m, d->predict[2 * m + k]);
    }
}

/* .. and takes from them what the update had given. */
static void update_back(const palp_domain *d, float *x, uint32_t level) {
    for (uint32_t m = d->level_start[level]; m < d->level_start[level + 1]; m++) {
        for (uint32_t k = 0; k < 2; k++)
            add_scaled(x + LANES * m, x + LANES * d->parent[2 * m + k], -d->update[2 * m + k]);
    }
}

void palp_wavelet_adjoint(const palp_domain *domain, float *x) {
    for (uint32_t l = domain->levels - 1; l > 0; l--) {
        predict_back(domain, x, l);
        update_back(domain, x, l);
    }
}

void palp_row_mark(palp_row_scratch *scratch, uint32_t slot, float weight) {
    scratch->weight[slot] += weight;
    scratch->mark[slot / 32u] |= 1u << (slot % 32u);
}

uint32_t palp_row_next(const palp_row_scratch *scratch, uint32_t from, uint32_t end) {
    /* at most words */
    while (from < end) {
        uint32_t word = scratch->mark[from / 32u] >> (from % 32u);
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
    for (uint32_t m = palp_row_next(s, first, last); m < last; m = palp_row_next(s, m + 1, last)) {
        if (d->stencil_offset != NULL) {
            for (uint32_t k = d->stencil_offset[m]; k < d->stencil_offset[m + 1]; k++)
                palp_row_mark(s, d->stencil[k], d->stencil_weight[k] * s->weight[m]);
            continue;
        }
        for (uint32_t k = 0; k < 2; k++) {
            float w = d->predict[2 * m + k];
            uint32_t a = d->parent[2 * m + k];
            if (w > 0.0f && a < m) palp_row_mark(s, a, w * s->weight[m]);
        }
    }
    for (uint32_t a = palp_row_next(s, 0, first); a < first; a = palp_row_next(s, a + 1, first)) {
        for (uint32_t c = d->child_offset[a]; c < d->child_offset[a + 1]; c++) {
            uint32_t m = d->child[c];
            if (m < first || m >= last || !(d->child_weight[c] > 0.0f)) continue;
            palp_row_mark(s, m, -d->child_weight[c] * s->weight[a]);
        }
    }
}

bool palp_row_collect(uint32_t slots, palp_row_scratch *scratch, palp_row *row, uint32_t capacity) {
    uint32_t count = 0;
    for (uint32_t k = palp_row_next(scratch, 0, slots); k < slots;
         k = palp_row_next(scratch, k + 1, slots)) {
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

bool palp_row_finish(const palp_domain *domain, palp_row_scratch *scratch, palp_row *row,
                     uint32_t capacity) {
    for (uint32_t l = domain->levels - 1; l > 0; l--) row_level(domain, l, scratch);
    return palp_row_collect(domain->slots, scratch, row, capacity);
}

bool palp_wavelet_row(const palp_domain *domain, uint32_t slot, palp_row_scratch *scratch,
                      palp_row *row, uint32_t capacity) {
    palp_row_mark(scratch, slot, 1.0f);
    return palp_row_finish(domain, scratch, row, capacity);
}
