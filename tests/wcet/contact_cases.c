/* SPDX-License-Identifier: MIT */
#include "cases.h"

/* An episode: who touches, with what room, and how it moves. */
typedef struct {
    const palp_blob *blob;
    palp_node_contact_limits limits;
    palp_tool tool[PALP_MAX_TOOLS];
    uint32_t tools;
    float stiffness_N_per_m;
    palp_node_contact contact;
    palp_node_coupling coupling;
    palp_vec3 at[PALP_MAX_TOOLS];
    palp_touch_cost *unit; /* [PALP_WORKS] bounds at unit prices */
    cases *c;
} episode;

typedef float (*bound_of)(const palp_touch_cost *cost, const void *what);

typedef struct {
    uint32_t level, count, active;
    bool begins, due, out, in, solved;
} step;

typedef struct {
    const episode *e;
    bound_of bound;
    const step *what;
} question;

static float answer(const void *context, uint32_t k) {
    const question *q = context;
    return q->bound(&q->e->unit[k], q->what);
}

static void tell(episode *e, const char *name, uint32_t level, bound_of bound, const step *what,
                 uint64_t counted) {
    const question q = {e, bound, what};
    cases_tell(e->c, name, level, answer, &q, counted);
}

static float of_search(const palp_touch_cost *c, const void *what) {
    const step *s = what;
    return palp_cost_search(c, s->level, s->count, s->active);
}
static float of_admit(const palp_touch_cost *c, const void *what) {
    const step *s = what;
    return palp_cost_admit(c, s->level, s->count, s->active);
}
/* What a step of the coupling turned out to be. */
static float of_step(const palp_touch_cost *c, const void *what) {
    const step *s = what;
    float sum = palp_cost_pivot_solve(c, s->active);
    if (s->begins) sum += palp_cost_begin(c, s->count);
    if (s->begins && s->due) sum += palp_cost_refactor(c, s->active);
    if (s->out) sum += palp_cost_pivot_out(c, s->active);
    if (s->in) sum += palp_cost_pivot_in(c, s->count, s->active);
    if (s->solved) sum += palp_cost_couple(c, s->active);
    return sum;
}
static float of_leave(const palp_touch_cost *c, const void *what) {
    const step *s = what;
    return palp_cost_leave(c, s->active);
}
/* ---- tools and paths ---- */

static palp_vec3 anywhere(dice *d) {
    return (palp_vec3){dice_float(d), dice_float(d), dice_float(d)};
}

static palp_vec3 unit_vector(dice *d) {
    palp_vec3 v = anywhere(d);
    float length = palp_norm(v);
    return length > 0.05f ? palp_scale(1.0f / length, v) : (palp_vec3){0.0f, 0.0f, 1.0f};
}

static void choose_tools(episode *e, dice *d, float edge) {
    e->tools = dice_below(d, 4) == 0u ? 2u : 1u;
    uint32_t kind = dice_below(d, 4), balls = kind == 1u ? 2u + dice_below(d, 3) : 1u;
    for (uint32_t t = 0; t < e->tools; t++) {
        float size = edge * (0.8f + 3.5f * (1.0f + dice_float(d)));
        palp_tool tool = palp_tool_sphere(size);
        if (kind == 1u) {
            tool.balls = balls;
            for (uint32_t i = 0; i < balls; i++)
                tool.ball[i] = (palp_ball){palp_scale(0.7f * size, anywhere(d)), size};
        } else if (kind >= 2u) {
            palp_vec3 z = unit_vector(d), x = palp_cross(z, unit_vector(d));
            float length = palp_norm(x);
            x = length > 0.1f ? palp_scale(1.0f / length, x) : (palp_vec3){1.0f, 0.0f, 0.0f};
            if (!(length > 0.1f)) z = (palp_vec3){0.0f, 0.0f, 1.0f};
            tool.balls = 0;
            if (kind == 2u) {
                tool.pad = (palp_pad){.axis = {x, palp_cross(z, x), z},
                                      .half_m = {size, 0.6f * size},
                                      .edge_m = 0.4f * size};
            } else {
                tool.cylinder = (palp_cylinder){
                    .axis = z, .radius_m = size, .half_m = 1.5f * size, .rim_m = 0.3f * size};
            }
        }
        tool.friction = e->limits.friction ? 0.3f : 0.0f;
        e->tool[t] = tool;
    }
}

/* Above or below a random free node of the constraint level, off by about the tool's size. */
static palp_vec3 near_surface(const episode *e, dice *d, uint32_t t, float sunk) {
    const palp_blob *b = e->blob;
    uint32_t slot = dice_below(d, b->domain[PALP_FREE].slots);
    uint32_t node = b->domain[PALP_FREE].node[slot];
    float size = palp_tool_size(&e->tool[t]);
    palp_vec3 x = palp_vec3_at(b->rest_m + 3u * node), n = palp_vec3_at(b->normal + 3u * node);
    float above = e->tool[t].balls > 0u ? 1.0f : 0.0f;
    return palp_madd(x, (above - sunk) * size, n);
}

/* Steady sinking, trembling, jumps, jumps within the body. */
static void move(episode *e, dice *d, uint32_t style, uint32_t tick) {
    for (uint32_t t = 0; t < e->tools; t++) {
        float size = palp_tool_size(&e->tool[t]);
        bool jump = (style == 1u && tick % 8u == 0u) || style == 2u || (tick % 24u == 0u);
        if (jump) e->at[t] = near_surface(e, d, t, 0.6f * (1.0f + dice_float(d)));
        float pace = style == 3u ? 0.4f : 0.06f;
        e->at[t] = palp_madd(e->at[t], pace * size, anywhere(d));
    }
}

/* ---- one tick, step by step ---- */

static void count_search(episode *e, palp_fresh *fresh, uint32_t *found) {
    palp_node_contact *c = &e->contact;
    palp_vec3 around[PALP_MAX_TOOLS];
    step s = {.level = c->level, .count = c->count, .active = c->active_count};
    palp_node_coupling_centers(&e->coupling, c, e->at, around);
    uint64_t before = instructions();
    *found = palp_node_contact_search(c, around, fresh);
    uint64_t after = instructions();
    tell(e, "search", s.level, of_search, &s, after - before);
}

static void count_admissions(episode *e, const palp_fresh *fresh, uint32_t found) {
    palp_node_contact *c = &e->contact;
    for (uint32_t i = 0; i < found; i++) {
        step s = {.level = c->level, .count = c->count, .active = c->active_count};
        uint64_t before = instructions();
        palp_node_contact_admit(c, fresh[i]);
        uint64_t after = instructions();
        tell(e, "admit", s.level, of_admit, &s, after - before);
    }
}

static void count_solves(episode *e) {
    palp_node_contact *c = &e->contact;
    bool more = true;
    while (more) {
        uint32_t solves = e->coupling.solves;
        step s = {.count = c->count,
                  .active = c->active_count,
                  .begins = !e->coupling.solving,
                  .due = c->changes >= PALP_NODE_CONTACT_REFACTOR};
        bool full = c->pivots_now == c->limits.max_pivots && !s.begins;
        uint64_t before = instructions();
        more = palp_node_coupling_step(&e->coupling, c);
        uint64_t after = instructions();
        s.out = c->active_count < s.active;
        s.in = !s.out && !full;
        s.solved = e->coupling.solves > solves;
        tell(e, s.begins ? "begin" : "step", s.out ? 1u : 0u, of_step, &s, after - before);
    }
}

static void one_tick(episode *e, palp_fresh *fresh) {
    palp_node_coupling_result result[PALP_MAX_TOOLS];
    palp_vec3 around[PALP_MAX_TOOLS];
    uint32_t found;
    count_search(e, fresh, &found);
    count_admissions(e, fresh, found);
    palp_node_contact *c = &e->contact;
    step s = {.active = c->active_count};
    uint64_t before = instructions();
    palp_node_coupling_centers(&e->coupling, c, e->at, around);
    palp_node_coupling_begin(&e->coupling, c, e->at);
    uint64_t begun = instructions() - before;
    count_solves(e);
    s.active = c->active_count > s.active ? c->active_count : s.active;
    before = instructions();
    palp_node_coupling_end(&e->coupling, c, 1e-3f, result);
    uint64_t after = instructions();
    tell(e, "leave", 0, of_leave, &s, begun + after - before);
}

/* ---- episodes ---- */

static void price_units(episode *e) {
    for (uint32_t k = 0; k < cases_prices(e->c); k++) {
        palp_prices price = cases_price(e->c, k);
        e->unit[k] = palp_touch_cost_of(e->blob, e->limits, e->tool, e->tools, &price);
    }
}

static palp_node_contact_limits choose_limits(dice *d) {
    static const palp_node_contact_limits some[5] = {{96, 48, 4, 12, false},
                                                     {40, 24, 4, 12, false},
                                                     {160, 80, 6, 16, false},
                                                     {16, 8, 2, 6, false},
                                                     {48, 32, 4, 12, true}};
    return some[dice_below(d, 5)];
}

static void run_episode(cases *c, const palp_blob *blob, uint64_t seed) {
    dice d = {seed};
    size_t used = c->used;
    episode *e = cases_take(c, sizeof *e);
    *e = (episode){.blob = blob, .limits = choose_limits(&d), .c = c};
    palp_fresh *fresh = cases_take(c, e->limits.max_candidates * sizeof *fresh);
    e->unit = cases_take(c, PALP_WORKS * sizeof *e->unit);
    choose_tools(e, &d, blob->meta->mean_edge_m);
    price_units(e);
    size_t bytes = palp_node_contact_memsize(blob, e->limits);
    void *memory = cases_take(c, bytes);
    uint32_t style = dice_below(&d, 4);
    palp_status status = palp_node_contact_init(&e->contact, blob, blob->rest_m, e->tool, e->tools,
                                                e->limits, memory, bytes);
    palp_node_coupling_reset(&e->coupling);
    for (uint32_t t = 0; t < PALP_MAX_TOOLS; t++)
        e->coupling.spring[t].stiffness_N_per_m =
            blob->meta->stiffness_max_N_per_m * (0.02f + 0.2f * (1.0f + dice_float(&d)));
    for (uint32_t tick = 0; tick < 96u && status == PALP_OK; tick++) {
        move(e, &d, style, tick);
        one_tick(e, fresh);
    }
    c->used = used;
}

void cases_of_contact(cases *c, const palp_blob *blob, uint64_t seed, uint32_t episodes) {
    for (uint32_t i = 0; i < episodes; i++)
        run_episode(c, blob, seed * 1000003u + 7919u * (uint64_t)i + 1u);
}
