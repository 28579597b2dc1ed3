/* SPDX-License-Identifier: MIT */
#include "cia402.h"
#include "core/base/real.h"

#define PDO_OFF 0x80000000u
#define PDO_NO_REMOTE 0x40000000u

palp_cia402_state palp_cia402_state_of(uint32_t statusword) {
    switch (statusword & 0x4fu) { /* states in which bit 5 says nothing */
    case 0x00:
        return PALP_CIA402_NOT_READY;
    case 0x40:
        return PALP_CIA402_DISABLED;
    case 0x08:
    case 0x0f:
        return PALP_CIA402_FAULT;
    default:
        break;
    }
    switch (statusword & 0x6fu) {
    case 0x21:
        return PALP_CIA402_READY;
    case 0x23:
        return PALP_CIA402_SWITCHED_ON;
    case 0x27:
        return PALP_CIA402_ENABLED;
    case 0x07:
        return PALP_CIA402_QUICK_STOP;
    default:
        return PALP_CIA402_NOT_READY;
    }
}

uint32_t palp_cia402_statusword(palp_cia402_state state) {
    static const uint8_t bits[] = {0x00, 0x40, 0x21, 0x23, 0x27, 0x07, 0x08};
    return bits[state];
}

uint32_t palp_cia402_controlword(palp_cia402_state state, uint32_t phase) {
    switch (state) {
    case PALP_CIA402_DISABLED:
        return 0x06;
    case PALP_CIA402_READY:
        return 0x07;
    case PALP_CIA402_SWITCHED_ON:
    case PALP_CIA402_ENABLED:
        return 0x0f;
    case PALP_CIA402_FAULT:
        return (phase & 1u) != 0u ? 0x80 : 0x00;
    case PALP_CIA402_NOT_READY:
    case PALP_CIA402_QUICK_STOP:
        break;
    }
    return 0x00;
}

palp_can_frame palp_sdo_encode(uint32_t cob_id, palp_sdo sdo) {
    palp_can_frame f = {.id = cob_id, .length = 8};
    f.data[0] = sdo.command;
    palp_put_u16(f.data + 1, sdo.index);
    f.data[3] = sdo.sub;
    palp_put_u32(f.data + 4, sdo.value);
    return f;
}

bool palp_sdo_decode(const palp_can_frame *frame, uint32_t cob_id, palp_sdo *sdo) {
    if (!palp_can_is(frame, cob_id, 0, 8)) return false;
    *sdo = (palp_sdo){.command = frame->data[0],
                      .index = (uint16_t)palp_get_u16(frame->data + 1),
                      .sub = frame->data[3],
                      .value = palp_get_u32(frame->data + 4)};
    return true;
}

palp_can_frame palp_nmt_encode(uint8_t command, uint8_t node) {
    return (palp_can_frame){.id = PALP_COB_NMT, .length = 2, .data = {command, node}};
}

palp_can_frame palp_heartbeat_encode(uint8_t node, uint8_t state) {
    return (palp_can_frame){.id = PALP_COB_HEARTBEAT + node, .length = 1, .data = {state}};
}

palp_can_frame palp_rpdo_encode(uint8_t node, uint32_t controlword, int32_t torque) {
    palp_can_frame f = {.id = PALP_COB_RPDO1 + node, .length = 4};
    palp_put_u16(f.data, controlword);
    palp_put_u16(f.data + 2, (uint32_t)torque);
    return f;
}

palp_can_frame palp_tpdo_encode(uint8_t node, uint32_t statusword, int32_t position,
                                int32_t torque) {
    palp_can_frame f = {.id = PALP_COB_TPDO1 + node, .length = 8};
    palp_put_u16(f.data, statusword);
    palp_put_u32(f.data + 2, (uint32_t)position);
    palp_put_u16(f.data + 6, (uint32_t)torque);
    return f;
}

/* 0x60c2: the cycle as value * 10^index seconds, in whole milliseconds if it can be. */
static palp_cia402_step cycle_time(uint32_t sub, float rate_hz) {
    float value = 1e3f / rate_hz;
    uint32_t exponent = 0xfdu; /* -3 */
    bool whole = palp_abs(value - (float)(uint32_t)(value + 0.5f)) < 1e-3f;
    /* at most 5: it is above 1e-3 */
    while (!whole && value < 25.0f) {
        value *= 10.0f;
        exponent--;
    }
    return (palp_cia402_step){.index = 0x60c2,
                              .sub = (uint8_t)sub,
                              .size = 1,
                              .value = sub == 1u ? (uint32_t)(value + 0.5f) : exponent,
                              .optional = true};
}

/* Switches a PDO off that nobody here uses. */
static palp_cia402_step unused_pdo(uint16_t index) {
    return (palp_cia402_step){
        .index = index, .sub = 1, .size = 4, .value = PDO_OFF, .optional = true};
}

palp_cia402_step palp_cia402_configure(uint32_t i, uint8_t node, float rate_hz,
                                       uint32_t rated_torque_mNm, uint32_t watchdog_ms) {
    const palp_cia402_step steps[PALP_CIA402_STEPS] = {
        {.index = 0x6502, .sub = 0, .value = 1u << 9, .mask = 1u << 9}, /* can it do CST? */
        {.index = 0x6076, .sub = 0, .value = rated_torque_mNm, .mask = 0xffffffffu},
        {.index = 0x1017, .sub = 0, .size = 2, .value = PALP_CIA402_HEARTBEAT_MS},
        {.index = 0x1016, .sub = 1, .size = 4, .value = PALP_CANOPEN_HOST << 16 | watchdog_ms},
        {.index = 0x6007, .sub = 0, .size = 2, .value = 1}, /* silence is a fault */
        {.index = 0x6060, .sub = 0, .size = 1, .value = PALP_CIA402_CST},
        {.index = 0x6061, .sub = 0, .value = PALP_CIA402_CST, .mask = 0xffu},
        cycle_time(2, rate_hz),
        cycle_time(1, rate_hz),
        unused_pdo(0x1401),
        unused_pdo(0x1402),
        unused_pdo(0x1403),
        unused_pdo(0x1801),
        unused_pdo(0x1802),
        unused_pdo(0x1803),
        {.index = 0x1400, .sub = 1, .size = 4, .value = PDO_OFF | (PALP_COB_RPDO1 + node)},
        {.index = 0x1600, .sub = 0, .size = 1, .value = 0},
        {.index = 0x1600, .sub = 1, .size = 4, .value = 0x60400010},
        {.index = 0x1600, .sub = 2, .size = 4, .value = 0x60710010},
        {.index = 0x1600, .sub = 0, .size = 1, .value = 2},
        {.index = 0x1400, .sub = 2, .size = 1, .value = 1}, /* act at the next SYNC */
        {.index = 0x1400, .sub = 1, .size = 4, .value = PALP_COB_RPDO1 + node},
        {.index = 0x1800,
         .sub = 1,
         .size = 4,
         .value = PDO_OFF | PDO_NO_REMOTE | (PALP_COB_TPDO1 + node)},
        {.index = 0x1a00, .sub = 0, .size = 1, .value = 0},
        {.index = 0x1a00, .sub = 1, .size = 4, .value = 0x60410010},
        {.index = 0x1a00, .sub = 2, .size = 4, .value = 0x60640020},
        {.index = 0x1a00, .sub = 3, .size = 4, .value = 0x60770010},
        {.index = 0x1a00, .sub = 0, .size = 1, .value = 3},
        {.index = 0x1800, .sub = 2, .size = 1, .value = 1}, /* at every SYNC */
        {.index = 0x1800, .sub = 1, .size = 4, .value = PDO_NO_REMOTE | (PALP_COB_TPDO1 + node)},
    };
    return steps[i];
}
