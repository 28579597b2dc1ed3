/* SPDX-License-Identifier: MIT */
/*
 * Mechanisms that carry the tool. In each the home pose q = 0 has its tip at the origin.
 *
 * ARM3, PHANTOM-like: a yaw axis carries an upper arm (length a, elevation q2) and a forearm
 * (length b, angle q3 from straight down), both driven from the base:
 *
 *     rho = a cos q2 + b sin q3
 *     x = rho cos q1 - a,   y = rho sin q1,   z = a sin q2 - b cos q3 + b
 *
 * DELTA: three legs at 0, 120 and 240 degrees about z, and FIVE_BAR, the planar pantograph: two
 * legs along +x and -x, moving in the plane y = 0. Each leg has a motor at distance e (`base`: base
 * minus platform radius, or half the motors' distance), a proximal link a that swings up by q from
 * horizontal outward, and a distal link b to the tip:
 *
 *     | P - (e + a cos q_i) r_i - a sin q_i z | = b,     P above the elbows
 *
 * A pose is singular where the columns of the Jacobian J = d tip / d q lose their independence, or
 * where the distal links of a parallel mechanism do: `conditioning` is the smaller of the volumes
 * that their unit vectors span, 1 at best and 0 in a singular pose.
 */
#ifndef PALP_DEVICE_KINEMATICS_H
#define PALP_DEVICE_KINEMATICS_H

#include "core/base/real.h"
#include "core/device/drive.h"

typedef enum { PALP_ARM3, PALP_FIVE_BAR, PALP_DELTA } palp_mechanism;
#define PALP_MECHANISM_NAMES "arm3", "five-bar", "delta" /* in that order */

typedef struct {
    palp_mechanism mechanism;
    float upper_m, fore_m; /* a, b */
    float base_m;          /* e; ARM3: unused */
} palp_kinematics;

typedef struct {
    palp_vec3 tip_m;
    palp_vec3 column_m[PALP_AXES]; /* of J, m/rad; zero beyond the axes there are */
    float conditioning;
    bool reachable; /* false: the links do not meet; nothing else is meaningful then */
} palp_pose;

/* Joints: 3, or 2 of the five-bar. */
uint32_t palp_axes(const palp_kinematics *k);

/* Whether the lengths are positive and finite and the home pose exists: b > e + a of the parallel
 * ones. */
bool palp_kinematics_is_sound(const palp_kinematics *k);

/* Forward kinematics with J; a sine and cosine per joint, and two square roots. |q| <= 1e4. */
palp_pose palp_forward(const palp_kinematics *k, const float q_rad[PALP_AXES]);

/* Joint angles (elbows outward, or up) that put the tip at `tip_m`; false when it is out of reach.
 * The five-bar ignores y. */
bool palp_inverse(const palp_kinematics *k, palp_vec3 tip_m, float q_rad[PALP_AXES]);

/* Joint torques that make the tip push with `force_N`: tau = J^T f (Nm). */
void palp_pose_torques(const palp_pose *pose, palp_vec3 force_N, float torque_Nm[PALP_AXES]);

/* Velocity of the tip, J dq (m/s). */
palp_vec3 palp_pose_velocity(const palp_pose *pose, const float dq_rad_s[PALP_AXES]);

#endif
