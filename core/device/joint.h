/* SPDX-License-Identifier: MIT */
/*
 * One joint as its encoder tells it: which readings are believed, and how fast it moves.
 *
 * A reading is refused when it is not finite, out of the joint's limits by some steps, farther from
 * the last one than the joint can go, or a jump to exactly 0 (what some drives send when they do
 * not know).
 *
 * Velocity by first-order adaptive windowing: the slope of the longest line, ending at the newest
 * sample, that passes every sample between within one encoder step (Janabi-Sharifi, Hayward, Chen
 * 2000). Quiet at rest, quick in motion.
 */
#ifndef PALP_DEVICE_JOINT_H
#define PALP_DEVICE_JOINT_H

#include "core/device/canframe.h"

#define PALP_JOINT_WINDOW 16u

typedef struct {
    float min_rad, max_rad;
    float speed_max_rad_s; /* beyond it a reading is not believed */
    float step_rad;        /* one encoder count */
} palp_joint_limits;

typedef struct {
    float q_rad, dq_rad_s;
    uint32_t age;    /* ticks since the last believed reading; 0: in this tick */
    uint32_t frozen; /* ticks with the very same reading under torque */
    uint32_t bad_in_a_row;
    uint32_t bad_history; /* bit per reading, newest lowest: not believed */
    bool known;
    float sample_rad[PALP_JOINT_WINDOW]; /* ring of believed readings */
    uint32_t sample_tick[PALP_JOINT_WINDOW];
    uint32_t samples, newest, ticks;
} palp_joint;

/* Begins a tick that comes `periods` after the last. */
void palp_joint_age(palp_joint *joint, uint32_t periods);

/* Takes a reading in; false when it is not believed. A second one in the same tick replaces the
 * first. Constant time. */
bool palp_joint_take(palp_joint *joint, const palp_joint_limits *limits, float q_rad, float dt_s);

/* Estimates the velocity anew, once all readings of a tick are in. Cost: at most
 * PALP_JOINT_WINDOW^2 / 2 compares. */
void palp_joint_velocity(palp_joint *joint, const palp_joint_limits *limits, float dt_s);

#endif
