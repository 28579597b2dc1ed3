/* SPDX-License-Identifier: MIT */
#include "tool.h"
#include "core/base/apart.h"

#define BETA PALP_TOOL_BETA
#define HEIGHT 0.6f       /* sqrt(1 - BETA^2) */
#define SLOPE 1.3333334f  /* BETA / HEIGHT */
#define MERGE 0.2f        /* width of the blend between balls, over the smaller radius */
#define LEAST_FACING 0.3f /* a depth is measured as if the node faced the tool at least so well */
#define LEAST_SLOPE 0.5f  /* of a gap: below it the place lies between sides of the tool */

palp_tool palp_tool_sphere(float radius_m) {
    return (palp_tool){.balls = 1, .ball[0] = {.radius_m = radius_m}};
}

palp_tool palp_tool_capsule(palp_vec3 axis, float half_m, float radius_m) {
    return (palp_tool){
        .shape = PALP_TOOL_CYLINDER,
        .cylinder = {.axis = axis, .radius_m = radius_m, .half_m = half_m, .rim_m = radius_m}};
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

static bool cylinder_is_sound(const palp_cylinder *y) {
    float length = palp_norm(y->axis);
    return y->radius_m > 0.0f && y->half_m > 0.0f && y->rim_m > 0.0f &&
           palp_is_finite(y->radius_m + y->half_m + y->rim_m) && palp_abs(length - 1.0f) < 1e-3f;
}

static bool balls_are_sound(const palp_tool *tool) {
    if (tool->balls < 1u || tool->balls > PALP_TOOL_BALLS) return false;
    for (uint32_t i = 0; i < tool->balls; i++) {
        const palp_ball *b = &tool->ball[i];
        if (!(b->radius_m > 0.0f) || !palp_is_finite(b->radius_m)) return false;
        if (!palp_vec3_is_finite(b->center_m)) return false;
    }
    return true;
}

bool palp_tool_is_sound(const palp_tool *tool) {
    if (!(tool->friction >= 0.0f && tool->friction <= 10.0f)) return false;
    if (!(tool->sliding >= 0.0f && tool->sliding <= tool->friction)) return false;
    switch (tool->shape) {
    case PALP_TOOL_OF_BALLS:
        return balls_are_sound(tool);
    case PALP_TOOL_CYLINDER:
        return cylinder_is_sound(&tool->cylinder);
    case PALP_TOOL_PAD:
        return pad_is_sound(&tool->pad);
    case PALP_TOOL_FIELD:
        return tool->field.sample != NULL;
    default:
        return false;
    }
}

static float least_ball(const palp_tool *tool) {
    float least = tool->ball[0].radius_m;
    for (uint32_t i = 1; i < tool->balls; i++) least = palp_min(least, tool->ball[i].radius_m);
    return least;
}

float palp_tool_size(const palp_tool *tool) {
    const palp_cylinder *y = &tool->cylinder;
    switch (tool->shape) {
    case PALP_TOOL_CYLINDER:
        return palp_min(y->radius_m, 4.0f * y->rim_m);
    case PALP_TOOL_PAD:
        return tool->pad.edge_m;
    case PALP_TOOL_FIELD:
        return tool->field.size_m;
    default:
        return least_ball(tool);
    }
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

static palp_touch ball_at(const palp_ball *ball, palp_vec3 x, palp_vec3 n) {
    palp_vec3 r = palp_sub(x, ball->center_m);
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

PALP_APART static palp_touch pad_at(const palp_pad *p, palp_vec3 r, palp_vec3 n) {
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
PALP_APART static palp_touch cylinder_at(const palp_cylinder *y, palp_vec3 r, palp_vec3 n) {
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

PALP_APART static palp_touch balls_at(const palp_tool *tool, palp_vec3 x, palp_vec3 n) {
    palp_touch touch = ball_at(&tool->ball[0], x, n);
    for (uint32_t i = 1; i < tool->balls; i++) {
        float width = MERGE * palp_min(tool->ball[i].radius_m, tool->ball[i - 1u].radius_m);
        touch = merge(touch, ball_at(&tool->ball[i], x, n), width);
    }
    return touch;
}

/* The distance along the field's own direction, over how well the node faces it. */
PALP_APART static palp_touch field_at(const palp_tool_field *f, palp_vec3 x, palp_vec3 n) {
    const palp_tool_distance d = palp_tool_field_at(f, x);
    const float facing = -palp_dot(n, d.slope);
    const float over = 1.0f / palp_max(facing, LEAST_FACING);
    return (palp_touch){
        .depth_m = -d.distance_m * over, .facing = facing, .push = palp_scale(-over, d.slope)};
}

/* A ball along a segment: of its places c = s a the one that drives the node deepest along -n. Of
 * the depth n.(x - c) + sqrt(R^2 - |p - s a'|^2), with p and a' what of x and of the axis lies
 * across n, it is where s = (p.a' - (n.a) sqrt(R^2 |a'|^2 - |p x a'|^2)) / |a'|^2, within the
 * segment. Moving c along the axis changes nothing there, so the push is that of the ball at c. */
PALP_APART static palp_touch capsule_at(const palp_cylinder *y, palp_vec3 x, palp_vec3 n) {
    const float lean = palp_dot(n, y->axis);
    const palp_vec3 a = palp_madd(y->axis, -lean, n);
    const palp_vec3 p = palp_madd(x, -palp_dot(x, n), n);
    const float a2 = palp_dot(a, a), pa = palp_dot(p, a);
    float s = lean > 0.0f ? -y->half_m : y->half_m;
    if (a2 > LEAST_FACING * LEAST_FACING) {
        const float left = y->radius_m * y->radius_m * a2 - (palp_dot(p, p) * a2 - pa * pa);
        s = palp_clamp((pa - lean * palp_sqrt(palp_max(left, 0.0f))) / a2, -y->half_m, y->half_m);
    }
    const palp_ball ball = {palp_scale(s, y->axis), y->radius_m};
    return ball_at(&ball, x, n);
}

/* In the tool's own axes. */
static palp_touch touch_of(const palp_tool *tool, palp_vec3 x, palp_vec3 n) {
    switch (tool->shape) {
    case PALP_TOOL_CYLINDER:
        if (tool->cylinder.rim_m < tool->cylinder.radius_m)
            return cylinder_at(&tool->cylinder, x, n);
        return capsule_at(&tool->cylinder, x, n);
    case PALP_TOOL_PAD:
        return pad_at(&tool->pad, x, n);
    case PALP_TOOL_FIELD:
        return field_at(&tool->field, x, n);
    default:
        return balls_at(tool, x, n);
    }
}

palp_touch palp_tool_at(const palp_tool *tool, const palp_frame *at, palp_vec3 x, palp_vec3 n) {
    palp_touch touch = touch_of(tool, palp_carry_back(at, x), palp_rotate_back(at->r, n));
    touch.push = palp_rotate(at->r, touch.push);
    return touch;
}

static palp_gap gap_of_ball(const palp_ball *ball, palp_vec3 x) {
    palp_vec3 r = palp_sub(x, ball->center_m);
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
    const palp_vec3 n = palp_madd(low.normal, share, palp_sub(high.normal, low.normal));
    const float slope = palp_norm(n);
    low.gap_m /= palp_max(slope, LEAST_SLOPE);
    low.normal = palp_scale(1.0f / palp_max(slope, 0.05f), n);
    return low;
}

/* A cylinder with rounded rims: distance from the inner cylinder, less the rim's radius. */
PALP_APART static palp_gap gap_of_cylinder(const palp_cylinder *y, palp_vec3 r) {
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

PALP_APART static palp_gap gap_of_pad(const palp_pad *p, palp_vec3 r) {
    float gradient[2];
    float height = face_height(p, palp_dot(r, p->axis[0]), palp_dot(r, p->axis[1]), gradient);
    float slope = palp_sqrt(1.0f + gradient[0] * gradient[0] + gradient[1] * gradient[1]);
    palp_vec3 n = palp_madd(p->axis[2], -gradient[0], p->axis[0]);
    n = palp_madd(n, -gradient[1], p->axis[1]);
    return (palp_gap){(palp_dot(r, p->axis[2]) - height) / slope, palp_scale(1.0f / slope, n)};
}

PALP_APART static palp_gap gap_of_balls(const palp_tool *tool, palp_vec3 x) {
    palp_gap gap = gap_of_ball(&tool->ball[0], x);
    for (uint32_t i = 1; i < tool->balls; i++) {
        float width = MERGE * palp_min(tool->ball[i].radius_m, tool->ball[i - 1u].radius_m);
        gap = nearer(gap, gap_of_ball(&tool->ball[i], x), width);
    }
    return gap;
}

/* Over its slope, as long as that is one: it vanishes where several sides are equally near. */
static palp_gap gap_of_distance(palp_tool_distance d) {
    const palp_vec3 up = {0.0f, 0.0f, 1.0f};
    const float slope = palp_norm(d.slope);
    return (palp_gap){d.distance_m / palp_max(slope, LEAST_SLOPE),
                      slope > 0.0f ? palp_scale(1.0f / slope, d.slope) : up};
}

PALP_APART static palp_gap gap_of_field(const palp_tool_field *f, palp_vec3 x) {
    return gap_of_distance(palp_tool_field_at(f, x));
}

/* In the tool's own axes. */
static palp_gap gap_of(const palp_tool *tool, palp_vec3 x) {
    switch (tool->shape) {
    case PALP_TOOL_CYLINDER:
        return gap_of_cylinder(&tool->cylinder, x);
    case PALP_TOOL_PAD:
        return gap_of_pad(&tool->pad, x);
    case PALP_TOOL_FIELD:
        return gap_of_field(&tool->field, x);
    default:
        return gap_of_balls(tool, x);
    }
}

palp_gap palp_tool_gap(const palp_tool *tool, const palp_frame *at, palp_vec3 x) {
    palp_gap gap = gap_of(tool, palp_carry_back(at, x));
    gap.normal = palp_rotate(at->r, gap.normal);
    return gap;
}

#define OUT 1e-3f         /* of the size: how near the surface counts as out */
#define LEAST_TIP 0.2f    /* of the size */
#define LEVEL 0.1f        /* of a direction along the axis, up to which a cylinder lies across it */
#define PASSED 0.1f       /* of the radius: an axis that comes no nearer does not meet it */
#define LEAST_SLANT 0.25f /* of the axis to the side that it is to leave by */

/* Where the axis leaves the tool, from a place inside with this distance. */
static palp_gap gap_of_exit(const palp_tool_field *f, palp_vec3 x, palp_vec3 axis,
                            palp_tool_distance from) {
    const float most = -PALP_TOOL_STEEP * from.distance_m;
    palp_tool_distance d = from;
    float way = 0.0f;
    for (uint32_t k = 0; k < PALP_TOOL_EXIT && d.distance_m < -OUT * f->size_m; k++) {
        const float slant = palp_dot(d.slope, axis);
        way -= d.distance_m / (slant > LEAST_SLANT ? palp_min(slant, 1.0f) : 1.0f);
        if (way > most) return gap_of_distance(from);
        d = palp_tool_field_at(f, palp_madd(x, way, axis));
    }
    palp_gap out = gap_of_distance(d);
    const float depth = way * palp_dot(out.normal, axis);
    out.gap_m -= depth;
    return depth > 0.0f && depth < most ? out : gap_of_distance(from);
}

/* From the plane that a convex tool has at the place x + way a. */
static palp_gap gap_of_plane(palp_gap there, float way, palp_vec3 a) {
    there.gap_m -= way * palp_dot(there.normal, a);
    return there;
}

/* Of the ball that the axis leaves last; where it meets none, the nearest side. */
PALP_APART static palp_gap exit_of_balls(const palp_tool *tool, palp_vec3 x, palp_vec3 a,
                                         palp_gap nearest) {
    palp_gap out = nearest;
    float farthest = 0.0f;
    for (uint32_t i = 0; i < tool->balls; i++) {
        const float radius = tool->ball[i].radius_m;
        const palp_vec3 r = palp_sub(x, tool->ball[i].center_m);
        const float along = palp_dot(r, a);
        const float left2 = radius * radius - palp_dot(r, r) + along * along;
        const float way = palp_sqrt(palp_max(left2, 0.0f)) - along;
        if (way <= farthest || !(left2 > 0.0f)) continue;
        farthest = way;
        out =
            gap_of_plane((palp_gap){0.0f, palp_scale(1.0f / radius, palp_madd(r, way, a))}, way, a);
    }
    return out;
}

/* Where a line leaves a slab or round of half width `half`: at `from` along `slope` per length. */
static float leaves_plane(float from, float slope, float half) {
    return palp_abs(slope) > 1e-6f ? (half - (slope > 0.0f ? from : -from)) / palp_abs(slope)
                                   : 1e30f;
}
static float leaves_round(palp_vec3 from, palp_vec3 slope, float radius) {
    const float a = palp_dot(slope, slope), b = palp_dot(from, slope);
    const float left = b * b + a * palp_max(radius * radius - palp_dot(from, from), 0.0f);
    return a > 1e-6f ? (palp_sqrt(left) - b) / a : 1e30f;
}

/* Newton's method from the box about it: the distance of a convex tool is convex along a line, so
 * each step ends outside, at a plane that has all of it on one side. */
PALP_APART static palp_gap exit_of_cylinder(const palp_cylinder *y, palp_vec3 x, palp_vec3 a,
                                            palp_gap nearest) {
    const float z = palp_dot(x, y->axis), rises = palp_dot(a, y->axis);
    const palp_vec3 across = palp_madd(x, -z, y->axis), aside = palp_madd(a, -rises, y->axis);
    float way = palp_min(leaves_plane(z, rises, y->half_m + y->rim_m),
                         leaves_round(across, aside, y->radius_m));
    palp_gap out = gap_of_cylinder(y, palp_madd(x, way, a));
    way -= out.gap_m / palp_max(palp_dot(out.normal, a), LEAST_SLANT);
    out = gap_of_cylinder(y, palp_madd(x, way, a));
    return out.gap_m < PASSED * y->radius_m ? gap_of_plane(out, way, a) : nearest;
}

/* As far as the nearest side lies behind, from where the axis leaves the tool. */
static palp_gap gap_of_sides(const palp_tool *tool, palp_vec3 x, const palp_tool_press *press,
                             palp_gap nearest) {
    const palp_gap out = tool->shape == PALP_TOOL_CYLINDER
                             ? exit_of_cylinder(&tool->cylinder, x, press->axis, nearest)
                             : exit_of_balls(tool, x, press->axis, nearest);
    const float behind = 1.0f - palp_dot(nearest.normal, press->axis) / PALP_TOOL_AHEAD;
    const float share = press->whole * palp_clamp(behind, 0.0f, 1.0f);
    const palp_vec3 n = palp_madd(palp_scale(1.0f - share, nearest.normal), share, out.normal);
    return (palp_gap){nearest.gap_m + share * (out.gap_m - nearest.gap_m),
                      palp_scale(1.0f / palp_max(palp_norm(n), 0.05f), n)};
}

/* The same of a field, from the plane before its tip; it need not be convex, and has PALP_TOOL_EXIT
 * looks. */
static palp_gap exit_by_tip(const palp_tool_field *f, palp_vec3 x, const palp_tool_press *press) {
    const palp_vec3 a = press->axis;
    const palp_ball *tip = &press->tip;
    palp_gap gap = gap_of_field(f, x);
    float way = tip->radius_m - palp_dot(a, palp_sub(x, tip->center_m));
    if (!(way > 0.0f) || palp_dot(gap.normal, a) > PALP_TOOL_AHEAD) return gap;
    palp_gap out = gap;
    for (uint32_t k = 1; k < PALP_TOOL_EXIT; k++) {
        out = gap_of_field(f, palp_madd(x, way, a));
        if (palp_abs(out.gap_m) < OUT * f->size_m || k + 1u == PALP_TOOL_EXIT) break;
        way -= out.gap_m / palp_max(palp_dot(out.normal, a), LEAST_SLANT);
    }
    const bool met = palp_abs(out.gap_m) < PASSED * f->size_m && palp_dot(out.normal, a) > 0.0f;
    return met ? gap_of_plane(out, way, a) : gap;
}

PALP_APART static palp_gap along_field(const palp_tool_field *f, palp_vec3 x,
                                       const palp_tool_press *press) {
    if (press->sunk > 0.5f && press->tip.radius_m > 0.0f) return exit_by_tip(f, x, press);
    const palp_tool_distance d = palp_tool_field_at(f, x);
    return d.distance_m < 0.0f ? gap_of_exit(f, x, press->axis, d) : gap_of_distance(d);
}

palp_ball palp_tool_tip(const palp_tool_field *f, palp_vec3 e, palp_vec3 n) {
    const float d = palp_tool_field_at(f, palp_madd(e, -f->size_m, n)).distance_m;
    const float radius = palp_clamp(-d, LEAST_TIP * f->size_m, f->size_m);
    return (palp_ball){palp_madd(e, -radius, n), radius};
}

palp_gap palp_tool_gap_along(const palp_tool *tool, const palp_frame *at, palp_vec3 x,
                             const palp_tool_press *press) {
    const palp_vec3 own = palp_carry_back(at, x);
    palp_tool_press own_press = *press;
    palp_gap gap;
    own_press.axis = palp_rotate_back(at->r, press->axis);
    if (tool->shape == PALP_TOOL_FIELD) {
        gap = along_field(&tool->field, own, &own_press);
    } else {
        gap = gap_of(tool, own);
        if (palp_tool_faces_back(tool, gap, &own_press))
            gap = gap_of_sides(tool, own, &own_press, gap);
    }
    gap.normal = palp_rotate(at->r, gap.normal);
    return gap;
}

/* ---- how far it extends ---- */

PALP_APART static float largest_height(const palp_pad *p) {
    float most = p->edge_m;
    for (uint32_t i = 0; i < p->columns * p->rows; i++)
        most = palp_max(most, palp_abs(p->height_m[i]));
    return most;
}

static float extent_of_balls(const palp_tool *tool) {
    float extent = 0.0f;
    for (uint32_t i = 0; i < tool->balls; i++)
        extent = palp_max(extent, palp_norm(tool->ball[i].center_m) + tool->ball[i].radius_m);
    return extent;
}

/* Half of the corners' box about its middle, and where that is. */
static palp_vec3 middle_of(const palp_tool_field *f, palp_vec3 *half) {
    palp_vec3 low, high;
    palp_tool_field_box(f, &low, &high);
    *half = palp_scale(0.5f, palp_sub(high, low));
    return palp_scale(0.5f, palp_add(low, high));
}

float palp_tool_extent(const palp_tool *tool) {
    const palp_cylinder *y = &tool->cylinder;
    const palp_pad *p = &tool->pad;
    palp_vec3 half, middle;
    float u, v, w;
    switch (tool->shape) {
    case PALP_TOOL_CYLINDER:
        u = y->half_m + y->rim_m;
        return palp_sqrt(u * u + y->radius_m * y->radius_m);
    case PALP_TOOL_PAD:
        u = p->half_m[0] + p->edge_m, v = p->half_m[1] + p->edge_m, w = largest_height(p);
        return palp_sqrt(u * u + v * v + w * w);
    case PALP_TOOL_FIELD:
        middle = middle_of(&tool->field, &half);
        u = palp_abs(middle.x) + half.x, v = palp_abs(middle.y) + half.y;
        w = palp_abs(middle.z) + half.z;
        return palp_sqrt(u * u + v * v + w * w);
    default:
        return extent_of_balls(tool);
    }
}

bool palp_tool_may_reach(const palp_tool *tool, palp_vec3 own, float reach_m) {
    palp_vec3 half;
    if (tool->shape != PALP_TOOL_FIELD) return true;
    const palp_vec3 off = palp_sub(own, middle_of(&tool->field, &half));
    return palp_abs(off.x) <= half.x + reach_m && palp_abs(off.y) <= half.y + reach_m &&
           palp_abs(off.z) <= half.z + reach_m;
}

static float support_of_balls(const palp_tool *tool, palp_vec3 d) {
    float most = palp_dot(tool->ball[0].center_m, d) + tool->ball[0].radius_m;
    for (uint32_t i = 1; i < tool->balls; i++)
        most = palp_max(most, palp_dot(tool->ball[i].center_m, d) + tool->ball[i].radius_m);
    return most;
}

float palp_tool_support(const palp_tool *tool, palp_vec3 d) {
    const palp_cylinder *y = &tool->cylinder;
    const palp_pad *p = &tool->pad;
    palp_vec3 half, middle;
    float along;
    switch (tool->shape) {
    case PALP_TOOL_CYLINDER:
        along = palp_abs(palp_dot(d, y->axis));
        return y->half_m * along + palp_min(y->rim_m, y->radius_m) +
               palp_max(y->radius_m - y->rim_m, 0.0f) *
                   palp_sqrt(palp_max(1.0f - along * along, 0.0f));
    case PALP_TOOL_PAD:
        return (p->half_m[0] + p->edge_m) * palp_abs(palp_dot(d, p->axis[0])) +
               (p->half_m[1] + p->edge_m) * palp_abs(palp_dot(d, p->axis[1])) +
               largest_height(p) * palp_abs(palp_dot(d, p->axis[2]));
    case PALP_TOOL_FIELD:
        if (tool->field.extremes > 0u)
            return palp_dot(d, palp_tool_field_extreme(&tool->field, d)) +
                   tool->field.extreme_off_m + tool->field.radius_m;
        middle = middle_of(&tool->field, &half);
        return palp_dot(d, middle) + half.x * palp_abs(d.x) + half.y * palp_abs(d.y) +
               half.z * palp_abs(d.z);
    default:
        return support_of_balls(tool, d);
    }
}

palp_vec3 palp_tool_core(const palp_cylinder *y, palp_vec3 down, palp_vec3 x) {
    const float along = palp_dot(down, y->axis), beside = palp_dot(x, y->axis);
    const palp_vec3 across = palp_madd(down, -along, y->axis);
    const float aside = palp_norm(across), inner = palp_max(y->radius_m - y->rim_m, 0.0f);
    const float end = palp_clamp(along / LEVEL, -1.0f, 1.0f) * y->half_m;
    const float level = 1.0f - palp_min(palp_abs(along) / LEVEL, 1.0f);
    const float z = palp_clamp(end + level * beside, -y->half_m, y->half_m);
    const palp_vec3 place = palp_scale(z, y->axis);
    return aside > LEVEL ? palp_madd(place, inner / aside, across) : place;
}

/* How far a ball, a cylinder or the tip of a field extends along d. */
static float support_of(const palp_tool *tool, const palp_ball *tip, palp_vec3 d) {
    if (tool->shape == PALP_TOOL_CYLINDER) return palp_tool_support(tool, d);
    const palp_ball *ball = tool->shape == PALP_TOOL_FIELD ? tip : &tool->ball[0];
    return palp_dot(ball->center_m, d) + ball->radius_m;
}

palp_gap palp_tool_gap_flared(const palp_tool *tool, const palp_frame *at, palp_vec3 x,
                              const palp_tool_press *press, palp_gap gap, float share) {
    const float ahead = PALP_TOOL_FLARE, facing = palp_dot(gap.normal, press->axis);
    const palp_vec3 side = palp_madd(gap.normal, -facing, press->axis);
    const float aside = palp_norm(side);
    const bool known = tool->shape != PALP_TOOL_FIELD || press->tip.radius_m > 0.0f;
    if (facing >= ahead || !(share > 0.0f) || !(aside > 0.0f) || !palp_tool_flares(tool) || !known)
        return gap;
    const palp_vec3 n =
        palp_madd(palp_scale(ahead, press->axis), palp_sqrt(1.0f - ahead * ahead) / aside, side);
    const palp_vec3 own = palp_carry_back(at, x), own_n = palp_rotate_back(at->r, n);
    const float flared = palp_dot(own_n, own) - support_of(tool, &press->tip, own_n);
    const palp_vec3 mixed = palp_madd(gap.normal, share, palp_sub(n, gap.normal));
    return (palp_gap){gap.gap_m + share * (flared - gap.gap_m),
                      palp_scale(1.0f / palp_max(palp_norm(mixed), 0.05f), mixed)};
}

palp_vec3 palp_tool_turned(const palp_tool *tool, const palp_frame *at, palp_vec3 turn_rad) {
    if (palp_tool_is_ball(tool)) return (palp_vec3){0};
    if (tool->shape != PALP_TOOL_CYLINDER) return turn_rad;
    const palp_vec3 axis = palp_rotate(at->r, tool->cylinder.axis);
    return palp_madd(turn_rad, -palp_dot(turn_rad, axis), axis);
}
