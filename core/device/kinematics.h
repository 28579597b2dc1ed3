/* SPDX-License-Identifier: MIT */
/*
 * The PHANTOM-like three-axis arm: a yaw axis carrying an upper arm (length a, elevation q2) and a
 * forearm (length b, angle q3 from straight down), both driven from the base. Tip, with the home
 * pose q = 0 as origin:
 *
 *     rho = a cos q2 + b sin q3
 *     x = rho cos q1 - a,   y = rho sin q1,   z = a sin q2 - b cos q3 + b
 */
#ifndef PALP_DEVICE_KINEMATICS_H
#define PALP_DEVICE_KINEMATICS_H

#include "core/base/real.h"

#define PALP_AXES 3u

typedef struct {
    float upper_m, fore_m;
} palp_arm;

typedef struct {
    palp_vec3 tip_m;
    float jacobian[9]; /* d tip / d q, row-major */
} palp_arm_pose;

/* Forward kinematics and Jacobian; three sines and cosines. Joint angles in rad, |q| <= 1e4. */
palp_arm_pose palp_arm_forward(const palp_arm *arm, const float q_rad[PALP_AXES]);

/* Joint torques that make the tip push with `force_N`: tau = J^T f (Nm). */
void palp_arm_torques(const palp_arm_pose *pose, palp_vec3 force_N, float torque_Nm[PALP_AXES]);

#endif
