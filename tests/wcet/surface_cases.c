/* SPDX-License-Identifier: MIT */
/* Contact on the surface: every step of a tick, by every tool, level and place. */
#include "tests/wcet/cases.h"

/* What a step turned out to do. */
typedef struct {
    palp_contact_level level;
    palp_lattice_counts done;
    uint32_t count, active;
} step;

typedef float (*bound_of)(const palp_contact_cost *cost, const step *s);

typedef struct {
    const palp_contact_cost *unit;
    bound_of bound;
    const step *s;
} question;

static float answer(const void *context, uint32_t k) {
    const question *q = context;
    return q->bound(&q->unit[k], q->s);
}

static float of_fill(const palp_contact_cost *c, const step *s) {
    return palp_contact_cost_filled(c, s->done);
}
static float of_points(const palp_contact_cost *c, const step *s) {
    return palp_contact_cost_points(c, s->level, s->count);
}
static float of_assemble(const palp_contact_cost *c, const step *s) {
    return palp_contact_cost_assemble(c, s->level, s->count);
}
static float of_iterate(const palp_contact_cost *c, const step *s) {
    return palp_contact_cost_iterate(c, s->count, s->active, 1);
}
static float of_finish(const palp_contact_cost *c, const step *s) {
    return palp_contact_cost_finish(c, s->level, s->count, s->active);
}

static float of_place(const palp_contact_cost *c, const step *s) {
    (void)s;
    return palp_contact_cost_patches(c) + c->price.of[PALP_WORK_FINISH];
}

static palp_vec3 anywhere(dice *d) {
    return (palp_vec3){dice_float(d), dice_float(d), dice_float(d)};
}

/* A ball as a field of so many samples along each axis, with some of its extremes or none. */
#define FIELD_SAMPLES 16u
static palp_tool field_tool(cases *c, dice *d, float size) {
    int16_t *sample = cases_take(c, FIELD_SAMPLES * FIELD_SAMPLES * FIELD_SAMPLES * sizeof *sample);
    const float half = 1.5f * size, step = 2.0f * half / (float)(FIELD_SAMPLES - 1u);
    const float unit = 2.0f * half / 32767.0f;
    for (uint32_t i = 0; i < FIELD_SAMPLES * FIELD_SAMPLES * FIELD_SAMPLES; i++) {
        const palp_vec3 x = {step * (float)(i % FIELD_SAMPLES) - half,
                             step * (float)(i / FIELD_SAMPLES % FIELD_SAMPLES) - half,
                             step * (float)(i / (FIELD_SAMPLES * FIELD_SAMPLES)) - half};
        sample[i] = (int16_t)((palp_norm(x) - size) / unit);
    }
    const uint32_t extremes = dice_below(d, 2) * dice_below(d, 65);
    float *extreme = cases_take(c, 64u * 3u * sizeof *extreme);
    for (uint32_t k = 0; k < extremes; k++) {
        const palp_vec3 way = palp_madd((palp_vec3){0.01f, 0.0f, 0.0f}, 1.0f, anywhere(d));
        const palp_vec3 at = palp_scale(size / palp_norm(way), way);
        extreme[3u * k] = at.x;
        extreme[3u * k + 1u] = at.y;
        extreme[3u * k + 2u] = at.z;
    }
    return (palp_tool){.shape = PALP_TOOL_FIELD,
                       .field = {.extreme = extreme,
                                 .extremes = extremes,
.sample = sample,
                                 .count = {FIELD_SAMPLES, FIELD_SAMPLES, FIELD_SAMPLES},
                                 .origin_m = {-half, -half, -half},
                                 .step_m = step,
                                 .unit_m = unit,
                                 .size_m = size}};
}

static palp_tool some_tool(cases *c, dice *d, float edge) {
    float size = edge * (0.6f + 2.5f * (1.0f + dice_float(d)));
    palp_tool tool = palp_tool_sphere(size);
    palp_vec3 z = anywhere(d), x = palp_cross(z, anywhere(d));
    float length = palp_norm(x), *heights;
    switch (dice_below(d, 6)) {
    case 5:
        return field_tool(c, d, size);
    case 0:
        tool.balls = 2u + dice_below(d, PALP_TOOL_BALLS - 1u);
        for (uint32_t i = 0; i < tool.balls; i++)
            tool.ball[i] = (palp_ball){palp_scale(0.7f * size, anywhere(d)), size};
        return tool;
    case 1:
        if (length < 0.05f) return tool;
        tool.shape = PALP_TOOL_PAD;
        x = palp_scale(1.0f / length, x);
        z = palp_scale(1.0f / palp_norm(z), z);
        tool.pad = (palp_pad){
            .axis = {x, palp_cross(z, x), z}, .half_m = {size, 0.6f * size}, .edge_m = 0.4f * size};
        if (dice_below(d, 2) == 0u) return tool;
        tool.pad.columns = 2u + dice_below(d, 16);
        tool.pad.rows = 2u + dice_below(d, 16);
        heights = cases_take(c, 17u * 17u * sizeof *heights);
        for (uint32_t k = 0; k < 17u * 17u; k++) heights[k] = 0.1f * size * dice_float(d);
        tool.pad.height_m = heights;
        return tool;
    case 2:
        if (length < 0.05f) return tool;
        tool.shape = PALP_TOOL_CYLINDER;
        tool.cylinder = (palp_cylinder){.axis = palp_scale(1.0f / length, x),
                                        .radius_m = size,
                                        .half_m = 1.5f * size,
                                        .rim_m = 0.3f * size};
        return tool;
    default:
        return tool;
    }
}

/* A contact on the surface. */
typedef struct {
    cases *c;
    const palp_contact_cost *unit;
    palp_contact *contact;
} episode;

static void tell(episode *e, const char *name, bound_of bound, const step *s, uint64_t counted) {
    const question q = {e->unit, bound, s};
    cases_tell(e->c, name, e->contact->now, answer, &q, counted);
}

/* A point of a field rarely takes all the steps to its other side that its bound is for. */
static bool has_field(const palp_contact *c) {
    bool any = false;
    for (uint32_t t = 0; t < c->tool_count; t++) any = any || c->tools[t].shape == PALP_TOOL_FIELD;
    return any;
}

void cases_of_tick(cases *cases, palp_contact *contact, const palp_contact_cost *unit,
                   const palp_frame *at, const palp_contact_spring *spring) {
    episode episode = {cases, unit, contact}, *e = &episode;
    palp_contact *c = contact;
    step s = {.count = 0};
    uint64_t begun = instructions();
    palp_contact_begin(c, at, spring);
    uint64_t placed = instructions();
    if (c->assembly != NULL) tell(e, "place", of_place, &s, placed - begun);
    s.level = c->level;
    for (bool more = true; more;) {
        uint64_t before = instructions();
        more = palp_contact_fill(c);
        uint64_t after = instructions();
        s.done = c->done;
        tell(e, "fill", of_fill, &s, after - before);
    }
    uint64_t before = instructions();
    s.count = palp_contact_points(c);
    uint64_t after = instructions();
    if (s.count == 0u) return; /* what is left belongs to the tick */
    tell(e, has_field(c) ? "field" : "points", of_points, &s, after - before);
    before = instructions();
    while (s.count > 0u && palp_contact_assemble(c)) {}
    after = instructions();
    if (s.count > 0u) tell(e, "assemble", of_assemble, &s, after - before);
    for (bool more = s.count > 0u; more;) {
        before = instructions();
        more = palp_contact_iterate(c);
        after = instructions();
        s.active = c->active_count;
        if (more || c->iterations < PALP_CONTACT_ITERATIONS)
            tell(e, "iterate", of_iterate, &s, after - before);
    }
    s.active = c->active_count;
    before = instructions();
    palp_contact_finish(c);
    after = instructions();
    tell(e, "finish", of_finish, &s, after - before);
}

/* One to as many tools as there may be about a node, which wanders over the surface. */
static void run(cases *c, const palp_blob *blob, dice *d) {
    const size_t used = c->used;
    const float edge = blob->meta->mean_edge_m;
    const uint32_t tools = dice_below(d, 2) == 0u ? 1u : 1u + dice_below(d, PALP_CONTACT_TOOLS);
    palp_contact *contact = cases_take(c, sizeof *contact);
    palp_tool *tool = cases_take(c, tools * sizeof *tool);
    for (uint32_t t = 0; t < tools; t++) tool[t] = some_tool(c, d, edge);
    palp_contact_cost *unit = cases_take(c, PALP_WORKS * sizeof *unit);
    const palp_prices none = {{0}};
    const palp_contact_cost counts = palp_contact_cost_of(blob, tool, tools, &none);
    for (uint32_t k = 0; k < cases_prices(c); k++) {
        palp_prices price = cases_price(c, k);
        unit[k] = palp_contact_cost_at(&counts, tool, &price);
    }
    const uint32_t finest = PALP_CONTACT_LEVELS - 1u;
    const palp_contact_config config = {
        .blob = blob, .tools = tool, .tool_count = tools, .finest = finest};
    size_t bytes = palp_contact_memsize(&config);
    void *memory = cases_take(c, bytes);
    if (palp_contact_init(contact, &config, memory, bytes) == PALP_OK) {
        uint32_t node = blob->domain[PALP_FREE].node[dice_below(d, blob->domain[PALP_FREE].slots)];
        const float stiffness = blob->meta->stiffness_max_N_per_m * (1.2f + dice_float(d));
        for (uint32_t i = 0; i < 40u; i++) {
            palp_frame at[PALP_CONTACT_TOOLS];
            palp_contact_spring spring[PALP_CONTACT_TOOLS];
            if (i % 10u == 0u) contact->now = dice_below(d, PALP_CONTACT_LEVELS);
            for (uint32_t t = 0; t < tools; t++) {
                if (dice_below(d, 12) == 0u)
                    node = blob->ring[blob->ring_offset[node] +
                                      dice_below(d, blob->ring_offset[node + 1u] -
                                                        blob->ring_offset[node])];
                const float extent = palp_tool_extent(&tool[t]);
                const palp_frame rest = PALP_FRAME_IDENTITY;
                at[t] = palp_frame_at(palp_madd(palp_vec3_at(blob->rest_m + 3u * (size_t)node),
                                                extent * (1.0f - 0.5f * (1.0f + dice_float(d))),
                                                palp_vec3_at(blob->normal + 3u * (size_t)node)));
                if (i % 3u == 0u) palp_turn_by(anywhere(d), rest.r, at[t].r);
                spring[t] = (palp_contact_spring){.held = at[t], .stiffness_N_per_m = stiffness};
                spring[t].held.t = palp_madd(at[t].t, 0.3f * edge, anywhere(d));
                spring[t].stiffness_Nm_per_rad = dice_below(d, 2) == 0u ? 0.0f : 0.5f;
            }
            cases_of_tick(c, contact, unit, at, spring);
        }
    }
    c->used = used;
}

void cases_of_surface(cases *c, const palp_blob *blob, uint64_t seed, uint32_t episodes) {
    dice d = {seed};
    for (uint32_t i = 0; i < episodes && blob->regular.modes > 0u; i++) run(c, blob, &d);
}
