/* SPDX-License-Identifier: MIT */
/* What the controller must know of a haptic device; hosts read it from sim/devices/NAME.dev. */
#ifndef PALP_DEVICE_DEVICE_H
#define PALP_DEVICE_DEVICE_H

#include "core/device/kinematics.h"

/*
 * Torques that the mechanism itself asks for, added to those of the contact: the weight of the
 * moving parts, as it feels at the tip, and a share of each joint's friction in the direction of
 * motion. An integrator's own model comes in through the feed-forward of a tick.
 */
typedef struct {
    palp_vec3 gravity_compensation_N; /* force at the tip that holds it up; finite */
    float coulomb_Nm[PALP_AXES];  /* at the joints, at least 0; less than the true ones, or the */
    float viscous_Nms[PALP_AXES]; /* mechanism runs away by itself */
} palp_compensation;

/* Arrays by axis; those beyond palp_axes(&kinematics) are not read. */
typedef struct {
    palp_kinematics kinematics;
    palp_drive_config drives;
    uint8_t node_id[PALP_AXES]; /* drive of each joint, all different: 0 to 63; CiA 402: 1 to 126;
                                   moteus: 1 to 63; MIT: 0 to 15, and not master_id */
    uint32_t passive;           /* bit i: joint i of wrist or gripper has an encoder and no motor */
    float gear[PALP_AXES]; /* motor revolutions per joint revolution, not 0, sign = direction */
    float joint_zero_rad[PALP_AXES]; /* angle of a joint where its drive reads 0 */
    bool homes; /* drives read 0 where they were switched on: joint_zero_rad is found by homing */
    float joint_home_rad[PALP_AXES]; /* angles at which the mechanism is held meanwhile; within the
                                        limits if it homes */
    float joint_min_rad[PALP_AXES];  /* below joint_max_rad; both within PALP_JOINT_FARTHEST_RAD */
    float joint_max_rad[PALP_AXES];
    float force_max_N, slew_max_N_per_s, speed_max_m_s; /* at the tip; above 0 */
    float workspace_radius_m;    /* about the home pose, above 0; the force fades from 1.25 of it */
    float tool_radius_m;         /* of what the hand holds; only hosts read it */
    float stiffness_max_N_per_m; /* most that the device renders well, above 0 */
    float damping_max_Ns_per_m;  /* the same; at least 0 */
    float moment_max_Nm; /* of a wrist with motors, above 0; else not read, as the next two */
    float stiffness_max_Nm_per_rad, damping_max_Nms_per_rad;
    float mass_kg;          /* of the mechanism as it feels at the tip; 0: not known */
    float damping_Ns_per_m; /* of the mechanism itself, at the tip; at least 0 */
    palp_compensation compensation;
    float bit_rate_bps; /* of the bus; 0: not known, the time of frames is then taken for nothing */
    float data_rate_bps; /* second rate of CAN FD */
} palp_device;

/* Farthest that a joint may be asked or read to be, in any device: angles beyond it are not
 * resolved (rad). */
#define PALP_JOINT_FARTHEST_RAD 1e4f

/* Whether everything is positive where it must be, within range, and goes together. */
bool palp_device_is_sound(const palp_device *device);

/*
 * The virtual coupling's stiffness: the device's own limit, or less where the rate and the delay of
 * the loop ask for it, K <= (b + B) / (T / 2 + t_d), with b the mechanism's damping, B the
 * coupling's, t_d the age of estimates and the time of the frames on the bus (N/m).
 */
float palp_device_coupling(const palp_device *device);

/* The stiffest coupling whose oscillation with the mechanism's mass m the loop still follows, 0.7
 * radians per period and age of estimates: m / (2 (T + t_d)^2) (N/m). Without a mass: no limit. */
float palp_device_stiffest(const palp_device *device);

/* How fast a joint can turn when the tip moves at its limit, with room to spare; of wrist and gripper, as
 * a hand turns a stylus (rad/s). */
float palp_device_joint_speed(const palp_device *device, uint32_t joint);

/* Bit i: joint i has a motor. */
uint32_t palp_device_motors(const palp_device *device);
/* Whether motors turn the tool. */
bool palp_device_turns(const palp_device *device);

/* Joint torques that hold the mechanism up, and that follow its friction, at a pose and joint
 * velocities. */
void palp_device_compensate(const palp_device *device, const palp_pose *pose,
                            const float dq_rad_s[PALP_AXES], float gravity_Nm[PALP_AXES],
                            float friction_Nm[PALP_AXES]);

#endif
