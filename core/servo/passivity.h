/* SPDX-License-Identifier: MIT */
/*
 * Passivity observer and controller in the time domain (Hannaford and Ryu 2002), for a force that
 * is held for a period T, acts `delay` periods after the position that it answers, and builds up
 * with the time constant tau of the drives' torque.
 *
 *   observer     E += -F . d + s b |d|^2 / T     d: what the tip moved, F: mean force meanwhile
 *                E <= what the body and the coupling have stored
 *   controller   the motion that comes is d' = 2 d - d_before. If F . d' would give the hand more
 *                than E, f is lowered by alpha d' / T until it gives just that, alpha <= alpha_max.
 *
 * b is the mechanism's own damping, which swallows what sampling leaks: with K T / 2 < s b, Colgate
 * and Schenkel's condition with a margin, the controller has nothing to do. The share s = 1/2
 * leaves the rest to calm what is left: with all of it spent, a bounce would go on for ever.
 * Capping E at the stored energy keeps what was once dissipated from being spent on an oscillation
 * later.
 */
#ifndef PALP_SERVO_PASSIVITY_H
#define PALP_SERVO_PASSIVITY_H

#include "core/base/real.h"

#define PALP_PASSIVITY_DELAYS 8u

typedef struct {
    float damping_Ns_per_m;     /* b */
    float damping_max_Ns_per_m; /* alpha_max: palp_device_brake */
    uint32_t delay;             /* below PALP_PASSIVITY_DELAYS */
    float dt_s;
    float remains; /* share of a force that is left after a period of another, exp(-T / tau) */
    float prompt;  /* share of a new set-point in the mean force of its period */
} palp_passivity_config;

typedef struct {
    float energy_J;   /* E */
    float absorbed_J; /* sum of -F . d since the start: net energy that the hand has put in */
    palp_vec3 sent_N[PALP_PASSIVITY_DELAYS]; /* ring of held forces */
    palp_vec3 acting_N;                      /* at the end of the last period */
    palp_vec3 moved_m, before_m;             /* d, and the one before it */
    uint32_t newest, idle_ticks;
} palp_passivity;

/* Periods T > 0, lag tau >= 0. */
palp_passivity_config palp_passivity_configure(float damping_Ns_per_m, float damping_max_Ns_per_m,
                                               uint32_t delay, float dt_s, float lag_s);

/* The tip has moved by d since the last tick. */
void palp_passivity_observe(palp_passivity *p, const palp_passivity_config *config, palp_vec3 d_m);

/* The force to send instead of `force_N`, with `stored_J` in the body and the coupling; *braked
 * says whether it differs. */
palp_vec3 palp_passivity_limit(palp_passivity *p, const palp_passivity_config *config,
                               palp_vec3 force_N, float stored_J, bool *braked);

/* Records the force that was sent in this tick. */
void palp_passivity_sent(palp_passivity *p, palp_vec3 force_N);

#endif
