/* SPDX-License-Identifier: MIT */
#include "core/servo/answer.h"

#define NS_PER_S 1e9f
#define UNKNOWN 0.05f   /* error of a level that bake has not measured */
#define MISSES 8u       /* ticks in a row */
#define CALM_LATEST 64u /* times PALP_ANSWER_CALM_S */

#define PRICE(cost, kind) ((cost)->price.of[PALP_WORK_##kind])

float palp_answer_cost_around(const palp_contact_cost *cost) {
    const palp_contact_cost *c = cost;
    return PRICE(c, TICK) + PRICE(c, QUANTUM) +
           c->tools *
               (PRICE(c, COUPLE) + PRICE(c, LEAVE) + (float)PALP_COUPLING_LOOKS * PRICE(c, SOUGHT));
}

/* Solving and ending with so many iterations, at the most points that the level allows. */
static float solve_cost(const palp_contact_cost *c, palp_contact_level l, uint32_t iterations) {
    return palp_contact_cost_points(c, l, l.points) + palp_contact_cost_assemble(c, l, l.points) +
           (float)iterations * palp_contact_cost_iterate(c, l.points, l.contacts) +
           palp_contact_cost_finish(c, l, l.points, l.contacts);
}

float palp_answer_cost_full(const palp_contact_cost *cost, uint32_t level) {
    const palp_contact_level l = palp_contact_level_of(level, cost->modes);
    return palp_answer_cost_around(cost) + solve_cost(cost, l, PALP_CONTACT_ITERATIONS) +
           cost->tools * (float)PALP_LATTICE_FILLINGS *
               (palp_contact_cost_fill(cost, l) + PRICE(cost, QUANTUM));
}

float palp_answer_cost_least(const palp_contact_cost *cost, uint32_t level) {
    const palp_contact_level l = palp_contact_level_of(level, cost->modes);
    return palp_answer_cost_around(cost) + solve_cost(cost, l, PALP_ANSWER_ITERATIONS) +
           cost->tools * palp_contact_cost_fill(cost, l);
}

size_t palp_answer_memsize(const palp_blob *blob, uint32_t tool_count, uint32_t finest) {
    return palp_contact_memsize(blob, tool_count, finest);
}

palp_status palp_answer_init(palp_answer *answer, const palp_answer_config *config, void *memory,
                             size_t bytes, float *bound_ns) {
    palp_answer *a = answer;
    bool sound = config->dt_s > 0.0f && palp_cost_table_is_sound(&config->cost) &&
                 config->port.now_ns != NULL &&
                 config->cost.target->instructions.of[PALP_WORK_COMPLIANCE] > 0.0f;
    if (!sound) return PALP_ERR_ARGUMENT;
    *a = (palp_answer){.config = *config, .calm_wanted = 1};
    palp_status status = palp_contact_init(&a->contact, config->blob, config->tools,
                                           config->tool_count, config->finest, memory, bytes);
    if (status != PALP_OK) return status;
    const palp_prices ns = palp_prices_of(&config->cost);
    a->bound = palp_contact_cost_of(config->blob, config->tools, config->tool_count, &ns);
    a->tail_ns = palp_answer_cost_around(&a->bound) + config->after_ns;
    for (uint32_t l = 0; l < PALP_CONTACT_LEVELS; l++)
        a->least_ns[l] =
            palp_answer_cost_least(&a->bound, l) + config->before_ns + config->after_ns;
    float room = config->cost.margin * NS_PER_S * config->dt_s;
    if (bound_ns != NULL) *bound_ns = a->least_ns[0];
    if (a->least_ns[0] > room) return PALP_ERR_BUDGET;
    for (uint32_t l = 0; l <= config->finest; l++) {
        if (a->least_ns[l] <= room) a->limit = l;
    }
    a->contact.now = a->limit;
    palp_coupling_reset(&a->coupling);
    return PALP_OK;
}

void palp_answer_reset(palp_answer *answer) {
    palp_answer *a = answer;
    palp_contact_clear(&a->contact);
    palp_coupling_reset(&a->coupling);
    a->contact.now = a->limit;
    a->held_in_a_row = a->calm = a->missed = 0;
    a->calm_wanted = 1;
}

/* ---- time ---- */

/* Time left for anything but the end of the tick. */
static float left_ns(const palp_answer *a) {
    const palp_port *port = &a->config.port;
    float spent_ns = (float)(port->now_ns(port->context) - a->start_ns);
    return a->config.cost.margin * NS_PER_S * a->config.dt_s - a->tail_ns - spent_ns;
}

static uint32_t ticks_of(const palp_answer *a, float seconds) {
    return (uint32_t)(seconds / a->config.dt_s) + 1u;
}

static void change_level(palp_answer *a, uint32_t level) {
    a->contact.now = level;
    a->coupling.settling = PALP_COUPLING_SETTLING;
    a->held_in_a_row = a->calm = 0;
}

/* Whether the level has to give way, or may come back. */
static void choose_level(palp_answer *a) {
    uint32_t now = a->contact.now;
    if (a->held_in_a_row >= ticks_of(a, PALP_ANSWER_PATIENCE_S)) {
        a->held_in_a_row = 0;
        if (now == 0u) return;
        if (a->calm_wanted < CALM_LATEST) a->calm_wanted *= 2u;
        a->coarsened++;
        change_level(a, now - 1u);
    } else if (now < a->limit && a->calm >= a->calm_wanted * ticks_of(a, PALP_ANSWER_CALM_S)) {
        a->refined++;
        change_level(a, now + 1u);
    } else if (now == a->limit && a->calm >= 8u * ticks_of(a, PALP_ANSWER_CALM_S)) {
        a->calm_wanted = 1u;
    }
}

/* ---- the tick ---- */

/* A contact that presses and is not found is looked for again in the next ticks before it is let
 * go; meanwhile the tool goes on as foreseen, which lets go by itself when the device draws back.
 */
static bool bridges(palp_answer *a) {
    bool pressing = false;
    for (uint32_t t = 0; t < a->config.tool_count; t++)
        pressing = pressing || (a->coupling.tool[t].touching && a->contact.normal_N[t] > 0.0f);
    return pressing && a->missed++ < MISSES;
}

/* Bound of one more iteration and the end of the contact, as many points as there are. */
static float iteration_ns(const palp_answer *a) {
    const palp_contact *c = &a->contact;
    uint32_t active = c->count < c->level.contacts ? c->count : c->level.contacts;
    return palp_contact_cost_iterate(&a->bound, c->count, active) +
           palp_contact_cost_finish(&a->bound, c->level, c->count, active);
}

/* Bound of the rows of the matrix that are missing, an iteration and the end. */
static float rows_ns(const palp_answer *a) {
    const palp_contact *c = &a->contact;
    return palp_contact_cost_assemble(&a->bound, c->level, c->count) -
           palp_contact_cost_assemble(&a->bound, c->level, c->row) + iteration_ns(a);
}

/* Points and the matrix between them; false when time has run out meanwhile, or a contact that was
 * there is missed. */
static bool prepare(palp_answer *a, palp_answer_report *r) {
    palp_contact *c = &a->contact;
    const palp_contact_level l = palp_contact_level_of(c->now, a->bound.modes);
    const float rest = solve_cost(&a->bound, l, PALP_ANSWER_ITERATIONS);
    const float filling = palp_contact_cost_fill(&a->bound, l);
    palp_vec3 tool_m[PALP_CONTACT_TOOLS];
    palp_contact_spring spring[PALP_CONTACT_TOOLS];
    palp_coupling_springs(&a->coupling, c, tool_m, spring);
    palp_contact_begin(c, tool_m, spring);
    bool more = true;
    /* at most tools times PALP_LATTICE_FILLINGS */
    while (more) {
        more = palp_contact_fill(c);
        bool optional = more && palp_contact_may_skip(c);
        float tools_left = a->bound.tools - (float)c->filling;
        if (more && tools_left * filling + rest > left_ns(a)) {
            r->shortened = true;
            if (!optional) return false;
            palp_contact_skip(c);
            more = c->filling < c->tool_count;
        }
    }
    if (c->count == 0u) return !bridges(a);
    if (palp_contact_cost_points(&a->bound, l, c->count) + rows_ns(a) > left_ns(a)) {
        r->shortened = true;
        return false;
    }
    palp_contact_points(c);
    bool rows = true;
    /* at most room / PALP_CONTACT_ROWS */
    while (rows) {
        if (rows_ns(a) > left_ns(a)) {
            r->shortened = true;
            return false;
        }
        rows = palp_contact_assemble(c);
    }
    return true;
}

/* False when time or iterations have run out. */
static bool solve(palp_answer *a, palp_answer_report *r) {
    palp_contact *c = &a->contact;
    bool more = c->count > 0u;
    /* at most PALP_CONTACT_ITERATIONS */
    while (more) {
        if (iteration_ns(a) > left_ns(a)) {
            r->shortened = true;
            if (c->iterations == 0u) return false;
            break;
        }
        more = palp_contact_iterate(c);
    }
    if ((c->flags & PALP_CONTACT_SPENT) != 0u) return false; /* no solution to go by */
    if (palp_contact_cost_finish(&a->bound, c->level, c->count, c->active_count) > left_ns(a))
        return false;
    palp_contact_finish(c);
    return true;
}

/* See answer.h. */
static float doubt(palp_answer *a, const palp_coupling_result *result, bool held) {
    const palp_regular *body = &a->config.blob->regular;
    const float share =
        body->level_error != NULL ? body->level_error[2u * a->contact.now + 1u] : UNKNOWN;
    float most = 0.0f;
    for (uint32_t t = 0; t < a->config.tool_count; t++) {
        if (!held) a->solved_N[t] = result[t].force_N;
        float changed = palp_norm(palp_sub(result[t].force_N, a->solved_N[t]));
        most = palp_max(most, share * palp_norm(result[t].force_N) + 0.5f * changed);
    }
    return most;
}

void palp_answer_tick(palp_answer *answer, uint64_t start_ns, const palp_vec3 *device_m,
                      palp_coupling_result *result, palp_answer_report *report) {
    palp_answer *a = answer;
    palp_contact *c = &a->contact;
    palp_answer_report r = {.flags = 0};
    a->start_ns = start_ns;
    choose_level(a);
    const bool placed = palp_coupling_begin(&a->coupling, c, device_m);
    bool fits = a->least_ns[c->now] - a->config.before_ns - a->tail_ns <= left_ns(a);
    if (placed && fits && prepare(a, &r) && solve(a, &r)) {
        palp_coupling_take(&a->coupling, c, a->config.dt_s, result);
        if (c->count > 0u) a->missed = 0;
        a->held_in_a_row = 0;
        a->calm++;
    } else {
        palp_coupling_hold(&a->coupling, c, a->config.dt_s, result);
        a->held++;
        if (!fits || r.shortened) { /* for want of time */
            a->held_in_a_row++;
            a->calm = 0;
        }
        r.held = true;
    }
    r.doubt_N = doubt(a, result, r.held);
    r.level = c->now;
    r.flags = c->flags;
    r.points = c->count;
    r.active = c->active_count;
    r.iterations = c->iterations;
    *report = r;
}
