/* SPDX-License-Identifier: MIT */
#include "field.h"

static void lay_out(palp_field *f, const palp_blob *b, palp_arena *arena) {
    uint32_t n = b->domain[PALP_FREE].slots;
    *f = (palp_field){.blob = b};
    f->detail = palp_take(arena, (size_t)n * PALP_FIELD_LANES, sizeof(float));
    f->field = palp_take(arena, (size_t)n * PALP_FIELD_LANES, sizeof(float));
    f->applied_N = palp_take(arena, 3u * (size_t)n, sizeof(float));
    f->wanted = palp_take(arena, n, 1);
    f->loaded = palp_take(arena, n, sizeof(uint32_t));
}

size_t palp_field_memsize(const palp_blob *blob) {
    palp_field f;
    palp_arena arena = {0};
    lay_out(&f, blob, &arena);
    return arena.used;
}

static void sum_from_scratch(palp_field *f) {
    const palp_columns *c = &f->blob->columns[PALP_FREE][PALP_FREE];
    uint32_t n = f->blob->domain[PALP_FREE].slots;
    for (uint32_t i = 0; i < n * PALP_FIELD_LANES; i++) f->detail[i] = 0.0f;
    if (palp_blob_has(f->blob, PALP_META_GRAVITY)) {
        const float g[3] = {f->gravity_m_s2.x, f->gravity_m_s2.y, f->gravity_m_s2.z};
        palp_columns_add(c, c->columns - 1u, g, f->detail);
    }
    for (uint32_t i = 0; i < f->loaded_count; i++) {
        palp_columns_add(c, f->loaded[i], f->applied_N + 3u * f->loaded[i], f->detail);
    }
    f->updates = 0;
}

palp_status palp_field_init(palp_field *field, const palp_blob *blob, void *memory, size_t bytes) {
    palp_arena arena = {.base = memory};
    if (memory == NULL || ((uintptr_t)memory & (PALP_ALIGN - 1u)) != 0u) return PALP_ERR_ALIGNMENT;
    if (bytes < palp_field_memsize(blob)) return PALP_ERR_MEMORY;
    lay_out(field, blob, &arena);
    uint32_t n = blob->domain[PALP_FREE].slots;
    for (uint32_t i = 0; i < 3u * n; i++) field->applied_N[i] = 0.0f;
    for (uint32_t i = 0; i < n; i++) field->wanted[i] = 0;
    sum_from_scratch(field);
    return PALP_OK;
}

palp_status palp_field_gravity(palp_field *field, palp_vec3 acceleration_m_s2) {
    if (!palp_blob_has(field->blob, PALP_META_GRAVITY)) return PALP_ERR_ABSENT;
    if (!palp_vec3_is_finite(acceleration_m_s2)) return PALP_ERR_NOT_FINITE;
    field->gravity_m_s2 = acceleration_m_s2;
    sum_from_scratch(field);
    return PALP_OK;
}

/* Moves the force applied at `slot` to `force`, summing only the difference. */
static void change(palp_field *f, uint32_t slot, palp_vec3 force) {
    float *applied = f->applied_N + 3u * slot;
    const float delta[3] = {force.x - applied[0], force.y - applied[1], force.z - applied[2]};
    if (!(palp_dot(palp_vec3_at(delta), palp_vec3_at(delta)) > 0.0f)) return;
    palp_columns_add(&f->blob->columns[PALP_FREE][PALP_FREE], slot, delta, f->detail);
    applied[0] = force.x;
    applied[1] = force.y;
    applied[2] = force.z;
}

void palp_field_update(palp_field *field, const palp_load *loads, uint32_t count) {
    const palp_blob *b = field->blob;
    uint32_t nodes = b->meta->nodes;
    for (uint32_t i = 0; i < count; i++) {
        bool usable = loads[i].node < nodes && !palp_node_is_fixed(b, loads[i].node);
        if (usable) field->wanted[palp_node_slot(b, loads[i].node)] = 1;
    }
    uint32_t kept = 0;
    for (uint32_t i = 0; i < field->loaded_count; i++) {
        uint32_t slot = field->loaded[i];
        if (field->wanted[slot] != 0u) {
            field->wanted[slot] = 2;
            field->loaded[kept++] = slot;
        } else {
            change(field, slot, (palp_vec3){0});
        }
    }
    field->loaded_count = kept;
    for (uint32_t i = 0; i < count; i++) {
        if (loads[i].node >= nodes || palp_node_is_fixed(b, loads[i].node)) continue;
        uint32_t slot = palp_node_slot(b, loads[i].node);
        if (field->wanted[slot] == 1u) field->loaded[field->loaded_count++] = slot;
        change(field, slot, loads[i].force_N);
        field->wanted[slot] = 0;
    }
    if (++field->updates >= PALP_FIELD_REFRESH) sum_from_scratch(field);
}

const float *palp_field_reconstruct(palp_field *field, uint32_t level) {
    const palp_domain *d = &field->blob->domain[PALP_FREE];
    uint32_t top = level < d->levels ? level : d->levels - 1u;
    uint32_t used = d->level_start[top + 1] * PALP_FIELD_LANES;
    for (uint32_t i = 0; i < used; i++) field->field[i] = field->detail[i];
    palp_wavelet_inverse(d, field->field, top);
    return field->field;
}

void palp_field_pin(palp_field *field, uint32_t node, palp_vec3 direction, float displacement_m) {
    if (node >= field->blob->meta->nodes || palp_node_is_fixed(field->blob, node)) return;
    float *u = field->field + PALP_FIELD_LANES * palp_node_slot(field->blob, node);
    float off = displacement_m - palp_dot(direction, palp_vec3_at(u));
    u[0] += off * direction.x;
    u[1] += off * direction.y;
    u[2] += off * direction.z;
}
