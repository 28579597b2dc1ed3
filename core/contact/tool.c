/* SPDX-License-Identifier: MIT */
#include "tool.h"

#define BETA PALP_TOOL_BETA
#define HEIGHT 0.6f       /* sqrt(1 - BETA^2) */
#define SLOPE 1.3333334f  /* BETA / HEIGHT */
#define MERGE 0.2f        /* width of the blend between balls, over the smaller radius */
#define LEAST_FACING 0.3f /* a pad's depth is measured as if the node faced it at least so well */

palp_tool palp_tool_sphere(float radius_m) {
    return (palp_tool){.balls = 1, .ball[0] = {.radius_m = radius_m}};
}

static bool pad_is_sound(const palp_pad *p) {
    bool sound = p->half_m[0] > 0.0f && p->half_m[1] > 0.0f && p->edge_m > 0.0f &&
                 palp_is_finite(p->half_m[0] + p->half_m[1] + p->edge_m);
    for (uint32_t i = 0; i < 3; i++) {
        for (uint32_t k = 0; k < 3; k++) {
            float wanted = i == k ? 1.0f : 0.0f;
            sound = sound && palp_abs(palp_dot(p->axis[i], p->axis[k]) - wanted) < 1e-3f;
        }
    }
    if (p->columns == 0u) return sound;
    sound = sound && p->columns >= 2u && p->rows >= 2u && p->columns <= 1024u && p->rows <= 1024u &&
            p->height_m != NULL;
    for (uint32_t i = 0; sound && i < p->columns * p->rows; i++)
        sound = palp_is_finite(p->height_m[i]);
    return sound;
}

static bool is_cylinder(const palp_tool *tool) {
    return tool->balls == 0u && (tool->cylinder.radius_m > 0.0f || tool->cylinder.radius_m < 0.0f);
}

static bool cylinder_is_sound(const palp_cylinder *y) {
    float length = palp_norm(y->axis);
    return y->radius_m > 0.0f && y->half_m > 0.0f && y->rim_m > 0.0f &&
           palp_is_finite(y->radius_m + y->half_m + y->rim_m) && palp_abs(length - 1.0f) < 1e-3f;
}

bool palp_tool_is_sound(const palp_tool *tool) {
    if (!(tool->friction >= 0.0f && tool->friction <= 10.0f)) return false;
    if (!(tool->sliding >= 0.0f && tool->sliding <= tool->friction)) return false;
    if (tool->balls > PALP_TOOL_BALLS) return false;
    if (is_cylinder(tool)) return cylinder_is_sound(&tool->cylinder);
    if (tool->balls == 0u) return pad_is_sound(&tool->pad);
    for (uint32_t i = 0; i < tool->balls; i++) {
        const palp_ball *b = &tool->ball[i];
        if (!(b->radius_m > 0.0f) || !palp_is_finite(b->radius_m)) return false;
        if (!palp_vec3_is_finite(b->center_m)) return false;
    }
    return true;
}

float palp_tool_size(const palp_tool *tool) {
    if (is_cylinder(tool)) return palp_min(tool->cylinder.radius_m, 4.0f * tool->cylinder.rim_m);
    if (tool->balls == 0u) return tool->pad.edge_m;
    float least = tool->ball[0].radius_m;
    for (uint32_t i = 1; i < tool->balls; i++) least = palp_min(least, tool->ball[i].radius_m);
    return least;
}

/* Height psi(t) of a sphere of radius r at distance t off its axis, with its cone, and -psi'(t) /
 * t. */
static float profile(float r, float t, float *slope_over_t) {
    if (t <= BETA * r) {
        float psi = palp_sqrt(r * r - t * t);
        *slope_over_t = 1.0f / psi;
        return psi;
    }
    *slope_over_t = SLOPE / t;
    return HEIGHT * r - SLOPE * (t - BETA * r);
}

static palp_touch ball_at(const palp_ball *ball, palp_vec3 c, palp_vec3 x, palp_vec3 n) {
    palp_vec3 r = palp_sub(x, palp_add(c, ball->center_m));
    float along = palp_dot(r, n);
    palp_vec3 tangential = palp_madd(r, -along, n);
    float t = palp_norm(tangential);
    float slope_over_t;
    float psi = profile(ball->radius_m, t, &slope_over_t);
    float distance = palp_norm(r);
    return (palp_touch){.depth_m = along + psi,
                        .reach = t / (PALP_TOOL_REACH * ball->radius_m),
                        .facing = distance > 0.0f ? -along / distance : 0.0f,
                        .push = palp_madd(n, -slope_over_t, tangential)};
}

/* max(a, b), rounded off over `width` where they are close. */
static palp_touch merge(palp_touch a, palp_touch b, float width) {
    palp_touch high = a.depth_m >= b.depth_m ? a : b, low = a.depth_m >= b.depth_m ? b : a;
    float gap = high.depth_m - low.depth_m;
    if (gap >= width) return high;
    float share = 0.5f * (width - gap) / width;
    high.depth_m += 0.5f * (width - gap) * share;
    high.push = palp_madd(high.push, share, palp_sub(low.push, high.push));
    return high;
}

/* Weights of a quadratic B-spline at s over 0..count - 1, and their derivatives. */
typedef struct {
    uint32_t index[3];
    float weight[3], slope[3];
} spline;

static spline spline_at(float s, uint32_t count) {
    float last = (float)(count - 1u);
    float clamped = palp_clamp(s, -0.5f, last + 0.5f); /* beyond, the end values go on */
    uint32_t i = (uint32_t)palp_min(clamped + 0.5f, last);
    float t = clamped - (float)i;
    bool inside = s >= -0.5f && s <= last + 0.5f;
    spline p = {
        .index = {i > 0u ? i - 1u : 0u, i, i + 1u < count ? i + 1u : i},
        .weight = {0.5f * (0.5f - t) * (0.5f - t), 0.75f - t * t, 0.5f * (0.5f + t) * (0.5f + t)},
        .slope = {t - 0.5f, -2.0f * t, t + 0.5f}};
    for (uint32_t k = 0; k < 3 && !inside; k++) p.slope[k] = 0.0f;
    return p;
}

/* Height of the face at (u, v) and its gradient. */
static float face_height(const palp_pad *p, float u, float v, float gradient[2]) {
    const float at[2] = {u, v};
    float over[2], height = 0.0f, slope_over_t;
    for (uint32_t k = 0; k < 2; k++) {
        float out = palp_abs(at[k]) - p->half_m[k];
        over[k] = out > 0.0f ? (at[k] > 0.0f ? out : -out) : 0.0f;
    }
    float t = palp_sqrt(over[0] * over[0] + over[1] * over[1]);
    gradient[0] = gradient[1] = 0.0f;
    if (t > 0.0f) {
        height = profile(p->edge_m, t, &slope_over_t) - p->edge_m;
        for (uint32_t k = 0; k < 2; k++) gradient[k] = -slope_over_t * over[k];
    }
    if (p->columns == 0u) return height;
    float scale_u = 0.5f * (float)(p->columns - 1u) / p->half_m[0];
    float scale_v = 0.5f * (float)(p->rows - 1u) / p->half_m[1];
    spline a = spline_at((u + p->half_m[0]) * scale_u, p->columns);
    spline b = spline_at((v + p->half_m[1]) * scale_v, p->rows);
    for (uint32_t j = 0; j < 3; j++) {
        for (uint32_t i = 0; i < 3; i++) {
            float z = p->height_m[b.index[j] * p->columns + a.index[i]];
            height += a.weight[i] * b.weight[j] * z;
            gradient[0] += scale_u * a.slope[i] * b.weight[j] * z;
            gradient[1] += scale_v * a.weight[i] * b.slope[j] * z;
        }
    }
    return height;
}

static palp_touch pad_at(const palp_pad *p, palp_vec3 c, palp_vec3 x, palp_vec3 n) {
    palp_vec3 r = palp_sub(x, c);
    float u = palp_dot(r, p->axis[0]), v = palp_dot(r, p->axis[1]), gradient[2];
    float facing = -palp_dot(n, p->axis[2]);
    float over_cosine = 1.0f / palp_max(facing, LEAST_FACING);
    float depth = face_height(p, u, v, gradient) - palp_dot(r, p->axis[2]);
    palp_vec3 push = palp_scale(-1.0f, p->axis[2]);
    push = palp_madd(push, gradient[0], p->axis[0]);
    push = palp_madd(push, gradient[1], p->axis[1]);
    float out_u = palp_abs(u) - p->half_m[0], out_v = palp_abs(v) - p->half_m[1];
    return (palp_touch){.depth_m = depth * over_cosine,
                        .reach = palp_max(out_u, out_v) / (PALP_TOOL_REACH * p->edge_m),
                        .facing = facing,
                        .push = palp_scale(over_cosine, push)};
}

/* In the plane across the axis, where the node's normal has the length `lean`; the rims take away
 * from it beyond the ends. */
static palp_touch cylinder_at(const palp_cylinder *y, palp_vec3 c, palp_vec3 x, palp_vec3 n) {
    palp_vec3 r = palp_sub(x, c);
    float z = palp_dot(r, y->axis), slope_over_t, rim_over_t;
    palp_vec3 across = palp_madd(r, -z, y->axis);
    palp_vec3 flat = palp_madd(n, -palp_dot(n, y->axis), y->axis);
    float lean = palp_max(palp_norm(flat), LEAST_FACING);
    palp_vec3 m = palp_scale(1.0f / lean, flat);
    float along = palp_dot(across, m);
    palp_vec3 aside = palp_madd(across, -along, m);
    float t = palp_norm(aside), distance = palp_norm(across);
    float psi = profile(y->radius_m, t, &slope_over_t);
    float over = palp_abs(z) - y->half_m, depth = along + psi;
    palp_vec3 push = palp_madd(m, -slope_over_t, aside);
    push =
        palp_madd(push, slope_over_t * palp_dot(aside, m), m); /* 0 unless the node looks along */
    if (over > 0.0f) {
        depth += profile(y->rim_m, over, &rim_over_t) - y->rim_m;
        push = palp_madd(push, -rim_over_t * over * (z > 0.0f ? 1.0f : -1.0f), y->axis);
    }
    float reach = palp_max(t / y->radius_m, over / y->rim_m) / PALP_TOOL_REACH;
    return (palp_touch){.depth_m = depth / lean,
                        .reach = reach,
                        .facing = distance > 0.0f ? -along / distance : 0.0f,
                        .push = palp_scale(1.0f / lean, push)};
}

palp_touch palp_tool_at(const palp_tool *tool, palp_vec3 c, palp_vec3 x, palp_vec3 n) {
    if (is_cylinder(tool)) return cylinder_at(&tool->cylinder, c, x, n);
    if (tool->balls == 0u) return pad_at(&tool->pad, c, x, n);
    palp_touch touch = ball_at(&tool->ball[0], c, x, n);
    for (uint32_t i = 1; i < tool->balls; i++) {
        float width = MERGE * palp_min(tool->ball[i].radius_m, tool->ball[i - 1u].radius_m);
        touch = merge(touch, ball_at(&tool->ball[i], c, x, n), width);
    }
    return touch;
}

static palp_gap gap_of_ball(const palp_ball *ball, palp_vec3 c, palp_vec3 x) {
    palp_vec3 r = palp_sub(palp_sub(x, c), ball->center_m);
    float distance = palp_norm(r);
    palp_vec3 up = {0.0f, 0.0f, 1.0f};
    return (palp_gap){distance - ball->radius_m,
                      distance > 0.0f ? palp_scale(1.0f / distance, r) : up};
}

/* min(a, b), rounded off over `width` where they are close. */
static palp_gap nearer(palp_gap a, palp_gap b, float width) {
    palp_gap low = a.gap_m <= b.gap_m ? a : b, high = a.gap_m <= b.gap_m ? b : a;
    float between = high.gap_m - low.gap_m;
    if (between >= width) return low;
    float share = 0.5f * (width - between) / width;
    low.gap_m -= 0.5f * (width - between) * share;
    palp_vec3 n = palp_madd(low.normal, share, palp_sub(high.normal, low.normal));
    low.normal = palp_scale(1.0f / palp_max(palp_norm(n), 0.05f), n);
    return low;
}

/* A cylinder with rounded rims: distance from the inner cylinder, less the rim's radius. */
static palp_gap gap_of_cylinder(const palp_cylinder *y, palp_vec3 c, palp_vec3 x) {
    palp_vec3 r = palp_sub(x, c);
    float z = palp_dot(r, y->axis), rim = palp_min(y->rim_m, y->radius_m);
    palp_vec3 across = palp_madd(r, -z, y->axis);
    float distance = palp_norm(across), side = z >= 0.0f ? 1.0f : -1.0f;
    palp_vec3 radial = distance > 0.0f ? palp_scale(1.0f / distance, across) : (palp_vec3){0};
    palp_vec3 along = palp_scale(side, y->axis);
    float out = distance - (y->radius_m - rim), over = palp_abs(z) - y->half_m;
    if (out > 0.0f && over > 0.0f) {
        float d = palp_sqrt(out * out + over * over);
        return (palp_gap){d - rim, palp_madd(palp_scale(out / d, radial), over / d, along)};
    }
    return out >= over ? (palp_gap){out - rim, radial} : (palp_gap){over - rim, along};
}

static palp_gap gap_of_pad(const palp_pad *p, palp_vec3 c, palp_vec3 x) {
    palp_vec3 r = palp_sub(x, c);
    float gradient[2];
    float height = face_height(p, palp_dot(r, p->axis[0]), palp_dot(r, p->axis[1]), gradient);
    float slope = palp_sqrt(1.0f + gradient[0] * gradient[0] + gradient[1] * gradient[1]);
    palp_vec3 n = palp_madd(p->axis[2], -gradient[0], p->axis[0]);
    n = palp_madd(n, -gradient[1], p->axis[1]);
    return (palp_gap){(palp_dot(r, p->axis[2]) - height) / slope, palp_scale(1.0f / slope, n)};
}

palp_gap palp_tool_gap(const palp_tool *tool, palp_vec3 c, palp_vec3 x) {
    if (is_cylinder(tool)) return gap_of_cylinder(&tool->cylinder, c, x);
    if (tool->balls == 0u) return gap_of_pad(&tool->pad, c, x);
    palp_gap gap = gap_of_ball(&tool->ball[0], c, x);
    for (uint32_t i = 1; i < tool->balls; i++) {
        float width = MERGE * palp_min(tool->ball[i].radius_m, tool->ball[i - 1u].radius_m);
        gap = nearer(gap, gap_of_ball(&tool->ball[i], c, x), width);
    }
    return gap;
}

float palp_tool_extent(const palp_tool *tool) {
    const palp_cylinder *y = &tool->cylinder;
    const palp_pad *p = &tool->pad;
    if (is_cylinder(tool)) {
        float half = y->half_m + y->rim_m;
        return palp_sqrt(half * half + y->radius_m * y->radius_m);
    }
    if (tool->balls == 0u) {
        float u = p->half_m[0] + p->edge_m, v = p->half_m[1] + p->edge_m, most = p->edge_m;
        for (uint32_t i = 0; i < p->columns * p->rows; i++)
            most = palp_max(most, palp_abs(p->height_m[i]));
        return palp_sqrt(u * u + v * v + most * most);
    }
    float extent = 0.0f;
    for (uint32_t i = 0; i < tool->balls; i++)
        extent = palp_max(extent, palp_norm(tool->ball[i].center_m) + tool->ball[i].radius_m);
    return extent;
}
