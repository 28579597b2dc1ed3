/* SPDX-License-Identifier: MIT */
/* Rigid motions x -> r x + t; r row-major and orthonormal. */
#ifndef PALP_BASE_FRAME_H
#define PALP_BASE_FRAME_H

#include "core/base/real.h"

typedef struct {
    float r[9];
    palp_vec3 t;
} palp_frame;

#define PALP_FRAME_IDENTITY                                                                        \
    ((palp_frame){{1.0f, 0.0f, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f, 0.0f, 1.0f}, {0.0f, 0.0f, 0.0f}})

/* A force, and the moment about a point that goes with it. */
typedef struct {
    palp_vec3 force_N, moment_Nm;
} palp_wrench;

static inline palp_vec3 palp_rotate(const float r[9], palp_vec3 v) {
    const palp_vec3 out = {palp_dot(palp_vec3_at(r), v), palp_dot(palp_vec3_at(r + 3), v),
                           palp_dot(palp_vec3_at(r + 6), v)};
    return out;
}

/* r^T v */
static inline palp_vec3 palp_rotate_back(const float r[9], palp_vec3 v) {
    const palp_vec3 out = {r[0] * v.x + r[3] * v.y + r[6] * v.z,
                           r[1] * v.x + r[4] * v.y + r[7] * v.z,
                           r[2] * v.x + r[5] * v.y + r[8] * v.z};
    return out;
}

static inline palp_vec3 palp_carry(const palp_frame *f, palp_vec3 x) {
    return palp_add(palp_rotate(f->r, x), f->t);
}

static inline palp_vec3 palp_carry_back(const palp_frame *f, palp_vec3 x) {
    return palp_rotate_back(f->r, palp_sub(x, f->t));
}

/* Two unit vectors that complete the unit vector n to a right-handed frame (t_0, t_1, n). */
static inline void palp_tangents(palp_vec3 n, palp_vec3 tangent[2]) {
    const palp_vec3 x = {1.0f, 0.0f, 0.0f}, y = {0.0f, 1.0f, 0.0f};
    const palp_vec3 t = palp_cross(n, palp_abs(n.x) < 0.6f ? x : y);
    tangent[0] = palp_scale(1.0f / palp_norm(t), t);
    tangent[1] = palp_cross(n, tangent[0]);
}

/* The turn that takes one to the other, as a vector: its axis times its angle, up to pi. */
palp_vec3 palp_turn_between(const float from[9], const float to[9]);

/* r turned by a vector of rotation. */
void palp_turn_by(palp_vec3 turn_rad, const float r[9], float out[9]);

/* A frame at rest in a place. */
static inline palp_frame palp_frame_at(palp_vec3 t) {
    palp_frame f = {{1.0f, 0.0f, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f, 0.0f, 1.0f}, t};
    return f;
}

/* Whether r is a rotation, to 1 %: finite, orthonormal, and no reflection. */
bool palp_is_rotation(const float r[9]);

/* a after b: x -> a(b(x)) */
palp_frame palp_frame_compose(const palp_frame *a, const palp_frame *b);

/* The motion that takes b's coordinates to a's: a^-1 after b. */
palp_frame palp_frame_between(const palp_frame *a, const palp_frame *b);

/* Rotation by `angle_rad` about the unit `axis` through `origin`; exactly the identity for 0. */
palp_frame palp_frame_turn(palp_vec3 axis, palp_vec3 origin, float angle_rad);

/* Largest of the entries of a.r - b.r, and of |a.t - b.t| / length_m: 0 for equal motions. */
float palp_frame_distance(const palp_frame *a, const palp_frame *b, float length_m);

#endif
