/* SPDX-License-Identifier: MIT */
/* A simulated motor drive: the other end of every protocol of core/device, with its current loop,
 * encoder and watchdog. */
#ifndef PALP_SIM_DRIVE_H
#define PALP_SIM_DRIVE_H

#include "core/device/cia402.h"
#include "core/device/drive.h"

#define SIM_DRIVE_QUEUE 4

typedef struct {
    const palp_drive_config *config;
    uint8_t node;
    bool live;          /* acts on torque */
    uint32_t error;     /* shown to the controller, and never live while it stands */
    uint32_t announced; /* of the errors, by an emergency message */
    bool timed_out;     /* the watchdog has let go; latched by CiA 402 and moteus */
    double torque_Nm, actual_Nm;
    double since_command_s, watchdog_s;
    double turns, turns_per_s; /* encoder reading, and its rate as the drive estimates it */
    palp_can_frame answer[SIM_DRIVE_QUEUE];
    uint32_t answers;
    double next_heartbeat_s, heartbeat_s;
    /* ODrive */
    uint32_t axis_state;
    bool torque_mode;
    /* CiA 402 */
    palp_cia402_state state;
    uint8_t nmt, mode, rpdo_entries, tpdo_entries, tpdo_type;
    bool rpdo_on, tpdo_on, lets_go; /* lets_go: 0x6007 makes silence a fault */
    uint16_t controlword;
    uint16_t refuses, ignores,
        mutes; /* objects that it does not serve, take values of, answer for */
    int32_t target;
    /* Palp */
    palp_e2e sent, received;
} sim_drive;

void sim_drive_init(sim_drive *d, const palp_drive_config *config, uint8_t node);

/* A frame on the bus, whoever it is for. */
void sim_drive_receive(sim_drive *d, const palp_can_frame *frame);

/* Torque follows the command for `h_s`, as long as commands come. */
void sim_drive_move(sim_drive *d, double h_s);

/* The encoder reads `turns` after `dt_s`. */
void sim_drive_read(sim_drive *d, double turns, double dt_s);

/* Frames of the period that ends at `time_s`; returns how many, at most SIM_DRIVE_QUEUE + 2. */
uint32_t sim_drive_transmit(sim_drive *d, double time_s, palp_can_frame *frames);

#endif
