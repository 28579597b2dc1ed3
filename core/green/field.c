/* SPDX-License-Identifier: MIT */
#include "field.h"

static void lay_out(palp_field *f, const palp_blob *b, palp_arena *arena) {
    uint32_t n = b->domain[PALP_FREE].slots;
    *f = (palp_field){.blob = b};
    for (uint32_t l = 0; l <= b->meta->constraint_level; l++)
        f->first[l + 1u] =
            f->first[l] + (b->level[l].columns.columns > 0u ? b->level[l].nodes : 0u);
    uint32_t all = f->first[b->meta->constraint_level + 1u];
    f->detail = palp_take(arena, (size_t)n * PALP_FIELD_LANES, sizeof(float));
    f->field = palp_take(arena, (size_t)n * PALP_FIELD_LANES, sizeof(float));
    f->applied_N = palp_take(arena, 3u * (size_t)all, sizeof(float));
    f->wanted = palp_take(arena, all, 1);
    f->loaded = palp_take(arena, all, sizeof(uint32_t));
}

static uint32_t count_of(const palp_field *f) {
    return f->first[f->blob->meta->constraint_level + 1u];
}

/* details += the column of basis function number `which` times the force */
static void add_column(palp_field *f, uint32_t which, const float force[3]) {
    uint32_t level = 0;
    /* at most PALP_MAX_LEVELS */
    while (which >= f->first[level + 1u]) level++;
    if (palp_blob_has(f->blob, PALP_META_SPLIT)) {
        palp_split_add(f->blob, which - f->first[level], force, f->load, f->detail);
        return;
    }
    palp_columns_add(&f->blob->level[level].columns, which - f->first[level], force, f->detail);
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
    for (uint32_t a = 0; a < PALP_MAX_MODES; a++) f->load[a] = 0.0f;
    if (palp_blob_has(f->blob, PALP_META_GRAVITY)) {
        const float g[3] = {f->gravity_m_s2.x, f->gravity_m_s2.y, f->gravity_m_s2.z};
        palp_columns_add(c, c->columns - 1u, g, f->detail);
    }
    for (uint32_t i = 0; i < f->loaded_count; i++) {
        add_column(f, f->loaded[i], f->applied_N + 3u * f->loaded[i]);
    }
    f->updates = 0;
}

palp_status palp_field_init(palp_field *field, const palp_blob *blob, void *memory, size_t bytes) {
    palp_arena arena = {.base = memory};
    const palp_status status = palp_check_block(memory, bytes, palp_field_memsize(blob));
    if (status != PALP_OK) return status;
    lay_out(field, blob, &arena);
    uint32_t n = count_of(field);
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

/* Moves the force applied at basis function `which` to `force`, summing only the difference. */
static void change(palp_field *f, uint32_t which, palp_vec3 force) {
    float *applied = f->applied_N + 3u * which;
    const float delta[3] = {force.x - applied[0], force.y - applied[1], force.z - applied[2]};
    if (!(palp_dot(palp_vec3_at(delta), palp_vec3_at(delta)) > 0.0f)) return;
    add_column(f, which, delta);
    applied[0] = force.x;
    applied[1] = force.y;
    applied[2] = force.z;
}

/* Number of a basis function among all; their count if the blob does not hold it. */
static uint32_t number_of(const palp_field *f, palp_basis b) {
    bool held = b.level <= f->blob->meta->constraint_level &&
                b.slot < f->first[b.level + 1u] - f->first[b.level];
    return held ? f->first[b.level] + b.slot : count_of(f);
}

void palp_field_update(palp_field *field, const palp_load *loads, uint32_t count) {
    uint32_t all = count_of(field);
    for (uint32_t i = 0; i < count; i++) {
        uint32_t which = number_of(field, loads[i].at);
        if (which < all) field->wanted[which] = 1;
    }
    uint32_t kept = 0;
    for (uint32_t i = 0; i < field->loaded_count; i++) {
        uint32_t which = field->loaded[i];
        if (field->wanted[which] != 0u) {
            field->wanted[which] = 2;
            field->loaded[kept++] = which;
        } else {
            change(field, which, (palp_vec3){0});
        }
    }
    field->loaded_count = kept;
    for (uint32_t i = 0; i < count; i++) {
        uint32_t which = number_of(field, loads[i].at);
        if (which >= all) continue;
        if (field->wanted[which] == 1u) field->loaded[field->loaded_count++] = which;
        change(field, which, loads[i].force_N);
        field->wanted[which] = 0;
    }
    if (++field->updates >= PALP_FIELD_REFRESH) sum_from_scratch(field);
}

const float *palp_field_reconstruct(palp_field *field, uint32_t level) {
    const palp_domain *d = &field->blob->domain[PALP_FREE];
    uint32_t top = level < d->levels ? level : d->levels - 1u;
    uint32_t used = d->level_start[top + 1] * PALP_FIELD_LANES;
    for (uint32_t i = 0; i < used; i++) field->field[i] = field->detail[i];
    if (palp_blob_has(field->blob, PALP_META_SPLIT))
        palp_split_add_modes(field->blob, field->load, d->level_start[top + 1], field->field);
    else
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
