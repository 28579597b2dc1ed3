/* SPDX-License-Identifier: MIT */
/* The simulated hand: a spring and damper that pull the device along a script. */
#ifndef PALP_SIM_HAND_H
#define PALP_SIM_HAND_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
    double time_s, x_m[3];
} hand_key;

/* The turn from the device's axes, axis times angle, and the joint of a gripper. */
typedef struct {
    double turn_rad[3], gripper_rad;
} hand_turn;

/* Where a hand wants the tool. */
typedef struct {
    double x_m[3];
    hand_turn turn;
} hand_pose;

/* Keys in device coordinates; between two keys the target moves with minimum jerk. */
typedef struct {
    hand_key *key;
    hand_turn *turn; /* [count]; NULL: the hand does not turn the tool */
    uint32_t count;
    double stiffness_N_per_m, damping_Ns_per_m;
    double stiffness_Nm_per_rad, damping_Nms_per_rad;
    bool even;       /* between two keys at an even speed, not with minimum jerk */
    double tremor_m; /* at 8 to 11 Hz; a hand never holds quite still */
} hand;

/* A person's hand, without a script yet: as stiff as one is, and never quite still. */
hand hand_of_person(void);

/*
 * Reads `name_or_path`: "touch" (the built-in script: approach, press, slide, press deep, let go,
 * over ten seconds) or a file of lines `t x y z [rx ry rz [gripper]]`: m, and degrees. Exits 2 with the
 * line named when it is wrong.
 */
hand hand_load(const char *name_or_path);

/* What the hand wants at `time_s`; before the first and after the last key it holds as
 * still as a hand can: with its tremor. */
void hand_target(const hand *h, double time_s, hand_pose *at);

#endif
