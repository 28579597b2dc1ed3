/* SPDX-License-Identifier: MIT */
/*
 * The bounded-time answer of a multizone model: posture, contact at nodes, friction and coupling of
 * one or several tools within a share of each period.
 *
 *   tick   keep the seams up with the posture, on the finest level that leaves time for the contact
 *          take in candidates while there is time for them and for the answer
 *          solve pivot by pivot while there is time for another
 *   spare  after the answer is sent: finer factors of the seams
 *
 * The clock is looked at before each step, whose bound is known (budget.h), so nothing is begun
 * that could end late; the best forces so far, which are always feasible, are the answer.
 */
#ifndef PALP_SERVO_BOUNDED_H
#define PALP_SERVO_BOUNDED_H

#include "core/servo/budget.h"

typedef struct {
    palp_assembly *assembly; /* held by reference */
    bool pairs;              /* its zones touch each other */
    const palp_tool *tools;  /* kept by reference */
    uint32_t tool_count;
    palp_node_contact_limits limits;
    palp_cost_table cost;
    palp_port port;
    float dt_s;
} palp_bounded_config;

/* What a level of the seams costs, in ns; unknowns are counted. Fixed at opening. */
typedef struct {
    float factor, step, settle, solve, unknowns;
} palp_seam_cost;

/* How the seams of a multizone model were kept up with its posture (moving.c). */
typedef struct {
    uint32_t level;   /* of the seams in this answer; PALP_DIAGONAL: the approximation */
    uint32_t aborted; /* levels begun or looked at and given up */
    bool renewed;     /* the factor was made anew */
    float drift;      /* of the posture off that of the factor before */
} palp_moving_report;

typedef struct {
    palp_bounded_config config;
    palp_touch_cost bound;                           /* in ns */
    palp_moving_report moving;                       /* of the last tick */
    palp_seam_cost seam_cost[PALP_SEAM_LEVELS + 1u]; /* of each level, then of the approximation */
    bool finer;                                      /* a finer factor is under way in spare time */
    uint32_t barred; /* level that spare time gave up until the posture changes */
    palp_node_contact contact;
    palp_node_coupling
        coupling;      /* the caller sets stiffness and damping of each spring after init */
    palp_fresh *fresh; /* [max_new] */
    uint64_t start_ns; /* of the tick under way */
    float tail_ns;     /* kept back for the end of a tick */
} palp_bounded;

typedef struct {
    uint32_t flags, pivots, candidates, active, admitted, deferred;
    bool shortened; /* did less than the limits allow because time ran out */
} palp_bounded_report;

size_t palp_bounded_memsize(const palp_zones *zones, uint32_t finest,
                            palp_node_contact_limits limits);

/*
 * Errors: LIMITS, ARGUMENT, ALIGNMENT, MEMORY, and BUDGET when the least answer
 * does not fit the period; *bound_ns (may be NULL) then says how much time it needs.
 * After an error *bounded is not to be used.
 */
palp_status palp_bounded_init(palp_bounded *bounded, const palp_bounded_config *config,
                              void *memory, size_t bytes, float *bound_ns);

/* Lets everything go. */
void palp_bounded_reset(palp_bounded *bounded);

/*
 * Takes joint values and the place of zone 0 of a multizone model, for the next tick. That tick
 * makes the seams' factor anew when the posture has drifted, on the finest level that leaves time
 * for the contact, giving a level up when the clock says so; below the coarsest is the block
 * diagonal approximation. While nothing is near a tool a factor of a posture near by serves for
 * iterations instead. Spare time makes finer factors while the posture rests.
 */
#define PALP_REUSE_NEAR 0.01f /* drift up to which a factor serves contact */
#define PALP_REUSE_FAR 0.15f  /* and up to which it serves as a preconditioner */
void palp_bounded_pose(palp_bounded *bounded, const float *value, const palp_frame *root);

/* Of moving.c, for bounded.c. */
void palp_moving_tick(palp_bounded *bounded, float rest_ns);
void palp_moving_spare(palp_bounded *bounded);
void palp_moving_costs(palp_bounded *bounded);
float palp_moving_cost_least(const palp_bounded *bounded, uint32_t count);
float palp_bounded_left_ns(const palp_bounded *bounded);

/* A tick that began at start_ns on the port's clock, devices at device_m[tool_count]. */
void palp_bounded_tick(palp_bounded *bounded, uint64_t start_ns, const palp_vec3 *device_m,
                       palp_node_coupling_result *result, palp_bounded_report *report);

/* Time left over in the same period. */
void palp_bounded_spare(palp_bounded *bounded);

/* Multiply-adds and look-ups counted so far, of all contacts. */
uint64_t palp_bounded_work(const palp_bounded *bounded);

#endif
