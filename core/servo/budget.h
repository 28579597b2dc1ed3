/* SPDX-License-Identifier: MIT */
/*
 * What a tick can cost at most, in operations (one multiply-add, compare or table step with its
 * loads) and, through the target's cost table, in time. Every bound is a formula in counts that are
 * known before the step is begun: of the blob, of the limits, or of the contact as it stands. So a
 * simulation that cannot be in time is refused when it is opened, and a step that cannot be is not
 * begun.
 */
#ifndef PALP_SERVO_BUDGET_H
#define PALP_SERVO_BUDGET_H

#include "core/touch/coupling.h"
#include "core/touch/ladder.h"

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
    float grid;       /* a look at the search grid and the scan */
    float near;       /* one neighbour met by the search */
    float pair;       /* moving the entries of one pair of candidates */
    float tool;       /* one evaluation of the tool */
    float row;        /* one row of W^-1 */
    float extraction; /* one block of G from a compressed column */
    float columns;    /* of the springs: 3 per tool */
    uint32_t tables;  /* bit per level that has one */
    float modes;      /* on the finest level, of the zone that has most; 0: one body */
    float bodies, pairs,
        nearest;              /* zones; 2 if they touch each other; one look for a nearest node */
    float seam_row, unknowns; /* of the seams' level in use: one candidate's row, its length */
    float ring, limit_active, limit_candidates;
    float least_active, least_candidates; /* most that the coarsest rung can have of either */
} palp_cost_bound;

palp_cost_bound palp_cost_of(const palp_blob *blob, palp_contact_limits limits,
                             const palp_tool *tools, uint32_t tool_count);

/* The same of a multizone model with seams up to level `finest`: the worst of its zones in each
 * count. */
palp_cost_bound palp_cost_of_zones(const palp_zones *zones, uint32_t finest, bool pairs,
                                   palp_contact_limits limits, const palp_tool *tools,
                                   uint32_t tool_count);

/*
 * Moving `count` candidates along on a level of the seams with `unknowns` (palp_seams_cost_solve
 * being `solve`): count (60 modes + solve / 2 + unknowns + 60) + 30 modes active + count^2
 * (unknowns + 8) / 2, and max_new count look-ups for zones that touch each other.
 */
float palp_cost_follow(const palp_cost_bound *bound, palp_contact_limits limits, uint32_t count,
                       float unknowns, float solve);

/* The search from `count` candidates: grid + count (tool + 5 active + ring near + pair count); of a
 * mixed set near counts five times. */
float palp_cost_search(const palp_cost_bound *bound, palp_rung rung, uint32_t count,
                       uint32_t active);

/* What follows the solves of a tick: energy, fading reliefs, output chain, frames. */
float palp_cost_tail(const palp_cost_bound *bound, uint32_t active);

/* Taking one candidate in while `count` are there: count + 1 look-ups on a level with a table, else
 * row + (2 count + 1) extraction; of a mixed set each look-up is one per child of a hat. */
float palp_cost_admit(const palp_cost_bound *bound, palp_rung rung, uint32_t count);

/* One pivot with `active` in contact: 5 active^2 + columns (active^2 / 2 + columns active) +
 * count (2 active + 6) + 32 active. */
float palp_cost_pivot(const palp_cost_bound *bound, uint32_t count, uint32_t active);

/* Beginning and ending one solve: count (tool + 4) + active^3 / 6 + 40 active. */
float palp_cost_solve(const palp_cost_bound *bound, uint32_t count, uint32_t active);

/* The PALP_COUPLING_SOLVES solves of a tick with `pivots` each, and friction. */
float palp_cost_answer(const palp_cost_bound *bound, uint32_t count, uint32_t active,
                       uint32_t pivots);

/* Going over to a rung on which `load` basis functions carry the forces: load^2 / 2 look-ups,
 * load^3 / 6 + 3 load^2, load evaluations of the tool. */
float palp_cost_change(const palp_cost_bound *bound, palp_rung rung, uint32_t load);

/* The whole tick: everything that the limits allow on the finest level, and the least that still is
 * an answer, on the coarsest. */
float palp_cost_full(const palp_cost_bound *bound, palp_contact_limits limits);
float palp_cost_least(const palp_cost_bound *bound);

#endif
