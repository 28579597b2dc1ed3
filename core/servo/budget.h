/* SPDX-License-Identifier: MIT */
/*
 * What a tick can cost at most, by the formulas beside the operations (green, zone, dyna, contact:
 * cost.h) and the target's prices. Every count in them is known before the step is begun: of the
 * blob, of the level, or of the contact as it stands. So a simulation that cannot be in time is
 * refused when it is opened, and a step that cannot be is not begun.
 */
#ifndef PALP_SERVO_BUDGET_H
#define PALP_SERVO_BUDGET_H

#include "core/budget/target.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* The port: the only function pointer in core. It is called from within ticks, so it must neither
 * wait nor call back. The first reading of a tick is where its time begins to count: a loop that
 * may wake up late returns when the period began, and what is left of it is shorter by that. */
typedef struct {
    uint64_t (*now_ns)(void *context); /* never goes back; not NULL */
    void *context;                     /* handed over as it is; may be NULL */
} palp_port;

/* A target, and how fast it is. A bound in ns is instructions * ns_per_instruction + bytes touched
 * * ns_per_byte, both upper bounds with caches cold. */
typedef struct {
    const palp_target *target; /* of budget/target.h; kept by reference */
    float ns_per_instruction;  /* above 0 */
    float ns_per_byte;         /* at least 0 */
    float margin;              /* share of the period that belongs to the tick, above 0 to 1 */
} palp_cost_table;

/* Whether everything is within these ranges; false for NaN. */
bool palp_cost_table_is_sound(const palp_cost_table *table);

/* What one of each kind of work costs by a sound table, in ns. */
palp_prices palp_prices_of(const palp_cost_table *table);

#endif
