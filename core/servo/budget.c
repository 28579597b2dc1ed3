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

float palp_cost_answer(const palp_touch_cost *cost, uint32_t count, uint32_t active,
                       uint32_t pivots) {
    const float solves = (float)PALP_COUPLING_SOLVES;
    return solves * (palp_cost_begin(cost, count) + palp_cost_couple(cost, active)) +
           palp_cost_refactor(cost, active) +
           (float)pivots * (palp_cost_pivot(cost, count, active) + PRICE(cost, QUANTUM));
}

static float servo(const palp_touch_cost *c) {
    return PRICE(c, SERVO) + FRAMES * PRICE(c, FRAME) + 3.0f * PRICE(c, AXIS);
}

float palp_cost_full(const palp_touch_cost *cost, palp_rung rung) {
    const palp_contact_limits l = cost->limits;
    return servo(cost) + palp_cost_tail(cost, l.max_active) +
           palp_cost_search(cost, rung, l.max_candidates, l.max_active) +
           palp_cost_answer(cost, l.max_candidates, l.max_active,
                            PALP_COUPLING_PIVOTS * l.max_pivots) +
           (float)l.max_new * (palp_cost_admit(cost, rung, l.max_candidates - 1u, l.max_active) +
                               PRICE(cost, QUANTUM));
}

float palp_cost_least(const palp_touch_cost *cost, const palp_blob *blob) {
    const palp_contact_limits l = cost->limits;
    uint32_t level = 0;
    while (level < blob->meta->constraint_level && (cost->tables >> level & 1u) == 0u) level++;
    uint32_t nodes = cost->zones > 1.0f ? UINT32_MAX : blob->level[level].nodes;
    uint32_t count = nodes < l.max_candidates ? nodes : l.max_candidates;
    uint32_t active = nodes < l.max_active ? nodes : l.max_active;
    return servo(cost) + palp_cost_tail(cost, active) +
           palp_cost_search(cost, (palp_rung){level, level}, count, active) +
           palp_cost_answer(cost, count, active, PALP_COUPLING_SOLVES);
}
