/* SPDX-License-Identifier: MIT */
#include "core/contact/friction.h"
#include "core/contact/contact_internal.h"

#define SPRINGS PALP_FRICTION_SPRINGS
#define HERTZ 1.2f   /* compliance under a force like the pressure, over that of all points alike */
#define LAID 0.85f   /* sqrt(z / z_top) when the depths are laid */
#define SHALLOW 0.4f /* and below which they are laid anew */
#define SETTLED 1e-5f

/* A spring as it is in a solution: in the tangent plane, with w and mu (z - z_j). */
typedef struct {
    float stretch_m[2], stiffness_N_per_m, reach_m;
    palp_vec3 *at; /* e_j */
} spring;

typedef struct {
    spring of[2u * SPRINGS];
    uint32_t count;
    palp_symmetric2 m;  /* M */
    float unit_N_per_m; /* w of a depth that touches wholly, times how many there are */
} spring_set;

void palp_friction_reset(palp_friction *friction) { *friction = (palp_friction){0}; }

/* ---- the contact ---- */

static void find_tangents(palp_friction *f) {
    palp_vec3 n = f->axis;
    palp_vec3 x = {1.0f, 0.0f, 0.0f}, y = {0.0f, 1.0f, 0.0f};
    palp_vec3 t = palp_cross(n, palp_abs(n.x) < 0.6f ? x : y);
    f->tangent[0] = palp_scale(1.0f / palp_norm(t), t);
    f->tangent[1] = palp_cross(n, f->tangent[0]);
}

/* Neither direction below `least`, and definite. */
static palp_symmetric2 made_definite(palp_symmetric2 c, float least) {
    const palp_symmetric2 d = {palp_max(c.xx, least), c.xy, palp_max(c.yy, least)};
    const bool sound = c.xx >= least && c.yy >= least && c.xy * c.xy <= d.xx * d.yy - least * least;
    return sound ? c : (palp_symmetric2){d.xx, 0.0f, d.yy};
}

/* No direction is stiffer than a tenth of the softest: truncated modes may leave the whole slightly
 * indefinite near fixed nodes. */
static void measure_compliance(palp_friction *f, palp_contact *c, uint32_t tool) {
    palp_symmetric2 near, far;
    palp_contact_tangential(c, tool, f->tangent, f->normal_N, &near, &far);
    const float scale = f->rounded ? 1.0f / HERTZ : 1.0f;
    if (far.xx < 0.0f || far.yy < 0.0f) { /* stiffer than a half-space */
        near.xx += far.xx, near.xy += far.xy, near.yy += far.yy;
        far = (palp_symmetric2){0.0f, 0.0f, 0.0f};
    }
    near = (palp_symmetric2){scale * near.xx, scale * near.xy, scale * near.yy};
    f->near_m_per_N = made_definite(near, 0.1f * palp_max(near.xx, near.yy));
    f->far_m_per_N = made_definite(far, 0.0f);
}

static float mean_compliance(const palp_friction *f) {
    return 0.5f * (f->near_m_per_N.xx + f->near_m_per_N.yy);
}

/* ---- depths ---- */

/* Share of depth j that touches, 0..1. */
static float covered(float root, uint32_t j) {
    return palp_clamp(root * (float)SPRINGS - (float)j, 0.0f, 1.0f);
}

/* Stretch that part of depth i between two places, from and to of 0..1, has in all. */
static palp_vec3 stretch_between(const palp_friction *f, uint32_t i, float from, float to) {
    const float end = palp_min(to, covered(f->root, i)), kept = f->kept[i];
    const float inner = palp_max(palp_min(end, kept) - from, 0.0f);
    const float outer = palp_max(end - palp_max(from, kept), 0.0f);
    return palp_madd(palp_scale(inner, f->stretch_m[0][i]), outer, f->stretch_m[1][i]);
}

/* Depths anew; `grows`: z_top of before over the new one, as a root. */
static void lay_depths(palp_friction *f, float grows) {
    palp_friction old = *f;
    const float step = 1.0f / grows, touched = f->root * (float)SPRINGS;
    for (uint32_t j = 0; j < SPRINGS; j++) {
        const float from = palp_min((float)j * step, (float)SPRINGS);
        const float to = palp_min(from + step, touched);
        palp_vec3 sum = {0};
        /* at most SPRINGS; all depths together twice that */
        for (uint32_t i = (uint32_t)from; i < SPRINGS && (float)i < to; i++) {
            const float low = palp_clamp(from - (float)i, 0.0f, 1.0f);
            const float high = palp_clamp(to - (float)i, 0.0f, 1.0f);
            if (high > low) sum = palp_add(sum, stretch_between(&old, i, low, high));
        }
        f->stretch_m[0][j] = to > from ? palp_scale(1.0f / (to - from), sum) : (palp_vec3){0};
        f->stretch_m[1][j] = (palp_vec3){0};
    }
    f->root *= grows;
    for (uint32_t j = 0; j < SPRINGS; j++) f->kept[j] = covered(f->root, j);
}

/* The depth z: what loses touch forgets, what comes in touch is not stretched yet. */
static void press(palp_friction *f, float z) {
    if (!f->rounded) {
        f->root = f->kept[0] = 1.0f;
        f->top_m = z;
        return;
    }
    float root = f->top_m > 0.0f ? palp_sqrt(z / f->top_m) : 2.0f;
    if (root > 1.0f || root < SHALLOW) {
        const float top = z / (LAID * LAID);
        lay_depths(f, f->top_m > 0.0f ? palp_sqrt(f->top_m / top) : 1.0f);
        f->top_m = top;
        root = LAID;
    }
    for (uint32_t j = 0; j < SPRINGS; j++) {
        const float before = covered(f->root, j), now = covered(root, j), kept = f->kept[j];
        if (now > before)
            f->stretch_m[1][j] = palp_scale((before - kept) / (now - kept), f->stretch_m[1][j]);
        f->kept[j] = palp_min(kept, now);
        if (!(now > f->kept[j])) f->stretch_m[1][j] = (palp_vec3){0};
        if (!(now > 0.0f)) f->stretch_m[0][j] = (palp_vec3){0};
    }
    f->root = root;
}

/* ---- springs ---- */

static float coefficient(const palp_friction *f, const palp_tool *tool, float z) {
    const float still = tool->friction, sliding = palp_tool_sliding(tool);
    return sliding + (still - sliding) / (1.0f + f->slid_m / palp_max(still * z, 1e-30f));
}

/* Adds the spring of depth j between two places of it. */
static void add_spring(palp_friction *f, float mu, uint32_t part, uint32_t j, float from, float to,
                       spring_set *s) {
    if (!(to > from)) return;
    const float low = ((float)j + from) / (float)SPRINGS, high = ((float)j + to) / (float)SPRINGS;
    const float top = f->top_m, z = top * f->root * f->root;
    const float depth = f->rounded ? top * (low * low + low * high + high * high) / 3.0f : 0.0f;
    const float share = f->rounded ? (to - from) / (float)SPRINGS : 1.0f;
    palp_vec3 *at = &f->stretch_m[part][j];
    s->of[s->count++] =
        (spring){.stretch_m = {palp_dot(*at, f->tangent[0]), palp_dot(*at, f->tangent[1])},
                 .stiffness_N_per_m = share * s->unit_N_per_m,
                 .reach_m = mu * (z - depth),
                 .at = at};
}

static void find_springs(palp_friction *f, float mu, spring_set *s) {
    const palp_symmetric2 a = f->near_m_per_N;
    const float mean = mean_compliance(f), over = mean / (a.xx * a.yy - a.xy * a.xy);
    s->m = (palp_symmetric2){over * a.yy, -over * a.xy, over * a.xx};
    s->unit_N_per_m = 1.0f / (f->root * mean);
    s->count = 0;
    for (uint32_t j = 0; j < (f->rounded ? SPRINGS : 1u); j++) {
        add_spring(f, mu, 0, j, 0.0f, f->kept[j], s);
        add_spring(f, mu, 1, j, f->kept[j], covered(f->root, j), s);
    }
}

/* M v, shortened to `reach`; *d: its derivative by M v. Returns the factor. */
static float clip(const spring_set *s, const float v[2], float reach, float out[2],
                  palp_symmetric2 *d) {
    out[0] = s->m.xx * v[0] + s->m.xy * v[1];
    out[1] = s->m.xy * v[0] + s->m.yy * v[1];
    const float length2 = out[0] * out[0] + out[1] * out[1];
    *d = (palp_symmetric2){1.0f, 0.0f, 1.0f};
    if (length2 <= reach * reach) return 1.0f;
    const float factor = reach / palp_sqrt(length2);
    *d = (palp_symmetric2){factor * (1.0f - out[0] * out[0] / length2),
                           -factor * out[0] * out[1] / length2,
                           factor * (1.0f - out[1] * out[1] / length2)};
    out[0] *= factor;
    out[1] *= factor;
    return factor;
}

/* P of the springs stretched by `by` more, and its derivative by that. */
static void pull(const spring_set *s, const float by[2], float force[2], float slope[2][2]) {
    float d[2][2] = {{0.0f}};
    force[0] = force[1] = 0.0f;
    for (uint32_t j = 0; j < s->count; j++) {
        const spring *p = &s->of[j];
        const float v[2] = {p->stretch_m[0] + by[0], p->stretch_m[1] + by[1]};
        const float w = p->stiffness_N_per_m;
        float out[2];
        palp_symmetric2 each;
        (void)clip(s, v, p->reach_m, out, &each);
        force[0] += w * out[0];
        force[1] += w * out[1];
        d[0][0] += w * each.xx;
        d[0][1] += w * each.xy;
        d[1][1] += w * each.yy;
    }
    slope[0][0] = d[0][0] * s->m.xx + d[0][1] * s->m.xy;
    slope[0][1] = d[0][0] * s->m.xy + d[0][1] * s->m.yy;
    slope[1][0] = d[0][1] * s->m.xx + d[1][1] * s->m.xy;
    slope[1][1] = d[0][1] * s->m.xy + d[1][1] * s->m.yy;
}

/* How far the springs are stretched more, by = unheld - soft P, by semismooth Newton steps. */
static void find_stretch(const spring_set *s, const float unheld[2], palp_symmetric2 soft,
                         float most_N, float by[2]) {
    const float small = SETTLED * (soft.xx + soft.yy) * most_N;
    by[0] = by[1] = 0.0f;
    for (uint32_t step = 0; step < PALP_FRICTION_STEPS; step++) {
        float force[2], slope[2][2];
        pull(s, by, force, slope);
        const float r[2] = {by[0] - unheld[0] + soft.xx * force[0] + soft.xy * force[1],
                            by[1] - unheld[1] + soft.xy * force[0] + soft.yy * force[1]};
        if (step > 0u && palp_abs(r[0]) + palp_abs(r[1]) <= small) return;
        const float a = 1.0f + soft.xx * slope[0][0] + soft.xy * slope[1][0];
        const float b = soft.xx * slope[0][1] + soft.xy * slope[1][1];
        const float c = soft.xy * slope[0][0] + soft.yy * slope[1][0];
        const float d = 1.0f + soft.xy * slope[0][1] + soft.yy * slope[1][1];
        const float inverse = 1.0f / (a * d - b * c);
        by[0] -= inverse * (d * r[0] - b * r[1]);
        by[1] -= inverse * (a * r[1] - c * r[0]);
    }
}

static palp_vec3 in_plane(const palp_friction *f, const float v[2]) {
    return palp_madd(palp_scale(v[0], f->tangent[0]), v[1], f->tangent[1]);
}

/* Lets the springs slip where they are stretched by `by` more; force[2]: P. */
static void slip(palp_friction *f, const spring_set *s, const float by[2], float force[2]) {
    float twice_J = 0.0f, sticking = 0.0f;
    force[0] = force[1] = 0.0f;
    f->slipping = true;
    for (uint32_t j = 0; j < s->count; j++) {
        const spring *p = &s->of[j];
        const float v[2] = {p->stretch_m[0] + by[0], p->stretch_m[1] + by[1]};
        float out[2];
        palp_symmetric2 d;
        const float factor = clip(s, v, p->reach_m, out, &d);
        const float w = p->stiffness_N_per_m, kept[2] = {factor * v[0], factor * v[1]};
        force[0] += w * out[0];
        force[1] += w * out[1];
        twice_J += w * (out[0] * kept[0] + out[1] * kept[1]);
        *p->at = palp_scale(factor, palp_add(*p->at, in_plane(f, by)));
        if (factor < 1.0f) continue;
        sticking += w;
        f->slipping = false;
    }
    const palp_symmetric2 b = f->far_m_per_N;
    twice_J +=
        b.xx * force[0] * force[0] + 2.0f * b.xy * force[0] * force[1] + b.yy * force[1] * force[1];
    f->force_N = palp_scale(-1.0f, in_plane(f, force));
    f->energy_J = 0.5f * twice_J;
    f->sticking_N_per_m = sticking / (1.0f + 0.5f * (b.xx + b.yy) * sticking);
    f->slid_m = f->slipping ? f->slid_m + palp_sqrt(by[0] * by[0] + by[1] * by[1]) : 0.0f;
}

void palp_friction_solve(palp_friction *friction, palp_contact *contact, uint32_t tool,
                         palp_vec3 rest_m, float stiffness_N_per_m) {
    palp_friction *f = friction;
    if (!(contact->normal_N[tool] > 0.0f)) {
        palp_friction_reset(f);
        return;
    }
    const float soft = stiffness_N_per_m > 0.0f ? 1.0f / stiffness_N_per_m : 0.0f;
    const palp_vec3 normal = contact->force_N[tool];
    const palp_vec3 free_m = palp_madd(rest_m, -soft, f->force_N); /* without T */
    f->rounded = contact->tools[tool].balls > 0u;
    f->axis = palp_scale(1.0f / palp_max(palp_norm(normal), 1e-30f), normal);
    f->normal_N = contact->normal_N[tool];
    if (!f->touching) f->tool_m = free_m;
    f->touching = true;
    find_tangents(f);
    measure_compliance(f, contact, tool);
    const float z = (f->rounded ? 1.5f : 1.0f) * f->normal_N * mean_compliance(f);
    press(f, z);
    const float mu = coefficient(f, &contact->tools[tool], z);
    /* what the springs would be stretched by without force: B P of before is given back */
    const palp_symmetric2 far = f->far_m_per_N;
    const palp_vec3 off = palp_sub(free_m, f->tool_m);
    const float before[2] = {-palp_dot(f->force_N, f->tangent[0]),
                             -palp_dot(f->force_N, f->tangent[1])};
    const float unheld[2] = {palp_dot(off, f->tangent[0]) + far.xx * before[0] + far.xy * before[1],
                             palp_dot(off, f->tangent[1]) + far.xy * before[0] +
                                 far.yy * before[1]};
    spring_set springs;
    float by[2], force[2];
    find_springs(f, mu, &springs);
    find_stretch(&springs, unheld, (palp_symmetric2){far.xx + soft, far.xy, far.yy + soft},
                 mu * f->normal_N, by);
    slip(f, &springs, by, force);
    contact->work_done += 40u * (PALP_FRICTION_STEPS + 2u) * (uint64_t)springs.count;
    const float moved[2] = {
        by[0] + far.xx * (force[0] - before[0]) + far.xy * (force[1] - before[1]),
        by[1] + far.xy * (force[0] - before[0]) + far.yy * (force[1] - before[1])};
    f->solved_m = palp_add(f->tool_m, in_plane(f, moved));
}

void palp_friction_carry(palp_friction *friction, palp_vec3 by_m) {
    friction->tool_m = palp_add(friction->tool_m, by_m);
}

void palp_friction_settle(palp_friction *friction, palp_vec3 tool_m) {
    palp_friction *f = friction;
    const palp_vec3 more = palp_sub(tool_m, f->solved_m);
    f->tool_m = tool_m;
    if (!f->touching) return;
    for (uint32_t j = 0; j < (f->rounded ? SPRINGS : 1u); j++) {
        if (f->kept[j] > 0.0f) f->stretch_m[0][j] = palp_add(f->stretch_m[0][j], more);
        if (covered(f->root, j) > f->kept[j])
            f->stretch_m[1][j] = palp_add(f->stretch_m[1][j], more);
    }
}

float palp_friction_share(const palp_friction *friction, float stiffness_N_per_m) {
    return friction->sticking_N_per_m / (friction->sticking_N_per_m + stiffness_N_per_m);
}
