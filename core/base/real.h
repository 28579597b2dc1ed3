/* SPDX-License-Identifier: MIT */
/*
 * Single-precision scalars and 3-vectors without libm.
 *
 * Only operations that IEEE 754 rounds correctly (+ - * / sqrt) are used, in a fixed order, so
 * every platform computes the same bits when contraction is off.
 */
#ifndef PALP_BASE_REAL_H
#define PALP_BASE_REAL_H

#include <stdbool.h>
#include <stdint.h>

#define PALP_PI_F 3.14159265358979f

typedef struct {
    float x, y, z;
} palp_vec3;

/* Symmetric, 2 x 2. */
typedef struct {
    float xx, xy, yy;
} palp_symmetric2;

/* Square root, rounded correctly. A program that is compiled with errno for mathematics in mind
 * gets the library's own, so that it needs no libm. */
float palp_square_root(float x);
#ifdef __NO_MATH_ERRNO__
static inline float palp_sqrt(float x) { return __builtin_sqrtf(x); }
#else
static inline float palp_sqrt(float x) { return palp_square_root(x); }
#endif
static inline float palp_abs(float x) { return __builtin_fabsf(x); }
static inline float palp_min(float a, float b) { return a < b ? a : b; }
static inline float palp_max(float a, float b) { return a > b ? a : b; }
static inline float palp_clamp(float x, float lo, float hi) {
    return palp_min(palp_max(x, lo), hi);
}

/* False for NaN and infinities; looks at bits, so no compiler flag can fold it away. */
/* What a clock has gone on from `start_ns`, in ns; more than four seconds, or backwards, are four
 * seconds: no time is left. In 32 bits, since processors of 32 bits make a float of 64 bits by a
 * call. */
static inline float palp_elapsed_ns(uint64_t start_ns, uint64_t now_ns) {
    const uint64_t gone = now_ns - start_ns;
    return (float)(gone < UINT32_MAX ? (uint32_t)gone : UINT32_MAX);
}

static inline bool palp_is_finite(float x) {
    union {
        float f;
        uint32_t u;
    } bits = {x};
    return (bits.u & 0x7f800000u) != 0x7f800000u;
}

/* How many bits are set, added up in pairs, fours, eights and all. */
static inline uint32_t palp_bits(uint32_t x) {
    x -= (x >> 1u) & 0x55555555u;
    x = (x & 0x33333333u) + ((x >> 2u) & 0x33333333u);
    x = (x + (x >> 4u)) & 0x0f0f0f0fu;
    return (x * 0x01010101u) >> 24u;
}

static inline bool palp_same_bits(float a, float b) {
    union {
        float f;
        uint32_t u;
    } x = {a}, y = {b};
    return x.u == y.u;
}

static inline palp_vec3 palp_vec3_at(const float *p) {
    const palp_vec3 out = {p[0], p[1], p[2]};
    return out;
}
static inline palp_vec3 palp_add(palp_vec3 a, palp_vec3 b) {
    const palp_vec3 out = {a.x + b.x, a.y + b.y, a.z + b.z};
    return out;
}
static inline palp_vec3 palp_sub(palp_vec3 a, palp_vec3 b) {
    const palp_vec3 out = {a.x - b.x, a.y - b.y, a.z - b.z};
    return out;
}
static inline palp_vec3 palp_scale(float s, palp_vec3 a) {
    const palp_vec3 out = {s * a.x, s * a.y, s * a.z};
    return out;
}
static inline palp_vec3 palp_madd(palp_vec3 a, float s, palp_vec3 b) {
    return palp_add(a, palp_scale(s, b));
}
static inline float palp_dot(palp_vec3 a, palp_vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline palp_vec3 palp_cross(palp_vec3 a, palp_vec3 b) {
    const palp_vec3 out = {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
    return out;
}
static inline float palp_norm(palp_vec3 a) { return palp_sqrt(palp_dot(a, a)); }
/* a, or the vector along it of length `most` where it is longer. */
static inline palp_vec3 palp_at_most(palp_vec3 a, float most) {
    const float length = palp_norm(a);
    return length > most ? palp_scale(most / length, a) : a;
}
static inline bool palp_vec3_is_finite(palp_vec3 a) {
    return palp_is_finite(a.x) && palp_is_finite(a.y) && palp_is_finite(a.z);
}

/*
 * Sine and cosine of `angle_rad`, |angle_rad| <= 1e4; absolute error below 3e-7 for |angle| <= 10.
 * Cost: one range reduction and two polynomials, no branches on the angle beyond the quadrant.
 */
void palp_sincos(float angle_rad, float *sine, float *cosine);

/* Angle of the point (x, y) in rad, -pi..pi; 0 for the origin. Error below 3e-7. */
float palp_atan2(float y, float x);

#endif
