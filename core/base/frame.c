/* SPDX-License-Identifier: MIT */
#include "frame.h"

#define ORTHONORMAL 0.01f

bool palp_is_rotation(const float r[9]) {
    const palp_vec3 row[3] = {palp_vec3_at(r), palp_vec3_at(r + 3), palp_vec3_at(r + 6)};
    bool sound = palp_abs(palp_dot(palp_cross(row[0], row[1]), row[2]) - 1.0f) <= ORTHONORMAL;
    for (uint32_t i = 0; i < 3u; i++) {
        for (uint32_t k = 0; k <= i; k++) {
            const float off = palp_dot(row[i], row[k]) - (i == k ? 1.0f : 0.0f);
            sound = sound && palp_abs(off) <= ORTHONORMAL; /* false for NaN */
        }
    }
    return sound;
}

palp_frame palp_frame_compose(const palp_frame *a, const palp_frame *b) {
    palp_frame f = {.t = palp_carry(a, b->t)};
    for (uint32_t i = 0; i < 3; i++) {
        for (uint32_t j = 0; j < 3; j++)
            f.r[3u * i + j] = a->r[3u * i] * b->r[j] + a->r[3u * i + 1u] * b->r[3u + j] +
                              a->r[3u * i + 2u] * b->r[6u + j];
    }
    return f;
}

palp_frame palp_frame_between(const palp_frame *a, const palp_frame *b) {
    palp_frame f = {.t = palp_carry_back(a, b->t)};
    for (uint32_t i = 0; i < 3; i++) {
        for (uint32_t j = 0; j < 3; j++)
            f.r[3u * i + j] =
                a->r[i] * b->r[j] + a->r[3u + i] * b->r[3u + j] + a->r[6u + i] * b->r[6u + j];
    }
    return f;
}

palp_frame palp_frame_turn(palp_vec3 axis, palp_vec3 origin, float angle_rad) {
    float s, c;
    float half_s, half_c;
    palp_sincos(angle_rad, &s, &c);
    palp_sincos(0.5f * angle_rad, &half_s, &half_c);
    float rest = 2.0f * half_s * half_s; /* 1 - cos, without cancellation */
    const float a[3] = {axis.x, axis.y, axis.z};
    const float cross[9] = {0.0f, -a[2], a[1], a[2], 0.0f, -a[0], -a[1], a[0], 0.0f};
    palp_frame f;
    for (uint32_t e = 0; e < 9; e++) {
        float unit = e % 4u == 0u ? 1.0f : 0.0f; /* R = I + s [a] + (1 - c) (a a^T - I) */
        f.r[e] = unit + s * cross[e] + rest * (a[e / 3u] * a[e % 3u] - unit);
    }
    palp_vec3 along = palp_scale(palp_dot(axis, origin), axis);
    palp_vec3 off = palp_sub(origin, along); /* o - R o, with the part along the axis left out */
    f.t = palp_madd(palp_scale(rest, off), -s, palp_cross(axis, off));
    return f;
}

float palp_frame_distance(const palp_frame *a, const palp_frame *b, float length_m) {
    float most = palp_norm(palp_sub(a->t, b->t)) / length_m;
    for (uint32_t e = 0; e < 9; e++) most = palp_max(most, palp_abs(a->r[e] - b->r[e]));
    return most;
}
