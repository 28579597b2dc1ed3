/* SPDX-License-Identifier: MIT */
/* Levels, memory and opening of contact. */
#include "core/contact/contact_internal.h"

#define ZONE_CELLS 16u /* on the coarse levels of multizone models */

palp_contact_level palp_contact_level_of(uint32_t level, uint32_t modes) {
    static const uint32_t cells[PALP_CONTACT_LEVELS] = {6, 6, 6, 20, 40};
    static const uint32_t share[PALP_CONTACT_LEVELS] = {4, 2, 1, 1, 1};
    static const uint32_t contacts[PALP_CONTACT_LEVELS] = {12, 12, 12, 36, 72};
    uint32_t m = (modes / share[level] + PALP_MODE_LANES - 1u) / PALP_MODE_LANES * PALP_MODE_LANES;
    return (palp_contact_level){level, cells[level], 3u * cells[level] + 2u, contacts[level], m};
}

palp_contact_level palp_contact_level_of_zones(uint32_t level, uint32_t modes) {
    palp_contact_level l = palp_contact_level_of(level, modes);
    if (level >= PALP_CONTACT_FINEST) return l;
    return (palp_contact_level){level, ZONE_CELLS, 3u * ZONE_CELLS + 2u, 2u * ZONE_CELLS, l.modes};
}

palp_contact_level palp_contact_level_at(const palp_contact *contact, uint32_t level) {
    return contact->assembly != NULL ? palp_contact_level_of_zones(level, contact->modes)
                                     : palp_contact_level_of(level, contact->modes);
}

static uint32_t room_of(const palp_contact *c, uint32_t finest) {
    uint32_t most = 0;
    for (uint32_t l = 0; l <= finest; l++) {
        uint32_t points = palp_contact_level_at(c, l).points;
        if (points > most) most = points;
    }
    return most;
}

static uint32_t zone_modes(const palp_assembly *a) {
    uint32_t most = 0;
    for (uint32_t z = 0; z < a->zones->meta->zones; z++)
        most = a->zones->zone[z].modes > most ? a->zones->zone[z].modes : most;
    return most;
}

static void lay_out(palp_contact *c, palp_arena *arena) {
    const uint32_t modes = c->modes;
    c->side_room = ((c->pairs ? 2u * c->room : c->room) + LANES - 1u) / LANES * LANES;
    const uint32_t room = c->room, sides = c->side_room;
    const uint32_t padded = sides / LANES * LANES + LANES * c->bodies;
    c->surface = palp_take(arena, c->bodies, sizeof *c->surface);
    c->frame_before = palp_take(arena, c->assembly != NULL ? c->bodies : 0u, sizeof(palp_frame));
    c->closest =
        palp_take(arena, c->pairs ? c->bodies * (c->bodies - 1u) / 2u : 0u, sizeof *c->closest);
    c->beyond = palp_take(arena, c->assembly != NULL ? c->bodies : 0u, sizeof *c->beyond);
    for (uint32_t b = 0; b < c->bodies && c->assembly != NULL; b++) {
        const size_t triangles = c->assembly->zones->blob[b].meta->triangles;
        uint32_t *table = palp_take(arena, 3u * triangles, sizeof *table);
        if (arena->base != NULL) c->beyond[b] = table;
    }
    c->patch = palp_take(arena, c->patches, sizeof *c->patch);
    c->point = palp_take(arena, room, sizeof *c->point);
    c->before = palp_take(arena, room, sizeof *c->before);
    c->facing = palp_take(arena, c->pairs ? room : 0u, sizeof *c->facing);
    c->facing_before = palp_take(arena, c->pairs ? room : 0u, sizeof *c->facing);
    for (uint32_t k = 0; k < c->patches; k++) {
        palp_lattice_table *table = palp_take(arena, 2u, sizeof *table);
        if (arena->base == NULL) continue;
        c->patch[k].table = table;
        c->patch[k].table_before = table + 1u;
    }
    c->side_point = palp_take(arena, sides, sizeof *c->side_point);
    c->other_side = palp_take(arena, room, sizeof *c->other_side);
    c->node = palp_take(arena, 3u * sides, sizeof *c->node);
    c->node_body = palp_take(arena, 3u * sides, sizeof *c->node_body);
    c->node_u_m = palp_take(arena, 3u * sides, sizeof *c->node_u_m);
    c->node_bent_m = palp_take(arena, 3u * sides, sizeof *c->node_bent_m);
    c->node_slot = palp_take(arena, PALP_CONTACT_NODE_SLOTS, sizeof *c->node_slot);
    c->corner = palp_take(arena, sides, sizeof *c->corner);
    c->run = palp_take(arena, sides, sizeof *c->run); /* no more than there are sides */
    for (uint32_t k = 0; k < 11u; k++) c->column[k] = palp_take(arena, sides, sizeof(float));
    for (uint32_t k = 0; k < 11u; k++) c->pressed[k] = palp_take(arena, padded, sizeof(float));
    c->pressed_side = palp_take(arena, padded, sizeof(uint16_t));
    c->pressed_of = palp_take(arena, c->bodies, sizeof *c->pressed_of);
    c->mode = palp_take_rows(arena, modes, sides, sizeof(float));
    c->load = palp_take(arena, modes, sizeof(float));
    for (uint32_t k = 0; k < 2u; k++) c->side_row[k] = palp_take(arena, sides, sizeof(float));
    c->g = palp_take_rows(arena, room, room, sizeof(float));
    c->factor = palp_take_rows(arena, room, room, sizeof(float));
    c->target = palp_take(arena, room, sizeof(float));
    c->lambda = palp_take(arena, room, sizeof(float));
    c->scratch = palp_take(arena, room + 1u, sizeof(float));
    c->active = palp_take(arena, room, sizeof(uint32_t));
    if (c->assembly == NULL) return;
    const size_t width = 3u * (size_t)c->assembly->seams.modes;
    c->seam = palp_take_rows(arena, 2u * width, sides, sizeof(float));
    c->felt = palp_take(arena, 3u * (size_t)zone_modes(c->assembly), sizeof(float));
    c->answer = palp_take(arena, 2u * width, sizeof(float));
}

static uint32_t modes_of(const palp_contact_config *config) {
    const palp_blob *blob = config->assembly != NULL ? config->assembly->zones->blob : config->blob;
    return blob->regular.modes;
}

/* All but what lies in memory. */
static void describe(palp_contact *c, const palp_contact_config *config) {
    palp_assembly *assembly = config->assembly;
    const bool pairs = assembly != NULL && config->pairs;
    *c = (palp_contact){.assembly = assembly,
                        .pairs = pairs,
                        .bodies = assembly != NULL ? assembly->zones->meta->zones : 1u,
                        .patches = config->tool_count + (pairs ? PALP_CONTACT_PAIRS : 0u),
                        .tools = config->tools,
                        .tool_count = config->tool_count,
                        .modes = modes_of(config),
                        .now = config->finest};
    c->room = room_of(c, config->finest);
    c->level = palp_contact_level_at(c, config->finest);
}

size_t palp_contact_memsize(const palp_contact_config *config) {
    palp_arena arena = {0};
    palp_contact c;
    const bool sound = config->finest < PALP_CONTACT_LEVELS && config->tool_count > 0u &&
                       config->tool_count <= PALP_CONTACT_TOOLS && modes_of(config) > 0u;
    if (!sound) return 0;
    describe(&c, config);
    lay_out(&c, &arena);
    return arena.used;
}

static palp_status check(const palp_contact_config *config) {
    if (config->finest >= PALP_CONTACT_LEVELS) return PALP_ERR_LIMITS;
    const palp_assembly *a = config->assembly;
    for (uint32_t i = 0; i < (a != NULL ? a->zones->meta->zones : 1u); i++) {
        palp_surface surface;
        const palp_status status = a != NULL ? palp_surface_open_zone(&surface, config->assembly, i)
                                             : palp_surface_open(&surface, config->blob);
        if (status != PALP_OK) return status;
        if (surface.blob->regular.modes != modes_of(config)) return PALP_ERR_ARGUMENT;
    }
    if (config->tool_count < 1u || config->tool_count > PALP_CONTACT_TOOLS)
        return PALP_ERR_ARGUMENT;
    for (uint32_t t = 0; t < config->tool_count; t++) {
        if (!palp_tool_is_sound(&config->tools[t])) return PALP_ERR_ARGUMENT;
    }
    return PALP_OK;
}

palp_status palp_contact_init(palp_contact *c, const palp_contact_config *config, void *memory,
                              size_t bytes) {
    palp_arena arena = {.base = memory};
    palp_status status = check(config);
    if (status != PALP_OK) return status;
    status = palp_check_block(memory, bytes, palp_contact_memsize(config));
    if (status != PALP_OK) return status;
    describe(c, config);
    lay_out(c, &arena);
    for (uint32_t i = 0; i < c->bodies && c->assembly != NULL; i++)
        (void)palp_surface_open_zone(&c->surface[i], c->assembly, i);
    if (c->assembly == NULL) (void)palp_surface_open(&c->surface[0], config->blob);
    if (c->assembly != NULL) {
        c->frame = c->assembly->world;
        palp_contact_open_patches(c);
    }
    for (uint32_t t = 0; t < c->tool_count; t++) {
        c->extent_m[t] = palp_tool_extent(&c->tools[t]);
        c->reach_m[t] = 0.0f;
        for (uint32_t b = 0; b < c->bodies; b++)
            c->reach_m[t] =
                palp_max(c->reach_m[t], palp_lattice_reach(&c->tools[t], c->surface[b].blob));
    }
    palp_contact_forget_nodes(c);
    palp_contact_clear(c);
    return PALP_OK;
}

void palp_contact_clear(palp_contact *c) {
    for (uint32_t k = 0; k < c->patches; k++) {
        palp_contact_patch *p = &c->patch[k];
        palp_lattice_table *table = p->table, *before = p->table_before;
        *p = (palp_contact_patch){.table = table, .table_before = before};
        palp_lattice_clear(table);
        palp_lattice_clear(before);
    }
    for (uint32_t t = 0; t < c->tool_count; t++) {
        c->force_N[t] = c->beyond_N[t] = c->repaid_N[t] = (palp_vec3){0};
        c->moment_Nm[t] = c->beyond_Nm[t] = c->repaid_Nm[t] = (palp_vec3){0};
        c->normal_N[t] = 0.0f;
    }
    for (uint32_t m = 0; m < PALP_LATTICE_FAR_MODES; m++) c->far_load[m] = 0.0f;
    c->count = c->count_before = c->active_count = 0;
    c->energy_J = c->owed_J = c->stored_J = 0.0f;
    c->solved = false;
    c->crowd = 1.0f;
}
