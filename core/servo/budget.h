/* SPDX-License-Identifier: MIT */
/*
 * What a tick can cost at most, by the formulas beside the operations (green, zone, dyna, touch:
 * cost.h) and the target's prices. Every count in them is known before the step is begun: of the
 * blob, of the limits, or of the contact as it stands. So a simulation that cannot be in time is
 * refused when it is opened, and a step that cannot be is not begun.
 */
#ifndef PALP_SERVO_BUDGET_H
#define PALP_SERVO_BUDGET_H

#include "core/servo/target.h"
#include "core/touch/cost.h"
#include <stddef.h>

/* The port: the only function pointers in core. */
typedef struct {
    uint64_t (*now_ns)(void *context); /* monotonic */
    void *context;
} palp_port;

/* A target, and how fast it is. A bound in ns is instructions * ns_per_instruction + bytes touched
 * * ns_per_byte, both upper bounds with caches cold. */
typedef struct {
    const palp_target *target; /* kept by reference */
    float ns_per_instruction, ns_per_byte;
    float margin; /* share of the period that belongs to the tick, 0..1 */
} palp_cost_table;

bool palp_cost_table_is_sound(const palp_cost_table *table);

#define PALP_LEAST_PIVOTS 6u /* per tick, in the least answer */

/* In ns. */
palp_prices palp_prices_of(const palp_cost_table *table);

/* What follows the solves of a tick: palp_cost_leave, TICK and half of SERVO. */
float palp_cost_tail(const palp_touch_cost *cost, uint32_t active);

/* The PALP_NODE_COUPLING_SOLVES solves of a tick, `pivots` in all with `active` in contact at most,
 * one of them with the factor made afresh; a QUANTUM each, and palp_cost_relieve for every solve
 * that may end without room. */
float palp_cost_answer(const palp_touch_cost *cost, uint32_t count, uint32_t active,
                       uint32_t pivots);

/* The whole tick: everything that the limits allow on one level, and the least that still is an
 * answer, on the coarsest one. */
float palp_cost_full(const palp_touch_cost *cost, uint32_t level);
float palp_cost_least(const palp_touch_cost *cost);

#endif
