/* SPDX-License-Identifier: MIT */
#include "odrive.h"

/* Payload length of a command, 0xff when it is not one of ours. */
static uint8_t payload_length(uint32_t command) {
    switch (command) {
    case PALP_ODRIVE_ESTOP:
        return 0;
    case PALP_ODRIVE_CLEAR_ERRORS:
        return 1;
    case PALP_ODRIVE_SET_AXIS_STATE:
    case PALP_ODRIVE_SET_INPUT_TORQUE:
        return 4;
    case PALP_ODRIVE_HEARTBEAT:
    case PALP_ODRIVE_GET_ERROR:
    case PALP_ODRIVE_ENCODER_ESTIMATES:
    case PALP_ODRIVE_SET_CONTROLLER_MODE:
        return 8;
    default:
        return 0xff;
    }
}

bool palp_odrive_is_telemetry(const palp_can_frame *frame) {
    const uint32_t commands = 1u << 0x00 | 1u << 0x04 | 1u << 0x05 | 1u << 0x06 | 1u << 0x0a |
                              1u << 0x14 | 1u << 0x15 | 1u << 0x17 | 1u << 0x1a | 1u << 0x1c |
                              1u << 0x1d;
    return frame->flags == 0u && frame->length <= 8u &&
           (commands >> (frame->id & 0x1fu) & 1u) != 0u;
}

bool palp_odrive_decode(const palp_can_frame *frame, palp_odrive_message *message) {
    uint32_t command = frame->id & 0x1fu;
    /* Older firmware has CLEAR_ERRORS without its byte; both are accepted. */
    bool short_clear = command == PALP_ODRIVE_CLEAR_ERRORS && frame->length == 0u;
    if (frame->flags != 0u || frame->id > 0x7ffu) return false;
    if (frame->length != payload_length(command) && !short_clear) return false;
    const uint8_t *d = frame->data;
    *message = (palp_odrive_message){.node = (uint8_t)(frame->id >> 5),
                                     .command = (palp_odrive_command)command};
    switch (message->command) {
    case PALP_ODRIVE_HEARTBEAT:
        message->error = palp_get_u32(d);
        message->state = d[4];
        /* Firmware 0.6 leaves the last byte 0, and has other things in the two before it; 0.5 sets
         * its high bit when no trajectory is under way. */
        if (d[7] != 0u) message->parts = (d[5] & 1u) | (d[6] & 1u) << 1u | (d[7] & 1u) << 2u;
        break;
    case PALP_ODRIVE_GET_ERROR:
        message->error = palp_get_u32(d);
        break;
    case PALP_ODRIVE_SET_AXIS_STATE:
        message->state = palp_get_u32(d);
        break;
    case PALP_ODRIVE_ENCODER_ESTIMATES:
        message->position_rev = palp_get_f32(d);
        message->velocity_rev_s = palp_get_f32(d + 4);
        break;
    case PALP_ODRIVE_SET_CONTROLLER_MODE:
        message->control_mode = palp_get_u32(d);
        message->input_mode = palp_get_u32(d + 4);
        break;
    case PALP_ODRIVE_SET_INPUT_TORQUE:
        message->torque_Nm = palp_get_f32(d);
        break;
    case PALP_ODRIVE_ESTOP:
    case PALP_ODRIVE_CLEAR_ERRORS:
        break;
    }
    return true;
}

palp_can_frame palp_odrive_encode(const palp_odrive_message *message) {
    palp_can_frame f = {.id = (uint32_t)message->node << 5 | (uint32_t)message->command,
                        .length = payload_length((uint32_t)message->command)};
    switch (message->command) {
    case PALP_ODRIVE_HEARTBEAT:
        palp_put_u32(f.data, message->error);
        f.data[4] = (uint8_t)message->state;
        if (message->parts != 0u) {
            f.data[5] = (uint8_t)(message->parts & 1u);
            f.data[6] = (uint8_t)(message->parts >> 1u & 1u);
            f.data[7] = (uint8_t)(0x80u | message->parts >> 2u);
        }
        break;
    case PALP_ODRIVE_GET_ERROR:
        palp_put_u32(f.data, message->error);
        break;
    case PALP_ODRIVE_SET_AXIS_STATE:
        palp_put_u32(f.data, message->state);
        break;
    case PALP_ODRIVE_ENCODER_ESTIMATES:
        palp_put_f32(f.data, message->position_rev);
        palp_put_f32(f.data + 4, message->velocity_rev_s);
        break;
    case PALP_ODRIVE_SET_CONTROLLER_MODE:
        palp_put_u32(f.data, message->control_mode);
        palp_put_u32(f.data + 4, message->input_mode);
        break;
    case PALP_ODRIVE_SET_INPUT_TORQUE:
        palp_put_f32(f.data, message->torque_Nm);
        break;
    case PALP_ODRIVE_ESTOP:
    case PALP_ODRIVE_CLEAR_ERRORS:
        break;
    }
    return f;
}
