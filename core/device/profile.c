/* SPDX-License-Identifier: MIT */
#include "profile.h"

#define VELOCITY_UNIT 0.01f

static palp_can_frame frame_of(uint32_t id, bool fd, uint8_t length, uint32_t nibble) {
    palp_can_frame f = {.id = id, .flags = fd ? PALP_CAN_FD : 0, .length = length};
    f.data[1] = (uint8_t)(nibble << 4);
    return f;
}

palp_can_frame palp_profile_encode_command(palp_e2e *e2e, uint8_t node, bool fd,
                                           const palp_profile_command *command) {
    palp_can_frame f = frame_of(PALP_PROFILE_COMMAND + node, fd, 8, (uint32_t)command->mode);
    palp_put_u16(f.data + 2, command->watchdog_ms);
    palp_put_f32(f.data + 4, command->torque_Nm);
    palp_e2e_protect(e2e, &f);
    return f;
}

palp_can_frame palp_profile_encode_status(palp_e2e *e2e, uint8_t node, bool fd,
                                          const palp_profile_status *status) {
    palp_can_frame f = frame_of(PALP_PROFILE_STATUS + node, fd, fd ? PALP_PROFILE_FD_STATUS : 8,
                                (uint32_t)status->state);
    if (fd) {
        palp_put_u16(f.data + 2, status->error);
        palp_put_f32(f.data + 4, status->position_rev);
        palp_put_f32(f.data + 8, status->velocity_rev_s);
        palp_put_f32(f.data + 12, status->torque_Nm);
    } else {
        palp_put_f32(f.data + 2, status->position_rev);
        palp_put_u16(f.data + 6, (uint32_t)palp_saturate(status->velocity_rev_s / VELOCITY_UNIT,
                                                         INT16_MIN, INT16_MAX));
    }
    palp_e2e_protect(e2e, &f);
    return f;
}

bool palp_profile_decode_command(palp_e2e *e2e, const palp_can_frame *frame, uint8_t node, bool fd,
                                 palp_profile_command *command, palp_e2e_verdict *verdict) {
    if (!palp_can_is(frame, PALP_PROFILE_COMMAND + node, fd ? PALP_CAN_FD : 0, 8)) return false;
    *verdict = palp_e2e_check(e2e, frame);
    *command = (palp_profile_command){.mode = (palp_profile_mode)(frame->data[1] >> 4),
                                      .watchdog_ms = palp_get_u16(frame->data + 2),
                                      .torque_Nm = palp_get_f32(frame->data + 4)};
    return true;
}

bool palp_profile_decode_status(palp_e2e *e2e, const palp_can_frame *frame, uint8_t node, bool fd,
                                palp_profile_status *status, palp_e2e_verdict *verdict) {
    if (!palp_can_is(frame, PALP_PROFILE_STATUS + node, fd ? PALP_CAN_FD : 0,
                     fd ? PALP_PROFILE_FD_STATUS : 8))
        return false;
    *verdict = palp_e2e_check(e2e, frame);
    *status = (palp_profile_status){.state = (palp_profile_state)(frame->data[1] >> 4)};
    if (fd) {
        status->error = palp_get_u16(frame->data + 2);
        status->position_rev = palp_get_f32(frame->data + 4);
        status->velocity_rev_s = palp_get_f32(frame->data + 8);
        status->torque_Nm = palp_get_f32(frame->data + 12);
    } else {
        status->position_rev = palp_get_f32(frame->data + 2);
        status->velocity_rev_s = (float)palp_get_i16(frame->data + 6) * VELOCITY_UNIT;
    }
    return true;
}
