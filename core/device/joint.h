/* SPDX-License-Identifier: MIT */
/*
 * One joint as its encoder tells it: which readings are believed, and how fast it moves.
 *
 * A reading is refused when it is not finite, out of the joint's limits by some steps, farther from
 * the last one than the joint can go, or a jump to exactly 0 (what some drives send when they do
 * not know). Of two readings in one tick the one counts that is nearer to where the joint was
 * expected, whatever their order. One with the very same bits as the last is an old one sent again
 * when the joint moves by PALP_JOINT_STALE steps in that time; after PALP_JOINT_REPEATS_S of them
 * it is believed: the joint has been stopped.
 *
 * Velocity by first-order adaptive windowing: the slope of the longest line, ending at the newest
 * sample, that passes every sample between within one encoder step (Janabi-Sharifi, Hayward, Chen
 * 2000). Quiet at rest, quick in motion. A line over a time t is known to step / t; what is left of
 * the velocity beyond that is certain.
 *
 * Without a reading the joint goes on with its velocity, for PALP_JOINT_FORESEEN periods at most.
 * The reading that comes then is approached in as many periods as were missed, so that lost frames
 * make no step:
 *
 *     place = q + shift,   shift = (foreseen - q) (1 - t / missed)
 */
#ifndef PALP_DEVICE_JOINT_H
#define PALP_DEVICE_JOINT_H

#include "core/device/canframe.h"

#define PALP_JOINT_WINDOW 16u
#define PALP_JOINT_FORESEEN 6u
#define PALP_JOINT_STALE 4.0f
#define PALP_JOINT_REPEATS_S 0.0035f

typedef struct {
    float min_rad, max_rad;
    float speed_max_rad_s; /* beyond it a reading is not believed */
    float step_rad;        /* one encoder count */
    float zero_rad; /* where a drive reads 0, which drives also send when they know nothing */
} palp_joint_limits;

typedef struct {
    float q_rad, dq_rad_s; /* last believed reading; velocity */
    float certain_rad_s;   /* of it, what the encoder's step leaves no doubt of */
    float believed_rad;    /* where the joint is taken to be */
    float shift_rad;       /* of it from the reading, */
    float approach_rad;    /* and by how much that is lessened in a period */
    float expected_rad;    /* of this tick, before its readings */
    uint32_t missed;       /* periods without a reading before this tick */
    uint32_t age;          /* ticks since the last believed reading; 0: in this tick */
    uint32_t frozen;       /* ticks with the very same reading under torque */
    uint32_t bad_in_a_row;
    uint32_t bad_history; /* bit per reading, newest lowest: not believed */
    bool known;
    float sample_rad[PALP_JOINT_WINDOW]; /* ring of believed readings */
    uint32_t sample_tick[PALP_JOINT_WINDOW];
    uint32_t samples, newest, ticks;
} palp_joint;

/* Begins a tick that comes `periods` after the last, of dt_s each. */
void palp_joint_age(palp_joint *joint, uint32_t periods, float dt_s);

typedef enum {
    PALP_READING_TAKEN,
    PALP_READING_STALE, /* an old one: nothing has changed */
    PALP_READING_BAD    /* not believed */
} palp_reading;

/* Takes a reading in. Constant time. */
palp_reading palp_joint_take(palp_joint *joint, const palp_joint_limits *limits, float q_rad,
                             float dt_s);

/* Ends the readings of a tick: where the joint is taken to be. */
void palp_joint_update_belief(palp_joint *joint, const palp_joint_limits *limits);

/* Estimates the velocity anew, once all readings of a tick are in. Cost: at most
 * PALP_JOINT_WINDOW^2 / 2 compares. */
void palp_joint_velocity(palp_joint *joint, const palp_joint_limits *limits, float dt_s);

#endif
