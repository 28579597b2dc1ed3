/* SPDX-License-Identifier: MIT */
#include "port/embedded/embedded_scene.h"
#include "core/base/arena.h"

/* What the bodies' files are opened as. */
static palp_blob blob[PALP_SCENE_BODIES];
static palp_zones zones[PALP_SCENE_BODIES];
static palp_assembly assembly[PALP_SCENE_BODIES];
static palp_tets tets[PALP_SCENE_BODIES];

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
    for (uint32_t j = 0; j < zones[number].meta->joints; j++) value[j] = 0.0f;
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

static palp_status open_zones(uint32_t number, palp_arena *arena) {
    const embedded_body *b = &embedded.body[number];
    const palp_frame rest = PALP_FRAME_IDENTITY;
    float value[PALP_MAX_JOINTS];
    palp_status status = palp_zones_open(&zones[number], b->data, (size_t)(b->end - b->data));
    if (status != PALP_OK) return status;
    const size_t bytes = palp_assembly_memsize(&zones[number], b->seams_finest);
    void *memory = palp_take(arena, bytes, 1);
    if (arena->used > embedded.bytes) return PALP_ERR_MEMORY;
    status = palp_assembly_init(&assembly[number], &zones[number], b->seams_finest, memory, bytes);
    if (status != PALP_OK) return status;
    const palp_vec3 g = b->config.gravity_m_s2;
    if (palp_norm(g) > 0.0f) status = palp_assembly_gravity(&assembly[number], g);
    values_at(number, 0.0, value);
    palp_assembly_pose(&assembly[number], value, &rest);
    palp_assembly_settle(&assembly[number]);
    return status;
}

static palp_status open_body(uint32_t number, palp_body_config *c, palp_arena *arena) {
    const embedded_body *b = &embedded.body[number];
    const size_t bytes = (size_t)(b->end - b->data);
    *c = b->config;
    c->blob = &blob[number];
    c->assembly = &assembly[number];
    c->tets = &tets[number];
    if (c->kind == PALP_BODY_ELASTIC) return palp_blob_open(&blob[number], b->data, bytes);
    if (c->kind == PALP_BODY_ZONES) return open_zones(number, arena);
    const palp_status status = palp_tets_open(&tets[number], b->data, bytes);
    if (status == PALP_OK) c->adapt = palp_adapt_defaults(&tets[number]);
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
            status =
                palp_tool_field_open(&tool[t].tool.field, e->data, (size_t)(e->end - e->data));
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
    void *memory = palp_take(&arena, bytes, 1);
    if (bytes == 0u || arena.used > embedded.bytes) return PALP_ERR_MEMORY;
    return palp_scene_open(scene, &config, memory, bytes, bound_ns);
}
