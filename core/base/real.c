/* SPDX-License-Identifier: MIT */
#include "real.h"

/* pi/2 in three parts whose products with a small integer are exact (Cody and Waite). */
#define HALF_PI_HI 1.5703125f
#define HALF_PI_MID 4.8351287841796875e-4f
#define HALF_PI_LO 3.138557e-7f
#define TAN_PI_8 0.414213562f

float palp_square_root(float x) { return __builtin_sqrtf(x); }

static float sine_kernel(float r) {
    float s = r * r;
    float p = -1.9515296e-4f;
    p = p * s + 8.3321609e-3f;
    p = p * s - 1.6666655e-1f;
    return p * s * r + r;
}

static float cosine_kernel(float r) {
    float s = r * r;
    float p = 2.4433157e-5f;
    p = p * s - 1.3887316e-3f;
    p = p * s + 4.1666646e-2f;
    return p * s * s - 0.5f * s + 1.0f;
}

void palp_sincos(float angle_rad, float *sine, float *cosine) {
    float turns = angle_rad * 0.636619772f;
    int32_t quadrant = (int32_t)(turns >= 0.0f ? turns + 0.5f : turns - 0.5f);
    float q = (float)quadrant;
    float r = ((angle_rad - q * HALF_PI_HI) - q * HALF_PI_MID) - q * HALF_PI_LO;
    float s = sine_kernel(r);
    float c = cosine_kernel(r);
    uint32_t k = (uint32_t)quadrant & 3u;
    float a = (k & 1u) != 0u ? c : s;
    float b = (k & 1u) != 0u ? s : c;
    *sine = (k & 2u) != 0u ? -a : a;
    *cosine = (k == 1u || k == 2u) ? -b : b;
}

/* atan t, |t| <= tan(pi/8): least squares at Chebyshev nodes, error below 2.2e-8. */
static float arctangent_kernel(float t) {
    float s = t * t;
    float p = 7.88242817e-2f;
    p = p * s - 1.38171092e-1f;
    p = p * s + 1.99710369e-1f;
    p = p * s - 3.33327264e-1f;
    return p * s * t + t;
}

float palp_atan2(float y, float x) {
    float ax = palp_abs(x), ay = palp_abs(y);
    float high = palp_max(ax, ay), low = palp_min(ax, ay);
    if (!(high > 0.0f)) return 0.0f;
    float t = low / high;
    bool far = t > TAN_PI_8; /* atan t = pi/4 + atan((t - 1) / (t + 1)) */
    float angle = arctangent_kernel(far ? (t - 1.0f) / (t + 1.0f) : t);
    if (far) angle += 0.25f * PALP_PI_F;
    if (ay > ax) angle = 0.5f * PALP_PI_F - angle;
    if (x < 0.0f) angle = PALP_PI_F - angle;
    return y < 0.0f ? -angle : angle;
}
