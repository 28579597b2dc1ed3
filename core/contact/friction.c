/* SPDX-License-Identifier: MIT */
#include "core/base/apart.h"
#include "core/contact/friction.h"
#include "core/base/frame.h"
#include "core/contact/contact_internal.h"

#define HERTZ 1.2f /* compliance under a force like the pressure, over that of all points alike */
#define SPREAD_ROUND                                                                               \
    2.5f /* a^2 over the mean square distance from the middle, by pressure: Hertz, */
#define SPREAD_FLAT 1.5f /* and under a punch */
#define SETTLED 1e-5f

void palp_friction_reset(palp_friction *friction) { *friction = (palp_friction){0}; }

/* ---- the contact ---- */

/* Neither direction below `least`, and definite. */
static palp_symmetric2 made_definite(palp_symmetric2 c, float least) {
    const palp_symmetric2 d = {palp_max(c.xx, least), c.xy, palp_max(c.yy, least)};
    const bool sound = c.xx >= least && c.yy >= least && c.xy * c.xy <= d.xx * d.yy - least * least;
    return sound ? c : (palp_symmetric2){d.xx, 0.0f, d.yy};
}

/* Along the only region, or across the force of several. */
static void find_tangents(palp_friction *f, palp_vec3 force) {
    const palp_contact_region *one = &f->region[0].at;
    const float size = palp_norm(force);
    const bool single = f->regions == 1u || !(size > 0.0f);
    palp_tangents(single ? one->axis : palp_scale(1.0f / size, force), f->tangent);
}

/* No direction is stiffer than a tenth of the softest: truncated modes may leave the whole slightly
 * indefinite near fixed nodes. */
static void measure_compliance(palp_friction *f, palp_contact *c, uint32_t tool,
                               const palp_contact_region *region) {
    palp_symmetric2 near[PALP_CONTACT_REGIONS], far;
    palp_contact_tangential(c, tool, f->tangent, region, f->regions, near, &far);
    if (f->regions == 1u && (far.xx < 0.0f || far.yy < 0.0f)) { /* stiffer than a half-space */
        near[0].xx += far.xx, near[0].xy += far.xy, near[0].yy += far.yy;
        far = (palp_symmetric2){0.0f, 0.0f, 0.0f};
    }
    for (uint32_t k = 0; k < f->regions; k++) {
        const float scale = f->region[k].rounded ? 1.0f / HERTZ : 1.0f;
        const palp_symmetric2 a = {scale * near[k].xx, scale * near[k].xy, scale * near[k].yy};
        f->region[k].near_m_per_N = made_definite(a, 0.1f * palp_max(a.xx, a.yy));
    }
    f->far_m_per_N = made_definite(far, 0.0f);
}

/* What of region `o` of before goes on in region `r`, by the forces of all that it goes on in. */
PALP_APART static float share_of(const palp_friction *f, uint32_t o, uint32_t r) {
    float all = 0.0f;
    for (uint32_t k = 0; k < f->regions; k++) {
        if ((f->region[k].at.parents >> o & 1u) != 0u) all += f->region[k].at.normal_N;
    }
    return all > 0.0f ? f->region[r].at.normal_N / all : 0.0f;
}

/* The springs of region r, after those of before. */
static void take_over(palp_friction *f, uint32_t r, const palp_springs *old, uint32_t count) {
    const palp_springs *from[PALP_CONTACT_REGIONS];
    float share[PALP_CONTACT_REGIONS];
    uint32_t found = 0;
    for (uint32_t o = 0; o < count; o++) {
        if ((f->region[r].at.parents >> o & 1u) == 0u) continue;
        from[found] = &old[o];
        share[found] = share_of(f, o, r);
        if (share[found] * old[o].at.normal_N > share[0] * from[0]->at.normal_N) { /* it leads */
            const palp_springs *first = from[0];
            const float part = share[0];
            from[0] = from[found], share[0] = share[found];
            from[found] = first, share[found] = part;
        }
        found++;
    }
    if (found > 0u) palp_springs_inherit(&f->region[r], from, share, found);
}

/* The regions of this tick, with the springs of those before. */
static void track_regions(palp_friction *f, palp_friction_work *w, palp_contact *c, uint32_t tool) {
    const palp_tool_shape shape = c->tools[tool].shape;
    const bool rounded = shape == PALP_TOOL_OF_BALLS || shape == PALP_TOOL_FIELD;
    const uint32_t before = f->regions;
    for (uint32_t k = 0; k < before; k++) {
        w->before[k] = f->region[k];
        w->region[0][k] = f->region[k].at;
    }
    f->regions = palp_contact_regions(c, tool, w->region[0], before, w->region[1]);
    for (uint32_t k = 0; k < f->regions; k++) {
        const palp_contact_region *at = &w->region[1][k];
        const float over = rounded ? SPREAD_ROUND : SPREAD_FLAT;
        f->region[k] = (palp_springs){
            .at = *at, .radius_m = palp_sqrt(over * at->gyration_m2), .rounded = rounded};
    }
    if (f->regions == 0u) return;
    find_tangents(f, c->force_N[tool]);
    measure_compliance(f, c, tool, w->region[1]);
    for (uint32_t k = 0; k < f->regions; k++) take_over(f, k, w->before, before);
}

/* ---- springs of all regions ---- */

typedef struct {
    const palp_friction *of;
    palp_spring_set *set;
    float soft_m_per_N; /* 1 / k */
} system;

/* B v */
static palp_vec3 far_displacement(const palp_friction *f, palp_vec3 v) {
    const palp_symmetric2 b = f->far_m_per_N;
    const float x = palp_dot(f->tangent[0], v), y = palp_dot(f->tangent[1], v);
    return palp_madd(palp_scale(b.xx * x + b.xy * y, f->tangent[0]), b.xy * x + b.yy * y,
                     f->tangent[1]);
}

/* (B + 1/k) v */
static palp_vec3 yield(const system *s, palp_vec3 v) {
    return palp_madd(far_displacement(s->of, v), s->soft_m_per_N, v);
}

/* x of a x = b, by the columns of a. */
static palp_vec3 solve3(const palp_vec3 a[3], palp_vec3 b) {
    const palp_vec3 c[3] = {palp_cross(a[1], a[2]), palp_cross(a[2], a[0]), palp_cross(a[0], a[1])};
    const float inverse = 1.0f / palp_dot(a[0], c[0]);
    return (palp_vec3){inverse * palp_dot(c[0], b), inverse * palp_dot(c[1], b),
                       inverse * palp_dot(c[2], b)};
}

static float size_of(palp_vec3 v) { return palp_abs(v.x) + palp_abs(v.y) + palp_abs(v.z); }

/* How far all springs are stretched more, by = unheld - (B + 1/k) P, by semismooth Newton steps. */
static palp_vec3 find_stretch(const system *s, palp_vec3 unheld, float most_N) {
    const palp_friction *f = s->of;
    const palp_symmetric2 b = f->far_m_per_N;
    const float small = SETTLED * (b.xx + b.yy + 2.0f * s->soft_m_per_N) * most_N;
    palp_vec3 by = {0};
    for (uint32_t step = 0; step < PALP_FRICTION_STEPS; step++) {
        palp_vec3 force = {0}, slope[3] = {{0}};
        for (uint32_t k = 0; k < f->regions; k++) palp_springs_add(&s->set[k], by, &force, slope);
        const palp_vec3 r = palp_add(palp_sub(by, unheld), yield(s, force));
        if (step > 0u && size_of(r) <= small) return by;
        palp_vec3 column[3] = {yield(s, slope[0]), yield(s, slope[1]), yield(s, slope[2])};
        column[0].x += 1.0f, column[1].y += 1.0f, column[2].z += 1.0f;
        by = palp_sub(by, solve3(column, r));
    }
    return by;
}

/* The springs as they are now, of a tool that has turned; the most that they carry. */
static float gather(palp_friction *f, const palp_tool *tool, palp_vec3 turn_rad, system *s) {
    float most_N = 0.0f;
    for (uint32_t k = 0; k < f->regions; k++) {
        palp_springs *r = &f->region[k];
        palp_springs_press(r, palp_springs_depth(r));
        const float mu = palp_springs_coefficient(r, tool);
        palp_springs_gather(r, mu, turn_rad, &s->set[k]);
        most_N += mu * r->at.normal_N;
    }
    return most_N;
}

/* At most: nothing slips. */
static float against_turn(const palp_friction *f, const system *s) {
    float sum = 0.0f;
    for (uint32_t k = 0; k < f->regions; k++) {
        const palp_vec3 arm = f->region[k].at.centre_m;
        sum += s->set[k].stiffness_Nm + s->set[k].stiffness_N_per_m * palp_dot(arm, arm);
    }
    return sum;
}

void palp_friction_solve(palp_friction *f, palp_friction_work *work, palp_contact *contact,
                         uint32_t tool, const palp_frame *rest, float stiffness_N_per_m) {
    system s = {.of = f,
                .set = work->set,
                .soft_m_per_N = stiffness_N_per_m > 0.0f ? 1.0f / stiffness_N_per_m : 0.0f};
    const palp_vec3 before = palp_scale(-1.0f, f->force_N);
    const palp_vec3 unslowed_m = palp_madd(rest->t, s.soft_m_per_N, before); /* without T */
    const bool touched = f->regions > 0u;
    if (contact->normal_N[tool] > 0.0f) track_regions(f, work, contact, tool);
    if (!(contact->normal_N[tool] > 0.0f) || f->regions == 0u) {
        palp_friction_reset(f);
        return;
    }
    f->normal_N = contact->normal_N[tool];
    if (!touched) {
        f->tool = *rest;
        f->tool.t = unslowed_m;
    }
    const palp_vec3 turn = palp_turn_between(f->tool.r, rest->r);
    const float most_N = gather(f, &contact->tools[tool], turn, &s);
    /* what the springs would be stretched by without force: B P of before is given back */
    const palp_vec3 unheld = palp_add(palp_sub(unslowed_m, f->tool.t), far_displacement(f, before));
    const palp_vec3 by = find_stretch(&s, unheld, most_N);
    palp_springs_pull pull = {.slipping = true};
    for (uint32_t k = 0; k < f->regions; k++) {
        palp_springs_slip(&s.set[k], by, &pull);
        contact->work_done += 50u * (PALP_FRICTION_STEPS + 2u) * (uint64_t)s.set[k].count;
    }
    const palp_symmetric2 b = f->far_m_per_N;
    const palp_vec3 compliant_m = far_displacement(f, pull.force_N);
    f->force_N = palp_scale(-1.0f, pull.force_N);
    f->moment_Nm = palp_scale(-1.0f, pull.moment_Nm);
    f->energy_J = pull.energy_J + 0.5f * palp_dot(pull.force_N, compliant_m);
    f->sticking_N_per_m =
        pull.sticking_N_per_m / (1.0f + 0.5f * (b.xx + b.yy) * pull.sticking_N_per_m);
    f->slipping = pull.slipping;
    f->sticking_Nm = against_turn(f, &s);
    f->solved_m =
        palp_add(f->tool.t, palp_add(by, palp_sub(compliant_m, far_displacement(f, before))));
}

void palp_friction_carry(palp_friction *friction, palp_vec3 by_m) {
    friction->tool.t = palp_add(friction->tool.t, by_m);
}

void palp_friction_settle(palp_friction *f, const palp_frame *tool) {
    const palp_vec3 more = palp_sub(tool->t, f->solved_m);
    f->tool = *tool;
    for (uint32_t k = 0; k < f->regions; k++) palp_springs_move(&f->region[k], more);
}

float palp_friction_share(const palp_friction *friction, float stiffness_N_per_m) {
    return friction->sticking_N_per_m / (friction->sticking_N_per_m + stiffness_N_per_m);
}
