/* SPDX-License-Identifier: MIT */
/* Parts of the tick of a dynamic body, with a ball that jumps about in it. */
#include "tests/wcet/cases.h"

typedef struct {
    palp_dynamic body;
    palp_tool tool;
} poked;

static uint64_t no_time(void *context) {
    (void)context;
    return 0;
}

static void set(features *f, palp_work kind, uint32_t count) { f->count[kind] = (float)count; }

/* Elements due in step s, in whole groups. */
static uint32_t due_in(const palp_dyna *d, uint32_t s, uint32_t steps) {
    uint32_t top = 0, sum = 0;
    while (1u << top < steps) top++;
    for (uint32_t c = 0; c <= top; c++) {
        uint32_t end = c == top ? PALP_STEP_CLASSES : c + 1u;
        uint32_t n = d->class_start[end] - d->class_start[c];
        if ((s & ((steps >> c) - 1u)) == 0u) sum += (n + PALP_LANES - 1u) / PALP_LANES * PALP_LANES;
    }
    return sum;
}

static void count_search(cases *c, poked *p, palp_vec3 place) {
    const palp_frame at = palp_frame_at(place);
    palp_impose *i = &p->body.impose;
    features f = {{0}};
    uint64_t before = instructions();
    palp_impose_begin(i, &at);
    uint64_t after = instructions();
    uint32_t narrow_tests = PALP_IMPOSE_NARROW_TESTS * i->max_points - i->narrow_tests;
    set(&f, PALP_WORK_SKIN, p->body.config.tets->meta->skin);
    set(&f, PALP_WORK_SKIN_TOOL, p->body.config.tets->meta->skin);
    set(&f, PALP_WORK_NARROW, narrow_tests);
    set(&f, PALP_WORK_ROOM,
        narrow_tests > i->max_points ? (narrow_tests - i->max_points) * i->max_points : 0u);
    cases_tell_features(c, "impose", 0, &f, after - before);
}

static void count_steps(cases *c, poked *p, uint32_t most_class) {
    palp_dyna *d = &p->body.dyna;
    palp_wrench on_tool;
    uint32_t steps = palp_dyna_steps(d, most_class);
    for (uint32_t s = 0; s < steps; s++) {
        features f = {{0}};
        set(&f, PALP_WORK_ELEMENT, due_in(d, s, steps));
        set(&f, PALP_WORK_NODE_STEP, d->active_count);
        set(&f, PALP_WORK_SOURCE, d->interpolation_terms);
        const float each = p->tool.friction > 0.0f ? PALP_IMPOSE_RUBS : 1.0f;
        set(&f, PALP_WORK_IMPOSED, (uint32_t)(each * (float)p->body.impose.count));
        uint64_t before = instructions();
        palp_dyna_forces(d, s, steps);
        palp_dyna_move(d, steps);
        palp_impose_step(&p->body.impose, s, steps);
        palp_dyna_interpolate(d);
        uint64_t after = instructions();
        cases_tell_features(c, "steps", s == 0u, &f, after - before);
    }
    palp_impose_end(&p->body.impose, &on_tool);
}

static void count_end(cases *c, poked *p, float room) {
    palp_dyna *d = &p->body.dyna;
    palp_adapt *a = &p->body.adapt;
    const palp_tets *t = p->body.config.tets;
    features f = {{0}};
    uint64_t before = instructions();
    (void)palp_energy_watch(&p->body.energy, d, 0.0f, p->body.changed);
    palp_adapt_report r = palp_adapt_tick(a, (palp_adapt_room){room, 300.0f, 3000.0f});
    uint64_t after = instructions();
    p->body.changed = r.splits + r.merges > 0u;
    set(&f, PALP_WORK_NODE_TICK, t->meta->nodes);
    set(&f, PALP_WORK_FAMILY, t->meta->families * (1u + a->config.max_changes));
    set(&f, PALP_WORK_ELEMENT_TEST, a->config.max_element_tests - a->element_tests);
    if (p->body.changed) {
        set(&f, PALP_WORK_LIST_NODE, t->meta->nodes);
        set(&f, PALP_WORK_LIST_TET, t->meta->tets);
        set(&f, PALP_WORK_LIST_SKIN, t->meta->skin);
        set(&f, PALP_WORK_SOURCE, t->mean_offset[t->meta->nodes]);
    }
    cases_tell_features(c, "adapt", p->body.changed, &f, after - before);
}

void cases_of_dyna(cases *c, const palp_tets *tets, uint64_t seed, uint32_t episodes) {
    dice d = {seed};
    size_t used = c->used;
    for (uint32_t e = 0; e < episodes; e++, c->used = used) {
        poked *p = cases_take(c, sizeof *p);
        uint32_t points = 16u << dice_below(&d, 3);
        size_t bytes = palp_dynamic_memsize(tets, points);
        p->tool =
            palp_tool_sphere(tets->meta->diagonal_m *
                             (dice_below(&d, 3) == 0u ? 0.6f : 0.08f + 0.07f * dice_float(&d)));
        p->tool.friction = e % 2u == 1u ? 0.3f : 0.0f;
        palp_dynamic_config config = {.tets = tets,
                                      .material = palp_material_of(4e3f, 0.4f, 1000, 3e-4f, 5),
                                      .adapt = palp_adapt_defaults(tets),
                                      .tools = &p->tool,
                                      .tool_count = 1,
                                      .max_points = points,
                                      .most_class = 5,
                                      .cost = {&palp_target_counted, 1e-6f, 0.0f, 0.8f},
                                      .port = {.now_ns = no_time},
                                      .tick_s = 1e-3f};
        palp_vec3 at = {0};
        const palp_frame begin = PALP_FRAME_IDENTITY;
        config.adapt.max_changes = 1u + dice_below(&d, 12);
        config.adapt.dwell_ticks = dice_below(&d, 30);
        if (palp_dynamic_init(&p->body, &config, &begin, cases_take(c, bytes), bytes, NULL) != PALP_OK)
            return;
        for (uint32_t tick = 0; tick < 120u; tick++) {
            uint32_t node = tets->skin_node[dice_below(&d, tets->meta->skin)];
            if (tick % 16u == 0u) at = palp_vec3_at(tets->rest_m + 3u * node);
            float pace = 0.05f * p->tool.ball[0].radius_m;
            at = palp_madd(at, pace, (palp_vec3){dice_float(&d), dice_float(&d), dice_float(&d)});
            count_search(c, p, at);
            count_steps(c, p, dice_below(&d, 6));
            count_end(c, p, tick % 40u < 30u ? 1e9f : -1e6f);
        }
    }
    c->used = used;
}
