/* SPDX-License-Identifier: MIT */
/* Contact on multizone models that move: compliances across seams, closed paths, zones that touch
 * each other, and the bounded-time answer. */
#include "core/contact/contact_internal.h"
#include "core/servo/answer.h"
#include "tests/models.h"
#include "tests/tap.h"
#include "tools/press/press.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

#define EDGE 0.02
#define COMMON "young 3e4\npoisson 0.4\n"
#define FINEST (PALP_SEAM_LEVELS - 1)

static zoned make_chain(uint32_t n) {
    static const int bar3[3][3] = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
    uint32_t *cell;
    mesh m = model_voxels(bar3, 3, EDGE, n, &cell);
    return model_zones(&m,
                       COMMON
                       "zone a\nfix-below x 1e-6\nfix-below z 1e-6\nzone b\nfix-below z 1e-6\n"
                       "zone c\nfix-below z 1e-6\ncut a b 0.02 0 0 1 0 0\n"
                       "cut b c 0.04 0 0 1 0 0\njoint ab revolute a b\naxis 0 1 0\n"
                       "origin 0.02 0.01 0.002\njoint bc revolute b c\naxis 0 0.8 0.6\n"
                       "origin 0.04 0.01 0.004\n",
                       0);
}

static palp_contact *open_contact(palp_assembly *a, bool pairs, const palp_tool *tool,
                                  uint32_t level) {
    palp_contact *c = allocate(1, sizeof *c);
    const palp_contact_config config = {
        .assembly = a, .pairs = pairs, .tools = tool, .tool_count = 1, .finest = level};
    size_t bytes = palp_contact_memsize(&config);
    if (palp_contact_init(c, &config, allocate_aligned(bytes, 1), bytes) != PALP_OK)
        die(EXIT_WORK, "contact");
    return c;
}

static void pose(palp_assembly *a, const float *value) {
    const palp_frame at_rest = PALP_FRAME_IDENTITY;
    palp_assembly_pose(a, value, &at_rest);
    (void)palp_seams_refresh(&a->seams, a->configuration, a->seams.finest);
    palp_assembly_settle(a);
}

static uint32_t free_node(const palp_zones *z, uint32_t zone, uint32_t seed) {
    const palp_domain *d = &z->blob[zone].domain[PALP_FREE];
    return d->node[seed * 7919u % d->slots];
}

/* d . u at one node for a unit force along e at another, seams included, through the field path. */
static double response(palp_assembly *a, uint32_t zone, uint32_t node, palp_vec3 d,
                       uint32_t loaded_zone, uint32_t loaded, palp_vec3 e) {
    const palp_zones *z = a->zones;
    const palp_blob *b = &z->blob[zone];
    float *modes = allocate(3 * (size_t)z->zone[zone].modes, sizeof *modes);
    float *felt = allocate(3 * (size_t)z->zone[loaded_zone].modes, sizeof *felt);
    float *w = allocate(3 * (size_t)a->seams.modes, sizeof *w);
    palp_assembly_unload(a);
    palp_zone_modal_load(z, FINEST, loaded_zone, loaded, e, felt);
    palp_assembly_load(a, loaded_zone, felt);
    const float *total = palp_assembly_total(a);
    for (uint32_t i = 0; i < 3 * a->seams.modes; i++) w[i] = total[i] - a->w[i];
    palp_seams_expand(&a->seams, a->configuration, FINEST, zone, w, modes);
    double u = (double)palp_dot(d, palp_zone_modal_displacement(z, FINEST, zone, node, modes));
    if (zone == loaded_zone && !palp_node_is_fixed(b, node) && !palp_node_is_fixed(b, loaded)) {
        float block[9];
        palp_table_block(b, b->meta->constraint_level, palp_node_slot(b, node),
                         palp_node_slot(b, loaded), block);
        u += (double)palp_dot(d, palp_rotate(block, e));
    }
    free(modes);
    free(felt);
    free(w);
    return u;
}

static void test_reciprocity(const zoned *model) {
    palp_assembly *a = model_assembly(model->zones, FINEST);
    const float value[PALP_MAX_JOINTS] = {0.5f, -0.7f};
    double worst = 0, most = 0;
    pose(a, value);
    for (uint32_t k = 0; k < 60; k++) {
        uint32_t p = k % 3, q = k / 3 % 3;
        const palp_vec3 d = {0.6f, 0.0f, 0.8f}, e = {0.0f, -1.0f, 0.0f};
        uint32_t i = free_node(a->zones, p, k + 1), j = free_node(a->zones, q, 3 * k + 2);
        double there = response(a, p, i, d, q, j, e), back = response(a, q, j, e, p, i, d);
        worst = fmax(worst, fabs(there - back));
        most = fmax(most, fabs(there));
    }
    AT_MOST(worst / most, 1e-5, "reciprocity between any two zones of a bent chain");
    palp_vec3 f[3], m[3];
    palp_assembly_unload(a);
    (void)palp_assembly_total(a);
    palp_vec3 sum = {0}, turn = {0};
    double scale = 0;
    for (uint32_t z = 0; z < 3;
         z++) { /* what each seam does to one side it does not to the other */
        palp_assembly_wrench(a, z, &f[z], &m[z]);
        sum = palp_add(sum, f[z]);
        turn = palp_add(turn, m[z]);
        scale = fmax(scale, (double)palp_norm(f[z]));
    }
    AT_MOST((double)palp_norm(sum) / scale, 1e-4,
            "bent: the seams' forces on all links add up to zero");
    AT_MOST((double)palp_norm(turn) / (scale * EDGE), 1e-3, "and their moments");
}

/* The force on a rigid tool at `at`, the points settled in a few ticks. */
static palp_vec3 press(palp_contact *c, palp_vec3 place, int ticks) {
    const palp_frame at = palp_frame_at(place);
    const palp_contact_spring spring = {.held = at};
    for (int i = 0; i < ticks; i++) palp_contact_solve(c, &at, &spring);
    return c->force_N[0];
}

static uint32_t zones_pressed(const palp_contact *c) {
    uint32_t zones = 0;
    for (uint32_t i = 0; i < c->count; i++) {
        if (c->point[i].force_N > 0.0f) zones |= 1u << c->point[i].at.body;
    }
    return zones;
}

/* d . u between two points through the whole solution of the seams, shared out to their corners. */
static double response_between(palp_assembly *a, const palp_contact_point *p,
                               const palp_contact_point *q) {
    const uint32_t zp = p->at.body, zq = q->at.body;
    double sum = 0;
    for (uint32_t k = 0; k < 9; k++) {
        const uint32_t np = a->zones->blob[zp].triangle[3 * p->at.triangle + k % 3];
        const uint32_t nq = a->zones->blob[zq].triangle[3 * q->at.triangle + k / 3];
        sum += (double)(p->at.weight[k % 3] * q->at.weight[k / 3]) *
               response(a, zp, np, p->m, zq, nq, q->m);
    }
    return sum;
}

/* What the compliances between points change by from the rest configuration to another, against
 * unit forces and the whole solution of the seams in both. */
static void test_compliance(const zoned *model) {
    palp_assembly *a = model_assembly(model->zones, FINEST);
    const palp_tool tool = palp_tool_sphere(0.008f);
    palp_contact *c = open_contact(a, false, &tool, PALP_CONTACT_FINEST);
    const float value[PALP_MAX_JOINTS] = {-0.2f, 0.1f}, rest[PALP_MAX_JOINTS] = {0.0f};
    pose(a, value);
    palp_vec3 over = palp_carry(&a->world[2], (palp_vec3){0.0405f, 0.010f, 0.0265f});
    (void)press(c, over, 12); /* astride the seam between b and c */
    const uint32_t n = c->count < 8 ? c->count : 8, by = c->count / n;
    double g[8][8], r[8][8], worst = 0, most = 0;
    uint32_t zones = zones_pressed(c);
    for (int at_rest = 0; at_rest < 2; at_rest++) {
        if (at_rest == 1) pose(a, rest);
        palp_contact_bond(c);
        for (uint32_t i = 0; i < n; i++) {
            float *row = c->g + (size_t)(i * by) * c->room;
            palp_contact_compliance_row(c, i * by, row);
            for (uint32_t j = 0; j <= i; j++) {
                const palp_contact_point *p = &c->point[i * by], *q = &c->point[j * by];
                g[i][j] =
                    (at_rest == 0 ? 0 : g[i][j]) + (at_rest == 0 ? 1 : -1) * (double)row[j * by];
                r[i][j] = (at_rest == 0 ? 0 : r[i][j]) +
                          (at_rest == 0 ? 1 : -1) * response_between(a, p, q);
            }
        }
    }
    for (uint32_t i = 0; i < n; i++) {
        for (uint32_t j = 0; j <= i; j++) {
            worst = fmax(worst, fabs(g[i][j] - r[i][j]));
            most = fmax(most, fabs(r[i][j]));
        }
    }
    CHECK(zones == 6u && n == 8, "a tool astride a seam has points on both zones");
    AT_MOST(
        worst / most, 1e-3,
        "what bending changes of their compliances, against unit forces and the whole solution");
}

/* ---- against one body ---- */

/* Presses along a line over the cut bar, and over the same bar in one piece. */
static void test_cut(uint32_t n, uint32_t level) {
    zoned cut = make_chain(n);
    static const int bar3[3][3] = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
    uint32_t *cell;
    baked whole = model_bake(model_voxels(bar3, 3, EDGE, n, &cell), 1e-6, 0, false, false);
    const double scale = 3e4 / whole.material.young_Pa;
    palp_assembly *a = model_assembly(cut.zones, level);
    const float radius = 0.008f;
    const palp_tool tool = palp_tool_sphere(radius);
    palp_contact *c = open_contact(a, false, &tool, PALP_CONTACT_FINEST);
    palp_contact *one = contact_open(&whole.blob, &tool, 1, PALP_CONTACT_FINEST);
    double worst = 0, mean = 0, step = 0, last = 0;
    int count = 0;
    for (int i = 0; i <= 60; i++) {
        palp_vec3 at = {0.014f + 0.0002f * (float)i, 0.0105f, (float)EDGE + 0.9f * radius};
        double f = (double)palp_norm(press(c, at, i == 0 ? 12 : 3));
        press_hold(one, at, i == 0 ? 12 : 3);
        double g = scale * (double)palp_norm(one->force_N[0]);
        worst = fmax(worst, fabs(f / g - 1));
        mean += fabs(f / g - 1);
        if (i > 0) step = fmax(step, fabs(f - last) / g);
        last = f;
        count++;
        if (i % 6 == 0) printf("# x %.4f: cut %.5f, whole %.5f, %.3f\n", (double)at.x, f, g, f / g);
    }
    printf("# %u per edge, seams level %u: off the uncut bar by %.3g in the mean, %.3g at worst, "
           "largest step %.3g\n",
           n, level, mean / count, worst, step);
    AT_MOST(worst, 0.07,
            "a bar that is cut, sliding over the seam, against the same bar in one piece");
    AT_MOST(step, 0.02, "largest step on the way");
}

/* ---- energy ---- */

/* Bending of the seams and contact together. */
static double energy(palp_assembly *a, const palp_contact *c) {
    double bent = (double)palp_seams_energy(&a->seams, a->configuration, a->seams.finest, a->w);
    return bent + (c != NULL ? (double)c->energy_J : 0);
}

/* The moments that the seams exert on the links are what the stored energy changes by. */
static void test_moments(const zoned *model) {
    palp_assembly *a = model_assembly(model->zones, FINEST);
    double worst = 0, most = 0;
    for (uint32_t j = 0; j < 2; j++) {
        const float step = 0.004f;
        double stored[2], tau = 0;
        for (uint32_t k = 0; k < 3; k++) {
            float value[PALP_MAX_JOINTS] = {0.2f, 0.15f};
            value[j] += step * (k == 0 ? -1.0f : k == 1 ? 1.0f : 0.0f);
            pose(a, value);
            palp_assembly_unload(a);
            (void)palp_assembly_total(a);
            if (k < 2) stored[k] = energy(a, NULL);
        }
        const palp_joint_entry *e = &a->zones->joint[j];
        const palp_frame *frame = &a->configuration->frame[e->parent];
        palp_vec3 axis = palp_rotate(frame->r, palp_vec3_at(e->axis));
        palp_vec3 origin = palp_carry(frame, palp_vec3_at(e->origin_m));
        for (uint32_t z = j + 1; z < 3; z++) {
            palp_vec3 force, moment;
            palp_assembly_wrench(a, z, &force, &moment);
            tau -= (double)palp_dot(axis, palp_sub(moment, palp_cross(origin, force)));
        }
        double slope = (stored[1] - stored[0]) / (2 * (double)step);
        worst = fmax(worst, fabs(slope - tau));
        most = fmax(most, fabs(slope));
    }
    AT_MOST(worst / most, 1e-3,
            "bent: moments of the seams about both joints against the change of stored energy");
}

typedef struct {
    double hand_J, joints_J, stored_J;
    uint32_t active, zones;
} path_work;

/* What the model does on each joint (Nm): through the seams on all links beyond it, and by the tool
 * on those links' surfaces, whose exact force acts at the tool's place. */
static void joint_moments(palp_assembly *a, palp_contact *c, palp_vec3 at, double *tau) {
    palp_vec3 on[3] = {{0}};
    palp_contact_load_seams(c);
    (void)palp_assembly_total(a);
    for (uint32_t i = 0; i < c->count; i++) {
        const palp_contact_point *p = &c->point[i];
        on[p->at.body] = palp_madd(on[p->at.body], p->force_N, p->out);
    }
    for (uint32_t z = 0; z < 3; z++) { /* what is beyond -sum lambda m, in the same shares */
        float all = palp_norm(on[0]) + palp_norm(on[1]) + palp_norm(on[2]);
        if (all > 0.0f) on[z] = palp_madd(on[z], -palp_norm(on[z]) / all, c->beyond_N[0]);
    }
    for (uint32_t j = 0; j < 2; j++) {
        const palp_joint_entry *e = &a->zones->joint[j];
        const palp_frame *frame = &a->configuration->frame[e->parent];
        palp_vec3 axis = palp_rotate(frame->r, palp_vec3_at(e->axis));
        palp_vec3 origin = palp_carry(frame, palp_vec3_at(e->origin_m));
        tau[j] = 0;
        for (uint32_t z = j + 1; z < 3; z++) {
            palp_vec3 force, moment;
            palp_assembly_wrench(a, z, &force, &moment);
            moment = palp_sub(moment, palp_cross(origin, force));
            moment = palp_add(moment, palp_cross(palp_sub(at, origin), on[z]));
            tau[j] += (double)palp_dot(axis, moment);
        }
    }
}

/* Net work that hand and joints do on the model over one turn of a closed path in `steps`; swing:
 * of the joints, 0: they stand. */
static path_work go_round(const zoned *model, uint32_t steps, uint32_t level, float swing) {
    palp_assembly *a = model_assembly(model->zones, level);
    const palp_tool tool = palp_tool_sphere(0.008f);
    palp_contact *c = open_contact(a, false, &tool, PALP_CONTACT_FINEST);
    path_work r = {.hand_J = 0};
    palp_vec3 last_at = {0}, last_force = {0};
    double first_J = 0, last_tau[2] = {0};
    float last[2] = {0};
    for (uint32_t i = 0; i <= steps; i++) {
        double s = 2 * 3.14159265358979 * i / steps, tau[2];
        const float value[PALP_MAX_JOINTS] = {swing * (float)(0.08 * sin(s)),
                                              swing * (float)(0.1 * sin(2 * s))};
        palp_vec3 at = {(float)(0.037 + 0.008 * sin(s)), (float)(0.010 + 0.003 * cos(s)),
                        (float)(0.0268 + 0.0015 * cos(s))};
        pose(a, value);
        palp_vec3 force = press(c, at, i == 0 ? 12 : 1);
        double now_J = energy(a, c);
        joint_moments(a, c, at, tau);
        if (i == 0) first_J = now_J;
        for (uint32_t j = 0; j < 2 && i > 0; j++)
            r.joints_J -= 0.5 * (tau[j] + last_tau[j]) * (double)(value[j] - last[j]);
        if (i > 0)
            r.hand_J -= 0.5 * (double)palp_dot(palp_add(last_force, force), palp_sub(at, last_at));
        r.stored_J = fmax(r.stored_J, now_J - first_J);
        r.zones |= zones_pressed(c);
        if (c->active_count > r.active) r.active = c->active_count;
        last_at = at;
        last_force = force;
        for (uint32_t j = 0; j < 2; j++) {
            last[j] = value[j];
            last_tau[j] = tau[j];
        }
    }
    return r;
}

/* Where a bent seam is a fold, the force is exact as at any sharp edge: to some per cent. */
static void test_closed_path(const zoned *model, uint32_t level, float swing, double most) {
    double off[2];
    path_work r = {.hand_J = 0};
    for (uint32_t k = 0; k < 2; k++) {
        r = go_round(model, 800u << k, level, swing);
        off[k] = fabs(r.hand_J + r.joints_J) / r.stored_J;
        printf("# seams level %u, %u steps: hand %.3g J, joints %.3g J, together %.2g of the %.3g "
               "J stored in between; up to %u points on zones %#x\n",
               level, 800u << k, r.hand_J, r.joints_J, off[k], r.stored_J, r.active, r.zones);
    }
    CHECK(r.zones == 6u && r.active >= 4, "the path touches two zones with up to %u points",
          r.active);
    AT_MOST(off[1], most, "closed path of tool%s: net work over what is stored in between",
            swing > 0 ? " and joints" : ", joints standing");
}

/* ---- zones before zones ---- */

/* Forces of the pairs on each zone, and the largest penetration that is left. */
static double pair_forces(const palp_contact *c, palp_vec3 *on, uint32_t *pairs) {
    double deepest = 0;
    *pairs = 0;
    for (uint32_t z = 0; z < c->bodies; z++) on[z] = (palp_vec3){0.0f, 0.0f, 0.0f};
    for (uint32_t i = 0; i < c->count; i++) {
        const palp_contact_point *p = &c->point[i];
        const palp_contact_patch *patch = &c->patch[p->patch];
        if (patch->tool < PALP_CONTACT_TOOLS || !c->facing[i].found) continue;
        float closed = palp_dot(p->m, p->u_m) + palp_dot(c->facing[i].m, c->facing[i].u_m);
        deepest = fmax(deepest, (double)(c->target[i] - closed));
        if (!(p->force_N > 0.0f)) continue;
        (*pairs)++;
        palp_vec3 there = palp_rotate(c->assembly->world[patch->other].r, c->facing[i].m);
        on[patch->body] = palp_madd(on[patch->body], p->force_N, p->out);
        on[patch->other] = palp_madd(on[patch->other], p->force_N, there);
    }
    return deepest;
}

/* Arms on a hub: cubes u[cubes], each of the zone that is named beside it. */
static zoned make_arms(const int (*u)[3], const char *const *name, uint32_t cubes,
                       const char *zones, const char *joints) {
    uint32_t *cell;
    char lines[512];
    mesh m = model_voxels(u, cubes, EDGE, 4, &cell);
    char *labels = model_labels(cell, m.triangles, name);
    snprintf(lines, sizeof lines, COMMON "%slabels %s\n%s", zones, labels, joints);
    zoned model = model_zones(&m, lines, 0);
    remove(labels);
    return model;
}

/* Two arms on a hub, one of which turns until their tips press on each other. */
static void test_pairs(void) {
    static const int u[7][3] = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {0, 0, 1},
                                {2, 0, 1}, {0, 0, 2}, {2, 0, 2}};
    static const char *const name[] = {"hub", "hub", "hub", "left", "right", "left", "right"};
    const zoned model =
        make_arms(u, name, 7,
                  "zone hub\nfix-below z 1e-6\nzone left\nfix-below x 1e-6\nzone right\n"
                  "fix-above x 0.059999\n",
                  "joint l fixed hub left\njoint r revolute hub right\naxis 0 1 0\n"
                  "origin 0.05 0.01 0.02\n");
    palp_assembly *a = model_assembly(model.zones, 2);
    const palp_tool tool = palp_tool_sphere(0.002f);
    palp_contact *c = open_contact(a, true, &tool, PALP_CONTACT_FINEST);
    palp_vec3 on[3], far = {1.0f, 1.0f, 1.0f};
    uint32_t pairs = 0, before = 0;
    double deepest = 0, force[2] = {0}, jump = 0, last = 0;
    for (uint32_t i = 0; i <= 800; i++) {
        float value[PALP_MAX_JOINTS] = {0.0f, -0.68f * (float)i / 800.0f};
        pose(a, value);
        (void)press(c, far, 1);
        deepest = pair_forces(c, on, &pairs);
        double now = (double)palp_norm(on[2]);
        jump = fmax(jump, fabs(now - last));
        last = now;
        if (i == 400) before = pairs;
        if (i == 700) force[0] = now;
        force[1] = now;
    }
    CHECK(before == 0 && pairs > 0, "arms apart: %u pairs; pressed together: %u", before, pairs);
    CHECK(force[1] > force[0] && force[0] > 0,
          "the more they turn the harder they press: %.3g, %.3g N", force[0], force[1]);
    AT_MOST((double)palp_norm(palp_add(on[1], on[2])) / force[1], 1e-5,
            "what one does to the other comes back");
    AT_MOST(jump / force[1], 0.08, "largest step of the force while they close in 800 steps");
    AT_MOST(deepest / EDGE, 2e-3, "penetration that is left, over the arms' width");
}

/* How far the displacement of the points, both sides together, is from g lambda, over the largest.
 */
static double off_matrix(const palp_contact *c) {
    double off = 0, most = 0;
    for (uint32_t a = 0; a < c->active_count; a++) {
        const uint32_t i = c->active[a];
        double along = (double)palp_dot(c->point[i].m, c->point[i].u_m), sum = 0;
        if (c->other_side[i] > 0) along += (double)palp_dot(c->facing[i].m, c->facing[i].u_m);
        for (uint32_t k = 0; k < c->active_count; k++)
            sum += (double)c->g[(size_t)i * c->room + c->active[k]] *
                   (double)c->point[c->active[k]].force_N;
        off = fmax(off, fabs(along - sum));
        most = fmax(most, fabs(along));
    }
    return off / most;
}

/* Three arms on one hub; the outer ones turn against the middle one, so that it is the first zone
 * of one pair and the second of the other. */
static void test_two_pairs(void) {
    static const int u[11][3] = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}, {4, 0, 0}, {0, 0, 1},
                                 {2, 0, 1}, {4, 0, 1}, {0, 0, 2}, {2, 0, 2}, {4, 0, 2}};
    static const char *const name[] = {"hub",    "hub",   "hub",  "hub",    "hub",  "left",
                                       "middle", "right", "left", "middle", "right"};
    const zoned model =
        make_arms(u, name, 11,
                  "zone hub\nfix-below z 1e-6\nzone left\nfix-below x 1e-6\nzone middle\n"
                  "fix-above z 0.059999\nzone right\nfix-above x 0.099999\n",
                  "joint l revolute hub left\naxis 0 1 0\norigin 0.01 0.01 0.02\n"
                  "joint m fixed hub middle\njoint r revolute hub right\naxis 0 1 0\n"
                  "origin 0.09 0.01 0.02\n");
    palp_assembly *a = model_assembly(model.zones, 2);
    const palp_tool tool = palp_tool_sphere(0.002f);
    palp_contact *c = open_contact(a, true, &tool, PALP_CONTACT_FINEST);
    palp_vec3 on[4], far = {1.0f, 1.0f, 1.0f};
    uint32_t pairs = 0, patches = 0;
    double worst = 0, jump = 0, last = 0, force = 0;
    for (uint32_t i = 0; i <= 800; i++) {
        const float turn = 0.68f * (float)i / 800.0f;
        float value[PALP_MAX_JOINTS] = {turn, 0.0f, -turn};
        pose(a, value);
        (void)press(c, far, 1);
        patches = 0;
        for (uint32_t k = c->tool_count; k < c->patches; k++)
            patches += c->patch[k].normal_N > 0.0f ? 1u : 0u;
        if (patches > 1) worst = fmax(worst, off_matrix(c));
        (void)pair_forces(c, on, &pairs);
        force = (double)palp_norm(on[1]);
        jump = fmax(jump, fabs(force - last));
        last = force;
    }
    CHECK(patches == 2, "the middle arm meets %u others, on %u points", patches, pairs);
    AT_MOST(worst, 1e-3, "two pairs: displacements of both sides over those of the matrix");
    AT_MOST(jump / force, 0.08, "largest step of the force while they close in 800 steps");
    AT_MOST((double)palp_norm(palp_add(on[1], palp_add(on[2], on[3]))) / force, 1e-5,
            "what the middle one gets the others give");
}

/* Ticks that are held while the model carries the tool along: it goes as far as the model does. */
static void test_carried(const zoned *model) {
    palp_assembly *a = model_assembly(model->zones, FINEST);
    const palp_tool tool = palp_tool_sphere(0.008f);
    palp_contact *c = open_contact(a, false, &tool, PALP_CONTACT_FINEST);
    palp_coupling k = {.settling = 0};
    palp_coupling_result result;
    palp_contact_spring spring;
    palp_frame tool_at;
    palp_vec3 hand = {0.03f, 0.01f, 0.0265f}, start = {0};
    const palp_vec3 step = {2e-5f, 1e-5f, -3e-5f};
    const float value[PALP_MAX_JOINTS] = {0};
    palp_frame root = PALP_FRAME_IDENTITY;
    pose(a, value);
    palp_coupling_reset(&k);
    k.tool[0].stiffness_N_per_m = 200.0f;
    for (uint32_t i = 0; i < 60; i++) {
        palp_frame at = palp_frame_at(hand);
        at.t.z += i < 20 ? 0.01f - 0.0005f * (float)i : 0.0f;
        if (!palp_coupling_begin(&k, c, &at)) continue;
        palp_coupling_springs(&k, c, &tool_at, &spring);
        palp_contact_solve(c, &tool_at, &spring);
        palp_coupling_take(&k, c, 1e-3f, &result);
    }
    start = result.tool.t;
    const float force = palp_norm(result.force_N);
    for (uint32_t i = 1; i <= 6; i++) {
        root.t = palp_scale((float)i, step);
        palp_assembly_pose(a, value, &root);
        palp_assembly_settle(a);
        const palp_frame at = palp_frame_at(palp_add(hand, root.t));
        (void)palp_coupling_begin(&k, c, &at);
        palp_coupling_hold(&k, c, 1e-3f, &result);
    }
    palp_vec3 off = palp_sub(palp_sub(result.tool.t, start), palp_scale(6.0f, step));
    CHECK(force > 0.01f, "a tool presses with %.3g N", (double)force);
    AT_MOST((double)palp_norm(off) / (double)palp_norm(step), 0.05,
            "six held ticks: off the way of the model, over a tick of it");
}

/* ---- bounded time ---- */

typedef struct {
    palp_answer *b;
} work_clock;

static uint64_t now_ns(void *context) {
    const work_clock *k = context;
    /* ticks may have begun before */
    return (uint64_t)(0.3 * (double)palp_answer_work(k->b)) + 10000000u;
}

/* Ticks with a configuration each under a budget (of work): the levels used, late ticks, largest
 * step of the force. */
static void run_budget(const zoned *model, double budget_us, uint32_t finest, double tardy_us) {
    palp_assembly *a = model_assembly(model->zones, finest);
    palp_answer *b = allocate(1, sizeof *b);
    work_clock clock = {.b = b};
    const palp_tool tool = palp_tool_sphere(0.008f);
    const palp_frame rest = PALP_FRAME_IDENTITY;
    palp_answer_config config = {
        .contact = {.assembly = a, .tools = &tool, .tool_count = 1, .finest = PALP_CONTACT_FINEST},
        .cost = {.target = &palp_target_counted,
                 .ns_per_instruction = 0.3f,
                 .margin = (float)(budget_us / 1000)},
        .port = {.now_ns = now_ns, .context = &clock},
        .dt_s = 1e-3f};
    size_t bytes = palp_answer_memsize(&config.contact);
    float bound = 0;
    palp_status status = palp_answer_init(b, &config, allocate_aligned(bytes, 1), bytes, &bound);
    if (status == PALP_ERR_BUDGET) {
        CHECK(budget_us * 1e3 < (double)bound,
              "a budget of %.0f us is refused: the least answer may take %.0f", budget_us,
              (double)bound * 1e-3);
        return;
    }
    b->coupling.tool[0].stiffness_N_per_m = 200.0f;
    uint32_t at[PALP_SEAM_LEVELS + 1] = {0}, late = 0, aborted = 0, touching = 0;
    double most = 0, jump = 0, strongest = 0;
    palp_vec3 last = {0};
    for (uint32_t i = 0; i < 3000; i++) {
        float s = (float)i / 3000.0f, sine, cosine, one, two;
        palp_sincos(6.2831853f * s, &sine, &cosine);
        palp_sincos(25.132741f * s, &one, &two);
        const float value[PALP_MAX_JOINTS] = {0.3f * sine, 0.2f * one};
        const palp_frame hand = palp_frame_at(
            (palp_vec3){0.037f + 0.008f * sine, 0.010f, 0.0300f - 0.006f * (1.0f - cosine)});
        palp_coupling_result result;
        palp_answer_report report;
        uint64_t start = now_ns(&clock) - (uint64_t)(tardy_us * 1e3);
        palp_answer_pose(b, value, &rest);
        palp_answer_tick(b, start, &hand, &result, &report);
        double used = (double)(now_ns(&clock) - start);
        most = fmax(most, used);
        late += used > budget_us * 1e3;
        at[report.moving.level == PALP_DIAGONAL ? PALP_SEAM_LEVELS : report.moving.level]++;
        aborted += report.moving.aborted;
        touching += report.active > 0;
        jump = fmax(jump, (double)palp_norm(palp_sub(result.force_N, last)));
        strongest = fmax(strongest, (double)palp_norm(result.force_N));
        last = result.force_N;
        palp_answer_spare(b);
    }
    printf("# budget %.0f us, finest level %u, ticks that begin %.0f us late: levels", budget_us,
           finest, tardy_us);
    for (uint32_t l = 0; l <= PALP_SEAM_LEVELS; l++)
        if (at[l] > 0) printf(l < PALP_SEAM_LEVELS ? " %u: %u" : " diagonal (%u): %u", l, at[l]);
    printf("; given up %u times; longest tick %.0f us, %u of 3000 touch\n", aborted, most * 1e-3,
           touching);
    CHECK(late == 0 && touching > 300,
          "a new configuration each tick in a budget of %.0f us: %u late", budget_us, late);
    AT_MOST(jump / strongest, 0.05, "largest step of the force over the largest force");
}

int main(void) {
    zoned chain = make_chain(5);
    test_reciprocity(&chain);
    test_compliance(&chain);
    test_cut(5, 4);
    test_cut(8, 4);
    test_moments(&chain);
    test_closed_path(&chain, FINEST, 0.0f, 2e-3);
    test_closed_path(&chain, FINEST, 1.0f, 3e-2);
    test_closed_path(&chain, 1, 1.0f, 3e-2);
    test_pairs();
    test_two_pairs();
    test_carried(&chain);
    run_budget(&chain, 950, 4, 0);
    run_budget(&chain, 700, 4, 0);
    run_budget(&chain, 600, 3, 0);
    run_budget(&chain, 800, 4, 250);
    run_budget(&chain, 100, 4, 0);
    return tap_done();
}
