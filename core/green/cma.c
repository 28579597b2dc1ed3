/* SPDX-License-Identifier: MIT */
#include "cma_internal.h"
#include "core/base/frame.h"

static void lay_out(palp_cma *c, const palp_blob *b, uint32_t n, palp_arena *arena) {
    *c = (palp_cma){.blob = b, .capacity = n};
    c->switches = palp_take(arena, n, sizeof *c->switches);
    c->chosen = palp_take(arena, n, sizeof *c->chosen);
    c->capacitance = palp_take_rows(arena, n, n, sizeof(float));
    c->factor = palp_take_rows(arena, n, n, sizeof(float));
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
    if (palp_blob_has(b, PALP_META_SPLIT)) {
        const uint32_t slots = b->domain[PALP_FREE].slots;
        c->turned = palp_take(arena, (size_t)slots * PALP_FIELD_LANES, sizeof(float));
        c->weights.index = palp_take(arena, slots, sizeof(uint16_t));
        c->weights.weight = palp_take(arena, slots, sizeof(float));
        c->others.index = palp_take(arena, slots, sizeof(uint16_t));
        c->others.weight = palp_take(arena, slots, sizeof(float));
    }
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
    const palp_status status =
        palp_check_block(memory, bytes, palp_cma_memsize(blob, max_unknowns));
    if (status != PALP_OK) return status;
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
    cma->count = cma->solved = 0;
    cma->level = cma->blob->meta->constraint_level;
    cma->pairing = PALP_ENERGETIC;
    cma->gravity_m_s2 = (palp_vec3){0};
    for (uint32_t i = 0; i < 3u * cma->blob->meta->nodes; i++) cma->given[i] = 0.0f;
    for (uint32_t i = 0; i < cma->blob->meta->nodes; i++) cma->state[i] = 0;
}

static void push(palp_cma *c, uint32_t node, palp_vec3 direction, float target) {
    c->switches[c->count++] =
        (palp_switched_unknown){.node = node, .direction = direction, .target = target};
}

static void push_all(palp_cma *c, uint32_t node, palp_vec3 target) {
    push(c, node, (palp_vec3){1.0f, 0.0f, 0.0f}, target.x);
    if (palp_blob_has(c->blob, PALP_META_SCALAR)) return;
    push(c, node, (palp_vec3){0.0f, 1.0f, 0.0f}, target.y);
    push(c, node, (palp_vec3){0.0f, 0.0f, 1.0f}, target.z);
}

static void set_prescribed(palp_cma *c, uint32_t node, palp_vec3 v) {
    float *g = c->given + 3u * node;
    g[0] = v.x;
    g[1] = v.y;
    g[2] = v.z;
}

static void prescribe_free(palp_cma *c, uint32_t node, palp_condition condition, palp_vec3 value) {
    palp_vec3 n = palp_vec3_at(c->blob->normal + 3u * node);
    switch (condition) {
    case PALP_PRESCRIBE_DISPLACEMENT:
        push_all(c, node, value);
        break;
    case PALP_PRESCRIBE_NORMAL:
        push(c, node, n, value.x);
        break;
    case PALP_PRESCRIBE_TRACTION:
        set_prescribed(c, node, palp_scale(c->blob->area_m2[node], value));
        break;
    case PALP_PRESCRIBE_FORCE:
    case PALP_RELEASE:
        set_prescribed(c, node, value);
        break;
    }
}

static void prescribe_fixed(palp_cma *c, uint32_t node, palp_condition condition, palp_vec3 value) {
    palp_vec3 n = palp_vec3_at(c->blob->normal + 3u * node);
    palp_vec3 t[2];
    switch (condition) {
    case PALP_PRESCRIBE_DISPLACEMENT:
        set_prescribed(c, node, value);
        break;
    case PALP_PRESCRIBE_NORMAL:
        palp_tangents(n, t);
        set_prescribed(c, node, palp_scale(value.x, n));
        push(c, node, t[0], 0.0f);
        push(c, node, t[1], 0.0f);
        break;
    case PALP_PRESCRIBE_TRACTION:
        push_all(c, node, palp_scale(c->blob->area_m2[node], value));
        break;
    case PALP_PRESCRIBE_FORCE:
        push_all(c, node, value);
        break;
    case PALP_RELEASE:
        push_all(c, node, (palp_vec3){0});
        break;
    }
}

static uint32_t unknowns_of(bool fixed, palp_condition condition) {
    if (condition == PALP_PRESCRIBE_DISPLACEMENT) return fixed ? 0u : 3u;
    if (condition == PALP_PRESCRIBE_NORMAL) return fixed ? 2u : 1u;
    return fixed ? 3u : 0u;
}

palp_status palp_cma_prescribe(palp_cma *cma, uint32_t node, palp_condition condition,
                               palp_vec3 value) {
    if (node >= cma->blob->meta->nodes || cma->state[node] != 0u) return PALP_ERR_ARGUMENT;
    bool fixed = palp_node_is_fixed(cma->blob, node);
    if (!fixed && condition == PALP_RELEASE) return PALP_ERR_ARGUMENT;
    bool scalar = palp_blob_has(cma->blob, PALP_META_SCALAR);
    if (scalar &&
        (condition == PALP_PRESCRIBE_NORMAL || value.y * value.y + value.z * value.z > 0.0f))
        return PALP_ERR_ARGUMENT;
    if (!palp_vec3_is_finite(value)) return PALP_ERR_NOT_FINITE;
    if (fixed && !palp_blob_has(cma->blob, PALP_META_FIXED_COLUMNS)) return PALP_ERR_ABSENT;
    if (cma->capacity - cma->count < unknowns_of(fixed, condition)) return PALP_ERR_CAPACITY;
    cma->state[node] = (uint8_t)(1u + (uint32_t)condition);
    if (fixed) {
        prescribe_fixed(cma, node, condition, value);
    } else {
        prescribe_free(cma, node, condition, value);
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

palp_status palp_cma_solve(palp_cma *cma, float *u_m, float *f_N) {
    if (!palp_cma_is_held(cma)) return PALP_ERR_SINGULAR;
    palp_status status = palp_cma_choose(cma);
    if (status != PALP_OK) return status;
    palp_cma_sum_columns(cma);
    status = palp_cma_solve_unknowns(cma);
    if (status != PALP_OK) return status;
    palp_cma_carry(cma);
    palp_cma_sum_columns(cma);
    palp_cma_nodal_forces(cma);
    palp_cma_write(cma, u_m, f_N);
    return PALP_OK;
}
