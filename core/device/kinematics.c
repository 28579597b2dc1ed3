/* SPDX-License-Identifier: MIT */
#include "kinematics.h"

#define SINGULAR_WRIST 0.1f /* |cos q5| below which its moment fades */

uint32_t palp_arm_axes(const palp_kinematics *k) { return k->mechanism == PALP_FIVE_BAR ? 2u : 3u; }

static uint32_t wrist_axes(const palp_kinematics *k) { return k->wrist ? 3u : 0u; }

static bool has_gripper(const palp_kinematics *k) {
    return k->gripper_m_per_rad > 0.0f || k->gripper_m_per_rad < 0.0f;
}

uint32_t palp_axes(const palp_kinematics *k) {
    return palp_arm_axes(k) + wrist_axes(k) + (has_gripper(k) ? 1u : 0u);
}

uint32_t palp_wrist_axis(const palp_kinematics *k) {
    return k->wrist ? palp_arm_axes(k) : palp_axes(k);
}

uint32_t palp_gripper_axis(const palp_kinematics *k) {
    return has_gripper(k) ? palp_arm_axes(k) + wrist_axes(k) : palp_axes(k);
}

bool palp_kinematics_is_sound(const palp_kinematics *k) {
    bool positive = k->upper_m > 0.0f && k->fore_m > 0.0f && palp_is_finite(k->upper_m) &&
                    palp_is_finite(k->fore_m) && palp_is_finite(k->gripper_m_per_rad);
    if (k->mechanism == PALP_ARM3) return positive;
    return positive && k->base_m >= 0.0f && k->fore_m > k->base_m + k->upper_m;
}

/* Volume spanned by the unit vectors along `n` columns. */
static float independence(const palp_vec3 *c, uint32_t n) {
    palp_vec3 normal = palp_cross(c[0], c[1]);
    float volume = n == 2u ? palp_norm(normal) : palp_abs(palp_dot(normal, c[2]));
    float sizes = palp_norm(c[0]) * palp_norm(c[1]) * (n == 2u ? 1.0f : palp_norm(c[2]));
    return sizes > 0.0f ? volume / sizes : 0.0f;
}

/* ---- ARM3 ---- */

static palp_pose arm_forward(const palp_kinematics *k, const float *s, const float *c) {
    float a = k->upper_m, b = k->fore_m;
    float rho = a * c[1] + b * s[2];
    palp_pose pose = {.tip_m = {rho * c[0] - a, rho * s[0], a * s[1] - b * c[2] + b},
                      .column_m = {{-rho * s[0], rho * c[0], 0.0f},
                                   {-a * s[1] * c[0], -a * s[1] * s[0], a * c[1]},
                                   {b * c[2] * c[0], b * c[2] * s[0], b * s[2]}},
                      .reachable = true};
    /* The three columns' volume over its largest: the links' angle times the reach from the axis.
     */
    float sine = palp_abs(c[1] * c[2] + s[1] * s[2]);
    pose.conditioning = sine * palp_min(1.0f, palp_abs(rho) / (a + b) * 2.0f);
    return pose;
}

static bool arm_inverse(const palp_kinematics *k, palp_vec3 tip, float *q) {
    float a = k->upper_m, b = k->fore_m, x = tip.x + a, z = tip.z - b;
    float rho = palp_sqrt(x * x + tip.y * tip.y);
    /* Two links: rho = a cos q2 + b cos p, z = a sin q2 + b sin p with p = q3 - pi/2, elbow up. */
    float cosine = (rho * rho + z * z - a * a - b * b) / (2.0f * a * b);
    if (!(cosine > -1.0f && cosine < 1.0f)) return false;
    float elbow = -palp_atan2(palp_sqrt((1.0f - cosine) * (1.0f + cosine)), cosine);
    float s, c;
    palp_sincos(elbow, &s, &c);
    q[0] = palp_atan2(tip.y, x);
    q[1] = palp_atan2(z, rho) - palp_atan2(b * s, a + b * c);
    q[2] = q[1] + elbow + 0.5f * PALP_PI_F;
    return true;
}

/* ---- legs of the parallel mechanisms ---- */

/* Outward direction of leg i. */
static palp_vec3 leg_direction(palp_mechanism mechanism, uint32_t i) {
    static const palp_vec3 delta[3] = {
        {1.0f, 0.0f, 0.0f}, {-0.5f, 0.866025404f, 0.0f}, {-0.5f, -0.866025404f, 0.0f}};
    static const palp_vec3 five_bar[2] = {{1.0f, 0.0f, 0.0f}, {-1.0f, 0.0f, 0.0f}};
    return mechanism == PALP_DELTA ? delta[i] : five_bar[i];
}

static float home_height(const palp_kinematics *k) {
    float reach = k->base_m + k->upper_m;
    return palp_sqrt(k->fore_m * k->fore_m - reach * reach);
}

/* Centre of the circle through the elbows (of two: their middle), and its unit axis upwards. */
static bool elbow_circle(const palp_vec3 *p, uint32_t n, palp_vec3 *center, palp_vec3 *axis) {
    palp_vec3 u = palp_sub(p[1], p[0]);
    if (n == 2u) {
        float length = palp_norm(u);
        *center = palp_scale(0.5f, palp_add(p[0], p[1]));
        if (!(length > 0.0f)) return false;
        *axis = (palp_vec3){u.z / length, 0.0f, -u.x / length};
        return true;
    }
    palp_vec3 v = palp_sub(p[2], p[0]), w = palp_cross(u, v);
    float ww = palp_dot(w, w);
    if (!(ww > 0.0f)) return false;
    palp_vec3 to = palp_add(palp_scale(palp_dot(v, v), palp_cross(w, u)),
                            palp_scale(palp_dot(u, u), palp_cross(v, w)));
    *center = palp_madd(p[0], 0.5f / ww, to);
    *axis = palp_scale(1.0f / palp_sqrt(ww), w);
    return true;
}

static palp_pose legs_forward(const palp_kinematics *k, const float *s, const float *c) {
    const uint32_t n = palp_arm_axes(k);
    palp_pose pose = {.reachable = false};
    palp_vec3 elbow[3], center, axis, link[3] = {{0}};
    for (uint32_t i = 0; i < n; i++) {
        palp_vec3 r = leg_direction(k->mechanism, i);
        elbow[i] = palp_scale(k->base_m + k->upper_m * c[i], r);
        elbow[i].z = k->upper_m * s[i];
    }
    if (!elbow_circle(elbow, n, &center, &axis)) return pose;
    palp_vec3 radius = palp_sub(center, elbow[0]);
    float height2 = k->fore_m * k->fore_m - palp_dot(radius, radius);
    if (!(height2 > 0.0f)) return pose;
    palp_vec3 tip = palp_madd(center, palp_sqrt(height2), axis);
    /* links l_i . dP = w_i dq_i, w_i = l_i . d elbow_i / d q_i; J = L^-1 diag(w) */
    float w[3] = {0};
    for (uint32_t i = 0; i < n; i++) {
        palp_vec3 r = leg_direction(k->mechanism, i);
        link[i] = palp_sub(tip, elbow[i]);
        w[i] = k->upper_m * (-s[i] * palp_dot(link[i], r) + c[i] * link[i].z);
    }
    if (n == 2u) link[2] = (palp_vec3){0.0f, 1.0f, 0.0f};
    float det = palp_dot(palp_cross(link[0], link[1]), link[2]);
    float far = independence(link, n);
    if (!(far > 1e-4f)) return pose;
    for (uint32_t i = 0; i < n; i++) {
        palp_vec3 across = palp_cross(link[(i + 1u) % 3u], link[(i + 2u) % 3u]);
        pose.column_m[i] = palp_scale(w[i] / det, across);
    }
    tip.z -= home_height(k);
    pose.tip_m = tip;
    pose.conditioning = palp_min(far, independence(pose.column_m, n));
    pose.reachable = true;
    return pose;
}

/* (x - a cos q)^2 + y^2 + (z - a sin q)^2 = b^2 with x, y seen from the motor along the leg. */
static bool legs_inverse(const palp_kinematics *k, palp_vec3 tip, float *q) {
    float a = k->upper_m, b = k->fore_m;
    palp_vec3 p = {tip.x, k->mechanism == PALP_FIVE_BAR ? 0.0f : tip.y, tip.z + home_height(k)};
    for (uint32_t i = 0; i < palp_arm_axes(k); i++) {
        palp_vec3 r = leg_direction(k->mechanism, i);
        float x = palp_dot(p, r) - k->base_m;
        float y = p.y * r.x - p.x * r.y;
        float in_plane = x * x + p.z * p.z;
        float half = (a * a + in_plane + y * y - b * b) / (2.0f * a);
        float rest = in_plane - half * half;
        if (!(rest >= 0.0f)) return false;
        q[i] = palp_atan2(p.z, x) - palp_atan2(palp_sqrt(rest), half);
    }
    return true;
}

/* ---- wrist ---- */

static palp_vec3 column_of(const float r[9], uint32_t k) {
    const palp_vec3 c = {r[k], r[3u + k], r[6u + k]};
    return c;
}

static void set_columns(float r[9], palp_vec3 x, palp_vec3 y, palp_vec3 z) {
    const palp_vec3 c[3] = {x, y, z};
    for (uint32_t k = 0; k < 3u; k++) {
        r[k] = c[k].x;
        r[3u + k] = c[k].y;
        r[6u + k] = c[k].z;
    }
}

/* The link that carries the wrist, and how the arm's joints turn it. */
static void link_of(const palp_kinematics *k, const float *s, const float *c, palp_pose *pose) {
    const palp_vec3 z = {0.0f, 0.0f, 1.0f};
    for (uint32_t e = 0; e < 9u; e++) pose->r[e] = e % 4u == 0u ? 1.0f : 0.0f;
    for (uint32_t i = 0; i < PALP_AXES; i++) pose->turn[i] = (palp_vec3){0.0f, 0.0f, 0.0f};
    pose->wrist_conditioning = 1.0f;
    if (k->mechanism != PALP_ARM3 || !k->wrist) return;
    const palp_vec3 out = {c[0], s[0], 0.0f}, aside = {-s[0], c[0], 0.0f};
    const palp_vec3 x = palp_madd(palp_scale(c[2], out), s[2], z); /* Ry(-q3) of the yawed axes */
    set_columns(pose->r, x, aside, palp_cross(x, aside));
    pose->turn[0] = z;
    pose->turn[2] = palp_scale(-1.0f, aside);
}

/* Turns two columns of r towards each other: the first goes to the second. */
static void turn_columns(float r[9], uint32_t from, uint32_t to, float s, float c) {
    for (uint32_t i = 0; i < 9u; i += 3u) {
        const float a = r[i + from], b = r[i + to];
        r[i + from] = c * a + s * b;
        r[i + to] = c * b - s * a;
    }
}

static void add_wrist(const palp_kinematics *k, const float *s, const float *c, palp_pose *pose) {
    const uint32_t w = palp_wrist_axis(k);
    pose->turn[w] = column_of(pose->r, 2);
    turn_columns(pose->r, 0, 1, s[w], c[w]); /* about z: x towards y */
    pose->turn[w + 1u] = column_of(pose->r, 1);
    turn_columns(pose->r, 2, 0, s[w + 1u], c[w + 1u]); /* about y: z towards x */
    pose->turn[w + 2u] = column_of(pose->r, 0);
    turn_columns(pose->r, 1, 2, s[w + 2u], c[w + 2u]); /* about x: y towards z */
    pose->wrist_conditioning = palp_abs(c[w + 1u]);
}

/* ---- public ---- */

palp_pose palp_forward(const palp_kinematics *k, const float q_rad[PALP_AXES]) {
    float s[PALP_AXES] = {0}, c[PALP_AXES] = {0};
    for (uint32_t i = 0; i < palp_axes(k); i++) palp_sincos(q_rad[i], &s[i], &c[i]);
    palp_pose pose = k->mechanism == PALP_ARM3 ? arm_forward(k, s, c) : legs_forward(k, s, c);
    link_of(k, s, c, &pose);
    if (k->wrist) add_wrist(k, s, c, &pose);
    if (has_gripper(k)) pose.opening_m = k->gripper_m_per_rad * q_rad[palp_gripper_axis(k)];
    return pose;
}

bool palp_inverse(const palp_kinematics *k, palp_vec3 tip_m, float q_rad[PALP_AXES]) {
    return k->mechanism == PALP_ARM3 ? arm_inverse(k, tip_m, q_rad) : legs_inverse(k, tip_m, q_rad);
}

void palp_inverse_wrist(const palp_kinematics *k, const float r[9], float q_rad[PALP_AXES]) {
    float s[3] = {0}, c[3] = {0};
    palp_pose link;
    if (!k->wrist) return;
    for (uint32_t i = 0; i < palp_arm_axes(k); i++) palp_sincos(q_rad[i], &s[i], &c[i]);
    link_of(k, s, c, &link);
    /* R_link^T r = Rz Ry Rx: its first column is (cz cy, sz cy, -sy), its last row (-sy, cy sx, cy cx) */
    const palp_vec3 x = palp_rotate_back(link.r, column_of(r, 0));
    const palp_vec3 up = column_of(link.r, 2);
    const float level = palp_sqrt(x.x * x.x + x.y * x.y);
    float *q = q_rad + palp_wrist_axis(k);
    q[0] = level > 1e-6f ? palp_atan2(x.y, x.x) : 0.0f;
    q[1] = palp_atan2(-x.z, level);
    if (level > 1e-6f) {
        q[2] = palp_atan2(palp_dot(up, column_of(r, 1)), palp_dot(up, column_of(r, 2)));
    } else { /* singular: turned about x alone */
        const palp_vec3 y = palp_rotate_back(link.r, column_of(r, 1));
        q[2] = palp_atan2(x.z > 0.0f ? y.x : -y.x, y.y) * (x.z > 0.0f ? 1.0f : -1.0f);
    }
}

void palp_pose_torques(const palp_pose *pose, palp_vec3 force_N, palp_vec3 moment_Nm,
                       float torque_Nm[PALP_AXES]) {
    for (uint32_t i = 0; i < PALP_AXES; i++)
        torque_Nm[i] = palp_dot(pose->column_m[i], force_N) + palp_dot(pose->turn[i], moment_Nm);
}

palp_vec3 palp_pose_transmits(const palp_pose *pose, const palp_kinematics *k, uint32_t motors,
                              palp_vec3 moment_Nm) {
    palp_vec3 sum = {0.0f, 0.0f, 0.0f};
    const uint32_t first = palp_wrist_axis(k);
    if (!k->wrist || (motors >> first & 7u) == 0u) return sum;
    const palp_vec3 *w = pose->turn + first;
    const float volume = palp_dot(w[0], palp_cross(w[1], w[2])); /* +-cos q5 */
    const float gain = palp_clamp(2.0f * palp_abs(volume) / SINGULAR_WRIST - 1.0f, 0.0f, 1.0f);
    if (!(gain > 0.0f)) return sum;
    for (uint32_t i = 0; i < 3u; i++) { /* M . w_i = tau_i: by the reciprocal axes */
        if ((motors >> (first + i) & 1u) == 0u) continue;
        const palp_vec3 along = palp_cross(w[(i + 1u) % 3u], w[(i + 2u) % 3u]);
        sum = palp_madd(sum, gain * palp_dot(w[i], moment_Nm) / volume, along);
    }
    return sum;
}

palp_vec3 palp_pose_velocity(const palp_pose *pose, const float dq_rad_s[PALP_AXES]) {
    palp_vec3 v = {0.0f, 0.0f, 0.0f};
    for (uint32_t i = 0; i < PALP_AXES; i++) v = palp_madd(v, dq_rad_s[i], pose->column_m[i]);
    return v;
}

palp_vec3 palp_pose_turning(const palp_pose *pose, const float dq_rad_s[PALP_AXES]) {
    palp_vec3 w = {0.0f, 0.0f, 0.0f};
    for (uint32_t i = 0; i < PALP_AXES; i++) w = palp_madd(w, dq_rad_s[i], pose->turn[i]);
    return w;
}
