/* SPDX-License-Identifier: MIT */
#include "bounded.h"

#define NS_PER_S 1e9f
#define PIVOT_HATS 2u   /* of the next coarser rung, that one more in contact may come to load */
#define PATIENCE 3u     /* ticks in a row that may be cut short before the rung is given up */
#define CLIMB_AFTER 20u /* ticks on a rung before a finer one is prepared, at first */
#define CLIMB_LATEST 1280u
#define HELD 8u          /* waits that a climb must have held, or the next one waits longer */
#define CLIMB_SHARE 0.7f /* of capacity and period that the finer rung may take */

size_t palp_bounded_memsize(const palp_blob *blob, palp_node_contact_limits limits) {
    palp_arena arena = {0};
    if (!palp_node_contact_limits_sound(limits)) return 0;
    (void)palp_take(&arena, limits.max_new, sizeof(palp_fresh));
    (void)palp_take(&arena, palp_ladder_memsize(blob, limits), 1);
    return arena.used;
}

size_t palp_bounded_memsize_zones(const palp_zones *zones, uint32_t finest,
                                  palp_node_contact_limits limits) {
    palp_arena arena = {0};
    if (!palp_node_contact_limits_sound(limits)) return 0;
    (void)palp_take(&arena, limits.max_new, sizeof(palp_fresh));
    (void)palp_take(&arena, palp_node_contact_memsize_zones(zones, finest, limits), 1);
    return arena.used;
}

/* Memory that a configuration needs. */
static size_t need_of(const palp_bounded_config *c) {
    if (c->assembly == NULL) return palp_bounded_memsize(c->blob, c->limits);
    return palp_bounded_memsize_zones(c->assembly->zones, c->assembly->seams.finest, c->limits);
}

static void set_bound(palp_bounded *b) {
    const palp_bounded_config *c = &b->config;
    palp_prices *ns = &b->bound.price; /* no copy on the stack */
    *ns = palp_prices_of(&c->cost);
    if (c->assembly == NULL) {
        b->bound = palp_touch_cost_of(c->blob, c->limits, c->tools, c->tool_count, ns);
    } else {
        b->bound = palp_touch_cost_of_zones(c->assembly->zones, c->assembly->seams.finest, c->pairs,
                                            c->limits, c->tools, c->tool_count, ns);
    }
}

static palp_status open_ladder(palp_bounded *b, palp_arena *arena) {
    const palp_bounded_config *c = &b->config;
    if (c->assembly != NULL) {
        size_t room = palp_node_contact_memsize_zones(c->assembly->zones, c->assembly->seams.finest,
                                                      c->limits);
        return palp_ladder_init_zones(&b->ladder, c->assembly, c->pairs, c->tools, c->tool_count,
                                      c->limits, palp_take(arena, room, 1), room);
    }
    size_t room = palp_ladder_memsize(c->blob, c->limits);
    return palp_ladder_init(&b->ladder, c->blob, c->blob->rest_m, c->tools, c->tool_count,
                            c->limits, palp_take(arena, room, 1), room);
}

palp_status palp_bounded_init(palp_bounded *bounded, const palp_bounded_config *config,
                              void *memory, size_t bytes, float *bound_ns) {
    palp_arena arena = {.base = memory};
    palp_bounded *b = bounded;
    if (!palp_node_contact_limits_sound(config->limits)) return PALP_ERR_LIMITS;
    bool positive = config->dt_s > 0.0f && palp_cost_table_is_sound(&config->cost) &&
                    config->port.now_ns != NULL;
    if (!positive || config->tool_count < 1u || config->tool_count > PALP_MAX_TOOLS)
        return PALP_ERR_ARGUMENT;
    if (memory == NULL || ((uintptr_t)memory & (PALP_ALIGN - 1u)) != 0u) return PALP_ERR_ALIGNMENT;
    if (bytes < need_of(config)) return PALP_ERR_MEMORY;
    *b = (palp_bounded){.config = *config,
                        .barred = PALP_NONE,
                        .climb_wait = CLIMB_AFTER,
                        .since_climb = HELD * CLIMB_LATEST};
    const palp_assembly *zones = config->assembly;
    set_bound(b);
    float least_ns = palp_cost_least(&b->bound);
    if (zones != NULL) {
        palp_moving_costs(b);
        least_ns += palp_moving_cost_least(b, config->limits.max_candidates);
    }
    b->tail_ns = palp_cost_tail(&b->bound, config->limits.max_active);
    if (bound_ns != NULL) *bound_ns = least_ns;
    if (least_ns > config->cost.margin * NS_PER_S * config->dt_s) return PALP_ERR_BUDGET;
    b->fresh = palp_take(&arena, config->limits.max_new, sizeof *b->fresh);
    return open_ladder(b, &arena);
}

void palp_bounded_reset(palp_bounded *bounded) {
    if (bounded->config.assembly != NULL) palp_assembly_calm(bounded->config.assembly);
    bounded->finer = false;
    bounded->barred = PALP_NONE;
    palp_ladder_clear(&bounded->ladder);
    palp_node_coupling_reset(&bounded->coupling);
    bounded->cut_short = 0;
    bounded->climb_wait = CLIMB_AFTER;
    bounded->since_climb = HELD * CLIMB_LATEST;
}

uint64_t palp_bounded_work(const palp_bounded *bounded) {
    const palp_assembly *a = bounded->config.assembly;
    return bounded->ladder.contact[0].work_done + bounded->ladder.contact[1].work_done +
           (a != NULL ? a->seams.work_done : 0u);
}

/* ---- time ---- */

/* Time left for anything but the end of the tick. */
float palp_bounded_left_ns(const palp_bounded *bounded) {
    const palp_bounded *b = bounded;
    const palp_port *port = &b->config.port;
    float spent_ns = (float)(port->now_ns(port->context) - b->start_ns);
    return b->config.cost.margin * NS_PER_S * b->config.dt_s - b->tail_ns - spent_ns;
}

static uint32_t least(uint32_t a, uint32_t b) { return a < b ? a : b; }

/* Bound of the least answer by the contact as it stands, with `more` candidates. */
static float answer_ns(const palp_bounded *b, const palp_node_contact *c, uint32_t more) {
    uint32_t count = least(c->count + more, b->config.limits.max_candidates);
    uint32_t reachable = c->active_count + PALP_LEAST_PIVOTS;
    uint32_t active = least(least(reachable, count), b->config.limits.max_active);
    return palp_cost_answer(&b->bound, count, active, PALP_LEAST_PIVOTS);
}

/* Bound of finding out, on `rung`, what giving it up would cost. */
static float look_ns(const palp_bounded *b, uint32_t rung, uint32_t active) {
    if (rung == 0u) return 0.0f;
    return palp_cost_load(&b->bound, b->ladder.at[rung - 1u], b->config.limits.max_candidates,
                          active);
}

/* Bound of giving `rung` up, with `active` in contact that load so many hats below, and answering
 * there; 0 on the coarsest. */
static float retreat_ns(const palp_bounded *b, uint32_t rung, uint32_t load, uint32_t active) {
    if (rung == 0u) return 0.0f;
    uint32_t count = least(load, b->config.limits.max_candidates);
    uint32_t pressed = least(load, b->config.limits.max_active);
    return palp_cost_change(&b->bound, b->ladder.at[rung - 1u], load, active) +
           palp_cost_answer(&b->bound, count, pressed, PALP_LEAST_PIVOTS);
}

/* The same for the present rung, `taken` pivots into this tick, when `more` have been taken. */
static void keep_back(palp_bounded *b, uint32_t taken, uint32_t more) {
    uint32_t active =
        least(palp_ladder_contact(&b->ladder)->active_count + more, b->config.limits.max_active);
    uint32_t load = b->retreat_load + PIVOT_HATS * (taken + more);
    b->retreat_ns = retreat_ns(b, b->ladder.rung, load, active);
}

/* ---- the tick ---- */

static void tools_of(const palp_bounded *b, palp_vec3 *tool_m) {
    for (uint32_t t = 0; t < b->config.tool_count; t++) tool_m[t] = b->coupling.spring[t].tool_m;
}

static void drop(palp_bounded *b, palp_bounded_report *r) {
    palp_vec3 tool_m[PALP_MAX_TOOLS];
    tools_of(b, tool_m);
    r->flags |= palp_ladder_contact(&b->ladder)->flags;
    b->cut_short = 0;
    if (!palp_ladder_drop(&b->ladder, tool_m)) return;
    r->aborted++;
    if (b->since_climb >= HELD * CLIMB_LATEST) return; /* this climb is accounted for */
    bool held = b->since_climb >= HELD * b->climb_wait;
    b->climb_wait = held ? CLIMB_AFTER : least(2u * b->climb_wait, CLIMB_LATEST);
    b->since_climb = HELD * CLIMB_LATEST;
}

static void choose_rung(palp_bounded *b, palp_bounded_report *r) {
    const uint32_t full = PALP_NODE_CONTACT_ACTIVE_FULL | PALP_NODE_CONTACT_CANDIDATES_FULL;
    bool crowded = (palp_ladder_contact(&b->ladder)->flags & full) != 0u;
    if (crowded || b->cut_short >= PATIENCE) drop(b, r);
    /* at most rungs: each turn goes down one */
    while (b->ladder.rung > 0u) {
        const palp_node_contact *c = palp_ladder_contact(&b->ladder);
        float need =
            answer_ns(b, c, 0u) +
            palp_cost_search(&b->bound, b->ladder.at[b->ladder.rung], c->count, c->active_count) +
            look_ns(b, b->ladder.rung, c->active_count);
        b->retreat_load = palp_ladder_load(&b->ladder, b->ladder.rung - 1u);
        keep_back(b, 0, PALP_LEAST_PIVOTS);
        if (need + b->retreat_ns <= palp_bounded_left_ns(b)) break;
        drop(b, r);
    }
    if (b->ladder.rung == 0u) b->retreat_ns = 0.0f;
}

/* Takes in candidates as far as time allows. */
static void take_in(palp_bounded *b, const palp_vec3 *around, palp_bounded_report *r) {
    palp_node_contact *c = palp_ladder_contact(&b->ladder);
    uint32_t fresh = palp_node_contact_search(c, around, b->fresh);
    uint32_t i = 0;
    for (; i < fresh; i++) {
        float admit =
            palp_cost_admit(&b->bound, b->ladder.at[b->ladder.rung], c->count, c->active_count);
        if (admit + answer_ns(b, c, 1u) + b->retreat_ns > palp_bounded_left_ns(b)) break;
        palp_node_contact_admit(c, b->fresh[i]);
    }
    r->admitted = i;
    r->deferred = fresh - i;
}

/* Beginning a solve, with the factor made afresh if that is due. */
static float begin_ns(const palp_bounded *b, const palp_node_contact *c) {
    bool due = c->changes >= PALP_NODE_CONTACT_REFACTOR;
    return palp_cost_begin(&b->bound, c->count) +
           (due ? palp_cost_refactor(&b->bound, c->active_count) : 0.0f);
}

/* Solves on the present rung, with time kept back for giving it up, or, with `all`, with whatever
 * time there is. False when it ran out before the least answer was there. */
static bool solve(palp_bounded *b, const palp_vec3 *device_m, bool all, bool *settled) {
    palp_node_contact *c = palp_ladder_contact(&b->ladder);
    uint32_t quanta = 0;
    bool more = true;
    palp_node_coupling_begin(&b->coupling, c, device_m);
    /* at most PALP_NODE_COUPLING_PIVOTS max_pivots */
    while (more) {
        float quantum = palp_cost_pivot(&b->bound, c->count, c->active_count) +
                        palp_cost_couple(&b->bound, c->active_count + 1u) +
                        b->bound.price.of[PALP_WORK_QUANTUM];
        if (!b->coupling.solving) quantum += begin_ns(b, c);
        if (all) {
            b->retreat_ns = 0.0f;
        } else {
            keep_back(b, b->coupling.pivots, 1);
        }
        if (quanta > 0u && quantum + b->retreat_ns > palp_bounded_left_ns(b)) break;
        more = palp_node_coupling_step(&b->coupling, c);
        quanta++;
    }
    *settled = !more;
    return !more || quanta >= PALP_LEAST_PIVOTS;
}

void palp_bounded_tick(palp_bounded *bounded, uint64_t start_ns, const palp_vec3 *device_m,
                       palp_node_coupling_result *result, palp_bounded_report *report) {
    palp_bounded *b = bounded;
    palp_bounded_report r = {.aborted = 0};
    palp_vec3 around[PALP_MAX_TOOLS];
    bool settled;
    b->start_ns = start_ns;
    if (b->since_climb < HELD * CLIMB_LATEST) b->since_climb++;
    if (b->config.assembly != NULL) {
        palp_node_contact *c = palp_ladder_contact(&b->ladder);
        palp_moving_tick(b, answer_ns(b, c, 0u) + palp_cost_search(&b->bound, b->ladder.at[0],
                                                                   c->count, c->active_count));
    }
    choose_rung(b, &r);
    palp_node_coupling_centers(&b->coupling, palp_ladder_contact(&b->ladder), device_m, around);
    take_in(b, around, &r);
    if (!solve(b, device_m, false, &settled) && b->ladder.rung > 0u) {
        drop(b, &r); /* this answer is what was kept back; what it reaches is taken */
        (void)solve(b, device_m, true, &settled);
    }
    b->cut_short = settled ? 0u : b->cut_short + 1u;
    palp_node_contact *c = palp_ladder_contact(&b->ladder);
    palp_node_coupling_end(&b->coupling, c, b->config.dt_s, result);
    palp_ladder_relax(&b->ladder, b->config.dt_s);
    r.level = c->level;
    r.outer = c->outer;
    r.flags |= c->flags;
    r.pivots = c->pivots;
    r.candidates = c->count;
    r.active = c->active_count;
    r.shortened = !settled || r.deferred > 0u;
    *report = r;
}

/* ---- spare time ---- */

/* What a tick on `rung` with `count` candidates and `active` in contact, and giving it up with
 * `load` hats below, take of the time that ticks have. */
static float share_of(const palp_bounded *b, uint32_t rung, uint32_t count, uint32_t active,
                      uint32_t load) {
    float need = b->tail_ns + palp_cost_search(&b->bound, b->ladder.at[rung], count, active) +
                 palp_cost_answer(&b->bound, count, active, PALP_LEAST_PIVOTS) +
                 look_ns(b, rung, active) +
                 retreat_ns(b, rung, load + PIVOT_HATS * PALP_LEAST_PIVOTS, active);
    return need / (b->config.cost.margin * NS_PER_S * b->config.dt_s);
}

/* Whether the next finer rung would have room and time to spare. */
static bool finer_fits(palp_bounded *b) {
    uint32_t load = palp_ladder_load(&b->ladder, b->ladder.rung + 1u);
    uint32_t count = least(2u * load, b->config.limits.max_candidates);
    if ((float)load > CLIMB_SHARE * (float)b->config.limits.max_active) return false;
    return share_of(b, b->ladder.rung + 1u, count, load, load) <= CLIMB_SHARE;
}

/* Without contact: up to the finest rung where contact could begin. */
static void begin_finer(palp_bounded *b) {
    palp_ladder *l = &b->ladder;
    uint32_t finest = l->rungs - 1u;
    uint32_t active = least(PALP_LEAST_PIVOTS, b->config.limits.max_active);
    /* at most rungs; a mixed one is for a contact that there is */
    while (finest > l->rung && (l->at[finest].outer != l->at[finest].level ||
                                share_of(b, finest, active, active, 0u) > 1.0f))
        finest--;
    if (finest > l->rung) palp_ladder_clear_to(l, finest);
}

void palp_bounded_spare(palp_bounded *bounded) {
    palp_bounded *b = bounded;
    palp_ladder *l = &b->ladder;
    palp_vec3 tool_m[PALP_MAX_TOOLS];
    if (b->config.assembly != NULL) palp_moving_spare(b);
    if (l->rung + 1u >= l->rungs) return;
    if (palp_ladder_contact(l)->active_count == 0u) {
        begin_finer(b);
        return;
    }
    if (!l->preparing && ++l->waited < b->climb_wait) return;
    if (!finer_fits(b)) {
        palp_ladder_forget(l);
        return;
    }
    palp_rung finer = l->at[l->rung + 1u];
    tools_of(b, tool_m);
    uint32_t missing = palp_ladder_prepare(l, tool_m, b->fresh);
    palp_node_contact *next = palp_ladder_other(l);
    for (uint32_t i = 0; i < missing; i++) {
        if (palp_cost_admit(&b->bound, finer, next->count, next->active_count) >
            palp_bounded_left_ns(b))
            return;
        palp_node_contact_admit(next, b->fresh[i]);
    }
    uint32_t now = palp_ladder_contact(l)->active_count;
    float change = palp_cost_climb(&b->bound, finer, next->count, now);
    if (missing > 0u || change > palp_bounded_left_ns(b)) return;
    if (palp_ladder_climb(l, tool_m)) b->since_climb = 0;
}
