/* SPDX-License-Identifier: MIT */
#include "cma.h"
#include "core/base/linalg.h"

#define REFINEMENTS 2

static uint32_t domain_of(const palp_blob *b, uint32_t node) {
    return palp_node_is_fixed(b, node) ? PALP_FIXED : PALP_FREE;
}

static void lay_out(palp_cma *c, const palp_blob *b, uint32_t n, palp_arena *arena) {
    *c = (palp_cma){.blob = b, .capacity = n};
    c->switches = palp_take(arena, n, sizeof *c->switches);
    c->capacitance = palp_take(arena, (size_t)n * n, sizeof(float));
    c->factor = palp_take(arena, (size_t)n * n, sizeof(float));
    c->scale = palp_take(arena, n, sizeof(float));
    c->rhs = palp_take(arena, n, sizeof(float));
    c->solution = palp_take(arena, n, sizeof(float));
    c->residual = palp_take(arena, n, sizeof(float));
    c->perm = palp_take(arena, n, sizeof(uint32_t));
    c->given = palp_take(arena, 3u * (size_t)b->meta->nodes, sizeof(float));
    c->state = palp_take(arena, b->meta->nodes, 1);
    uint32_t longest = b->domain[PALP_FREE].slots > b->domain[PALP_FIXED].slots
                           ? b->domain[PALP_FREE].slots
                           : b->domain[PALP_FIXED].slots;
    c->carried = palp_take(arena, 3u * (size_t)b->domain[PALP_FREE].slots, sizeof(float));
    c->covered = palp_take(arena, b->domain[PALP_FREE].slots, 1);
    c->row.index = palp_take(arena, longest, sizeof(uint16_t));
    c->row.weight = palp_take(arena, longest, sizeof(float));
    for (uint32_t d = 0; d < PALP_DOMAINS; d++) {
        uint32_t slots = b->domain[d].slots;
        c->detail[d] = palp_take(arena, (size_t)slots * PALP_FIELD_LANES, sizeof(float));
        c->scratch[d].weight = palp_take(arena, slots, sizeof(float));
        c->scratch[d].mark = palp_take(arena, (slots + 31u) / 32u, sizeof(uint32_t));
    }
}

size_t palp_cma_memsize(const palp_blob *blob, uint32_t max_unknowns) {
    palp_cma c;
    palp_arena arena = {0};
    lay_out(&c, blob, max_unknowns, &arena);
    return arena.used;
}

palp_status palp_cma_init(palp_cma *cma, const palp_blob *blob, uint32_t max_unknowns, void *memory,
                          size_t bytes) {
    palp_arena arena = {.base = memory};
    if (max_unknowns > 3u * blob->meta->nodes) return PALP_ERR_LIMITS;
    if (memory == NULL || ((uintptr_t)memory & (PALP_ALIGN - 1u)) != 0u) return PALP_ERR_ALIGNMENT;
    if (bytes < palp_cma_memsize(blob, max_unknowns)) return PALP_ERR_MEMORY;
    lay_out(cma, blob, max_unknowns, &arena);
    for (uint32_t d = 0; d < PALP_DOMAINS; d++) {
        uint32_t slots = blob->domain[d].slots;
        for (uint32_t i = 0; i < slots; i++) cma->scratch[d].weight[i] = 0.0f;
        for (uint32_t i = 0; i < (slots + 31u) / 32u; i++) cma->scratch[d].mark[i] = 0u;
    }
    palp_cma_clear(cma);
    return PALP_OK;
}

void palp_cma_clear(palp_cma *cma) {
    cma->count = 0;
    cma->level = cma->blob->meta->constraint_level;
    cma->pairing = PALP_ENERGETIC;
    cma->gravity_m_s2 = (palp_vec3){0};
    for (uint32_t i = 0; i < 3u * cma->blob->meta->nodes; i++) cma->given[i] = 0.0f;
    for (uint32_t i = 0; i < cma->blob->meta->nodes; i++) cma->state[i] = 0;
}

static void push(palp_cma *c, uint32_t node, palp_vec3 direction, float target) {
    c->switches[c->count++] = (palp_switch){.node = node, .direction = direction, .target = target};
}

static void push_all(palp_cma *c, uint32_t node, palp_vec3 target) {
    push(c, node, (palp_vec3){1.0f, 0.0f, 0.0f}, target.x);
    if (palp_blob_has(c->blob, PALP_META_SCALAR)) return;
    push(c, node, (palp_vec3){0.0f, 1.0f, 0.0f}, target.y);
    push(c, node, (palp_vec3){0.0f, 0.0f, 1.0f}, target.z);
}

/* Two unit vectors that complete n to an orthonormal frame. */
static void tangents(palp_vec3 n, palp_vec3 *a, palp_vec3 *b) {
    palp_vec3 axis =
        palp_abs(n.x) < 0.6f ? (palp_vec3){1.0f, 0.0f, 0.0f} : (palp_vec3){0.0f, 1.0f, 0.0f};
    palp_vec3 t = palp_cross(n, axis);
    *a = palp_scale(1.0f / palp_norm(t), t);
    *b = palp_cross(n, *a);
}

static void set_given(palp_cma *c, uint32_t node, palp_vec3 v) {
    float *g = c->given + 3u * node;
    g[0] = v.x;
    g[1] = v.y;
    g[2] = v.z;
}

static void give_free(palp_cma *c, uint32_t node, palp_condition condition, palp_vec3 value) {
    palp_vec3 n = palp_vec3_at(c->blob->normal + 3u * node);
    switch (condition) {
    case PALP_GIVE_DISPLACEMENT:
        push_all(c, node, value);
        break;
    case PALP_GIVE_NORMAL:
        push(c, node, n, value.x);
        break;
    case PALP_GIVE_TRACTION:
        set_given(c, node, palp_scale(c->blob->area_m2[node], value));
        break;
    case PALP_GIVE_FORCE:
    case PALP_RELEASE:
        set_given(c, node, value);
        break;
    }
}

static void give_fixed(palp_cma *c, uint32_t node, palp_condition condition, palp_vec3 value) {
    palp_vec3 n = palp_vec3_at(c->blob->normal + 3u * node);
    palp_vec3 a, b;
    switch (condition) {
    case PALP_GIVE_DISPLACEMENT:
        set_given(c, node, value);
        break;
    case PALP_GIVE_NORMAL:
        tangents(n, &a, &b);
        set_given(c, node, palp_scale(value.x, n));
        push(c, node, a, 0.0f);
        push(c, node, b, 0.0f);
        break;
    case PALP_GIVE_TRACTION:
        push_all(c, node, palp_scale(c->blob->area_m2[node], value));
        break;
    case PALP_GIVE_FORCE:
        push_all(c, node, value);
        break;
    case PALP_RELEASE:
        push_all(c, node, (palp_vec3){0});
        break;
    }
}

static uint32_t unknowns_of(bool fixed, palp_condition condition) {
    if (condition == PALP_GIVE_DISPLACEMENT) return fixed ? 0u : 3u;
    if (condition == PALP_GIVE_NORMAL) return fixed ? 2u : 1u;
    return fixed ? 3u : 0u;
}

palp_status palp_cma_give(palp_cma *cma, uint32_t node, palp_condition condition, palp_vec3 value) {
    if (node >= cma->blob->meta->nodes || cma->state[node] != 0u) return PALP_ERR_ARGUMENT;
    bool fixed = palp_node_is_fixed(cma->blob, node);
    if (!fixed && condition == PALP_RELEASE) return PALP_ERR_ARGUMENT;
    bool scalar = palp_blob_has(cma->blob, PALP_META_SCALAR);
    if (scalar && (condition == PALP_GIVE_NORMAL || value.y * value.y + value.z * value.z > 0.0f))
        return PALP_ERR_ARGUMENT;
    if (!palp_vec3_is_finite(value)) return PALP_ERR_NOT_FINITE;
    if (fixed && !palp_blob_has(cma->blob, PALP_META_FIXED_COLUMNS)) return PALP_ERR_ABSENT;
    if (cma->capacity - cma->count < unknowns_of(fixed, condition)) return PALP_ERR_CAPACITY;
    cma->state[node] = (uint8_t)(1u + (uint32_t)condition);
    if (fixed) {
        give_fixed(cma, node, condition, value);
    } else {
        give_free(cma, node, condition, value);
    }
    return PALP_OK;
}

palp_status palp_cma_level(palp_cma *cma, uint32_t level, palp_pairing pairing) {
    if (level > cma->blob->meta->constraint_level) return PALP_ERR_ARGUMENT;
    cma->level = level;
    cma->pairing = pairing;
    return PALP_OK;
}

palp_status palp_cma_gravity(palp_cma *cma, palp_vec3 acceleration_m_s2) {
    if (!palp_blob_has(cma->blob, PALP_META_GRAVITY)) return PALP_ERR_ABSENT;
    if (!palp_vec3_is_finite(acceleration_m_s2)) return PALP_ERR_NOT_FINITE;
    cma->gravity_m_s2 = acceleration_m_s2;
    return PALP_OK;
}

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

/* ---- levels ---- */

/* A force on slot m of a level above the stored ones is taken by its parents: P^T f. */
static void restrict_forces(palp_cma *c) {
    const palp_domain *d = &c->blob->domain[PALP_FREE];
    for (uint32_t i = 0; i < d->slots; i++) {
        for (uint32_t k = 0; k < 3; k++) c->carried[3u * i + k] = c->given[3u * d->node[i] + k];
    }
    for (uint32_t m = d->slots; m-- > c->blob->level[c->blob->meta->constraint_level].nodes;) {
        for (uint32_t side = 0; side < 2; side++) {
            float w = d->predict[2u * m + side];
            float *parent = c->carried + 3u * d->parent[2u * m + side];
            if (!(w > 0.0f)) continue;
            for (uint32_t k = 0; k < 3; k++) parent[k] += w * c->carried[3u * m + k];
        }
        for (uint32_t k = 0; k < 3; k++) c->carried[3u * m + k] = 0.0f;
    }
}

/* Forces on the basis functions of `level` become forces on those of level + 1. */
static void spread_forces(const palp_blob *b, uint32_t level, float *force) {
    const palp_domain *d = &b->domain[PALP_FREE];
    const float *coarse = b->level[level].area_m2, *fine = b->level[level + 1u].area_m2;
    for (uint32_t m = b->level[level].nodes; m < b->level[level + 1u].nodes; m++) {
        for (uint32_t side = 0; side < 2; side++) {
            float w = d->predict[2u * m + side];
            uint32_t p = d->parent[2u * m + side];
            if (!(w > 0.0f)) continue;
            float share = w * fine[m] / coarse[p];
            for (uint32_t k = 0; k < 3; k++) force[3u * m + k] += share * force[3u * p + k];
        }
    }
    for (uint32_t i = 0; i < b->level[level].nodes; i++) {
        float share = fine[i] / coarse[i];
        for (uint32_t k = 0; k < 3; k++) force[3u * i + k] *= share;
    }
}

/* Adds the solved forces, level by level, to what is carried on the constraint level. */
static void carry_solution(palp_cma *c) {
    const palp_blob *b = c->blob;
    for (uint32_t i = 0; i < 3u * b->domain[PALP_FREE].slots; i++) c->carried[i] = 0.0f;
    for (uint32_t l = 0; l <= b->meta->constraint_level; l++) {
        for (uint32_t k = 0; k < c->count; k++) {
            const palp_switch *s = &c->switches[k];
            if (palp_node_is_fixed(b, s->node) || s->level != l) continue;
            float *f = c->carried + 3u * palp_node_slot(b, s->node);
            f[0] += s->value * s->direction.x;
            f[1] += s->value * s->direction.y;
            f[2] += s->value * s->direction.z;
        }
        if (l < b->meta->constraint_level) spread_forces(b, l, c->carried);
    }
    for (uint32_t i = 0; i < b->domain[PALP_FREE].slots; i++) {
        for (uint32_t k = 0; k < 3; k++)
            c->given[3u * b->domain[PALP_FREE].node[i] + k] += c->carried[3u * i + k];
    }
    for (uint32_t k = 0; k < c->count; k++) {
        const palp_switch *s = &c->switches[k];
        if (!palp_node_is_fixed(b, s->node)) continue;
        float *u = c->given + 3u * s->node;
        u[0] += s->value * s->direction.x;
        u[1] += s->value * s->direction.y;
        u[2] += s->value * s->direction.z;
    }
}

/* Which basis function stands for each displaced free node (MR 68). */
static palp_status choose_levels(palp_cma *c) {
    const palp_blob *b = c->blob;
    const palp_domain *d = &b->domain[PALP_FREE];
    uint32_t hats = b->level[c->level].nodes, stored = b->level[b->meta->constraint_level].nodes;
    for (uint32_t i = 0; i < d->slots; i++) c->covered[i] = 0;
    for (uint32_t k = 0; k < c->count; k++) {
        const palp_switch *s = &c->switches[k];
        uint32_t slot = palp_node_slot(b, s->node);
        if (!palp_node_is_fixed(b, s->node) && slot < hats) c->covered[slot] = 1;
    }
    for (uint32_t m = hats; m < d->slots; m++) {
        for (uint32_t side = 0; side < 2; side++) {
            bool under = d->predict[2u * m + side] > 0.0f && c->covered[d->parent[2u * m + side]];
            if (under) c->covered[m] = 1;
        }
    }
    uint32_t kept = 0;
    for (uint32_t k = 0; k < c->count; k++) {
        palp_switch s = c->switches[k];
        uint32_t slot = palp_node_slot(b, s.node);
        s.level = slot < hats ? c->level : b->meta->constraint_level;
        bool fixed = palp_node_is_fixed(b, s.node);
        if (fixed && c->pairing == PALP_COLLOCATED && c->level + 1u < b->meta->levels)
            return PALP_ERR_ABSENT; /* reactions to hats come by reciprocity, which it lacks */
        if (!fixed && slot >= hats) {
            if (c->covered[slot] != 0u) continue;
            if (slot >= stored) return PALP_ERR_ABSENT;
        }
        c->switches[kept++] = s;
    }
    c->count = kept;
    return PALP_OK;
}

static bool is_coarse(const palp_cma *c, const palp_switch *s) {
    return !palp_node_is_fixed(c->blob, s->node) && s->level + 1u < c->blob->meta->levels;
}

/* ---- capacitance ---- */

/* g~_1 of MR 42 and 45: the RBVP's answer to what is given so far, as details. */
static void sum_columns(palp_cma *c) {
    const palp_blob *b = c->blob;
    for (uint32_t d = 0; d < PALP_DOMAINS; d++) {
        for (uint32_t i = 0; i < b->domain[d].slots * PALP_FIELD_LANES; i++) c->detail[d][i] = 0.0f;
    }
    restrict_forces(c);
    uint32_t stored = b->level[b->meta->constraint_level].nodes;
    for (uint32_t i = 0; i < b->meta->nodes; i++) {
        bool fixed = palp_node_is_fixed(b, i);
        uint32_t slot = palp_node_slot(b, i);
        if (!fixed && slot >= stored) continue;
        const float *v = fixed ? c->given + 3u * i : c->carried + 3u * slot;
        if (!(palp_dot(palp_vec3_at(v), palp_vec3_at(v)) > 0.0f)) continue;
        add_column(c, domain_of(b, i), slot, v);
    }
    const float g[3] = {c->gravity_m_s2.x, c->gravity_m_s2.y, c->gravity_m_s2.z};
    if (palp_blob_has(b, PALP_META_GRAVITY)) add_column(c, PALP_FREE, stored, g);
}

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
static const palp_columns *columns_of(const palp_cma *c, uint32_t d, const palp_switch *t) {
    const palp_blob *b = c->blob;
    bool fixed = palp_node_is_fixed(b, t->node);
    if (fixed || t->level == b->meta->constraint_level || d == PALP_FIXED)
        return &b->columns[d][fixed ? PALP_FIXED : PALP_FREE];
    return &b->level[t->level].columns;
}

/* Row k of C, and the residual t_k - e_k^T v0 (MR 39, 43). */
static void assemble_row(palp_cma *c, uint32_t k) {
    const palp_blob *b = c->blob;
    const palp_switch *s = &c->switches[k];
    uint32_t d = domain_of(b, s->node);
    float factor = row_factor(c, s->node);
    float block[9];
    uint32_t extracted = PALP_MAX_NODES + 1u, slot = palp_node_slot(b, s->node);
    if (is_coarse(c, s) && c->pairing == PALP_ENERGETIC) {
        (void)palp_basis_row(b, (palp_basis){s->level, slot}, &c->scratch[d], &c->row,
                             b->domain[d].slots);
    } else {
        (void)palp_wavelet_row(&b->domain[d], slot, &c->scratch[d], &c->row, b->domain[d].slots);
    }
    palp_vec3 v0 = {0};
    for (uint32_t r = 0; r < c->row.count; r++) {
        v0 = palp_madd(v0, c->row.weight[r],
                       palp_vec3_at(c->detail[d] + PALP_FIELD_LANES * c->row.index[r]));
    }
    c->rhs[k] = s->target - factor * palp_dot(s->direction, v0);
    for (uint32_t l = 0; l < c->count; l++) {
        const palp_switch *t = &c->switches[l];
        if (t->node != extracted) {
            palp_columns_extract(columns_of(c, d, t), palp_node_slot(b, t->node), &c->row, block);
            extracted = t->node;
        }
        c->capacitance[(size_t)k * c->count + l] =
            factor * contract(s->direction, block, t->direction);
    }
}

/* Reactions to hats below the constraint level are not stored: Betti gives their entries. */
static void complete_by_reciprocity(palp_cma *c) {
    for (uint32_t k = 0; k < c->count; k++) {
        for (uint32_t l = 0; l < c->count; l++) {
            const palp_switch *s = &c->switches[k], *t = &c->switches[l];
            bool missing = palp_node_is_fixed(c->blob, s->node) &&
                           !palp_node_is_fixed(c->blob, t->node) &&
                           t->level < c->blob->meta->constraint_level;
            if (missing)
                c->capacitance[(size_t)k * c->count + l] =
                    -c->capacitance[(size_t)l * c->count + k];
        }
    }
}

/* Betti: same-domain pairs are symmetric, force against displacement pairs are skew. */
static void enforce_reciprocity(palp_cma *c) {
    for (uint32_t k = 0; k < c->count; k++) {
        for (uint32_t l = 0; l < k; l++) {
            bool same =
                domain_of(c->blob, c->switches[k].node) == domain_of(c->blob, c->switches[l].node);
            float sign = same ? 1.0f : -1.0f;
            float *a = &c->capacitance[(size_t)k * c->count + l];
            float *b = &c->capacitance[(size_t)l * c->count + k];
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
    for (uint32_t k = 0; k < c->count; k++) {
        float diagonal = palp_abs(c->capacitance[(size_t)k * c->count + k]);
        c->scale[k] = diagonal > 0.0f ? inverse_root_power(diagonal) : 1.0f;
    }
    for (uint32_t k = 0; k < c->count; k++) {
        c->rhs[k] *= c->scale[k];
        for (uint32_t l = 0; l < c->count; l++) {
            c->capacitance[(size_t)k * c->count + l] *= c->scale[k] * c->scale[l];
        }
    }
}

static bool all_free(const palp_cma *c) {
    for (uint32_t k = 0; k < c->count; k++) {
        if (palp_node_is_fixed(c->blob, c->switches[k].node)) return false;
    }
    return true;
}

/* Whether C is symmetric up to compression and rounding. */
static bool is_reciprocal(const palp_cma *c) {
    bool coarse = false;
    for (uint32_t k = 0; k < c->count; k++) coarse = coarse || is_coarse(c, &c->switches[k]);
    return palp_blob_has(c->blob, PALP_META_SYMMETRIC) && (!coarse || c->pairing == PALP_ENERGETIC);
}

/* g := C^-1 rhs with refinement. */
static palp_status solve_capacitance(palp_cma *c) {
    size_t n = c->count;
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
    for (size_t k = 0; k < n; k++) c->switches[k].value = c->solution[k] * c->scale[k];
    return PALP_OK;
}

/* Nodal forces of the free domain, from those of the constraint level. */
static void nodal_forces(palp_cma *c) {
    const palp_blob *b = c->blob;
    const palp_domain *d = &b->domain[PALP_FREE];
    if (b->meta->constraint_level + 1u == d->levels) return;
    for (uint32_t l = b->meta->constraint_level; l + 1u < d->levels; l++)
        spread_forces(b, l, c->carried);
    for (uint32_t i = 0; i < 3u * d->slots; i++)
        c->given[3u * d->node[i / 3u] + i % 3u] = c->carried[i];
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
    for (uint32_t k = 0; k < c->count; k++) {
        const palp_switch *s = &c->switches[k];
        bool fixed = palp_node_is_fixed(c->blob, s->node);
        if (is_coarse(c, s) && c->pairing == PALP_ENERGETIC) continue;
        float *result = (fixed ? f_N : u_m) + 3u * s->node;
        float off = s->target - palp_dot(s->direction, palp_vec3_at(result));
        result[0] += off * s->direction.x;
        result[1] += off * s->direction.y;
        result[2] += off * s->direction.z;
    }
}

/* Whether node i has a prescribed displacement: fixed and left so, or given one. */
static bool node_is_held(const palp_cma *c, uint32_t i) {
    if (c->state[i] == 0u) return palp_node_is_fixed(c->blob, i);
    return c->state[i] == 1u + (uint32_t)PALP_GIVE_DISPLACEMENT;
}

/*
 * Rounding and thresholding hide that a body is loose, so this is looked at: with a fixed node
 * released and no normal constraint about, the held nodes must not lie on one line.
 */
static bool is_held(const palp_cma *c) {
    const palp_meta *m = c->blob->meta;
    bool released = false;
    for (uint32_t i = 0; i < m->nodes; i++) {
        if (c->state[i] == 1u + (uint32_t)PALP_GIVE_NORMAL) return true;
        released = released || (palp_node_is_fixed(c->blob, i) && !node_is_held(c, i));
    }
    if (!released) return true;
    palp_vec3 size = palp_sub(palp_vec3_at(m->box_max_m), palp_vec3_at(m->box_min_m));
    palp_vec3 first = {0}, span = {0};
    bool any = false;
    float off = 0.0f;
    for (uint32_t pass = 0; pass < 2u; pass++) {
        for (uint32_t i = 0; i < m->nodes; i++) {
            if (!node_is_held(c, i)) continue;
            palp_vec3 x = palp_vec3_at(c->blob->rest_m + 3u * i);
            if (!any) first = x;
            any = true;
            palp_vec3 d = palp_sub(x, first);
            if (pass == 0u && palp_dot(d, d) > palp_dot(span, span)) span = d;
            if (pass == 1u) off = palp_max(off, palp_norm(palp_cross(span, d)));
        }
    }
    return off > 1e-5f * palp_norm(span) * palp_norm(size);
}

palp_status palp_cma_solve(palp_cma *cma, float *u_m, float *f_N) {
    sum_columns(cma);
    palp_status status = is_held(cma) ? choose_levels(cma) : PALP_ERR_SINGULAR;
    for (uint32_t k = 0; k < cma->count && status == PALP_OK; k++) assemble_row(cma, k);
    if (status == PALP_OK) complete_by_reciprocity(cma);
    if (status == PALP_OK) status = solve_capacitance(cma);
    if (status != PALP_OK) return status;
    carry_solution(cma);
    sum_columns(cma);
    nodal_forces(cma);
    write_fields(cma, u_m, f_N);
    set_exact(cma, u_m, f_N);
    return PALP_OK;
}
