/* SPDX-License-Identifier: MIT */
#include "bounded.h"

#define NS_PER_S 1e9f
size_t palp_bounded_memsize(const palp_zones *zones, uint32_t finest,
                            palp_node_contact_limits limits) {
    palp_arena arena = {0};
    if (!palp_node_contact_limits_sound(limits)) return 0;
    (void)palp_take(&arena, limits.max_new, sizeof(palp_fresh));
    (void)palp_take(&arena, palp_node_contact_memsize_zones(zones, finest, limits), 1);
    return arena.used;
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
    const palp_zones *zones = config->assembly->zones;
    const uint32_t finest = config->assembly->seams.finest;
    if (bytes < palp_bounded_memsize(zones, finest, config->limits)) return PALP_ERR_MEMORY;
    *b = (palp_bounded){.config = *config, .barred = PALP_NONE};
    b->bound.price = palp_prices_of(&config->cost); /* no copy on the stack */
    b->bound = palp_touch_cost_of_zones(zones, finest, config->pairs, config->limits, config->tools,
                                        config->tool_count, &b->bound.price);
    palp_moving_costs(b);
    float least_ns =
        palp_cost_least(&b->bound) + palp_moving_cost_least(b, config->limits.max_candidates);
    b->tail_ns = palp_cost_tail(&b->bound, config->limits.max_active);
    if (bound_ns != NULL) *bound_ns = least_ns;
    if (least_ns > config->cost.margin * NS_PER_S * config->dt_s) return PALP_ERR_BUDGET;
    b->fresh = palp_take(&arena, config->limits.max_new, sizeof *b->fresh);
    size_t room = palp_node_contact_memsize_zones(zones, finest, config->limits);
    return palp_node_contact_init_zones(&b->contact, config->assembly, config->pairs, config->tools,
                                        config->tool_count, config->limits,
                                        palp_take(&arena, room, 1), room);
}

void palp_bounded_reset(palp_bounded *bounded) {
    palp_assembly_calm(bounded->config.assembly);
    bounded->finer = false;
    bounded->barred = PALP_NONE;
    palp_node_contact_clear(&bounded->contact, bounded->contact.level);
    palp_node_coupling_reset(&bounded->coupling);
}

uint64_t palp_bounded_work(const palp_bounded *bounded) {
    return bounded->contact.work_done + bounded->config.assembly->seams.work_done;
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

/* ---- the tick ---- */

/* Takes in candidates as far as time allows. */
static void take_in(palp_bounded *b, const palp_vec3 *around, palp_bounded_report *r) {
    palp_node_contact *c = &b->contact;
    uint32_t fresh = palp_node_contact_search(c, around, b->fresh);
    uint32_t i = 0;
    for (; i < fresh; i++) {
        float admit = palp_cost_admit(&b->bound, c->level, c->count, c->active_count);
        if (admit + answer_ns(b, c, 1u) > palp_bounded_left_ns(b)) break;
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

/* Pivot by pivot while there is time for another; false when it ran out. */
static bool solve(palp_bounded *b, const palp_vec3 *device_m) {
    palp_node_contact *c = &b->contact;
    uint32_t quanta = 0;
    bool more = true;
    palp_node_coupling_begin(&b->coupling, c, device_m);
    /* at most PALP_NODE_COUPLING_PIVOTS max_pivots */
    while (more) {
        float quantum = palp_cost_pivot(&b->bound, c->count, c->active_count) +
                        palp_cost_couple(&b->bound, c->active_count + 1u) +
                        b->bound.price.of[PALP_WORK_QUANTUM];
        if (!b->coupling.solving) quantum += begin_ns(b, c);
        if (quanta > 0u && quantum > palp_bounded_left_ns(b)) break;
        more = palp_node_coupling_step(&b->coupling, c);
        quanta++;
    }
    return !more;
}

void palp_bounded_tick(palp_bounded *bounded, uint64_t start_ns, const palp_vec3 *device_m,
                       palp_node_coupling_result *result, palp_bounded_report *report) {
    palp_bounded *b = bounded;
    palp_node_contact *c = &b->contact;
    palp_bounded_report r = {.flags = 0};
    palp_vec3 around[PALP_MAX_TOOLS];
    b->start_ns = start_ns;
    palp_moving_tick(b, answer_ns(b, c, 0u) +
                            palp_cost_search(&b->bound, c->level, c->count, c->active_count));
    palp_node_coupling_centers(&b->coupling, c, device_m, around);
    take_in(b, around, &r);
    bool settled = solve(b, device_m);
    palp_node_coupling_end(&b->coupling, c, b->config.dt_s, result);
    r.flags = c->flags;
    r.pivots = c->pivots;
    r.candidates = c->count;
    r.active = c->active_count;
    r.shortened = !settled || r.deferred > 0u;
    *report = r;
}

void palp_bounded_spare(palp_bounded *bounded) { palp_moving_spare(bounded); }
