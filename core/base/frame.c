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

palp_vec3 palp_turn_between(const float from[9], const float to[9]) {
    float r[9]; /* to from^T */
    for (uint32_t i = 0; i < 3u; i++) {
        for (uint32_t j = 0; j < 3u; j++)
            r[3u * i + j] = palp_dot(palp_vec3_at(to + 3u * i), palp_vec3_at(from + 3u * j));
    }
    const palp_vec3 twice = {r[7] - r[5], r[2] - r[6], r[3] - r[1]}; /* sine, along the axis */
    const float sine = 0.5f * palp_norm(twice), cosine = 0.5f * (r[0] + r[4] + r[8] - 1.0f);
    const float angle = palp_atan2(sine, cosine);
    if (sine > 1e-3f || cosine > 0.0f)
        return palp_scale(sine > 1e-12f ? 0.5f * angle / sine : 0.5f, twice);
    uint32_t k = r[0] >= r[4] && r[0] >= r[8] ? 0u : r[4] >= r[8] ? 1u : 2u; /* about a half turn */
    const float half[3] = {0.5f * (r[k] + r[3u * k]), 0.5f * (r[3u + k] + r[3u * k + 1u]),
                           0.5f * (r[6u + k] + r[3u * k + 2u])};
    palp_vec3 axis = {half[0] + (k == 0u ? 1.0f : 0.0f), half[1] + (k == 1u ? 1.0f : 0.0f),
                      half[2] + (k == 2u ? 1.0f : 0.0f)};
    if (palp_dot(axis, twice) < 0.0f) axis = palp_scale(-1.0f, axis);
    return palp_scale(angle / palp_norm(axis), axis);
}

void palp_turn_by(palp_vec3 turn_rad, const float r[9], float out[9]) {
    const float angle = palp_norm(turn_rad);
    const palp_vec3 x = {1.0f, 0.0f, 0.0f}, origin = {0.0f, 0.0f, 0.0f};
    const palp_vec3 axis = angle > 0.0f ? palp_scale(1.0f / angle, turn_rad) : x;
    palp_frame turn = palp_frame_turn(axis, origin, angle), of = {.t = origin};
    for (uint32_t e = 0; e < 9u; e++) of.r[e] = r[e];
    of = palp_frame_compose(&turn, &of);
    for (uint32_t e = 0; e < 9u; e++) out[e] = of.r[e];
}

float palp_frame_distance(const palp_frame *a, const palp_frame *b, float length_m) {
    float most = palp_norm(palp_sub(a->t, b->t)) / length_m;
    for (uint32_t e = 0; e < 9; e++) most = palp_max(most, palp_abs(a->r[e] - b->r[e]));
    return most;
}
