/* SPDX-License-Identifier: MIT */
/* The virtual haptic device: a mechanism's tip as a mass with damping and friction, behind
 * simulated drives. */
#ifndef PALP_SIM_DEVICE_H
#define PALP_SIM_DEVICE_H

#include "port/host/devfile.h"
#include "sim/drive.h"

#define SIM_FRAMES_OUT (PALP_AXES * (SIM_DRIVE_QUEUE + 2))

typedef struct {
    const device_file *file;
    double x_m[3], v_m_s[3];
    float q_rad[PALP_AXES];    /* of the last inverse kinematics */
    float zero_rad[PALP_AXES]; /* where the drives read 0 */
    sim_drive drive[PALP_AXES];
    uint32_t axes;
    double time_s, last_s;
    bool stuck;          /* the encoders stand still */
    double given_J;      /* by the motors to the hand: less weight, damping and friction */
    double offset_turns; /* added to the first one's reading */
} sim_device;

/* At rest with the tip at `x_m`, drives idle. */
void sim_device_init(sim_device *d, const device_file *file, const double x_m[3]);

/* A frame that the controller sent. */
void sim_device_receive(sim_device *d, const palp_can_frame *frame);

/* Moves for `dt_s` with the hand's spring (N/m), damper (Ns/m) and target, in small steps. */
void sim_device_move(sim_device *d, double dt_s, const double target_m[3], double hand_N_per_m,
                     double hand_Ns_per_m);

/* Frames that the drives send at the end of a period. Returns how many. */
uint32_t sim_device_transmit(sim_device *d, palp_can_frame frames[SIM_FRAMES_OUT]);

#endif
