/* SPDX-License-Identifier: MIT */
/*
 * moteus: one CAN FD frame to each drive and one back per cycle, made of register subframes. The id
 * is source << 8 | destination, bit 15 asks for an answer; above 7FF it takes 29 bits. Torque
 * control is position mode with both gains scaled to 0 and the torque as feed-forward; each command
 * carries its own watchdog.
 */
#ifndef PALP_DEVICE_MOTEUS_H
#define PALP_DEVICE_MOTEUS_H

#include "core/device/canframe.h"

#define PALP_MOTEUS_STOPPED 0
#define PALP_MOTEUS_FAULT 1
#define PALP_MOTEUS_POSITION 10
#define PALP_MOTEUS_TIMEOUT 11 /* its watchdog ran out; latched until stopped */
#define PALP_MOTEUS_REPLY 0x8000u

typedef struct {
    int32_t mode;
    float torque_Nm, torque_max_Nm, timeout_s;
} palp_moteus_command;

typedef struct {
    int32_t mode, fault;
    float position_rev, velocity_rev_s, torque_Nm;
} palp_moteus_answer;

/* A command with the query of what the answer holds: 48 bytes, or 12 for a stop. */
palp_can_frame palp_moteus_encode_command(uint8_t node, const palp_moteus_command *command);
/* 24 bytes: mode, position, velocity, torque, voltage, temperature, fault. */
palp_can_frame palp_moteus_encode_answer(uint8_t node, const palp_moteus_answer *answer);

/*
 * Walk the subframes of any register layout in any of the four number formats; false when a
 * subframe is cut short or unknown, or when it is not an FD frame with the right addresses.
 * Registers that are not known are skipped. Cost: the frame's bytes.
 */
bool palp_moteus_decode_command(const palp_can_frame *frame, uint8_t node,
                                palp_moteus_command *command);
bool palp_moteus_decode_answer(const palp_can_frame *frame, uint8_t node,
                               palp_moteus_answer *answer);

#endif
