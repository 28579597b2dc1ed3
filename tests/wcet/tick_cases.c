/* SPDX-License-Identifier: MIT */
/* Whole ticks: of the bounded answer and of the servo, as they come and at their worst. */
#include "cases.h"
#include "sim/orbit.h"

/* What was done in a tick, as its report and the contact tell afterwards. */
typedef struct {
    palp_rung rung;
    uint32_t count_before, active_before, count, active, admitted, solves, pivots, frames;
    bool due, servo, spoke;
} tick_done;

typedef float (*tick_bound)(const palp_touch_cost *cost, const tick_done *d);

static uint32_t most(uint32_t a, uint32_t b) { return a > b ? a : b; }

/* The sum of its steps, each with the most candidates and contacts that there were. */
static float of_tick(const palp_touch_cost *c, const tick_done *d) {
    const palp_prices *p = &c->price;
    uint32_t k = most(d->count_before, d->count), n = most(d->active_before, d->active);
    float quanta = (float)(d->pivots + d->admitted + 1u);
    float sum = p->of[PALP_WORK_TICK] + quanta * p->of[PALP_WORK_QUANTUM] +
                palp_cost_search(c, d->rung, d->count_before, d->active_before) +
                (float)d->admitted * palp_cost_admit(c, d->rung, k, n) +
                (float)d->solves * (palp_cost_begin(c, k) + palp_cost_couple(c, n)) +
                (float)d->pivots * palp_cost_pivot(c, k, n) + palp_cost_leave(c, n);
    if (d->due) sum += palp_cost_refactor(c, n);
    if (d->servo) sum += p->of[PALP_WORK_SERVO] + (float)d->frames * p->of[PALP_WORK_FRAME];
    return sum;
}
static float of_servo(const palp_touch_cost *c, const tick_done *d) {
    return c->price.of[PALP_WORK_SERVO] + (float)d->frames * c->price.of[PALP_WORK_FRAME];
}
static float of_limits(const palp_touch_cost *c, const tick_done *d) {
    return palp_cost_full(c, d->rung);
}
static float of_quantum(const palp_touch_cost *c, const tick_done *d) {
    (void)d;
    return c->price.of[PALP_WORK_QUANTUM];
}

typedef struct {
    const palp_blob *blob;
    palp_servo_config config;
    palp_touch_cost *unit;
    palp_servo *servo;
    orbit device;
    cases *c;
    float ns_per_instruction;
    uint64_t worst;
} session;

static uint64_t by_instructions(void *context) {
    const session *s = context;
    return (uint64_t)((float)(instructions() & 0xffffffffu) * s->ns_per_instruction);
}

static void tell(session *s, const char *name, uint32_t level, tick_bound bound, const tick_done *d,
                 uint64_t counted) {
    features f;
    for (uint32_t k = 0; k < PALP_WORKS; k++) f.count[k] = bound(&s->unit[k], d);
    s->c->sink(name, level, &f, counted);
}

static session *open_session(cases *c, const palp_blob *blob, palp_contact_limits limits,
                             float ball_m) {
    session *s = cases_take(c, sizeof *s);
    *s = (session){.blob = blob,
                   .config = orbit_config(blob, 1000.0f, ball_m),
                   .c = c,
                   .ns_per_instruction = 1e-6f};
    s->config.limits = limits;
    s->config.tool.friction = limits.friction ? 0.3f : 0.0f;
    s->config.cost = (palp_cost_table){&palp_target_counted, 1e-6f, 0.0f, 0.8f};
    s->config.port = (palp_port){by_instructions, s};
    s->unit = cases_take(c, PALP_WORKS * sizeof *s->unit);
    for (uint32_t k = 0; k < PALP_WORKS; k++) {
        palp_prices one = {{0}};
        one.of[k] = 1.0f;
        s->unit[k] = palp_touch_cost_of(blob, limits, &s->config.tool, 1, &one);
    }
    size_t bytes = palp_servo_memsize(blob, limits);
    palp_status status =
        palp_servo_open(&s->servo, blob, &s->config, cases_take(c, bytes), bytes, NULL);
    return status == PALP_OK ? s : NULL;
}

/* One tick of the servo; the more frames, the more of them say the same again. */
static void servo_tick(session *s, const float q[PALP_AXES], uint32_t frames) {
    palp_can_frame in[64], out[PALP_SERVO_FRAMES_OUT];
    palp_report r;
    uint32_t level = s->blob->meta->constraint_level;
    tick_done d = {.rung = {level, level}, .frames = frames, .servo = true};
    for (uint32_t k = 0; k < frames; k += PALP_AXES)
        orbit_speak(&s->device, &s->config.device, q, in + k);
    palp_tick_input input = {.frames = in, .count = frames, .events = 0};
    uint64_t before = instructions();
    uint32_t sent = palp_servo_tick(s->servo, &input, out, &r);
    uint64_t after = instructions();
    orbit_listen(&s->device, &s->config.device, out, sent);
    if (r.state != PALP_STATE_RUN && r.state != PALP_STATE_DAMPING) {
        tell(s, "servo", 0, of_servo, &d, after - before);
    } else {
        if (after - before > s->worst) {
            s->worst = after - before;
            tell(s, "session", level, of_limits, &d, after - before);
        }
        if (r.pivots > 1u || r.candidates > 0u) return;
        d.solves = d.pivots = 1;
        tell(s, "tick", level, of_tick, &d, after - before);
    }
    s->config.port.now_ns(s);
}

static void servo_session(cases *c, const palp_blob *blob, dice *d, palp_contact_limits limits,
                          uint32_t ticks) {
    size_t used = c->used;
    float edge = blob->meta->mean_edge_m;
    session *s = open_session(c, blob, limits, edge * (1.0f + 2.5f * (1.0f + dice_float(d))));
    float q[PALP_AXES], depth = 0.1f + 0.05f * dice_float(d);
    uint32_t phase = dice_below(d, 100000), style = dice_below(d, 3);
    for (uint32_t i = 0; i < ticks && s != NULL; i++) {
        orbit_path(phase + (style == 0u ? 0u : i), i < 300u ? 0.0f : depth, q);
        uint32_t frames = i < 200u ? 3u : style == 2u ? 3u : 3u + 3u * dice_below(d, 21);
        servo_tick(s, q, frames > 63u ? 63u : frames);
    }
    c->used = used;
}

/* ---- the bounded answer alone, hunted ---- */

typedef struct {
    palp_bounded bounded;
    palp_tool tool;
} answerer;

/* How a ball of `radius` mean edges moves: it dwells at a node for some ticks, sunk by a share of
 * its radius that changes by `swing`, trembles, and goes to another node, near or far. */
typedef struct {
    uint32_t limits, dwell;
    float radius, stiffness, sunk, swing, tremble, far;
    uint64_t seed;
} path;

static const palp_contact_limits rooms[4] = {
    {96, 48, 4, 12, false}, {40, 24, 4, 12, false}, {16, 8, 2, 6, false}, {48, 32, 4, 12, true}};

static path random_path(dice *d) {
    return (path){.limits = dice_below(d, 4),
                  .dwell = 1u + dice_below(d, 60),
                  .radius = 7.0f + 6.0f * dice_float(d),
                  .stiffness = 0.6f + 0.5f * dice_float(d),
                  .sunk = 0.5f + 0.4f * dice_float(d),
                  .swing = 0.3f + 0.3f * dice_float(d),
                  .tremble = 0.5f + 0.5f * dice_float(d),
                  .far = 0.5f + 0.5f * dice_float(d),
                  .seed = dice_roll(d)};
}

/* One that did much, changed a little. */
static path mutated(path p, dice *d) {
    float *value[6] = {&p.radius, &p.stiffness, &p.sunk, &p.swing, &p.tremble, &p.far};
    for (uint32_t i = 0; i < 6u; i++) *value[i] *= 1.0f + 0.3f * dice_float(d) * dice_float(d);
    if (dice_below(d, 3) == 0u) p.dwell = 1u + (p.dwell + dice_below(d, 9)) % 60u;
    if (dice_below(d, 2) == 0u) p.seed = dice_roll(d);
    p.sunk = palp_min(p.sunk, 1.2f);
    return p;
}

static palp_vec3 follow_path(const path *p, const palp_blob *b, dice *d, uint32_t tick,
                             uint32_t *node, float radius_m) {
    if (tick % p->dwell == 0u) {
        uint32_t first = b->ring_offset[*node], ring = b->ring_offset[*node + 1u] - first;
        bool far = 0.5f * (1.0f + dice_float(d)) < p->far || ring == 0u;
        *node = far ? b->domain[PALP_FREE].node[dice_below(d, b->domain[PALP_FREE].slots)]
                    : b->ring[first + dice_below(d, ring)];
    }
    float sunk = p->sunk + p->swing * dice_float(d);
    palp_vec3 at = palp_madd(palp_vec3_at(b->rest_m + 3u * *node), (1.0f - sunk) * radius_m,
                             palp_vec3_at(b->normal + 3u * *node));
    return palp_madd(at, p->tremble * b->meta->mean_edge_m,
                     (palp_vec3){dice_float(d), dice_float(d), dice_float(d)});
}

/* The limits of a tick alone, without the servo around it. */
static float of_answer_limits(const palp_touch_cost *c, const tick_done *d) {
    const palp_prices *p = &c->price;
    return palp_cost_full(c, d->rung) - p->of[PALP_WORK_SERVO] * 1.5f -
           64.0f * p->of[PALP_WORK_FRAME];
}

/* Returns the most that a tick on the finest rung took, and tells of what is more than is known of
 * each rung. */
static uint64_t bounded_session(cases *c, const palp_blob *blob, const path *p, uint32_t ticks,
                                uint64_t known[2u * PALP_MAX_LEVELS]) {
    const palp_contact_limits limits = rooms[p->limits];
    size_t used = c->used, bytes = palp_bounded_memsize(blob, limits);
    float edge = blob->meta->mean_edge_m;
    dice d = {p->seed};
    session *s = open_session(c, blob, limits, p->radius * edge);
    answerer *a = cases_take(c, sizeof *a);
    uint64_t worst[2u * PALP_MAX_LEVELS] = {0}; /* by rung */
    tick_done worst_of[2u * PALP_MAX_LEVELS];
    a->tool = palp_tool_sphere(p->radius * edge);
    a->tool.friction = limits.friction ? 0.3f : 0.0f;
    palp_bounded_config config = {.blob = blob,
                                  .tools = &a->tool,
                                  .tool_count = 1,
                                  .limits = limits,
                                  .cost = {&palp_target_counted, 1e-6f, 0.0f, 0.8f},
                                  .port = {by_instructions, s},
                                  .dt_s = 1e-3f};
    if (palp_bounded_init(&a->bounded, &config, cases_take(c, bytes), bytes, NULL) != PALP_OK)
        return 0;
    a->bounded.coupling.spring[0].stiffness_N_per_m =
        blob->meta->stiffness_max_N_per_m * p->stiffness;
    uint32_t node = blob->domain[PALP_FREE].node[0];
    for (uint32_t i = 0; i < ticks; i++) {
        palp_vec3 at = follow_path(p, blob, &d, i, &node, a->tool.ball[0].radius_m);
        const palp_contact *k = palp_ladder_contact(&a->bounded.ladder);
        tick_done done = {.rung = a->bounded.ladder.at[a->bounded.ladder.rung],
                          .count_before = k->count,
                          .active_before = k->active_count,
                          .due = k->changes + PALP_COUPLING_PIVOTS * limits.max_pivots >=
                                 PALP_CONTACT_REFACTOR};
        palp_coupling_result result;
        palp_bounded_report r;
        uint64_t before = instructions();
        palp_bounded_tick(&a->bounded, by_instructions(s), &at, &result, &r);
        uint64_t after = instructions();
        uint32_t level = 2u * done.rung.level + (done.rung.outer < done.rung.level);
        if (r.aborted > 0u) continue;
        k = palp_ladder_contact(&a->bounded.ladder);
        done.count = k->count;
        done.active = most(k->active_count, done.active_before) + 2u;
        if (done.active > limits.max_active) done.active = limits.max_active;
        done.admitted = r.admitted;
        done.pivots = r.pivots;
        done.solves = a->bounded.coupling.solves;
        tell(s, "answer", 100u * p->limits + level, of_tick, &done, after - before);
        if (after - before > worst[level]) {
            worst[level] = after - before;
            worst_of[level] = done;
        }
        if (r.pivots <= 1u && r.candidates == 0u)
            tell(s, "tick", level, of_tick, &done, after - before);
        palp_bounded_spare(&a->bounded);
    }
    for (uint32_t l = 0; l < 2u * PALP_MAX_LEVELS; l++) {
        if (worst[l] > known[l])
            tell(s, "whole", 100u * p->limits + l, of_answer_limits, &worst_of[l], worst[l]);
        known[l] = worst[l] > known[l] ? worst[l] : known[l];
    }
    c->used = used;
    return worst[2u * blob->meta->constraint_level];
}

static void hunt(cases *c, const palp_blob *blob, dice *d, uint32_t sessions) {
    path best[4];
    uint64_t most_counted[4] = {0}, known[4][2u * PALP_MAX_LEVELS] = {{0}};
    for (uint32_t i = 0; i < sessions; i++) {
        path p = random_path(d);
        if (i % 3u != 0u && most_counted[p.limits] > 0u) p = mutated(best[p.limits], d);
        uint64_t counted = bounded_session(c, blob, &p, 200, known[p.limits]);
        if (counted <= most_counted[p.limits]) continue;
        most_counted[p.limits] = counted;
        best[p.limits] = p;
    }
}

/* What palp_bounded_tick does between two steps. */
static void quantum_cases(cases *c, const palp_blob *blob) {
    size_t used = c->used;
    session *s = open_session(c, blob, PALP_CONTACT_DEFAULTS, blob->meta->mean_edge_m);
    const tick_done d = {.pivots = 0};
    volatile float sum = 0.0f;
    for (uint32_t i = 0; i < 16u && s != NULL; i++) {
        uint64_t before = instructions();
        sum += palp_cost_pivot(&s->unit[0], 40u + i, 20u) + palp_cost_couple(&s->unit[0], 21u) +
               palp_cost_begin(&s->unit[0], 40u) + palp_cost_refactor(&s->unit[0], 20u) +
               palp_cost_admit(&s->unit[0], (palp_rung){0, 0}, 40u, 20u) +
               (float)by_instructions(s);
        uint64_t after = instructions();
        tell(s, "quantum", 0, of_quantum, &d, after - before);
    }
    c->used = used;
}

void cases_of_ticks(cases *c, const palp_blob *blob, uint64_t seed, uint32_t episodes) {
    dice d = {seed};
    quantum_cases(c, blob);
    hunt(c, blob, &d, 2u * episodes);
    for (uint32_t i = 0; i < episodes; i += 4u)
        servo_session(c, blob, &d, rooms[i / 4u % 4u], 1500);
}
