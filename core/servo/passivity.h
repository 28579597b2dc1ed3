/* SPDX-License-Identifier: MIT */
/*
 * Passivity observer and controller in the time domain (Hannaford and Ryu 2002), for a force that
 * is held for a period T and acts `delay` periods after the position that it answers.
 *
 *   observer     E += -f . d + b |d|^2 / T     d: what the tip moved while f was held
 *                E <= what the body and the coupling have stored
 *   controller   the motion that comes is d' = v T. If f . d' would give the hand more than E, the
 *                part of f along d' is lowered until it gives just that, down to a brake of at most
 *                alpha_max |v| against the motion.
 *
 * b is the mechanism's own damping, which swallows what sampling leaks: with K T / 2 < b, Colgate
 * and Schenkel's condition, the controller has nothing to do. Capping E at the stored energy keeps
 * what was once dissipated from being spent on an oscillation later.
 */
#ifndef PALP_SERVO_PASSIVITY_H
#define PALP_SERVO_PASSIVITY_H

#include "core/base/real.h"

#define PALP_PASSIVITY_DELAYS 8u

typedef struct {
    float damping_Ns_per_m;     /* b */
    float damping_max_Ns_per_m; /* alpha_max */
    uint32_t delay;             /* below PALP_PASSIVITY_DELAYS */
    float dt_s;
} palp_passivity_config;

typedef struct {
    float energy_J;   /* E */
    float absorbed_J; /* sum of -f . d since the start: net energy that the hand has put in */
    palp_vec3 sent_N[PALP_PASSIVITY_DELAYS]; /* ring of held forces */
    uint32_t newest, idle_ticks;
} palp_passivity;

/* The tip has moved by d since the last tick. */
void palp_passivity_observe(palp_passivity *p, const palp_passivity_config *config, palp_vec3 d_m);

/* The force to send instead of `force_N`, at tip velocity v and with `stored_J` in the body and the
 * coupling; *braked says whether it differs. */
palp_vec3 palp_passivity_limit(palp_passivity *p, const palp_passivity_config *config,
                               palp_vec3 force_N, palp_vec3 velocity_m_s, float stored_J,
                               bool *braked);

/* Records the force that was sent in this tick. */
void palp_passivity_sent(palp_passivity *p, palp_vec3 force_N);

#endif
