/* SPDX-License-Identifier: MIT */
#include "port/embedded/embedded_scene.h"
#include "core/base/arena.h"

static palp_zones *zones[PALP_SCENE_BODIES]; /* of multizone models */

/* As scene_at of the host, so that a scene moves alike. */
static double value_at(const embedded_track *track, double t_s) {
    uint32_t i = 0;
    while (i + 1u < track->count && track->key[i + 1u].t_s <= t_s) i++;
    const embedded_key *a = &track->key[i], *b = i + 1u < track->count ? a + 1 : a;
    double s = b->t_s > a->t_s ? (t_s - a->t_s) / (b->t_s - a->t_s) : 0.0;
    s = s < 0.0 ? 0.0 : s > 1.0 ? 1.0 : s;
    s = s * s * s * (10.0 - s * (15.0 - 6.0 * s));
    return a->value + s * (b->value - a->value);
}

static void values_at(uint32_t number, double t_s, float value[PALP_MAX_JOINTS]) {
    const embedded_body *b = &embedded.body[number];
    for (uint32_t j = 0; j < zones[number]->meta->joints; j++) value[j] = 0.0f;
    for (uint32_t k = 0; k < b->tracks; k++)
        value[b->track[k].joint] = (float)value_at(&b->track[k], t_s);
}

void embedded_move(palp_scene *scene, double t_s) {
    const palp_frame rest = PALP_FRAME_IDENTITY;
    for (uint32_t b = 0; b < embedded.bodies; b++) {
        float value[PALP_MAX_JOINTS];
        if (embedded.body[b].config.kind != PALP_BODY_ZONES) continue;
        values_at(b, t_s, value);
        palp_scene_pose(scene, b, value, &rest);
    }
}

/* A piece of the scene's memory; NULL when it is not enough. */
static void *piece(palp_arena *arena, size_t bytes) {
    void *memory = palp_take(arena, bytes, 1);
    return arena->used <= embedded.bytes ? memory : NULL;
}

static palp_status open_zones(uint32_t number, palp_body_config *c, palp_arena *arena) {
    const embedded_body *b = &embedded.body[number];
    const palp_frame rest = PALP_FRAME_IDENTITY;
    float value[PALP_MAX_JOINTS];
    palp_zones *z = zones[number] = piece(arena, sizeof *z);
    palp_assembly *a = c->assembly = piece(arena, sizeof *a);
    if (a == NULL) return PALP_ERR_MEMORY;
    palp_status status = palp_zones_open(z, b->data, (size_t)(b->end - b->data));
    if (status != PALP_OK) return status;
    const size_t bytes = palp_assembly_memsize(z, b->seams_finest);
    void *memory = piece(arena, bytes);
    if (memory == NULL) return PALP_ERR_MEMORY;
    status = palp_assembly_init(a, z, b->seams_finest, memory, bytes);
    if (status != PALP_OK) return status;
    const palp_vec3 g = b->config.gravity_m_s2;
    if (palp_norm(g) > 0.0f) status = palp_assembly_gravity(a, g);
    values_at(number, 0.0, value);
    palp_assembly_pose(a, value, &rest);
    palp_assembly_settle(a);
    return status;
}

static palp_status open_body(uint32_t number, palp_body_config *c, palp_arena *arena) {
    const embedded_body *b = &embedded.body[number];
    const size_t bytes = (size_t)(b->end - b->data);
    *c = b->config;
    if (c->kind == PALP_BODY_ZONES) return open_zones(number, c, arena);
    if (c->kind == PALP_BODY_ELASTIC) {
        palp_blob *blob = piece(arena, sizeof *blob);
        c->blob = blob;
        return blob != NULL ? palp_blob_open(blob, b->data, bytes) : PALP_ERR_MEMORY;
    }
    palp_tets *tets = piece(arena, sizeof *tets);
    const palp_status status =
        tets != NULL ? palp_tets_open(tets, b->data, bytes) : PALP_ERR_MEMORY;
    c->tets = tets;
    if (status == PALP_OK) c->adapt = palp_adapt_defaults(tets);
    return status;
}

palp_status embedded_open(palp_scene **scene, const palp_cost_table *cost, const palp_port *port,
                          float *bound_ns) {
    palp_body_config body[PALP_SCENE_BODIES];
    palp_scene_tool tool[PALP_CONTACT_TOOLS];
    palp_arena arena = {.base = embedded.memory};
    palp_status status = PALP_OK;
    for (uint32_t b = 0; b < embedded.bodies && status == PALP_OK; b++)
        status = open_body(b, &body[b], &arena);
    for (uint32_t t = 0; t < embedded.tools && status == PALP_OK; t++) {
        const embedded_tool *e = &embedded.tool[t];
        tool[t] = e->mount;
        if (tool[t].tool.shape == PALP_TOOL_FIELD)
            status = palp_tool_field_open(&tool[t].tool.field, e->data, (size_t)(e->end - e->data));
    }
    if (status != PALP_OK) return status;
    const palp_scene_config config = {.body = body,
                                      .tool = tool,
                                      .hand = embedded.hand,
                                      .drive = embedded.drive,
                                      .bodies = embedded.bodies,
                                      .tools = embedded.tools,
                                      .hands = embedded.hands,
                                      .drives = embedded.drives,
                                      .cost = *cost,
                                      .port = *port};
    const size_t bytes = palp_scene_memsize(&config);
    void *memory = piece(&arena, bytes);
    if (bytes == 0u || memory == NULL) return PALP_ERR_MEMORY;
    return palp_scene_open(scene, &config, memory, bytes, bound_ns);
}
