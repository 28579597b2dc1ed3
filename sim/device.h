/* SPDX-License-Identifier: MIT */
/* The virtual haptic device: an arm's tip as a mass with damping and friction, behind three
 * simulated drives. */
#ifndef PALP_SIM_DEVICE_H
#define PALP_SIM_DEVICE_H

#include "core/device/canframe.h"
#include "core/device/device.h"

/* A device file, read: what the controller knows and what only the simulation needs. */
typedef struct {
    palp_device device;
    double mass_kg, damping_Ns_per_m, friction_N;
    char name[64];
} device_file;

/* Reads `name_or_path`: a built-in description or a file. Exits 2 with the line named when it is
 * wrong. */
device_file device_load(const char *name_or_path);

typedef struct {
    uint32_t state; /* ODrive axis state */
    bool torque_mode;
    double torque_Nm; /* commanded */
    double actual_Nm; /* after the current loop */
    double since_command_s;
    double turns, turns_per_s; /* encoder reading, and its rate as the drive estimates it */
} sim_drive;

#define SIM_FRAMES_OUT 8

typedef struct {
    const device_file *file;
    double x_m[3], v_m_s[3];
    double q_rad[PALP_AXES]; /* of the last inverse kinematics */
    sim_drive drive[PALP_AXES];
    double time_s, last_s, next_heartbeat_s;
} sim_device;

/* At rest with the tip at `x_m`, drives idle. */
void sim_device_init(sim_device *d, const device_file *file, const double x_m[3]);

/* A frame that the controller sent. */
void sim_device_receive(sim_device *d, const palp_can_frame *frame);

/* Moves for `dt_s` with the hand's spring (N/m), damper (Ns/m) and target, in small steps. */
void sim_device_move(sim_device *d, double dt_s, const double target_m[3], double hand_N_per_m,
                     double hand_Ns_per_m);

/* Frames that the drives send at the end of a period: estimates, and heartbeats when due. Returns
 * how many. */
uint32_t sim_device_transmit(sim_device *d, palp_can_frame frames[SIM_FRAMES_OUT]);

/* Joint angles that put the tip at x; false when out of reach. */
bool arm_inverse(const palp_arm *arm, const double x_m[3], double q_rad[PALP_AXES]);

#endif
