/* SPDX-License-Identifier: MIT */
/* IEEE half precision by double arithmetic; the run time has its own decoder (green/columns.c). */
#ifndef PALP_TOOLS_HALF_H
#define PALP_TOOLS_HALF_H

#include <math.h>
#include <stdint.h>

/* Nearest IEEE half (ties to even); |x| <= 1 here, so no overflow. */
static inline uint16_t to_half(float x) {
    double scaled = fabs((double)x);
    uint16_t sign = signbit(x) != 0 ? 0x8000u : 0u;
    int exponent;
    (void)frexp(scaled, &exponent);
    if (exponent < -13 || !(scaled > 0)) exponent = -13;
    double mantissa =
        nearbyint(ldexp(scaled, 11 - exponent)); /* 1024..2048, or less when subnormal */
    uint32_t bits = (uint32_t)((exponent + 13) << 10) + (uint32_t)mantissa;
    return (uint16_t)(sign | bits);
}

static inline float from_half(uint16_t h) {
    int exponent = (h >> 10) & 31;
    double m = h & 1023;
    double v = exponent == 0 ? ldexp(m, -24) : ldexp(m + 1024, exponent - 25);
    return (float)((h & 0x8000u) != 0 ? -v : v);
}

#endif
