/* SPDX-License-Identifier: MIT */
#include "budget.h"

#define PRICE(cost, kind) ((cost)->price.of[PALP_WORK_##kind])
#define FRAMES 64.0f /* received in one tick, as palp_servo_tick promises */

bool palp_cost_table_is_sound(const palp_cost_table *table) {
    return table->target != NULL && table->ns_per_instruction > 0.0f &&
           table->ns_per_byte >= 0.0f && table->margin > 0.0f && table->margin <= 1.0f;
}

palp_prices palp_prices_of(const palp_cost_table *table) {
    palp_prices p;
    for (uint32_t k = 0; k < PALP_WORKS; k++)
        p.of[k] = table->target->instructions.of[k] * table->ns_per_instruction +
                  palp_bytes_touched.of[k] * table->ns_per_byte;
    return p;
}

float palp_cost_tail(const palp_touch_cost *cost, uint32_t active) {
    return PRICE(cost, TICK) + 0.5f * PRICE(cost, SERVO) + palp_cost_leave(cost, active);
}

/* One of several pivots with at most `active` in contact: with no room left one is let out, or was
 * let in by the pivot before. */
static float pivot_among(const palp_touch_cost *c, uint32_t count, uint32_t active) {
    if (active < c->limits.max_active || active == 0u) return palp_cost_pivot(c, count, active);
    return palp_max(palp_cost_pivot_solve(c, active) + palp_cost_pivot_out(c, active),
                    palp_cost_pivot_solve(c, active - 1u) +
                        palp_cost_pivot_in(c, count, active - 1u));
}

float palp_cost_answer(const palp_touch_cost *cost, uint32_t count, uint32_t active,
                       uint32_t pivots) {
    const float solves = (float)PALP_NODE_COUPLING_SOLVES;
    bool full = active >= cost->limits.max_active;
    return solves * (palp_cost_begin(cost, count) + palp_cost_couple(cost, active) +
                     (full ? palp_cost_relieve(cost, count, active) : 0.0f)) +
           palp_cost_refactor(cost, active) +
           (float)pivots * (pivot_among(cost, count, active) + PRICE(cost, QUANTUM));
}

/* The most expensive way that `pivots` steps can go: of each, with n in contact, one is let out,
 * let in, or refused. Longest path by dynamic programming, from the last step to the first. */
static float costliest_pivots(const palp_touch_cost *c, uint32_t pivots) {
    float rest[PALP_MAX_CANDIDATES + 1u] = {0.0f}, most = 0.0f;
    const palp_node_contact_limits l = c->limits;
    for (uint32_t p = 0; p < pivots; p++) {
        float below = 0.0f; /* rest[n - 1] of the steps after this one */
        most = 0.0f;
        for (uint32_t n = 0; n <= l.max_active; n++) {
            float out = n > 0u ? palp_cost_pivot_out(c, n) + below : 0.0f;
            float in = 0.0f;
            if (n < l.max_active) { /* or refused: its pivot vanishes */
                float after = palp_max(rest[n], rest[n + 1u]);
                in = palp_cost_pivot_in(c, l.max_candidates, n) + after;
            }
            below = rest[n];
            rest[n] = palp_cost_pivot_solve(c, n) + palp_max(out, in);
            most = palp_max(most, rest[n]);
        }
    }
    return most;
}

/* All solves of a tick at the limits; each may end for want of room. */
static float full_answer(const palp_touch_cost *c) {
    const palp_node_contact_limits l = c->limits;
    uint32_t pivots = PALP_NODE_COUPLING_PIVOTS * l.max_pivots;
    uint32_t ends = PALP_NODE_COUPLING_SOLVES < pivots ? PALP_NODE_COUPLING_SOLVES : pivots;
    float end = palp_max(palp_cost_pivot(c, l.max_candidates, l.max_active),
                         pivot_among(c, l.max_candidates, l.max_active));
    return (float)PALP_NODE_COUPLING_SOLVES *
               (palp_cost_begin(c, l.max_candidates) + palp_cost_couple(c, l.max_active)) +
           (1.0f + (float)(pivots / PALP_NODE_CONTACT_REFACTOR)) *
               palp_cost_refactor(c, l.max_active) +
           costliest_pivots(c, pivots - ends) + (float)ends * end +
           (float)pivots * PRICE(c, QUANTUM);
}

static float servo(const palp_touch_cost *c) { return PRICE(c, SERVO) + FRAMES * PRICE(c, FRAME); }

static uint32_t no_more(uint32_t limit, float nodes) {
    return nodes < (float)limit ? (uint32_t)nodes : limit;
}

float palp_cost_full(const palp_touch_cost *cost, uint32_t level) {
    palp_touch_cost c = *cost;
    palp_node_contact_limits *l = &c.limits;
    float nodes = c.nodes[level < PALP_MAX_LEVELS ? level : 0u];
    l->max_candidates = no_more(l->max_candidates, nodes);
    l->max_active = no_more(l->max_active, nodes);
    return servo(&c) + palp_cost_tail(&c, l->max_active) +
           palp_cost_search(&c, level, l->max_candidates, l->max_active) + full_answer(&c) +
           (float)l->max_new *
               (palp_cost_admit(&c, level, l->max_candidates, l->max_active) + PRICE(&c, QUANTUM));
}

float palp_cost_least(const palp_touch_cost *cost) {
    const palp_node_contact_limits l = cost->limits;
    uint32_t level = 0;
    /* at most PALP_MAX_LEVELS */
    while (level + 1u < PALP_MAX_LEVELS && cost->nodes[level + 1u] > 0.0f &&
           (cost->tables >> level & 1u) == 0u)
        level++;
    uint32_t count = no_more(l.max_candidates, cost->nodes[level]);
    uint32_t active = no_more(l.max_active, cost->nodes[level]);
    return servo(cost) + palp_cost_tail(cost, active) +
           palp_cost_search(cost, level, count, active) +
           palp_cost_answer(cost, count, active, PALP_NODE_COUPLING_SOLVES);
}
