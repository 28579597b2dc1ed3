/* SPDX-License-Identifier: MIT */
/*
 * Passivity observer and controller in the time domain (after Hannaford and Ryu 2002): what the
 * motors give to the hand, and a controller that takes force away when they give too much.
 *
 * The observer keeps its books where encoders and motors are. Joint i has turned by dq_i in the n_i
 * periods between two readings, under torques tau_i that are held for a period, begin to act
 * `delay` periods after the reading that they answer, and build up with the drives' time constant:
 *
 *     E += sum_i -mean(tau_i) dq_i + s b |v|^2 t       mean over those n_i periods
 *     E <= what the body and the coupling have stored
 *
 * A wrist with encoders alone turns the tool against a moment that nobody feels; what that stores
 * counts as if the hand had felt it, so that it may come back as a force.
 *
 * So lost readings and skipped periods leave nothing out and count nothing twice. b is the
 * mechanism's own damping, which swallows part of what sampling leaks; v only what the encoder's
 * step leaves certain of the tip's velocity; the share s = 1/2 is what can be relied on. Capping E
 * at the stored energy keeps what was once dissipated from being spent on an oscillation later. A
 * reading's step leaves a doubt of sum |tau_i| step_i in E. -E beyond that doubt is the deficit D.
 *
 * The controller only scales the force, F' = gamma sigma F with gamma and sigma in 0..1, so what it
 * does can neither pull nor give: |F' . dx| <= |F . dx| for any motion.
 *
 *     gamma   at once, where F goes with the motion foreseen for the time in which it will act:
 *             from 1 at D = 0.2 D_max to 0 at 0.7 D_max, D with all that is on its way; rises
 *             within 20 ms
 *     sigma   for good, until the tool has been free for half a second: falls whenever gamma falls,
 *             and by the leak L, what the motors have done beyond what the same force would have
 *             done continuously, less what dampers swallow:
 *
 *             L += sum_i (mean(tau_i) - (tau_i + tau_i') / 2) dq_i - (s b |v|^2 + D v) T, L >= 0
 *             beyond 0.1 D_max: sigma /= 1 + dL / (0.1 D_max)
 *
 * with the torques tau and tau' that answer the readings at either end of dq, and the coupling's
 * damper D. Gamma bounds the deficit; sigma finds the stiffness that the device renders without
 * oscillation, within a few cycles, and stays there. A deficit beyond D_max is for the caller to
 * end.
 */
#ifndef PALP_SERVO_PASSIVITY_H
#define PALP_SERVO_PASSIVITY_H

#include "core/device/kinematics.h"

#define PALP_PASSIVITY_HISTORY 8u /* periods */
#define PALP_PASSIVITY_DEFICIT_J 1e-3f

typedef struct {
    uint32_t axes;
    float damping_Ns_per_m; /* b */
    uint32_t delay;         /* below PALP_PASSIVITY_HISTORY */
    float dt_s;
    float remains; /* share of a force that is left after a period of another, exp(-T / tau) */
    float tail;    /* tau / T: what a torque still gives after it has been taken back */
    float prompt;  /* share of a new set-point in the mean force of its period */
    float deficit_max_J;       /* > 0 */
    float step_rad[PALP_AXES]; /* of a joint's reading */
} palp_passivity_config;

/* What the encoders say in a tick. */
typedef struct {
    uint32_t periods; /* since the last tick, at least 1 */
    float q_rad[PALP_AXES], certain_rad_s[PALP_AXES];
    bool fresh[PALP_AXES];
    palp_vec3 certain_m_s, certain_turn_rad_s; /* of the tip, and of the tool's turn */
    float unfelt_J; /* that the hand has put in by turns that no motor resists */
} palp_passivity_motion;

typedef struct {
    float energy_J;     /* E */
    float absorbed_J;   /* net energy that the hand has put in since the start */
    float given_J;      /* largest deficit so far, -E without the doubt; not below 0 */
    float doubt_J;      /* of E, at present */
    float gamma, sigma; /* of the last tick */
    float leak_J;       /* L */
    float turned_rad[PALP_AXES], worked_J; /* in the last period; by the motors */
    float damped_J, swallowed_J;           /* by the force's own damping; and by the mechanism's */
    bool counted;                          /* the last period is known whole */
    float sent_Nm[PALP_PASSIVITY_HISTORY][PALP_AXES]; /* ring of held torques at the joints */
    float mean_Nm[PALP_PASSIVITY_HISTORY][PALP_AXES]; /* ring of what acted in the last periods */
    float acting_Nm[PALP_AXES];                       /* at the end of the last period */
    uint32_t newest, latest;                          /* of the two rings */
    float q_rad[PALP_AXES], certain_rad_s[PALP_AXES]; /* of the last reading of each joint */
    float before_rad_s[PALP_AXES];                    /* and of the one before */
    uint32_t since[PALP_AXES], unseen;                /* periods; unseen: of some joint */
    palp_vec3 velocity_m_s, before_m_s;               /* certain, of the tip; a tick before */
    palp_vec3 turn_rad_s, turn_before_rad_s;          /* of the tool's turn */
    uint32_t idle;                                    /* periods without contact */
    bool begun;
} palp_passivity;

/* Periods T > 0, lag tau >= 0; steps are for the caller to set. */
palp_passivity_config palp_passivity_configure(uint32_t axes, float damping_Ns_per_m,
                                               uint32_t delay, float dt_s, float lag_s);

/* Begins a tick. */
void palp_passivity_observe(palp_passivity *p, const palp_passivity_config *config,
                            const palp_passivity_motion *motion);

/* The share of force and moment at the tip that may be sent, with `stored_J` in the body and the
 * coupling and `damped_W` taken up by its damper. `steady`: they answer the readings of this tick. */
float palp_passivity_share(palp_passivity *p, const palp_passivity_config *config,
                           const palp_wrench *wrench, float stored_J, float damped_W, bool steady);

/* What motors of the scene have put into it, or taken out, in this tick: a joint that moves a body
 * against the tool does work that the hand may get. Before the share. */
void palp_passivity_bring(palp_passivity *p, float work_J);

/* Of two hands on one body, what that of p has put in and `other` may take out: what is missing in the
 * other's books, or what is beyond all that p could get back and has room there. Before the share. */
void palp_passivity_pass_on(palp_passivity *p, float stored_J, palp_passivity *other,
                            float other_stored_J);

/* Whether the deficit is beyond what is allowed. */
bool palp_passivity_exceeded(const palp_passivity *p, const palp_passivity_config *config);

/* Ends a tick: torques at the joints, without what the mechanism asks for. `config` NULL: books
 * alone. */
void palp_passivity_sent(palp_passivity *p, const palp_passivity_config *config,
                         const float torque_Nm[PALP_AXES]);

#endif
