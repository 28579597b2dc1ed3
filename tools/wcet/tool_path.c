/* SPDX-License-Identifier: MIT */
#include "tools/wcet/tool_path.h"

tool_path path_random(dice *d) {
    return (tool_path){.dwell = 1u + dice_below(d, 60),
                       .radius = 3.5f + 3.0f * dice_float(d),
                       .stiffness = 0.6f + 0.5f * dice_float(d),
                       .sunk = 0.5f + 0.4f * dice_float(d),
                       .swing = 0.3f + 0.3f * dice_float(d),
                       .tremble = 0.5f + 0.5f * dice_float(d),
                       .far = 0.5f + 0.5f * dice_float(d),
                       .seed = dice_roll(d)};
}

tool_path path_mutated(tool_path path, dice *d) {
    tool_path p = path;
    float *value[6] = {&p.radius, &p.stiffness, &p.sunk, &p.swing, &p.tremble, &p.far};
    for (uint32_t i = 0; i < 6u; i++) *value[i] *= 1.0f + 0.3f * dice_float(d) * dice_float(d);
    if (dice_below(d, 3) == 0u) p.dwell = 1u + (p.dwell + dice_below(d, 9)) % 60u;
    if (dice_below(d, 2) == 0u) p.seed = dice_roll(d);
    p.sunk = palp_min(p.sunk, 1.2f);
    return p;
}

static palp_vec3 next_place(const search *h, const tool_path *p, dice *d, uint32_t tick,
                            uint32_t *node) {
    const palp_blob *b = h->blob;
    if (tick % p->dwell == 0u) {
        uint32_t first = b->ring_offset[*node], ring = b->ring_offset[*node + 1u] - first;
        bool far = 0.5f * (1.0f + dice_float(d)) < p->far || ring == 0u;
        *node = far ? b->domain[PALP_FREE].node[dice_below(d, b->domain[PALP_FREE].slots)]
                    : b->ring[first + dice_below(d, ring)];
    }
    float sunk = p->sunk + p->swing * dice_float(d);
    palp_vec3 at =
        palp_madd(palp_vec3_at(b->rest_m + 3u * *node), (1.0f - sunk) * h->tool.ball[0].radius_m,
                  palp_vec3_at(b->normal + 3u * *node));
    return palp_madd(at, p->tremble * b->meta->mean_edge_m,
                     (palp_vec3){dice_float(d), dice_float(d), dice_float(d)});
}

float path_bound(const palp_contact_cost *cost, const path_tick *tick) {
    const palp_contact_level l = palp_contact_level_of(tick->level, cost->modes);
    float sum = palp_answer_cost_around(cost) + palp_contact_cost_filled(cost, tick->filled);
    if (tick->points == 0u) return sum;
    return sum + palp_contact_cost_points(cost, l, tick->points) +
           palp_contact_cost_assemble(cost, l, tick->points) +
           palp_contact_cost_iterate(cost, tick->points, tick->active, tick->iterations) +
           palp_contact_cost_finish(cost, l, tick->points, tick->active);
}

static void one_tick(search *h, palp_vec3 place) {
    const palp_frame at = palp_frame_at(place);
    palp_coupling_result result;
    palp_answer_report r;
    if (h->chill != NULL) h->chill();
    uint64_t before = h->port.now_ns(h->port.context);
    palp_answer_tick(&h->answer, before, &at, &result, &r);
    uint64_t after = h->port.now_ns(h->port.context);
    const palp_contact *c = &h->answer.contact;
    const path_tick t = {.level = r.level,
                         .filled = c->filled,
                         .points = c->count,
                         .active = c->most_active,
                         .iterations = c->iterations,
                         .cost = after - before};
    h->told(h->context, &t);
}

bool path_run(search *h, const tool_path *path, uint32_t ticks) {
    dice d = {path->seed};
    h->tool = palp_tool_sphere(path->radius * h->blob->meta->mean_edge_m);
    h->tool.friction = h->friction ? 0.3f : 0.0f;
    const palp_answer_config config = {
        .contact = {.blob = h->blob, .tools = &h->tool, .tool_count = 1, .finest = h->level},
        .cost = {&palp_target_counted, 1e-9f, 0.0f, 1.0f},
        .port = h->port,
        .dt_s = 1.0f};
    if (palp_answer_init(&h->answer, &config, h->memory, h->bytes, NULL) != PALP_OK) return false;
    h->answer.coupling.tool[0].stiffness_N_per_m =
        h->blob->meta->stiffness_max_N_per_m * path->stiffness;
    uint32_t node = h->blob->domain[PALP_FREE].node[0];
    for (uint32_t i = 0; i < ticks; i++) one_tick(h, next_place(h, path, &d, i, &node));
    return true;
}
