/* SPDX-License-Identifier: MIT */
/*
 * Keeping the seams of a multizone model up with its configuration, in what a tick can spare.
 *
 * A tick makes the seams' factor anew when the configuration has drifted, on the finest level that
 * leaves time for the contact, giving a level up when the clock says so; below the coarsest is the
 * block diagonal approximation, for which there is always time. While nothing is touched, a factor
 * of a configuration near by serves for iterations instead. Spare time makes finer factors while
 * the configuration rests.
 */
#ifndef PALP_SERVO_MOVING_H
#define PALP_SERVO_MOVING_H

#include "core/contact/contact.h"
#include "core/servo/budget.h"

#define PALP_REUSE_NEAR 0.01f /* drift up to which a factor serves contact */
#define PALP_REUSE_FAR 0.15f  /* and up to which it serves as a preconditioner */

/* What a level of the seams costs, in ns; unknowns are counted. Fixed at opening. */
typedef struct {
    float factor, step, settle, solve, forward, unknowns;
    float contact; /* what the contact takes at least on it; set by the caller before each tick */
} palp_seam_cost;

typedef struct {
    uint32_t level;   /* of the seams in this answer; PALP_DIAGONAL: the approximation */
    uint32_t aborted; /* levels begun or weighed and given up */
    bool renewed;     /* the factor was made anew */
    float drift;      /* of the configuration off that of the factor before */
} palp_moving_report;

typedef struct {
    palp_contact *contact;                           /* by reference */
    palp_prices price;                               /* in ns */
    float dt_s, share_ns;                            /* share of the period for a tick */
    palp_moving_report report;                       /* of the last tick */
    palp_seam_cost seam_cost[PALP_SEAM_LEVELS + 1u]; /* of each level, then of the approximation */
    float load_ns;                                   /* telling the assembly the contact's forces */
    bool finer;                                      /* a finer factor is under way in spare time */
    uint32_t barred; /* level that spare time gave up until the configuration changes */
} palp_moving;

/* Time left now for a tick, before the deadline of its answer. */
typedef struct {
    const palp_port *port;
    uint64_t start_ns;
    float share_ns;
} palp_deadline;
static inline float palp_left_ns(const palp_deadline *d) {
    return d->share_ns - palp_elapsed_ns(d->start_ns, d->port->now_ns(d->port->context));
}

/* `points`: the most that carry force. */
void palp_moving_init(palp_moving *moving, palp_contact *contact, const palp_prices *price,
                      float dt_s, float share_ns, uint32_t points);

/* Bound of palp_moving_tick with the approximation, which is always made in time, and of the
 * contact after it (ns). */
float palp_moving_least(const palp_moving *moving);
/* The same with the factor made anew on a level. */
float palp_moving_cost_of(const palp_moving *moving, uint32_t level);

/* A tick, in the configuration that the assembly has been put to, leaving time for the contact. */
void palp_moving_tick(palp_moving *moving, const palp_deadline *deadline);

/* Time left over: the next finer level while the configuration rests, as far as it would leave time
 * for a tick. */
void palp_moving_spare(palp_moving *moving, const palp_deadline *deadline);

/* Cost of the seams' level in use. */
const palp_seam_cost *palp_moving_cost(const palp_moving *moving);

#endif
