/* SPDX-License-Identifier: MIT */
/*
 * ODrive CANSimple: 11-bit id = node << 5 | command, little-endian payloads. The same codec serves
 * both ends, so that the simulated drive speaks exactly what the controller expects.
 */
#ifndef PALP_DEVICE_ODRIVE_H
#define PALP_DEVICE_ODRIVE_H

#include "core/device/canframe.h"

typedef enum {
    PALP_ODRIVE_HEARTBEAT = 0x01,
    PALP_ODRIVE_ESTOP = 0x02,
    PALP_ODRIVE_GET_ERROR = 0x03, /* cyclic, if it is switched on */
    PALP_ODRIVE_SET_AXIS_STATE = 0x07,
    PALP_ODRIVE_ENCODER_ESTIMATES = 0x09,
    PALP_ODRIVE_SET_CONTROLLER_MODE = 0x0b,
    PALP_ODRIVE_SET_INPUT_TORQUE = 0x0e,
    PALP_ODRIVE_CLEAR_ERRORS = 0x18
} palp_odrive_command;

#define PALP_ODRIVE_IDLE 1u
#define PALP_ODRIVE_CLOSED_LOOP 8u
#define PALP_ODRIVE_TORQUE_CONTROL 1u
#define PALP_ODRIVE_PASSTHROUGH 1u

/* Everything that a CANSimple frame can say; which fields are set depends on `command`. */
typedef struct {
    uint8_t node;
    palp_odrive_command command;
    uint32_t error; /* heartbeat, get error */
    uint32_t state; /* heartbeat, set axis state */
    uint32_t parts; /* heartbeat of firmware 0.5, errors that `error` need not show: 1 the motor's,
                       2 the encoder's, 4 the controller's */
    float position_rev; /* encoder estimates */
    float velocity_rev_s;
    float torque_Nm; /* set input torque */
    uint32_t control_mode, input_mode;
} palp_odrive_message;

/* Whether this is on the bus although nobody here reads it, sent by a drive on its own account or in
 * answer to somebody's tool: version, errors of parts, parameters (TxSdo), address, encoder counts,
 * motor current, temperature, bus voltage, sensorless estimates, torques, powers. */
bool palp_odrive_is_telemetry(const palp_can_frame *frame);

/* False for remote, error, extended or FD frames, unknown commands and wrong lengths. Constant
 * time. */
bool palp_odrive_decode(const palp_can_frame *frame, palp_odrive_message *message);

/* Precondition: node < 64 and a command of the list above. */
palp_can_frame palp_odrive_encode(const palp_odrive_message *message);

#endif
