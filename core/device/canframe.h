/* SPDX-License-Identifier: MIT */
/* One CAN or CAN FD frame, and little-endian fields in it. */
#ifndef PALP_DEVICE_CANFRAME_H
#define PALP_DEVICE_CANFRAME_H

#include <stdint.h>

#define PALP_CAN_EXTENDED 1u
#define PALP_CAN_REMOTE 2u
#define PALP_CAN_ERROR 4u
#define PALP_CAN_FD 8u

typedef struct {
    uint32_t id; /* 11 or 29 bits */
    uint8_t flags, length;
    uint8_t data[64];
} palp_can_frame;

static inline uint32_t palp_get_u32(const uint8_t *p) {
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}
static inline void palp_put_u32(uint8_t *p, uint32_t v) {
    for (int i = 0; i < 4; i++) p[i] = (uint8_t)(v >> (8 * i));
}
static inline float palp_get_f32(const uint8_t *p) {
    union {
        uint32_t u;
        float f;
    } bits = {.u = palp_get_u32(p)};
    return bits.f;
}
static inline void palp_put_f32(uint8_t *p, float v) {
    union {
        float f;
        uint32_t u;
    } bits = {.f = v};
    palp_put_u32(p, bits.u);
}

#endif
