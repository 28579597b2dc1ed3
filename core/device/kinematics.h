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
 *
 * A wrist of three joints whose axes meet at the tip may turn the tool: about z of the link that
 * carries it, then about y, then about x of the stylus, the axis that the hand holds:
 *
 *     R = R_link Rz(q4) Ry(q5) Rx(q6)
 *     R_link = Rz(q1) Ry(-q3) of ARM3's forearm; the others' platform does not turn
 *
 * so that at home the tool's axes are the device's; without a wrist they always are. It is singular where q5 is 90 degrees. A gripper may
 * follow: its joint opens two parallel jaws along the tool's y, each by half of gripper * q.
 *
 * The arm's joints are those before wrist and gripper. A wrench (F, M) about the tip is made by torques
 * tau = J^T F + W^T M with the columns w of W, the axes that joints turn the tool about. Joints that
 * no motor drives carry nothing, so of M only what the wrist's motors make comes through
 * (palp_pose_transmits).
 */
#ifndef PALP_DEVICE_KINEMATICS_H
#define PALP_DEVICE_KINEMATICS_H

#include "core/base/frame.h"
#include "core/device/drive.h"

typedef enum { PALP_ARM3, PALP_FIVE_BAR, PALP_DELTA } palp_mechanism;
#define PALP_MECHANISM_NAMES "arm3", "five-bar", "delta" /* in that order */

typedef struct {
    palp_mechanism mechanism;
    float upper_m, fore_m;   /* a, b */
    float base_m;            /* e; ARM3: unused */
    bool wrist;              /* three joints more, that turn the tool */
    float gripper_m_per_rad; /* and one that opens its jaws by so much; 0: there is none */
} palp_kinematics;

typedef struct {
    palp_vec3 tip_m;
    palp_vec3 column_m[PALP_AXES]; /* of J, m/rad; zero beyond the arm's axes */
    float r[9];                    /* of the tool; a rotation */
    palp_vec3 turn[PALP_AXES];     /* w, axes that joints turn it about; zero where they do not */
    float opening_m;               /* of the jaws */
    float conditioning;            /* of the arm */
    float wrist_conditioning;      /* |cos q5|; 1 without a wrist */
    bool reachable; /* false: the links do not meet; nothing else is meaningful then */
} palp_pose;

/* Joints of the arm: 3, or 2 of the five-bar. All joints: and 3 of a wrist, 1 of a gripper. */
uint32_t palp_arm_axes(const palp_kinematics *k);
uint32_t palp_axes(const palp_kinematics *k);
/* The first joint of the wrist, and that of the gripper; palp_axes where there is none. */
uint32_t palp_wrist_axis(const palp_kinematics *k);
uint32_t palp_gripper_axis(const palp_kinematics *k);

/* Whether the lengths are positive and finite and the home pose exists: b > e + a of the parallel
 * ones. */
bool palp_kinematics_is_sound(const palp_kinematics *k);

/* Forward kinematics with J and W; a sine and cosine per joint, and two square roots. |q| <= 1e4. */
palp_pose palp_forward(const palp_kinematics *k, const float q_rad[PALP_AXES]);

/* Joint angles of the arm (elbows outward, or up) that put the tip at `tip_m`, others left alone;
 * false when it is out of reach. The five-bar ignores y. */
bool palp_inverse(const palp_kinematics *k, palp_vec3 tip_m, float q_rad[PALP_AXES]);

/* Joint angles of the wrist that turn the tool to r, with the arm's in q_rad; |q5| at most 90
 * degrees. Does nothing without a wrist. */
void palp_inverse_wrist(const palp_kinematics *k, const float r[9], float q_rad[PALP_AXES]);

/* Joint torques that make the tip push with `force_N` and turn with `moment_Nm`: tau = J^T f + W^T m
 * (Nm); of the gripper 0. */
void palp_pose_torques(const palp_pose *pose, palp_vec3 force_N, palp_vec3 moment_Nm,
                       float torque_Nm[PALP_AXES]);

/* What of a moment the motors of a wrist can make, bit i of `motors` for joint i: the moment whose
 * parts along their axes are those of moment_Nm, and that has none along axes without. It fades where
 * the wrist becomes singular. */
palp_vec3 palp_pose_transmits(const palp_pose *pose, const palp_kinematics *k, uint32_t motors,
                              palp_vec3 moment_Nm);

/* Velocity of the tip, J dq (m/s); and of the tool's turn, W dq (rad/s). */
palp_vec3 palp_pose_velocity(const palp_pose *pose, const float dq_rad_s[PALP_AXES]);
palp_vec3 palp_pose_turning(const palp_pose *pose, const float dq_rad_s[PALP_AXES]);

#endif
