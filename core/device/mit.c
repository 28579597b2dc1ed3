/* SPDX-License-Identifier: MIT */
#include "mit.h"

/* x in [-full, full] on a grid of 2^bits steps; saturates. */
static uint32_t to_field(float x, float full, uint32_t bits) {
    int32_t top = (int32_t)((1u << bits) - 1u);
    return (uint32_t)palp_saturate((x + full) / (2.0f * full) * (float)top, 0, top);
}

static float from_field(uint32_t v, float full, uint32_t bits) {
    float top = (float)((1u << bits) - 1u);
    return (float)v * (2.0f * full) / top - full;
}

palp_can_frame palp_mit_encode_command(uint8_t node, uint8_t flags, const palp_mit_range *range,
                                       palp_mit_command command) {
    palp_can_frame f = {.id = node, .flags = flags, .length = 8};
    if (command.kind != PALP_MIT_COMMAND) {
        for (uint32_t i = 0; i < 7u; i++) f.data[i] = 0xff;
        f.data[7] = (uint8_t)command.kind;
        return f;
    }
    uint32_t p = to_field(0.0f, range->position_rad, 16), v = to_field(0.0f, 1.0f, 12);
    uint32_t t = to_field(command.torque_Nm, range->torque_Nm, 12);
    f.data[0] = (uint8_t)(p >> 8);
    f.data[1] = (uint8_t)p;
    f.data[2] = (uint8_t)(v >> 4);
    f.data[3] = (uint8_t)(v << 4); /* kp = kd = 0 */
    f.data[6] = (uint8_t)(t >> 8);
    f.data[7] = (uint8_t)t;
    return f;
}

bool palp_mit_decode_command(const palp_can_frame *frame, uint8_t node, uint8_t flags,
                             const palp_mit_range *range, palp_mit_command *command) {
    const uint8_t *d = frame->data;
    if (!palp_can_is(frame, node, flags, 8)) return false;
    bool special = true;
    for (uint32_t i = 0; i < 7u; i++) special = special && d[i] == 0xffu;
    if (special && d[7] >= PALP_MIT_ENTER && d[7] <= PALP_MIT_ZERO) {
        *command = (palp_mit_command){.kind = (palp_mit_kind)d[7]};
        return true;
    }
    uint32_t t = ((uint32_t)d[6] & 0xfu) << 8 | d[7];
    *command = (palp_mit_command){.torque_Nm = from_field(t, range->torque_Nm, 12)};
    return true;
}

palp_can_frame palp_mit_encode_answer(uint32_t master_id, uint8_t flags,
                                      const palp_mit_range *range, const palp_mit_answer *answer) {
    palp_can_frame f = {.id = master_id, .flags = flags, .length = answer->is_long ? 8u : 6u};
    uint32_t p = to_field(answer->position_rad, range->position_rad, 16);
    uint32_t v = to_field(answer->velocity_rad_s, range->velocity_rad_s, 12);
    uint32_t t = to_field(answer->torque_Nm, range->torque_Nm, 12);
    f.data[0] = answer->is_long ? (uint8_t)((uint32_t)answer->state << 4 | (answer->node & 0xfu))
                                : answer->node;
    f.data[1] = (uint8_t)(p >> 8);
    f.data[2] = (uint8_t)p;
    f.data[3] = (uint8_t)(v >> 4);
    f.data[4] = (uint8_t)(v << 4 | t >> 8);
    f.data[5] = (uint8_t)t;
    if (answer->is_long) {
        f.data[6] = 30;
        f.data[7] = answer->last;
    }
    return f;
}

uint32_t palp_mit_answer_node(const palp_can_frame *frame) {
    if (frame->length == 8u) return frame->data[0] & 0xfu;
    return frame->length == 6u ? frame->data[0] : PALP_MIT_NO_ANSWER;
}

bool palp_mit_decode_answer(const palp_can_frame *frame, uint32_t master_id, uint8_t flags,
                            const palp_mit_range *range, palp_mit_answer *answer) {
    const uint8_t *d = frame->data;
    if (frame->id != master_id || frame->flags != flags) return false;
    if (frame->length != 6u && frame->length != 8u) return false;
    bool is_long = frame->length == 8u;
    *answer = (palp_mit_answer){
        .node = (uint8_t)palp_mit_answer_node(frame),
        .state = is_long ? d[0] >> 4 : 0,
        .last = is_long ? d[7] : 0,
        .is_long = is_long,
        .position_rad = from_field((uint32_t)d[1] << 8 | d[2], range->position_rad, 16),
        .velocity_rad_s = from_field((uint32_t)d[3] << 4 | d[4] >> 4, range->velocity_rad_s, 12),
        .torque_Nm = from_field(((uint32_t)d[4] & 0xfu) << 8 | d[5], range->torque_Nm, 12)};
    return true;
}
