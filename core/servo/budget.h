/* SPDX-License-Identifier: MIT */
/*
 * What a tick can cost at most, in operations (one multiply-add, compare or table step with its loads) and,
 * through the target's cost table, in time. Every bound is a formula in counts that are fixed once the blob and the
 * limits are known, so a simulation that cannot be in time is refused when it is opened.
 */
#ifndef PALP_SERVO_BUDGET_H
#define PALP_SERVO_BUDGET_H

#include "core/touch/coupling.h"

/* The port: the only function pointers in core. */
typedef struct {
    uint64_t (*now_ns)(void *context); /* monotonic */
    void *context;
} palp_port;

typedef struct {
    float ns_per_operation; /* upper bound on the target, caches cold */
    float margin;           /* share of the period that belongs to the tick, 0..1 */
} palp_cost_table;

typedef enum { PALP_STEP_FIXED, PALP_STEP_SEARCH, PALP_STEP_ADMIT, PALP_STEP_SOLVE, PALP_STEPS } palp_step;

/* Operations: ADMIT is per node taken in, SOLVE per contact solve of one pivot; see budget.c. */
typedef struct {
    float operations[PALP_STEPS];
    float pivot_operations; /* each further pivot of a solve */
} palp_cost_bound;

palp_cost_bound palp_cost_of(const palp_blob *blob, palp_contact_limits limits);

/* The whole tick: everything that the limits allow, and the least that still is an answer. */
float palp_cost_full(const palp_cost_bound *bound, palp_contact_limits limits);
float palp_cost_least(const palp_cost_bound *bound);

#endif
