/* SPDX-License-Identifier: MIT */
#include "core/contact/springs.h"

#define DEPTHS PALP_SPRINGS_DEPTHS
#define LAID 0.85f      /* sqrt(z / z_top) when the depths are laid */
#define SHALLOW 0.4f    /* and below which they are laid anew */
#define LEAST_M 1e-12f  /* what a spring may be stretched at least, */
#define LEAST_RAD 1e-9f /* and twisted */
#define PROJECTIONS 4u
#define SPUN 0.55f /* q / p over spin a / slide while all slips: within 12 % of Coulomb's law */
#define FLAT 0.1472622f /* 3 pi / 64: (pi / 4) mu N a under a punch, over 16/3 G a^3 */

static float mean_compliance(const palp_springs *s) {
    return 0.5f * (s->near_m_per_N.xx + s->near_m_per_N.yy);
}

float palp_springs_depth(const palp_springs *springs) {
    return (springs->rounded ? 1.5f : 1.0f) * springs->at.normal_N * mean_compliance(springs);
}

float palp_springs_coefficient(const palp_springs *springs, const palp_tool *tool) {
    const float still = tool->friction, sliding = palp_tool_sliding(tool);
    const float path = still * palp_springs_depth(springs);
    return sliding + (still - sliding) / (1.0f + springs->slid_m / palp_max(path, 1e-30f));
}

/* ---- depths ---- */

/* Where spring i lies, as a root from 0 to 1; false if nothing of it touches. */
static bool extent(const palp_springs *s, uint32_t i, float *low, float *high) {
    const float per = 1.0f / (float)DEPTHS;
    const float kept = s->kept * (float)DEPTHS;
    const uint32_t last = kept < (float)(DEPTHS - 1u) ? (uint32_t)kept : DEPTHS - 1u;
    const float from = (float)(i > last ? i - 1u : i) * per;
    *low = i > last ? palp_max(from, s->kept) : from;
    *high = palp_min(from + per, i > last ? s->root : s->kept);
    return *high > *low;
}

/* What all springs have between two places, over its length; `first`: none before it reaches so
 * far, and is set to where to go on. */
static palp_vec3 mean_between(const palp_springs *s, float from, float to, uint32_t *first,
                              float *twist) {
    palp_vec3 sum = {0};
    float low, high, turn = 0.0f;
    for (uint32_t i = *first; i < PALP_SPRINGS; i++) {
        if (!extent(s, i, &low, &high)) continue;
        if (low >= to) break;
        if (high <= from) {
            *first = i + 1u;
            continue;
        }
        const float part = palp_min(high, to) - palp_max(low, from);
        sum = palp_madd(sum, part, s->stretch_m[i]);
        turn += part * s->twist_rad[i];
    }
    *twist = turn / (to - from);
    return palp_scale(1.0f / (to - from), sum);
}

static void forget(palp_springs *s, uint32_t i) {
    s->stretch_m[i] = (palp_vec3){0};
    s->twist_rad[i] = 0.0f;
}

/* Depths anew; `grows`: z_top of before over the new one, as a root. */
static void lay_depths(palp_springs *s, float grows) {
    const palp_springs old = *s;
    const float step = 1.0f / (grows * (float)DEPTHS);
    uint32_t first = 0;
    for (uint32_t i = 0; i < PALP_SPRINGS; i++) {
        const float from = (float)i * step, to = palp_min(from + step, old.root);
        forget(s, i);
        if (i < DEPTHS && to > from)
            s->stretch_m[i] = mean_between(&old, from, to, &first, &s->twist_rad[i]);
    }
    s->root *= grows;
    s->kept = s->root;
}

/* The load has changed: what comes in touch is not stretched, what loses it forgets. */
static void adapt_to_load(palp_springs *s, float root) {
    palp_springs now = *s;
    now.root = root;
    now.kept = palp_min(s->kept, root);
    for (uint32_t i = 0; i < PALP_SPRINGS; i++) {
        float low, high, before_low, before_high;
        const bool touched = extent(s, i, &before_low, &before_high);
        if (!extent(&now, i, &low, &high)) {
            forget(s, i);
        } else if (high > before_high || !touched) {
            const float left = touched ? (before_high - before_low) / (high - low) : 0.0f;
            s->stretch_m[i] = palp_scale(left, s->stretch_m[i]);
            s->twist_rad[i] *= left;
        }
    }
    s->root = now.root;
    s->kept = now.kept;
}

void palp_springs_press(palp_springs *s, float z) {
    if (!s->rounded) {
        s->root = s->kept = 1.0f;
        s->top_m = z;
        return;
    }
    float root = s->top_m > 0.0f ? palp_sqrt(z / s->top_m) : 2.0f;
    if (root > 1.0f || root < SHALLOW) {
        const float top = z / (LAID * LAID);
        lay_depths(s, s->top_m > 0.0f ? palp_sqrt(s->top_m / top) : 1.0f);
        s->top_m = top;
        root = LAID;
    }
    adapt_to_load(s, root);
}

/* ---- a solution ---- */

/* phi at x of 0..1. */
static float torsion_bound(float x) {
    /* at sixteenths; at 0, where it is infinite, that nothing is left which turns */
    static const float at[] = {1.3f,      0.753158f,  0.585412f,  0.485401f,  0.412745f, 0.354853f,
                               0.306152f, 0.263687f,  0.225712f,  0.191107f,  0.159117f, 0.129205f,
                               0.100982f, 0.0741533f, 0.0484923f, 0.0238218f, 0.0f};
    const float place = palp_clamp(16.0f * x, 0.0f, 15.999f);
    const uint32_t i = (uint32_t)place;
    return at[i] + (place - (float)i) * (at[i + 1u] - at[i]);
}

/* Adds spring i, if it touches. */
static void add_spring(palp_spring_set *set, float mu, uint32_t i) {
    const palp_springs *s = set->of;
    const float z = s->top_m * s->root * s->root;
    const float turns = mu * s->at.normal_N / (s->at.shear_Pa * s->radius_m * s->radius_m);
    palp_spring spring = {.number = i,
                          .stiffness_N_per_m = set->stiffness_N_per_m,
                          .reach_m = mu * z,
                          .stiffness_Nm = set->stiffness_Nm,
                          .reach_rad = FLAT * turns};
    if (s->rounded) {
        float low, high;
        if (!extent(s, i, &low, &high)) return;
        const float low3 = low * low * low, high3 = high * high * high;
        const float cube = s->root * s->root * s->root;
        const float middle = 0.75f * (high3 * high - low3 * low) / (high3 - low3);
        const float depth = s->top_m * (low * low + low * high + high * high) / 3.0f;
        spring.stiffness_N_per_m *= high - low;
        spring.reach_m = mu * (z - depth);
        spring.stiffness_Nm *= (high3 - low3) / cube;
        spring.reach_rad = turns * torsion_bound(middle / s->root);
    }
    spring.reach_m = palp_max(spring.reach_m, LEAST_M);
    spring.reach_rad = palp_max(spring.reach_rad, LEAST_RAD);
    spring.stretch_m[0] = palp_dot(s->stretch_m[i], s->at.tangent[0]);
    spring.stretch_m[1] = palp_dot(s->stretch_m[i], s->at.tangent[1]);
    spring.twist_rad = s->twist_rad[i];
    set->spring[set->count++] = spring;
}

void palp_springs_gather(palp_springs *s, float mu, palp_vec3 turn_rad, palp_spring_set *set) {
    const palp_symmetric2 a = s->near_m_per_N;
    const float mean = mean_compliance(s), over = mean / (a.xx * a.yy - a.xy * a.xy);
    *set = (palp_spring_set){.of = s,
                             .m = {over * a.yy, -over * a.xy, over * a.xx},
                             .stiffness_N_per_m = 1.0f / (s->root * mean),
                             .stiffness_Nm = 16.0f / 3.0f * s->at.shear_Pa * s->radius_m *
                                             s->radius_m * s->radius_m,
                             .moved_m = palp_cross(turn_rad, s->at.centre_m),
                             .turned_rad = palp_dot(turn_rad, s->at.axis)};
    for (uint32_t i = 0; i < (s->rounded ? PALP_SPRINGS : 1u); i++) add_spring(set, mu, i);
}

/* What a spring carries when it is stretched by `more` of the plane and turned with its set. */
typedef struct {
    float stretched_m[2], twisted_rad, out_m[2]; /* e, t, M e; before it slips */
    float share, share_rad;                      /* of e and t that is left */
    palp_symmetric2 slope;                       /* of what is left of M e, by M e */
} carried;

/* Onto the bound x^2 + y^2 + q^2 = 1: x and y over 1 + g, q over 1 + r g, so that q / (x, y) goes
 * with what they grow by, over r. Newton steps from g = 0 come from below. */
static void project(float push2, float turn, float r, float *share, float *share_rad) {
    float g = 0.0f;
    for (uint32_t step = 0; step < PROJECTIONS && turn * turn > 0.0f; step++) {
        const float a = 1.0f / (1.0f + g), b = 1.0f / (1.0f + r * g);
        const float x2 = push2 * a * a, q2 = turn * turn * b * b;
        g += 0.5f * (x2 + q2 - 1.0f) / (x2 * a + r * q2 * b);
    }
    const float a = 1.0f / (1.0f + g), b = 1.0f / (1.0f + r * g);
    const float over = 1.0f / palp_sqrt(push2 * a * a + turn * turn * b * b);
    *share = a * over;
    *share_rad = b * over;
}

static carried carry(const palp_spring_set *set, const palp_spring *p, const float more[2]) {
    const float v[2] = {p->stretch_m[0] + more[0], p->stretch_m[1] + more[1]};
    carried c = {
        .stretched_m = {v[0], v[1]},
        .twisted_rad = p->twist_rad + set->turned_rad,
        .out_m = {set->m.xx * v[0] + set->m.xy * v[1], set->m.xy * v[0] + set->m.yy * v[1]},
        .share = 1.0f,
        .share_rad = 1.0f,
        .slope = {1.0f, 0.0f, 1.0f}};
    float x = c.out_m[0] / p->reach_m, y = c.out_m[1] / p->reach_m;
    float turn = c.twisted_rad / p->reach_rad;
    if (x * x + y * y + turn * turn <= 1.0f) return c;
    const float r = p->reach_m / (SPUN * set->of->radius_m * p->reach_rad);
    project(x * x + y * y, turn, r, &c.share, &c.share_rad);
    x *= c.share, y *= c.share, turn *= c.share_rad;
    const float over =
        c.share * c.share / (c.share * (x * x + y * y) + r * c.share_rad * turn * turn);
    c.slope = (palp_symmetric2){c.share - over * x * x, -over * x * y, c.share - over * y * y};
    return c;
}

/* by_m and what the turn adds, in the plane of the region. */
static void in_plane(const palp_spring_set *set, palp_vec3 by_m, float more[2]) {
    const palp_vec3 all = palp_add(by_m, set->moved_m);
    more[0] = palp_dot(all, set->of->at.tangent[0]);
    more[1] = palp_dot(all, set->of->at.tangent[1]);
}

void palp_springs_add(const palp_spring_set *set, palp_vec3 by_m, palp_vec3 *force_N,
                      palp_vec3 slope[3]) {
    const palp_vec3 *t = set->of->at.tangent;
    float more[2], force[2] = {0.0f}, d[2][2] = {{0.0f}};
    in_plane(set, by_m, more);
    for (uint32_t j = 0; j < set->count; j++) {
        const palp_spring *p = &set->spring[j];
        const carried c = carry(set, p, more);
        const float w = p->stiffness_N_per_m;
        force[0] += w * c.share * c.out_m[0];
        force[1] += w * c.share * c.out_m[1];
        d[0][0] += w * c.slope.xx;
        d[0][1] += w * c.slope.xy;
        d[1][1] += w * c.slope.yy;
    }
    const palp_vec3 column[2] = {
        palp_madd(palp_scale(d[0][0] * set->m.xx + d[0][1] * set->m.xy, t[0]),
                  d[0][1] * set->m.xx + d[1][1] * set->m.xy, t[1]),
        palp_madd(palp_scale(d[0][0] * set->m.xy + d[0][1] * set->m.yy, t[0]),
                  d[0][1] * set->m.xy + d[1][1] * set->m.yy, t[1])};
    *force_N = palp_madd(palp_madd(*force_N, force[0], t[0]), force[1], t[1]);
    for (uint32_t k = 0; k < 2u; k++) {
        slope[0] = palp_madd(slope[0], t[k].x, column[k]);
        slope[1] = palp_madd(slope[1], t[k].y, column[k]);
        slope[2] = palp_madd(slope[2], t[k].z, column[k]);
    }
}

void palp_springs_slip(palp_spring_set *set, palp_vec3 by_m, palp_springs_pull *pull) {
    palp_springs *s = set->of;
    const palp_vec3 all = palp_add(by_m, set->moved_m);
    float more[2], force[2] = {0.0f}, moment = 0.0f, sticking = 0.0f, twice_J = 0.0f;
    in_plane(set, by_m, more);
    for (uint32_t j = 0; j < set->count; j++) {
        const palp_spring *p = &set->spring[j];
        const carried c = carry(set, p, more);
        const float w = p->stiffness_N_per_m, k = p->stiffness_Nm, share = c.share;
        const float twist = c.share_rad * c.twisted_rad;
        force[0] += w * share * c.out_m[0];
        force[1] += w * share * c.out_m[1];
        moment += k * twist;
        twice_J +=
            w * share * share * (c.out_m[0] * c.stretched_m[0] + c.out_m[1] * c.stretched_m[1]) +
            k * twist * twist;
        s->stretch_m[p->number] = palp_scale(share, palp_add(s->stretch_m[p->number], all));
        s->twist_rad[p->number] = twist;
        if (share >= 1.0f) sticking += w;
    }
    const palp_vec3 along =
        palp_madd(palp_scale(force[0], s->at.tangent[0]), force[1], s->at.tangent[1]);
    const bool slipping = !(sticking > 0.0f);
    s->slid_m = slipping ? s->slid_m + palp_sqrt(more[0] * more[0] + more[1] * more[1]) : 0.0f;
    pull->force_N = palp_add(pull->force_N, along);
    pull->moment_Nm =
        palp_add(pull->moment_Nm, palp_madd(palp_cross(s->at.centre_m, along), moment, s->at.axis));
    pull->sticking_N_per_m += sticking;
    pull->energy_J += 0.5f * twice_J;
    pull->slipping = pull->slipping && slipping;
}

void palp_springs_move(palp_springs *s, palp_vec3 more_m) {
    float low, high;
    for (uint32_t i = 0; i < (s->rounded ? PALP_SPRINGS : 1u); i++) {
        if (!s->rounded || extent(s, i, &low, &high))
            s->stretch_m[i] = palp_add(s->stretch_m[i], more_m);
    }
}

void palp_springs_inherit(palp_springs *s, const palp_springs *const *from, const float *share,
                          uint32_t count) {
    const palp_springs now = *s;
    *s = *from[0];
    s->at = now.at;
    s->near_m_per_N = now.near_m_per_N;
    s->radius_m = now.radius_m;
    if (count == 1u && share[0] >= 1.0f) return;
    s->top_m *= palp_springs_depth(&now) / palp_max(palp_springs_depth(from[0]), 1e-30f);
    for (uint32_t j = 0; j < PALP_SPRINGS; j++) {
        palp_vec3 stretch = {0};
        float twist = 0.0f;
        for (uint32_t i = 0; i < count; i++) {
            const palp_springs *f = from[i];
            const palp_vec3 e = f->stretch_m[j], n = f->at.axis;
            const palp_vec3 along = palp_madd(e, -palp_dot(e, n), n);
            stretch =
                palp_madd(stretch, share[i] * mean_compliance(&now) / mean_compliance(f), along);
            twist += share[i] * f->twist_rad[j];
        }
        s->stretch_m[j] = stretch;
        s->twist_rad[j] = twist;
    }
}
