/* SPDX-License-Identifier: MIT */
#include "cma_internal.h"
#include "core/base/linalg.h"

#define REFINEMENTS 2

/* e^T block e' */
static float contract(palp_vec3 e, const float block[9], palp_vec3 f) {
    palp_vec3 t = {palp_dot(palp_vec3_at(block), f), palp_dot(palp_vec3_at(block + 3), f),
                   palp_dot(palp_vec3_at(block + 6), f)};
    return palp_dot(e, t);
}

/* Tractions are stored on U; forces are wanted. */
static float row_factor(const palp_cma *c, uint32_t node) {
    return palp_node_is_fixed(c->blob, node) ? c->blob->area_m2[node] : 1.0f;
}

/* The columns that hold switch `t`, for rows of domain `d`. */
static const palp_columns *columns_of(const palp_cma *c, uint32_t d,
                                      const palp_switched_unknown *t) {
    const palp_blob *b = c->blob;
    bool fixed = palp_node_is_fixed(b, t->node);
    if (fixed || t->level == b->meta->constraint_level || d == PALP_FIXED)
        return &b->columns[d][fixed ? PALP_FIXED : PALP_FREE];
    return &b->level[t->level].columns;
}

/* The row of W^-1, or of R_l W^-1, that yields the value at switch `s`. */
static void make_row(palp_cma *c, const palp_switched_unknown *s) {
    const palp_blob *b = c->blob;
    const uint32_t d = palp_cma_domain(b, s->node), slot = palp_node_slot(b, s->node);
    if (palp_cma_is_coarse(c, s) && c->pairing == PALP_ENERGETIC) {
        (void)palp_basis_row(b, (palp_basis){s->level, slot}, &c->scratch[d], &c->row,
                             b->domain[d].slots);
    } else {
        (void)palp_wavelet_row(&b->domain[d], slot, &c->scratch[d], &c->row, b->domain[d].slots);
    }
}

/* The same of nodal values. */
static void make_weights(palp_cma *c, const palp_switched_unknown *s) {
    const uint32_t slot = palp_node_slot(c->blob, s->node);
    if (palp_cma_is_coarse(c, s) && c->pairing == PALP_ENERGETIC) {
        (void)palp_basis_weights(c->blob, (palp_basis){s->level, slot}, &c->scratch[PALP_FREE],
                                 &c->weights, c->blob->domain[PALP_FREE].slots);
        return;
    }
    c->weights.count = 1u;
    c->weights.index[0] = (uint16_t)slot;
    c->weights.weight[0] = 1.0f;
}

/* What the column of switch `t` shows in domain `d` at the row that was made. Of a split blob
 * reactions to loads are completed by reciprocity. */
static void extract(palp_cma *c, uint32_t d, const palp_switched_unknown *t, float block[9]) {
    const palp_blob *b = c->blob;
    const uint32_t slot = palp_node_slot(b, t->node);
    if (!palp_cma_is_split(c) || palp_node_is_fixed(b, t->node)) {
        palp_columns_extract(columns_of(c, d, t), slot, &c->row, block);
    } else if (d == PALP_FREE) {
        (void)palp_basis_weights(b, (palp_basis){t->level, slot}, &c->scratch[d], &c->others,
                                 b->domain[d].slots);
        palp_split_between(b, &c->weights, &c->others, block);
    }
}

/* Row k of C, and the residual t_k - e_k^T v0 (MR 39, 43). */
static void assemble_row(palp_cma *c, uint32_t k) {
    const palp_blob *b = c->blob;
    const palp_switched_unknown *s = palp_cma_unknown(c, k);
    const palp_row *row = &c->row;
    uint32_t d = palp_cma_domain(b, s->node);
    float factor = row_factor(c, s->node);
    float block[9] = {0};
    uint32_t extracted = PALP_MAX_NODES + 1u;
    make_row(c, s);
    if (palp_cma_is_split(c)) {
        make_weights(c, s);
        row = &c->weights;
    }
    palp_vec3 v0 = {0};
    for (uint32_t r = 0; r < row->count; r++)
        v0 = palp_madd(v0, row->weight[r],
                       palp_vec3_at(c->detail[d] + PALP_FIELD_LANES * row->index[r]));
    c->rhs[k] = s->target - factor * palp_dot(s->direction, v0);
    for (uint32_t l = 0; l < c->solved; l++) {
        const palp_switched_unknown *t = palp_cma_unknown(c, l);
        if (t->node != extracted) {
            extract(c, d, t, block);
            extracted = t->node;
        }
        c->capacitance[(size_t)k * c->solved + l] =
            factor * contract(s->direction, block, t->direction);
    }
}

/* Reactions to hats below the constraint level are not stored, of a split blob none to loads: Betti
 * gives their entries. */
static void complete_by_reciprocity(palp_cma *c) {
    for (uint32_t k = 0; k < c->solved; k++) {
        for (uint32_t l = 0; l < c->solved; l++) {
            const palp_switched_unknown *s = palp_cma_unknown(c, k), *t = palp_cma_unknown(c, l);
            bool missing = palp_node_is_fixed(c->blob, s->node) &&
                           !palp_node_is_fixed(c->blob, t->node) &&
                           (t->level < c->blob->meta->constraint_level || palp_cma_is_split(c));
            if (missing)
                c->capacitance[(size_t)k * c->solved + l] =
                    -c->capacitance[(size_t)l * c->solved + k];
        }
    }
}

/* Betti: same-domain pairs are symmetric, force against displacement pairs are skew. */
static void enforce_reciprocity(palp_cma *c) {
    for (uint32_t k = 0; k < c->solved; k++) {
        for (uint32_t l = 0; l < k; l++) {
            bool same = palp_cma_domain(c->blob, palp_cma_unknown(c, k)->node) ==
                        palp_cma_domain(c->blob, palp_cma_unknown(c, l)->node);
            float sign = same ? 1.0f : -1.0f;
            float *a = &c->capacitance[(size_t)k * c->solved + l];
            float *b = &c->capacitance[(size_t)l * c->solved + k];
            float mean = 0.5f * (*a + sign * *b);
            *a = mean;
            *b = sign * mean;
        }
    }
}

/* The power of two next below 1 / sqrt(x), so that scaling by it is exact. */
static float inverse_root_power(float x) {
    union {
        float f;
        uint32_t u;
    } bits = {.f = 1.0f / palp_sqrt(x)};
    bits.u &= 0x7f800000u;
    return bits.f;
}

static void scale_system(palp_cma *c) {
    for (uint32_t k = 0; k < c->solved; k++) {
        float diagonal = palp_abs(c->capacitance[(size_t)k * c->solved + k]);
        c->scale[k] = diagonal > 0.0f ? inverse_root_power(diagonal) : 1.0f;
    }
    for (uint32_t k = 0; k < c->solved; k++) {
        c->rhs[k] *= c->scale[k];
        for (uint32_t l = 0; l < c->solved; l++) {
            c->capacitance[(size_t)k * c->solved + l] *= c->scale[k] * c->scale[l];
        }
    }
}

static bool all_free(const palp_cma *c) {
    for (uint32_t k = 0; k < c->solved; k++) {
        if (palp_node_is_fixed(c->blob, palp_cma_unknown(c, k)->node)) return false;
    }
    return true;
}

/* Whether C is symmetric up to compression and rounding. */
static bool is_reciprocal(const palp_cma *c) {
    bool coarse = false;
    for (uint32_t k = 0; k < c->solved; k++)
        coarse = coarse || palp_cma_is_coarse(c, palp_cma_unknown(c, k));
    return palp_blob_has(c->blob, PALP_META_SYMMETRIC) && (!coarse || c->pairing == PALP_ENERGETIC);
}

/* g := C^-1 rhs with refinement. */
static palp_status solve_capacitance(palp_cma *c) {
    size_t n = c->solved;
    bool symmetric = is_reciprocal(c);
    bool definite = symmetric && all_free(c);
    if (symmetric) enforce_reciprocity(c);
    scale_system(c);
    for (size_t i = 0; i < n * n; i++) c->factor[i] = c->capacitance[i];
    palp_status status =
        definite ? palp_chol_factor(c->factor, n, n) : palp_lu_factor(c->factor, c->perm, n, n);
    if (status != PALP_OK) return status;
    for (size_t k = 0; k < n; k++) c->solution[k] = 0.0f;
    for (size_t k = 0; k < n; k++) c->residual[k] = c->rhs[k];
    for (int step = 0; step <= REFINEMENTS; step++) {
        if (definite) {
            palp_chol_solve(c->factor, n, n, c->residual);
        } else {
            palp_lu_solve(c->factor, c->perm, n, n, c->residual);
        }
        for (size_t k = 0; k < n; k++) c->solution[k] += c->residual[k];
        palp_residual(c->capacitance, c->solution, c->rhs, c->residual, n, n);
    }
    for (uint32_t k = 0; k < c->solved; k++)
        palp_cma_unknown(c, k)->value = c->solution[k] * c->scale[k];
    return PALP_OK;
}

palp_status palp_cma_solve_unknowns(palp_cma *cma) {
    for (uint32_t k = 0; k < cma->solved; k++) assemble_row(cma, k);
    complete_by_reciprocity(cma);
    return solve_capacitance(cma);
}
