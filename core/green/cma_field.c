/* SPDX-License-Identifier: MIT */
#include "cma_internal.h"

static bool rows_present(const palp_cma *c, uint32_t domain) {
    return domain == PALP_FREE || palp_blob_has(c->blob, PALP_META_REACTIONS);
}

/* details += column of `node` times v, in both row domains */
static void add_column(palp_cma *c, uint32_t column_domain, uint32_t slot, const float v[3]) {
    for (uint32_t row = 0; row < PALP_DOMAINS; row++) {
        if (!rows_present(c, row)) continue;
        palp_columns_add(&c->blob->columns[row][column_domain], slot, v, c->detail[row]);
    }
}

void palp_cma_sum_columns(palp_cma *c) {
    const palp_blob *b = c->blob;
    for (uint32_t d = 0; d < PALP_DOMAINS; d++) {
        for (uint32_t i = 0; i < b->domain[d].slots * PALP_FIELD_LANES; i++) c->detail[d][i] = 0.0f;
    }
    palp_cma_restrict(c);
    uint32_t stored = b->level[b->meta->constraint_level].nodes;
    for (uint32_t i = 0; i < b->meta->nodes; i++) {
        bool fixed = palp_node_is_fixed(b, i);
        uint32_t slot = palp_node_slot(b, i);
        if (!fixed && slot >= stored) continue;
        const float *v = fixed ? c->given + 3u * i : c->carried + 3u * slot;
        if (!(palp_dot(palp_vec3_at(v), palp_vec3_at(v)) > 0.0f)) continue;
        add_column(c, palp_cma_domain(b, i), slot, v);
    }
    const float g[3] = {c->gravity_m_s2.x, c->gravity_m_s2.y, c->gravity_m_s2.z};
    if (palp_blob_has(b, PALP_META_GRAVITY)) add_column(c, PALP_FREE, stored, g);
}

/* MR 46: one inverse transform per domain, then nodes take their values. */
static void write_fields(palp_cma *c, float *u_m, float *f_N) {
    const palp_blob *b = c->blob;
    for (uint32_t d = 0; d < PALP_DOMAINS; d++) {
        palp_wavelet_inverse(&b->domain[d], c->detail[d], b->domain[d].levels - 1);
    }
    for (uint32_t i = 0; i < b->meta->nodes; i++) {
        bool fixed = palp_node_is_fixed(b, i);
        const float *x =
            c->detail[fixed ? PALP_FIXED : PALP_FREE] + PALP_FIELD_LANES * palp_node_slot(b, i);
        for (uint32_t axis = 0; axis < 3; axis++) {
            float given = c->given[3u * i + axis];
            u_m[3u * i + axis] = fixed ? given : x[axis];
            f_N[3u * i + axis] = fixed ? b->area_m2[i] * x[axis] : given;
        }
    }
}

/* MR 47: along its direction a switched node has exactly what was prescribed. */
static void set_exact(const palp_cma *c, float *u_m, float *f_N) {
    for (uint32_t k = 0; k < c->solved; k++) {
        const palp_switched_unknown *s = palp_cma_unknown(c, k);
        bool fixed = palp_node_is_fixed(c->blob, s->node);
        if (palp_cma_is_coarse(c, s) && c->pairing == PALP_ENERGETIC) continue;
        float *result = (fixed ? f_N : u_m) + 3u * s->node;
        float off = s->target - palp_dot(s->direction, palp_vec3_at(result));
        result[0] += off * s->direction.x;
        result[1] += off * s->direction.y;
        result[2] += off * s->direction.z;
    }
}

void palp_cma_write(palp_cma *cma, float *u_m, float *f_N) {
    write_fields(cma, u_m, f_N);
    set_exact(cma, u_m, f_N);
}
