/* SPDX-License-Identifier: MIT */
#include "core/servo/body.h"
#include "core/base/arena.h"

static bool is_dynamic(const palp_body_config *c) { return c->kind == PALP_BODY_DYNAMIC; }

static palp_contact_config contact_of(const palp_body_config *c, const palp_tool *tools,
                                      uint32_t tool_count) {
    const bool zones = c->kind == PALP_BODY_ZONES;
    return (palp_contact_config){.blob = zones ? NULL : c->blob,
                                 .assembly = zones ? c->assembly : NULL,
                                 .pairs = zones && c->pairs,
                                 .tools = tools,
                                 .tool_count = tool_count,
                                 .finest = c->finest};
}

static void *lay_out(palp_arena *arena, palp_body *b, const palp_body_config *c,
                     uint32_t tool_count, size_t *bytes) {
    if (is_dynamic(c)) {
        b->dynamic = palp_take(arena, 1, sizeof *b->dynamic);
        *bytes = palp_dynamic_memsize(c->tets, c->max_points);
    } else {
        const palp_contact_config contact = contact_of(c, NULL, tool_count); /* counts alone */
        b->answer = palp_take(arena, 1, sizeof *b->answer);
        *bytes = palp_answer_memsize(&contact);
    }
    return palp_take(arena, *bytes, 1);
}

static bool is_there(const palp_body_config *c) {
    switch (c->kind) {
    case PALP_BODY_ELASTIC:
        return c->blob != NULL;
    case PALP_BODY_ZONES:
        return c->assembly != NULL;
    case PALP_BODY_DYNAMIC:
        return c->tets != NULL;
    default:
        return false;
    }
}

size_t palp_body_memsize(const palp_body_config *config, uint32_t tool_count) {
    palp_arena arena = {0};
    palp_body body;
    size_t bytes;
    if (!is_there(config)) return 0;
    (void)lay_out(&arena, &body, config, tool_count, &bytes);
    return bytes > 0u ? arena.used : 0u;
}

/* ---- opening ---- */

static palp_frame into(const palp_body *b, const palp_frame *scene) {
    return palp_frame_between(&b->config.at, scene);
}

static palp_status init_answer(palp_body *b, const palp_body_room *room, void *memory, size_t bytes,
                               float *bound_ns) {
    const palp_answer_config c = {.contact = contact_of(&b->config, room->tools, room->tool_count),
                                  .cost = room->cost,
                                  .port = room->port,
                                  .dt_s = room->dt_s,
                                  .before_ns = room->before_ns,
                                  .after_ns = room->after_ns};
    const palp_status status = palp_answer_init(b->answer, &c, memory, bytes, bound_ns);
    if (status != PALP_OK) return status;
    for (uint32_t t = 0; t < b->tool_count; t++) {
        b->answer->coupling.tool[t].measured = true;
    }
    b->least_ns = b->answer->least_ns[0] - room->before_ns - room->after_ns;
    b->most_ns = palp_answer_cost_full(&b->answer->bound, b->answer->limit);
    return PALP_OK;
}

static palp_status init_dynamic(palp_body *b, const palp_body_room *room, void *memory,
                                size_t bytes, float *bound_ns) {
    const palp_body_config *c = &b->config;
    const float period_ns = 1e9f * room->dt_s;
    palp_frame far_away[PALP_CONTACT_TOOLS];
    for (uint32_t t = 0; t < PALP_CONTACT_TOOLS; t++) far_away[t] = palp_tool_away();
    palp_dynamic_config d = {.tets = c->tets,
                             .material = c->material,
                             .gravity_m_s2 = palp_rotate_back(c->at.r, c->gravity_m_s2),
                             .adapt = c->adapt,
                             .tools = room->tools,
                             .tool_count = room->tool_count,
                             .max_points = c->max_points,
                             .most_class = c->most_class,
                             .cost = room->cost,
                             .port = room->port,
                             .tick_s = room->dt_s};
    d.cost.margin -= (room->before_ns + room->after_ns) / period_ns;
    if (!(d.cost.margin > 0.0f)) {
        if (bound_ns != NULL) *bound_ns = room->before_ns + room->after_ns;
        return PALP_ERR_BUDGET;
    }
    const palp_status status = palp_dynamic_init(b->dynamic, &d, far_away, memory, bytes, bound_ns);
    if (bound_ns != NULL) *bound_ns += room->before_ns + room->after_ns;
    if (status != PALP_OK) return status;
    b->dynamic->config.cost.margin = room->cost.margin - room->after_ns / period_ns;
    b->least_ns = palp_dynamic_cost_least(b->dynamic);
    b->most_ns = d.cost.margin * period_ns;
    return PALP_OK;
}

palp_status palp_body_init(palp_body *b, const palp_body_config *config, const palp_body_room *room,
                           void *memory, size_t bytes, float *bound_ns) {
    palp_arena arena = {.base = memory};
    size_t part;
    if (!is_there(config) || !palp_is_rotation(config->at.r) || !palp_vec3_is_finite(config->at.t))
        return PALP_ERR_ARGUMENT;
    const palp_status status =
        palp_check_block(memory, bytes, palp_body_memsize(config, room->tool_count));
    if (status != PALP_OK) return status;
    *b = (palp_body){.config = *config,
                     .tool_count = room->tool_count,
                     .spring = room->spring,
                     .dt_s = room->dt_s};
    void *rest = lay_out(&arena, b, config, room->tool_count, &part);
    return is_dynamic(config) ? init_dynamic(b, room, rest, part, bound_ns)
                              : init_answer(b, room, rest, part, bound_ns);
}

/* ---- the tick ---- */

/* A wrench and a tool's place, from the body's coordinates to the scene's. */
static palp_body_felt outward(const palp_body *b, palp_wrench w, const palp_frame *tool) {
    const palp_frame *at = &b->config.at;
    return (palp_body_felt){
        .wrench = {palp_rotate(at->r, w.force_N), palp_rotate(at->r, w.moment_Nm)},
        .tool = palp_frame_compose(at, tool)};
}

/* A part of the spring between a tool and its device. */
static void scale_spring(palp_coupling_tool *k, const palp_hand_spring *spring, float part) {
    k->stiffness_N_per_m = part * spring->N_per_m;
    k->damping_Ns_per_m = part * spring->Ns_per_m;
    k->stiffness_Nm_per_rad = part * spring->Nm_per_rad;
    k->damping_Nms_per_rad = part * spring->Nms_per_rad;
}

static void answer_tick(palp_body *b, uint64_t start_ns, const palp_body_tool *tool,
                        palp_body_felt *felt, palp_body_report *report) {
    palp_coupling_result *result = b->result;
    palp_answer_report a;
    palp_answer *answer = b->answer;
    palp_vec3 before_N[PALP_CONTACT_TOOLS];
    for (uint32_t t = 0; t < b->tool_count; t++) {
        palp_coupling_tool *k = &answer->coupling.tool[t];
        k->absent = !(tool[t].part > 0.0f);
        scale_spring(k, &b->spring[t], k->absent ? 1.0f : tool[t].part);
        k->velocity_m_s = palp_rotate_back(b->config.at.r, tool[t].velocity_m_s);
        k->velocity_rad_s = palp_rotate_back(b->config.at.r, tool[t].turning_rad_s);
        b->held[t] = into(b, &tool[t].at);
        before_N[t] = result[t].force_N;
    }
    palp_answer_tick(answer, start_ns, b->held, result, &a);
    const float stored = answer->contact.energy_J;
    for (uint32_t t = 0; t < b->tool_count; t++) {
        const palp_coupling_tool *k = &answer->coupling.tool[t];
        const palp_wrench w = {result[t].force_N, result[t].moment_Nm};
        felt[t] = outward(b, w, &result[t].tool);
        felt[t].held_J = result[t].energy_J - stored;
        felt[t].damped_W = result[t].damped_W;
        felt[t].moved_m = result[t].moved_m;
        /* the force that the way met, between those at its ends */
        felt[t].brought_J = 0.5f * palp_dot(palp_add(before_N[t], w.force_N), k->brought_m);
        felt[t].touching = k->touching;
        felt[t].found = k->placed;
        felt[t].slipping = k->friction.slipping;
    }
    *report = (palp_body_report){.level = a.level,
                                 .limit = answer->limit,
                                 .points = a.points,
                                 .active = a.active,
                                 .iterations = a.iterations,
                                 .flags = a.flags,
                                 .stored_J = stored,
                                 .doubt_N = a.doubt_N,
                                 .held = a.held,
                                 .shortened = a.shortened,
                                 .moving = a.moving};
}

/* The finest level of which any node is at work. */
static uint32_t finest_active(const palp_dynamic_report *r, uint32_t levels) {
    uint32_t finest = 0;
    for (uint32_t l = 0; l < levels; l++) finest = r->active[l] > 0u ? l : finest;
    return finest;
}

static void dynamic_tick(palp_body *b, uint64_t start_ns, const palp_body_tool *tool,
                         palp_body_felt *felt, palp_body_report *report) {
    palp_dynamic *d = b->dynamic;
    palp_frame at[PALP_CONTACT_TOOLS];
    palp_wrench on[PALP_CONTACT_TOOLS];
    float spring[PALP_CONTACT_TOOLS];
    for (uint32_t t = 0; t < b->tool_count; t++) {
        const palp_frame device = into(b, &tool[t].at);
        const bool present = tool[t].part > 0.0f;
        spring[t] = tool[t].part * b->spring[t].N_per_m;
        const bool was = b->proxy[t].placed;
        palp_vec3 contact_N = {0.0f, 0.0f, 0.0f};
        if (was) contact_N = d->on_tool[t].force_N;
        at[t] = present ? palp_proxy_move(&b->proxy[t], &device, contact_N, spring[t], b->dt_s)
                        : palp_tool_away();
        b->proxy[t].placed = present;
        if (present != was) palp_impose_place(&d->impose, t, &at[t]);
    }
    *report = (palp_body_report){.limit = d->config.tets->meta->levels - 1u};
    palp_dynamic_tick(d, start_ns, at, on, &report->dynamic);
    for (uint32_t t = 0; t < b->tool_count; t++) {
        float held_J;
        palp_wrench w = {.force_N = palp_proxy_force(&b->proxy[t], spring[t], &held_J)};
        if (b->proxy[t].touching) w.moment_Nm = on[t].moment_Nm;
        felt[t] = outward(b, w, &at[t]);
        felt[t].held_J = held_J;
        felt[t].touching = b->proxy[t].touching;
        felt[t].found = b->proxy[t].placed;
        felt[t].slipping = d->impose.slid[t] > 0u && d->impose.stuck[t] == 0u;
        if (!(d->config.tools[t].friction > 0.0f)) felt[t].slipping = b->proxy[t].touching;
    }
    const palp_dynamic_report *r = &report->dynamic;
    report->level = finest_active(r, d->config.tets->meta->levels);
    report->points = r->points;
    report->active = r->inside;
    report->iterations = r->steps;
    report->stored_J = palp_max(r->total_J, 0.0f);
    report->held = r->coasted;
    report->shortened = r->shortened;
}

void palp_body_tick(palp_body *b, uint64_t start_ns, const palp_body_tool *tool,
                    palp_body_felt *felt, palp_body_report *report) {
    if (b->dynamic != NULL)
        dynamic_tick(b, start_ns, tool, felt, report);
    else
        answer_tick(b, start_ns, tool, felt, report);
}

void palp_body_reset(palp_body *body) {
    if (body->answer != NULL) palp_answer_reset(body->answer);
    for (uint32_t t = 0; t < PALP_CONTACT_TOOLS; t++) body->proxy[t].placed = false;
}

void palp_body_spare(palp_body *body) {
    if (body->answer != NULL) palp_answer_spare(body->answer);
}
