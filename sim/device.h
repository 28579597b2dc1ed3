/* SPDX-License-Identifier: MIT */
/* The virtual haptic device: a mechanism's tip as a mass with damping and friction, its stylus as a
 * small inertia, behind simulated drives. */
#ifndef PALP_SIM_DEVICE_H
#define PALP_SIM_DEVICE_H

#include "port/host/devfile.h"
#include "sim/drive.h"
#include "sim/hand.h"

#define SIM_FRAMES_OUT (PALP_AXES * (SIM_DRIVE_QUEUE + 2))

typedef struct {
    const device_file *file;
    double x_m[3], v_m_s[3];
    float r[9]; /* of the stylus, */
    double w_rad_s[3], gripper_rad, gripper_rad_s;
    float q_rad[PALP_AXES];    /* of the last inverse kinematics */
    float zero_rad[PALP_AXES]; /* where the drives read 0 */
    sim_drive drive[PALP_AXES];
    uint32_t axes;
    double time_s, last_s;
    bool stuck;          /* the encoders stand still */
    double given_J;      /* by the motors to the hand: less weight, damping and friction */
    double offset_turns; /* added to the first one's reading */
} sim_device;

/* At rest there, drives idle. */
void sim_device_init(sim_device *d, const device_file *file, const hand_pose *at);

/* A frame that the controller sent. */
void sim_device_receive(sim_device *d, const palp_can_frame *frame);

/* Moves for `dt_s` by the hand's springs and dampers towards `target`, in small steps. */
void sim_device_move(sim_device *d, double dt_s, const hand_pose *target, const hand *h);

/* Frames that the drives send at the end of a period. Returns how many. */
uint32_t sim_device_transmit(sim_device *d, palp_can_frame frames[SIM_FRAMES_OUT]);

#endif
