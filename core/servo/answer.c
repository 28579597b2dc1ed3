/* SPDX-License-Identifier: MIT */
#include "core/servo/answer.h"
#include "core/base/apart.h"

#define NS_PER_S 1e9f
#define UNKNOWN 0.05f   /* error of a level that bake has not measured */
#define SEAMS_WANTED 2u /* level of the seams that comes before finer levels of contact */
#define CALM_LATEST 64u /* times PALP_ANSWER_CALM_S */

#define PRICE(cost, kind) ((cost)->price.of[PALP_WORK_##kind])

float palp_answer_cost_around(const palp_contact_cost *c) {
    return PRICE(c, TICK) + PRICE(c, QUANTUM) +
           c->tools * (PRICE(c, COUPLE) + PRICE(c, LEAVE) +
                       (float)PALP_COUPLING_SEARCHED * PRICE(c, SOUGHT)) +
           c->samples * PRICE(c, SOUGHT);
}

/* Solving and ending with so many iterations, at the most points that the level allows. */
static float solve_cost(const palp_contact_cost *c, palp_contact_level l, uint32_t iterations) {
    return palp_contact_cost_points(c, l, l.points) + palp_contact_cost_assemble(c, l, l.points) +
           palp_contact_cost_iterate(c, l.points, l.contacts, iterations) +
           palp_contact_cost_finish(c, l, l.points, l.contacts);
}

/* A filling for each tool, and for so many pairs of zones. */
static float fill_all(const palp_contact_cost *c, palp_contact_level l, float pairs) {
    float sum = 0.0f;
    const uint32_t tools = (uint32_t)c->tools;
    for (uint32_t t = 0; t < tools; t++) sum += palp_contact_cost_fill_by(c, l, t);
    if (pairs > 0.0f) sum += pairs * palp_contact_cost_fill_by(c, l, PALP_CONTACT_TOOLS);
    return sum;
}

float palp_answer_cost_full(const palp_contact_cost *cost, uint32_t level) {
    const palp_contact_level l = palp_contact_cost_level(cost, level);
    return palp_answer_cost_around(cost) + solve_cost(cost, l, PALP_CONTACT_ITERATIONS) +
           palp_contact_cost_patches(cost) +
           (float)PALP_LATTICE_FILLINGS * (fill_all(cost, l, cost->patches - cost->tools) +
                                           cost->patches * PRICE(cost, QUANTUM));
}

float palp_answer_cost_least(const palp_contact_cost *cost, uint32_t level) {
    const palp_contact_level l = palp_contact_cost_level(cost, level);
    return palp_answer_cost_around(cost) + solve_cost(cost, l, PALP_ANSWER_ITERATIONS) +
           palp_contact_cost_patches(cost) + fill_all(cost, l, cost->pairs) +
           (cost->tools + cost->pairs) * PRICE(cost, QUANTUM);
}

size_t palp_answer_memsize(const palp_contact_config *contact) {
    return palp_contact_memsize(contact);
}

static float share_ns(const palp_answer *a) {
    return a->config.cost.margin * NS_PER_S * a->config.dt_s;
}

/* Takes the costs of the contact on a level of the seams. */
static void on_seams(palp_answer *a, const palp_seam_cost *cost) {
    a->bound.unknowns = cost->unknowns;
    a->bound.solve = cost->solve;
    a->bound.forward = cost->forward;
}

static void find_bounds(palp_answer *a) {
    const palp_answer_config *c = &a->config;
    const palp_prices ns = palp_prices_of(&c->cost);
    float moving_ns = 0.0f;
    if (c->contact.assembly == NULL) {
        a->bound =
            palp_contact_cost_of(c->contact.blob, c->contact.tools, c->contact.tool_count, &ns);
    } else {
        a->bound = palp_contact_cost_of_zones(c->contact.assembly, c->contact.pairs,
                                              c->contact.tools, c->contact.tool_count, &ns);
        palp_moving_init(&a->moving, &a->contact, &ns, c->dt_s, share_ns(a),
                         palp_contact_cost_level(&a->bound, c->contact.finest).contacts);
        moving_ns = palp_moving_least(&a->moving);
        on_seams(a, &a->moving.seam_cost[PALP_SEAM_LEVELS]);
    }
    a->bound.finest = c->contact.finest;
    a->tail_ns = palp_answer_cost_around(&a->bound) + c->after_ns;
    for (uint32_t l = 0; l < PALP_CONTACT_LEVELS; l++)
        a->least_ns[l] =
            palp_answer_cost_least(&a->bound, l) + moving_ns + c->before_ns + c->after_ns;
}

/* What an answer on level l takes more with seams that serve well, instead of approximate ones: a
 * finer level of contact is not worth their loss. */
static float seams_ns(palp_answer *a, uint32_t l) {
    if (a->config.contact.assembly == NULL) return 0.0f;
    const uint32_t finest = a->config.contact.assembly->seams.finest;
    const uint32_t wanted = finest < SEAMS_WANTED ? finest : SEAMS_WANTED;
    float least = palp_moving_least(&a->moving) + palp_answer_cost_least(&a->bound, l);
    on_seams(a, &a->moving.seam_cost[wanted]);
    float more = palp_moving_cost_of(&a->moving, wanted) + palp_answer_cost_least(&a->bound, l);
    on_seams(a, &a->moving.seam_cost[PALP_SEAM_LEVELS]);
    return more - least;
}

palp_status palp_answer_init(palp_answer *a, const palp_answer_config *config, void *memory,
                             size_t bytes, float *bound_ns) {
    bool sound = config->dt_s > 0.0f && palp_cost_table_is_sound(&config->cost) &&
                 config->port.now_ns != NULL &&
                 config->cost.target->instructions.of[PALP_WORK_COMPLIANCE] > 0.0f;
    if (!sound) return PALP_ERR_ARGUMENT;
    *a = (palp_answer){.config = *config, .calm_wanted = 1};
    palp_status status = palp_contact_init(&a->contact, &config->contact, memory, bytes);
    if (status != PALP_OK) return status;
    find_bounds(a);
    if (bound_ns != NULL) *bound_ns = a->least_ns[0];
    if (a->least_ns[0] > share_ns(a)) return PALP_ERR_BUDGET;
    for (uint32_t l = 1; l <= config->contact.finest; l++) {
        if (a->least_ns[l] + seams_ns(a, l) <= share_ns(a)) a->limit = l;
    }
    a->contact.now = a->limit;
    palp_coupling_reset(&a->coupling);
    return PALP_OK;
}

void palp_answer_reset(palp_answer *a) {
    palp_contact_clear(&a->contact);
    if (a->config.contact.assembly != NULL) {
        palp_assembly_forget_forces(a->config.contact.assembly);
        a->moving.finer = false;
        a->moving.barred = PALP_NONE;
    }
    palp_coupling_reset(&a->coupling);
    a->contact.now = a->limit;
    a->held_in_a_row = a->calm = a->missed = 0;
    a->calm_wanted = 1;
}

/* ---- time ---- */

/* Time left for anything but the end of the tick. */
static palp_deadline deadline_of(const palp_answer *a) {
    return (palp_deadline){&a->config.port, a->start_ns, share_ns(a) - a->tail_ns};
}

static float left_ns(const palp_answer *a) {
    const palp_deadline d = deadline_of(a);
    return palp_left_ns(&d);
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

/* A contact that pressed and is not found is searched again in the next ticks before it is given
 * up. Meanwhile the tool goes on as foreseen, and comes free by itself when the device draws back.
 */
static bool bridges(palp_answer *a) {
    bool pressing = false;
    for (uint32_t t = 0; t < a->config.contact.tool_count; t++)
        pressing = pressing || (a->coupling.tool[t].touching && a->contact.normal_N[t] > 0.0f);
    return pressing && a->missed++ < PALP_ANSWER_MISSES;
}

/* Bound of one more iteration and the end of the contact, as many points as there are. */
static float iteration_ns(const palp_answer *a) {
    const palp_contact *c = &a->contact;
    uint32_t active = c->count < c->level.contacts ? c->count : c->level.contacts;
    return palp_contact_cost_iterate(&a->bound, c->count, active, 1) +
           palp_contact_cost_finish(&a->bound, c->level, c->count, active);
}

/* Bound of the rows of the matrix that are missing, an iteration and the end. */
static float rows_ns(const palp_answer *a) {
    const palp_contact *c = &a->contact;
    return palp_contact_cost_rows(&a->bound, c->level, c->row, c->count) + iteration_ns(a);
}

/* Bound of filling the present patch and those that press and are not filled yet. */
static float fillings_ns(const palp_answer *a, palp_contact_level l) {
    const palp_contact *c = &a->contact;
    float sum = palp_contact_cost_fill_by(&a->bound, l, c->patch[c->filling].tool);
    for (uint32_t k = 0; k < c->patches; k++) {
        const palp_contact_patch *p = &c->patch[k];
        if (!p->used || p->filled) continue;
        if (p->normal_N > 0.0f || c->assembly == NULL)
            sum += palp_contact_cost_fill_by(&a->bound, l, p->tool);
    }
    return sum;
}

/* On the coarsest level zones do not wait for each other: pairs that there is no time for are left
 * out, since the least answer has time for one of them only. */
static bool may_skip(const palp_contact *c) {
    const bool pair = c->patch[c->filling].tool == PALP_CONTACT_TOOLS;
    return palp_contact_may_skip(c) || (pair && c->now == 0u);
}

/* Points and the matrix between them; false when time has run out meanwhile, or a contact that was
 * there is missed. */
static bool prepare(palp_answer *a, palp_answer_report *r) {
    palp_contact *c = &a->contact;
    const palp_contact_level l = palp_contact_cost_level(&a->bound, c->now);
    const float rest = solve_cost(&a->bound, l, PALP_ANSWER_ITERATIONS);
    palp_frame at[PALP_CONTACT_TOOLS];
    palp_contact_spring spring[PALP_CONTACT_TOOLS];
    palp_coupling_springs(&a->coupling, c, at, spring);
    palp_contact_begin(c, at, spring);
    bool more = true;
    /* at most patches * PALP_LATTICE_FILLINGS */
    while (more) {
        more = palp_contact_fill(c);
        /* at most patches in all of prepare */
        while (more && fillings_ns(a, l) + rest > left_ns(a)) {
            r->shortened = true;
            if (!may_skip(c)) return false;
            palp_contact_skip(c);
            more = c->filling < c->patches;
        }
    }
    if (c->count == 0u) return !bridges(a);
    if (palp_contact_cost_points(&a->bound, l, c->count) + rows_ns(a) > left_ns(a)) {
        r->shortened = true;
        return false;
    }
    palp_contact_points(c);
    bool rows = true;
    /* at most points / PALP_CONTACT_ROWS + 1 */
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
    float most = 0.0f, share = 0.0f;
    for (uint32_t b = 0; b < a->contact.bodies; b++) {
        const float *error = a->contact.surface[b].blob->regular.level_error;
        share = palp_max(share, error != NULL ? error[2u * a->contact.now + 1u] : UNKNOWN);
    }
    for (uint32_t t = 0; t < a->config.contact.tool_count; t++) {
        if (!held) a->solved_N[t] = result[t].force_N;
        float changed = palp_norm(palp_sub(result[t].force_N, a->solved_N[t]));
        most = palp_max(most, share * palp_norm(result[t].force_N) + 0.5f * changed);
    }
    return most;
}

/* Keeps the seams up with the configuration, with time left for the contact. */
PALP_APART static void keep_up(palp_answer *a) {
    const palp_deadline d = deadline_of(a);
    palp_moving *m = &a->moving;
    for (uint32_t k = 0; k <= PALP_SEAM_LEVELS; k++) {
        on_seams(a, &m->seam_cost[k]);
        m->seam_cost[k].contact =
            palp_answer_cost_least(&a->bound, a->contact.now) - palp_answer_cost_around(&a->bound);
    }
    palp_moving_tick(m, &d);
    on_seams(a, palp_moving_cost(m));
}

void palp_answer_pose(palp_answer *answer, const float *value, const palp_frame *root) {
    palp_assembly_pose(answer->config.contact.assembly, value, root);
}

void palp_answer_spare(palp_answer *answer) {
    const palp_deadline d = deadline_of(answer);
    if (answer->config.contact.assembly != NULL) palp_moving_spare(&answer->moving, &d);
}

uint64_t palp_answer_work(const palp_answer *answer) {
    const palp_assembly *a = answer->config.contact.assembly;
    return answer->contact.work_done + (a != NULL ? a->seams.work_done : 0u);
}

void palp_answer_tick(palp_answer *a, uint64_t start_ns, const palp_frame *device,
                      palp_coupling_result *result, palp_answer_report *report) {
    palp_contact *c = &a->contact;
    palp_answer_report r = {.flags = 0};
    a->start_ns = start_ns;
    choose_level(a);
    if (a->config.contact.assembly != NULL) {
        keep_up(a);
        r.moving = a->moving.report;
    }
    const bool placed = palp_coupling_begin(&a->coupling, c, device);
    const float rest =
        palp_answer_cost_least(&a->bound, c->now) - palp_answer_cost_around(&a->bound);
    bool fits = rest <= left_ns(a);
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
