/* SPDX-License-Identifier: MIT */
#include "protect.h"

#define COUNTERS 15u

uint8_t palp_crc8(uint8_t crc, const uint8_t *data, uint32_t bytes) {
    /* of each half of a byte, by the polynomial 0x1d */
    static const uint8_t half[16] = {0x00, 0x1d, 0x3a, 0x27, 0x74, 0x69, 0x4e, 0x53,
                                     0xe8, 0xf5, 0xd2, 0xcf, 0x9c, 0x81, 0xa6, 0xbb};
    crc ^= 0xffu;
    for (uint32_t i = 0; i < bytes; i++) {
        crc = (uint8_t)(crc << 4 ^ half[crc >> 4 ^ data[i] >> 4]);
        crc = (uint8_t)(crc << 4 ^ half[crc >> 4 ^ (data[i] & 0xfu)]);
    }
    return crc ^ 0xffu;
}

static uint8_t crc_of(const palp_can_frame *frame) {
    const uint8_t id[2] = {(uint8_t)frame->id, (uint8_t)(frame->id >> 8)};
    return palp_crc8(palp_crc8(0, id, 2), frame->data + 1, frame->length - 1u);
}

void palp_e2e_protect(palp_e2e *e2e, palp_can_frame *frame) {
    e2e->counter = (uint8_t)((e2e->counter + 1u) % COUNTERS);
    frame->data[1] = (uint8_t)((frame->data[1] & 0xf0u) | e2e->counter);
    frame->data[0] = crc_of(frame);
}

palp_e2e_verdict palp_e2e_check(palp_e2e *e2e, const palp_can_frame *frame) {
    if (frame == NULL) return PALP_E2E_NO_NEW_DATA;
    if (frame->length < 2u || frame->length > PALP_CAN_MAX_DATA) return PALP_E2E_WRONG_CRC;
    uint32_t counter = frame->data[1] & 0xfu;
    if (frame->data[0] != crc_of(frame) || counter >= COUNTERS) return PALP_E2E_WRONG_CRC;
    uint32_t step = (counter + COUNTERS - e2e->counter) % COUNTERS;
    bool first = !e2e->synchronised;
    if (!first && step == 0u) return PALP_E2E_REPEATED;
    e2e->synchronised = true;
    e2e->counter = (uint8_t)counter;
    if (first || step == 1u) return PALP_E2E_OK;
    return step <= PALP_E2E_MAX_GAP ? PALP_E2E_SOME_LOST : PALP_E2E_WRONG_SEQUENCE;
}
