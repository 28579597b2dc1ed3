/* SPDX-License-Identifier: MIT */
/*
 * What a tick can cost at most, in operations (one multiply-add, compare or table step with its
 * loads) and, through the target's cost table, in time. Every bound is a formula in counts that are
 * fixed once the blob and the limits are known, so a simulation that cannot be in time is refused
 * when it is opened.
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

/* What the bounds below are made of, in operations; fixed when the simulation is opened. */
typedef struct {
    float fixed;      /* frames, kinematics, output chain */
    float search;     /* candidates and grid, at the limits */
    float row;        /* one row of W^-1 */
    float extraction; /* one block of G from a compressed column */
} palp_cost_bound;

palp_cost_bound palp_cost_of(const palp_blob *blob, palp_contact_limits limits);

/* Taking one node in while `count` candidates are there: row + (2 count + 1) extraction. */
float palp_cost_admit(const palp_cost_bound *bound, uint32_t count);

/*
 * One contact solve with `count` candidates, at most `active` nodes in contact and `pivots` steps:
 * count (60 + 2 active) + active^3/6 + active^2 + 20 active
 * + pivots (5 active^2 + 32 active + count (2 active + 6)).
 */
float palp_cost_solve(uint32_t count, uint32_t active, uint32_t pivots);

/* The whole tick: everything that the limits allow, and the least that still is an answer. */
float palp_cost_full(const palp_cost_bound *bound, palp_contact_limits limits);
float palp_cost_least(const palp_cost_bound *bound, palp_contact_limits limits);

#endif
