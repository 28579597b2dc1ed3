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

/* The columns of the fixed nodes that are displaced, and of gravity. */
static void add_given(palp_cma *c) {
    const palp_blob *b = c->blob;
    const float g[3] = {c->gravity_m_s2.x, c->gravity_m_s2.y, c->gravity_m_s2.z};
    for (uint32_t i = 0; i < b->meta->nodes; i++) {
        const float *v = c->given + 3u * i;
        if (!palp_node_is_fixed(b, i) || !(palp_dot(palp_vec3_at(v), palp_vec3_at(v)) > 0.0f))
            continue;
        add_column(c, PALP_FIXED, palp_node_slot(b, i), v);
    }
    for (uint32_t row = 0; row < PALP_DOMAINS && palp_blob_has(b, PALP_META_GRAVITY); row++) {
        const palp_columns *columns = &b->columns[row][PALP_FREE];
        if (rows_present(c, row) && !(row == PALP_FREE && palp_cma_is_split(c)))
            palp_columns_add(columns, columns->columns - 1u, g, c->detail[row]);
    }
}

/* Reactions to the forces on free nodes, by reciprocity: a fixed node's column times the forces. What
 * thresholding leaves unbalanced becomes a uniform traction. */
static void add_reactions(palp_cma *c) {
    const palp_blob *b = c->blob;
    const palp_domain *forced = &b->domain[PALP_FREE], *fixed = &b->domain[PALP_FIXED];
    float *traction = c->detail[PALP_FIXED], unbalanced[3] = {0}, area = 0.0f;
    for (uint32_t i = 0; i < forced->slots; i++) {
        for (uint32_t k = 0; k < 3u; k++) {
            c->turned[PALP_FIELD_LANES * i + k] = c->carried[3u * i + k];
            unbalanced[k] += c->carried[3u * i + k];
        }
        c->turned[PALP_FIELD_LANES * i + 3u] = 0.0f;
    }
    palp_wavelet_adjoint(forced, c->turned);
    for (uint32_t j = 0; j < fixed->slots; j++) {
        const float own = b->area_m2[fixed->node[j]];
        float sum[3];
        palp_columns_dot(&b->columns[PALP_FREE][PALP_FIXED], j, c->turned, sum);
        area += own;
        for (uint32_t k = 0; k < 3u; k++) {
            unbalanced[k] -= sum[k];
            traction[PALP_FIELD_LANES * j + k] -= sum[k] / own;
        }
    }
    for (uint32_t j = 0; j < fixed->slots; j++) {
        for (uint32_t k = 0; k < 3u; k++)
            traction[PALP_FIELD_LANES * j + k] -= unbalanced[k] / area;
    }
}

/* Of a split blob: what is transformed first, then nodal values. */
static void sum_split(palp_cma *c) {
    const palp_blob *b = c->blob;
    const palp_domain *d = &b->domain[PALP_FREE];
    const palp_columns *gravity = &b->columns[PALP_FREE][PALP_FREE];
    const float g[3] = {c->gravity_m_s2.x, c->gravity_m_s2.y, c->gravity_m_s2.z};
    for (uint32_t k = 0; k < PALP_DOMAINS; k++)
        palp_wavelet_inverse(&b->domain[k], c->detail[k], b->domain[k].levels - 1u);
    for (uint32_t a = 0; a < PALP_MAX_MODES; a++) c->load[a] = 0.0f;
    for (uint32_t i = 0; i < d->slots; i++) {
        const float *f = c->carried + 3u * i;
        if (palp_dot(palp_vec3_at(f), palp_vec3_at(f)) > 0.0f)
            palp_split_add(b, i, f, c->load, c->detail[PALP_FREE]);
    }
    palp_split_add_modes(b, c->load, d->slots, c->detail[PALP_FREE]);
    if (palp_blob_has(b, PALP_META_GRAVITY))
        palp_columns_add(gravity, gravity->columns - 1u, g, c->detail[PALP_FREE]);
    if (rows_present(c, PALP_FIXED)) add_reactions(c);
}

void palp_cma_sum_columns(palp_cma *c) {
    const palp_blob *b = c->blob;
    for (uint32_t d = 0; d < PALP_DOMAINS; d++) {
        for (uint32_t i = 0; i < b->domain[d].slots * PALP_FIELD_LANES; i++) c->detail[d][i] = 0.0f;
    }
    palp_cma_restrict(c);
    add_given(c);
    if (palp_cma_is_split(c)) {
        sum_split(c);
        return;
    }
    for (uint32_t i = 0; i < b->level[b->meta->constraint_level].nodes; i++) {
        const float *v = c->carried + 3u * i;
        if (palp_dot(palp_vec3_at(v), palp_vec3_at(v)) > 0.0f) add_column(c, PALP_FREE, i, v);
    }
}

/* MR 46: one inverse transform per domain, then nodes take their values. */
static void write_fields(palp_cma *c, float *u_m, float *f_N) {
    const palp_blob *b = c->blob;
    for (uint32_t d = 0; d < PALP_DOMAINS && !palp_cma_is_split(c); d++)
        palp_wavelet_inverse(&b->domain[d], c->detail[d], b->domain[d].levels - 1);
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
