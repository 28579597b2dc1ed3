/* SPDX-License-Identifier: MIT */
/* One CAN or CAN FD frame, and the little-endian fields in it. */
#ifndef PALP_DEVICE_CANFRAME_H
#define PALP_DEVICE_CANFRAME_H

#include <stdbool.h>
#include <stdint.h>

#define PALP_CAN_EXTENDED 1u
#define PALP_CAN_REMOTE 2u
#define PALP_CAN_ERROR 4u
#define PALP_CAN_FD 8u
#define PALP_CAN_MAX_DATA 64u
#define PALP_CAN_CLASSIC_DATA 8u

typedef struct {
    uint32_t id; /* 11 or 29 bits */
    uint8_t flags, length;
    uint8_t data[PALP_CAN_MAX_DATA];
} palp_can_frame;

/* The flags that an id asks for: more than 11 bits make it extended. */
static inline uint8_t palp_can_id_flags(uint32_t id) {
    return id > 0x7ffu ? PALP_CAN_EXTENDED : 0u;
}

/* Exactly this id, kind (flags) and length: what every codec asks first. */
static inline bool palp_can_is(const palp_can_frame *f, uint32_t id, uint8_t flags,
                               uint8_t length) {
    return f->id == id && f->flags == flags && f->length == length;
}

/* The smallest length that an FD frame can have for `bytes` of payload, at most 64. */
static inline uint8_t palp_can_fd_length(uint32_t bytes) {
    if (bytes <= 8u) return (uint8_t)bytes;
    if (bytes <= 24u) return (uint8_t)((bytes + 3u) / 4u * 4u);
    return (uint8_t)(bytes <= 32u ? 32u : bytes <= 48u ? 48u : 64u);
}

static inline uint32_t palp_get_u16(const uint8_t *p) {
    return (uint32_t)p[0] | (uint32_t)p[1] << 8;
}
static inline void palp_put_u16(uint8_t *p, uint32_t v) {
    for (int i = 0; i < 2; i++) p[i] = (uint8_t)(v >> (8 * i));
}
static inline uint32_t palp_get_u32(const uint8_t *p) {
    return palp_get_u16(p) | palp_get_u16(p + 2) << 16;
}
static inline void palp_put_u32(uint8_t *p, uint32_t v) {
    for (int i = 0; i < 4; i++) p[i] = (uint8_t)(v >> (8 * i));
}

/* Two's complement of 16 and 32 bits, without leaning on how a conversion out of range behaves. */
static inline int32_t palp_get_i16(const uint8_t *p) {
    uint32_t v = palp_get_u16(p);
    return v < 0x8000u ? (int32_t)v : (int32_t)v - 0x10000;
}
static inline int32_t palp_get_i32(const uint8_t *p) {
    uint32_t v = palp_get_u32(p);
    return v < 0x80000000u ? (int32_t)v : (int32_t)(v - 0x80000000u) + INT32_MIN;
}

static inline float palp_get_f32(const uint8_t *p) {
    union {
        uint32_t u;
        float f;
    } bits = {palp_get_u32(p)};
    return bits.f;
}
static inline void palp_put_f32(uint8_t *p, float v) {
    union {
        float f;
        uint32_t u;
    } bits = {v};
    palp_put_u32(p, bits.u);
}

/* Nearest integer to x, held within [low, high]; 0 for NaN. */
static inline int32_t palp_saturate(float x, int32_t low, int32_t high) {
    float r = x >= 0.0f ? x + 0.5f : x - 0.5f;
    if (!(r > (float)low)) return x < 0.0f || x > 0.0f ? low : 0;
    return r >= (float)high ? high : (int32_t)r;
}

#endif
