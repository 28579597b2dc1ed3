/* SPDX-License-Identifier: MIT */
/* Whole ticks: of the answer and of the servo, as they come and at their worst. */
#include "tests/wcet/cases.h"
#include "port/cortexm/test_trajectory.h"

typedef struct {
    path_tick t;
    uint32_t frames;
    bool servo;
} tick_done;

typedef float (*tick_bound)(const palp_contact_cost *cost, const tick_done *d);

static float of_servo(const palp_contact_cost *c, const tick_done *d) {
    return c->price.of[PALP_WORK_SERVO] + (float)d->frames * c->price.of[PALP_WORK_FRAME];
}
static float of_tick(const palp_contact_cost *c, const tick_done *d) {
    return path_bound(c, &d->t) + (d->servo ? of_servo(c, d) : 0.0f);
}
static float of_full(const palp_contact_cost *c, const tick_done *d) {
    float servo = palp_servo_cost_before(&c->price, NULL) + palp_servo_cost_after(&c->price, NULL);
    return palp_answer_cost_full(c, d->t.level) + (d->servo ? servo : 0.0f);
}
static float of_quantum(const palp_contact_cost *c, const tick_done *d) {
    (void)d;
    return c->price.of[PALP_WORK_QUANTUM];
}

typedef struct {
    const palp_blob *blob;
    palp_servo_config config;
    palp_contact_cost *unit;
    palp_servo *servo;
    test_trajectory device;
    cases *c;
    float ns_per_instruction;
    uint64_t worst;
} session;

static uint64_t by_instructions(void *context) {
    const session *s = context;
    return (uint64_t)((float)(instructions() & 0xffffffffu) * s->ns_per_instruction);
}

typedef struct {
    const session *s;
    tick_bound bound;
    const tick_done *d;
} question;

static float answer(const void *context, uint32_t k) {
    const question *q = context;
    return q->bound(&q->s->unit[k], q->d);
}

static void tell(session *s, const char *name, uint32_t level, tick_bound bound, const tick_done *d,
                 uint64_t counted) {
    const question q = {s, bound, d};
    cases_tell(s->c, name, level, answer, &q, counted);
}

static session *open_session(cases *c, const palp_blob *blob, uint32_t level, bool friction,
                             float ball_m) {
    session *s = cases_take(c, sizeof *s);
    *s = (session){.blob = blob,
                   .config = trajectory_config(blob, 1000.0f, ball_m),
                   .c = c,
                   .ns_per_instruction = 1e-6f};
    s->config.finest = level;
    s->config.tool.friction = friction ? 0.3f : 0.0f;
    s->config.cost = (palp_cost_table){&palp_target_counted, 1e-6f, 0.0f, 0.8f};
    s->config.port = (palp_port){by_instructions, s};
    s->unit = cases_take(c, PALP_WORKS * sizeof *s->unit);
    const palp_prices none = {{0}};
    const palp_contact_cost counts = palp_contact_cost_of(blob, &s->config.tool, 1, &none);
    for (uint32_t k = 0; k < cases_prices(c); k++) {
        palp_prices price = cases_price(c, k);
        s->unit[k] = palp_contact_cost_at(&counts, &s->config.tool, &price);
    }
    size_t bytes = palp_servo_memsize(blob, level);
    palp_status status =
        palp_servo_open(&s->servo, blob, &s->config, cases_take(c, bytes), bytes, NULL);
    return status == PALP_OK ? s : NULL;
}

/* One tick of the servo; the more frames, the more of them say the same again. */
static void servo_tick(session *s, const float q[PALP_AXES], uint32_t frames) {
    palp_can_frame in[64], out[PALP_SERVO_FRAMES_OUT];
    palp_report r;
    tick_done d = {.t = {.level = s->config.finest}, .frames = frames, .servo = true};
    for (uint32_t k = 0; k < frames; k += TRAJECTORY_AXES)
        trajectory_speak(&s->device, &s->config.device, q, in + k);
    palp_tick_input input = {.frames = in, .count = frames, .events = 0};
    uint64_t before = instructions();
    uint32_t sent = palp_servo_tick(s->servo, &input, out, &r);
    uint64_t after = instructions();
    trajectory_listen(&s->device, &s->config.device, out, sent);
    if (r.state != PALP_STATE_RUN && r.state != PALP_STATE_DAMPING) {
        tell(s, "servo", 0, of_servo, &d, after - before);
    } else if (after - before > s->worst) {
        s->worst = after - before;
        tell(s, "session", s->config.finest, of_full, &d, after - before);
    }
    s->config.port.now_ns(s);
}

static void servo_session(cases *c, const palp_blob *blob, dice *d, uint32_t level,
                          uint32_t ticks) {
    size_t used = c->used;
    const float edge = blob->meta->mean_edge_m;
    session *s = open_session(c, blob, level, dice_below(d, 2) == 0u,
                              edge * (0.6f + 2.7f * (1.0f + dice_float(d))));
    float q[PALP_AXES], depth = 0.1f + 0.05f * dice_float(d);
    uint32_t phase = dice_below(d, 100000), style = dice_below(d, 3);
    for (uint32_t i = 0; i < ticks && s != NULL; i++) {
        trajectory_path(phase + (style == 0u ? 0u : i), i < 300u ? 0.0f : depth, q);
        uint32_t frames = i < 200u ? 3u : style == 2u ? 3u : 3u + 3u * dice_below(d, 21);
        servo_tick(s, q, frames > 63u ? 63u : frames);
    }
    c->used = used;
}

/* ---- the answer alone, along searched paths ---- */

/* What is known of the level, and of the path under way. */
typedef struct {
    session *s;
    palp_contact_cost *unit;
    uint64_t known, worst;
} chase;

static void told(void *context, const path_tick *tick) {
    chase *h = context;
    const tick_done d = {.t = *tick};
    if (tick->cost > h->worst) h->worst = tick->cost;
    tell(h->s, "tick", tick->level, of_tick, &d, tick->cost);
    if (tick->cost <= h->known && h->s->c->price == NULL) return;
    h->known = tick->cost;
    tell(h->s, "whole", tick->level, of_full, &d, tick->cost);
}

static uint64_t instruction_clock(void *context) {
    (void)context;
    return instructions();
}

static void search_on_level(cases *c, const palp_blob *blob, dice *d, uint32_t level, bool friction,
                            uint32_t sessions) {
    size_t used = c->used;
    chase chased = {.known = 0};
    chased.s = open_session(c, blob, level, friction, 6.5f * blob->meta->mean_edge_m);
    search *h = cases_take(c, sizeof *h);
    *h = (search){.blob = blob,
                  .level = level,
                  .friction = friction,
                  .port = {.now_ns = instruction_clock},
                  .bytes = palp_answer_memsize(
                      &(palp_contact_config){.blob = blob, .tool_count = 1, .finest = level}),
                  .told = told,
                  .context = &chased};
    h->memory = cases_take(c, h->bytes);
    tool_path best = path_random(d);
    uint64_t most = 0;
    for (uint32_t i = 0; i < sessions && chased.s != NULL; i++) {
        tool_path p = i % 3u == 0u ? path_random(d) : path_mutated(best, d);
        chased.worst = 0;
        if (!path_run(h, &p, 40)) break;
        if (chased.worst <= most) continue;
        most = chased.worst;
        best = p;
    }
    c->used = used;
}

/* What palp_answer_tick does between two steps. */
static void quantum_cases(cases *c, const palp_blob *blob) {
    size_t used = c->used;
    session *s = open_session(c, blob, 0, false, blob->meta->mean_edge_m);
    const tick_done d = {.frames = 0};
    const palp_contact_level l = palp_contact_level_of(0, blob->regular.modes);
    volatile float sum = 0.0f;
    for (uint32_t i = 0; i < 16u && s != NULL; i++) {
        uint64_t before = instructions();
        sum += palp_contact_cost_iterate(&s->unit[0], 40u + i, 20u, 1) +
               palp_contact_cost_finish(&s->unit[0], l, 40u, 20u) + (float)by_instructions(s);
        uint64_t after = instructions();
        tell(s, "quantum", 0, of_quantum, &d, after - before);
    }
    c->used = used;
}

void cases_of_ticks(cases *c, const palp_blob *blob, uint64_t seed, uint32_t episodes) {
    dice d = {seed};
    quantum_cases(c, blob);
    for (uint32_t l = 0; l <= PALP_CONTACT_FINEST; l++)
        search_on_level(c, blob, &d, l, l % 2u == 0u, episodes / 3u + 1u);
    for (uint32_t i = 0; i < episodes; i += 8u)
        servo_session(c, blob, &d, i / 8u % (PALP_CONTACT_FINEST + 1u), 600);
}
