/* SPDX-License-Identifier: MIT */
/* Contact on multizone models that move: compliances across seams, closed paths, zones that touch
 * each other, and the bounded-time answer. */
#include "core/servo/bounded.h"
#include "tests/models.h"
#include "tests/tap.h"
#include "tools/util.h"
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

static palp_node_contact *open_contact(palp_assembly *a, bool pairs, const palp_tool *tool,
                                       palp_node_contact_limits limits) {
    palp_node_contact *c = allocate(1, sizeof *c);
    size_t bytes = palp_node_contact_memsize_zones(a->zones, a->seams.finest, limits);
    if (palp_node_contact_init_zones(c, a, pairs, tool, 1, limits, allocate_aligned(bytes, 1),
                                     bytes) != PALP_OK)
        die(EXIT_WORK, "contact");
    return c;
}

static void pose(palp_assembly *a, const float *value) {
    const palp_frame at_rest = PALP_FRAME_IDENTITY;
    palp_assembly_pose(a, value, &at_rest);
    (void)palp_seams_refresh(&a->seams, a->posture, a->seams.finest);
    palp_assembly_settle(a);
}

static uint32_t free_slot(const palp_zones *z, uint32_t zone, uint32_t seed) {
    return seed * 7919u % z->blob[zone].domain[PALP_FREE].slots;
}

/* d . u at one place for a unit force along e at another, seams included, through the field path.
 */
static double response(palp_assembly *a, uint32_t zone, uint32_t slot, palp_vec3 d,
                       uint32_t loaded_zone, uint32_t loaded, palp_vec3 e) {
    const palp_zones *z = a->zones;
    float *modes = allocate(3 * (size_t)z->zone[zone].modes, sizeof *modes);
    float *w = allocate(3 * (size_t)a->seams.modes, sizeof *w);
    palp_assembly_unload(a);
    palp_assembly_load(a, loaded_zone, loaded, e);
    const float *total = palp_assembly_total(a);
    for (uint32_t i = 0; i < 3 * a->seams.modes; i++) w[i] = total[i] - a->w[i];
    palp_seams_spread(&a->seams, a->posture, FINEST, zone, w, modes);
    double u = (double)palp_dot(d, palp_zone_follow(z, FINEST, zone, slot, modes));
    if (zone == loaded_zone) {
        float block[9];
        palp_table_block(&z->blob[zone], z->blob[zone].meta->constraint_level, slot, loaded, block);
        u += (double)palp_dot(d, palp_rotate(block, e));
    }
    free(modes);
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
        uint32_t i = free_slot(a->zones, p, k + 1), j = free_slot(a->zones, q, 3 * k + 2);
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

/* Brings all candidates in for a tool at `at`, solves with a rigid grip. */
static palp_vec3 press(palp_node_contact *c, palp_vec3 at) {
    palp_fresh fresh[PALP_MAX_CANDIDATES];
    palp_node_contact_follow(c);
    uint32_t n = palp_node_contact_search(c, &at, fresh);
    for (uint32_t i = 0; i < n; i++) palp_node_contact_admit(c, fresh[i]);
    return palp_node_contact_solve(c, at, (palp_grip){at, 0.0f});
}

/* g of the contact against unit forces through the seams' full solution. */
static void test_compliance(const zoned *model) {
    palp_assembly *a = model_assembly(model->zones, FINEST);
    const palp_tool tool = palp_tool_sphere(0.008f);
    palp_node_contact *c =
        open_contact(a, false, &tool, (palp_node_contact_limits){96, 48, 32, 60, false});
    const float value[PALP_MAX_JOINTS] = {-0.2f, 0.1f};
    pose(a, value);
    for (uint32_t n = 0; n < 12; n++) {
        palp_vec3 over = palp_carry(&a->world[2], (palp_vec3){0.0405f, 0.010f, 0.0265f});
        (void)press(c, over); /* astride the seam between b and c */
    }
    double worst = 0, most = 0;
    uint32_t zones = 0;
    for (uint32_t i = 0; i < c->count; i++) {
        const palp_candidate *p = &c->candidate[i];
        zones |= 1u << p->body;
        for (uint32_t j = 0; j <= i; j++) {
            const palp_candidate *q = &c->candidate[j];
            double g = response(a, p->body, p->slot, p->d, q->body, q->slot, q->d);
            worst = fmax(worst, fabs(g - (double)palp_node_contact_g(c, i, j)));
            most = fmax(most, fabs(g));
        }
    }
    CHECK(zones == 6u && c->count > 5, "a tool astride a seam has %u candidates on both zones",
          c->count);
    AT_MOST(worst / most, 1e-5, "their compliances against unit forces and the whole solution");
}

/* ---- energy ---- */

/* Bending of the seams and contact together. */
static double energy(palp_assembly *a, const palp_node_contact *c) {
    double bent = (double)palp_seams_energy(&a->seams, a->posture, a->seams.finest, a->w);
    return bent + (c != NULL ? (double)palp_node_contact_energy(c) : 0);
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
        const palp_frame *frame = &a->posture->frame[e->parent];
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
    double hand_J, joints_J, stored_J, left_J;
    uint32_t active, zones;
} path_work;

/*
 * Net work that hand and joints do on the model over one turn of a closed path in `steps`. Joints
 * move while the tool stands, and do what the stored energy grows by; then the tool moves, and the
 * hand does what its force says.
 */
static path_work go_round(const zoned *model, uint32_t steps, uint32_t level) {
    palp_assembly *a = model_assembly(model->zones, level);
    const palp_tool tool = palp_tool_sphere(0.008f);
    palp_node_contact *c =
        open_contact(a, false, &tool, (palp_node_contact_limits){96, 60, 40, 90, false});
    path_work r = {.hand_J = 0};
    palp_vec3 last_at = {0.0f, 0.0f, 0.0f};
    double last_J = 0, first_J = 0;
    for (uint32_t i = 0; i <= steps; i++) {
        double s = 2 * 3.14159265358979 * i / steps;
        const float value[PALP_MAX_JOINTS] = {(float)(0.25 * sin(s)), (float)(0.2 * sin(2 * s))};
        palp_vec3 at = {(float)(0.037 + 0.008 * sin(s)), (float)(0.010 + 0.003 * cos(s)),
                        (float)(0.0260 + 0.0035 * cos(s))};
        if (i == 0) last_at = at;
        pose(a, value);
        palp_vec3 before = press(c, last_at);
        double moved_J = energy(a, c);
        palp_vec3 after = press(c, at);
        double now_J = energy(a, c);
        if (i == 0) first_J = moved_J;
        if (i > 0) {
            r.joints_J += moved_J - last_J;
            r.hand_J -= 0.5 * (double)palp_dot(palp_add(before, after), palp_sub(at, last_at));
        }
        r.stored_J = fmax(r.stored_J, now_J - first_J);
        for (uint32_t k = 0; k < c->active_count; k++)
            r.zones |= 1u << c->candidate[c->active[k]].body;
        if (c->active_count > r.active) r.active = c->active_count;
        last_at = at;
        last_J = now_J;
    }
    r.left_J = last_J - first_J;
    return r;
}

static void test_closed_path(const zoned *model, uint32_t level) {
    double off[3];
    path_work r = {.hand_J = 0};
    for (uint32_t k = 0; k < 3; k++) {
        r = go_round(model, 200u << (2 * k), level);
        off[k] = fabs(r.hand_J + r.joints_J) / r.stored_J;
        printf("# level %u, %u steps: hand %.3g J, joints %.3g J, together %.2g of the %.3g J "
               "stored in between; up to %u nodes of zones %#x\n",
               level, 200u << (2 * k), r.hand_J, r.joints_J, off[k], r.stored_J, r.active, r.zones);
    }
    CHECK(r.zones == 6u && r.active >= 4,
          "level %u: the path touches two zones with up to %u nodes", level, r.active);
    AT_MOST(fabs(r.left_J) / r.stored_J, 1e-5, "what is stored comes back");
    AT_MOST(off[2], 1e-4,
            "closed path of tool and joints: net work over what is stored in between");
    CHECK(off[2] < off[0], "and it vanishes with the step: %.2g, %.2g, %.2g", off[0], off[1],
          off[2]);
    CHECK(fabs(r.hand_J) > 100 * fabs(r.hand_J + r.joints_J),
          "while the joints do %.3g J and the hand %.3g J", r.joints_J, r.hand_J);
}

/* ---- zones before zones ---- */

/* Forces of the pairs on each zone, and the largest penetration that is left. */
static double pair_forces(const palp_node_contact *c, palp_vec3 *on, uint32_t *pairs) {
    double deepest = 0;
    *pairs = 0;
    for (uint32_t z = 0; z < 3; z++) on[z] = (palp_vec3){0.0f, 0.0f, 0.0f};
    for (uint32_t i = 0; i < c->count; i++) {
        const palp_candidate *k = &c->candidate[i];
        if (k->tool != PALP_ZONE_TOOL) continue;
        double left = (double)(k->at.depth_m - k->relief_m - palp_node_contact_indentation(c, i));
        deepest = fmax(deepest, left);
        if (!c->candidate[i].active) continue;
        (*pairs)++;
        on[k->body] = palp_madd(on[k->body], -k->force_N, k->n);
        palp_vec3 d = palp_rotate(c->assembly->world[k->facing.body].r, k->facing.d);
        on[k->facing.body] = palp_madd(on[k->facing.body], -k->force_N, d);
    }
    return deepest;
}

/* Two arms on a hub, one of which turns until their tips press on each other. */
static void test_pairs(void) {
    static const int u[7][3] = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {0, 0, 1},
                                {2, 0, 1}, {0, 0, 2}, {2, 0, 2}};
    static const char *const name[] = {"hub", "hub", "hub", "left", "right", "left", "right"};
    uint32_t *cell;
    char lines[512];
    mesh m = model_voxels(u, 7, EDGE, 4, &cell);
    char *labels = model_labels(cell, m.triangles, name);
    snprintf(lines, sizeof lines,
             COMMON "zone hub\nfix-below z 1e-6\nzone left\nfix-below x 1e-6\nzone right\n"
                    "fix-above x 0.059999\nlabels %s\njoint l fixed hub left\n"
                    "joint r revolute hub right\naxis 0 1 0\norigin 0.05 0.01 0.02\n",
             labels);
    zoned model = model_zones(&m, lines, 0);
    remove(labels);
    palp_assembly *a = model_assembly(model.zones, 2);
    const palp_tool tool = palp_tool_sphere(0.002f);
    palp_node_contact *c =
        open_contact(a, true, &tool, (palp_node_contact_limits){96, 48, 16, 90, false});
    palp_vec3 on[3], far = {1.0f, 1.0f, 1.0f};
    uint32_t pairs = 0, before = 0;
    double deepest = 0, force[2] = {0}, jump = 0, last = 0;
    for (uint32_t i = 0; i <= 800; i++) {
        float value[PALP_MAX_JOINTS] = {0.0f, -0.68f * (float)i / 800.0f};
        pose(a, value);
        (void)press(c, far);
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
    AT_MOST((double)palp_norm(palp_add(on[1], on[2])) / force[1], 0.05,
            "what one does to the other comes back (directions are renewed a few at a time)");
    AT_MOST(jump / force[1], 0.1, "largest step of the force while they close in 800 steps");
    AT_MOST(deepest / EDGE, 2e-3, "penetration that is left, over the arms' width");
}

/* ---- bounded time ---- */

typedef struct {
    palp_bounded *b;
} work_clock;

static uint64_t now_ns(void *context) {
    const work_clock *k = context;
    return palp_bounded_work(k->b) + 10000000u; /* ticks may have begun before */
}

/* Ticks with a posture each under a budget (of work): the levels used, late ticks, largest step of
 * the force. */
static void run_budget(const zoned *model, double budget_us, uint32_t finest, double tardy_us) {
    palp_assembly *a = model_assembly(model->zones, finest);
    palp_bounded *b = allocate(1, sizeof *b);
    work_clock clock = {.b = b};
    const palp_tool tool = palp_tool_sphere(0.008f);
    const palp_frame rest = PALP_FRAME_IDENTITY;
    palp_bounded_config config = {.assembly = a,
                                  .tools = &tool,
                                  .tool_count = 1,
                                  .limits = {24, 12, 4, 12, false},
                                  .cost = {.target = &palp_target_counted,
                                           .ns_per_instruction = 1.0f,
                                           .margin = (float)(budget_us / 1000)},
                                  .port = {.now_ns = now_ns, .context = &clock},
                                  .dt_s = 1e-3f};
    size_t bytes = palp_bounded_memsize(model->zones, finest, config.limits);
    float bound = 0;
    palp_status status = palp_bounded_init(b, &config, allocate_aligned(bytes, 1), bytes, &bound);
    if (status == PALP_ERR_BUDGET) {
        CHECK(budget_us * 1e3 < (double)bound,
              "a budget of %.0f us is refused: the least answer may take %.0f", budget_us,
              (double)bound * 1e-3);
        return;
    }
    b->coupling.spring[0].stiffness_N_per_m = 200.0f;
    uint32_t at[PALP_SEAM_LEVELS + 1] = {0}, late = 0, aborted = 0, touching = 0;
    double most = 0, jump = 0, strongest = 0;
    palp_vec3 last = {0};
    for (uint32_t i = 0; i < 3000; i++) {
        float s = (float)i / 3000.0f, sine, cosine, one, two;
        palp_sincos(6.2831853f * s, &sine, &cosine);
        palp_sincos(25.132741f * s, &one, &two);
        const float value[PALP_MAX_JOINTS] = {0.3f * sine, 0.2f * one};
        palp_vec3 hand = {0.037f + 0.008f * sine, 0.010f, 0.0300f - 0.006f * (1.0f - cosine)};
        palp_node_coupling_result result;
        palp_bounded_report report;
        uint64_t start = now_ns(&clock) - (uint64_t)(tardy_us * 1e3);
        palp_bounded_pose(b, value, &rest);
        palp_bounded_tick(b, start, &hand, &result, &report);
        double used = (double)(now_ns(&clock) - start);
        most = fmax(most, used);
        late += used > budget_us * 1e3;
        at[b->moving.level == PALP_DIAGONAL ? PALP_SEAM_LEVELS : b->moving.level]++;
        aborted += b->moving.aborted;
        touching += report.active > 0;
        jump = fmax(jump, (double)palp_norm(palp_sub(result.force_N, last)));
        strongest = fmax(strongest, (double)palp_norm(result.force_N));
        last = result.force_N;
        palp_bounded_spare(b);
    }
    printf("# budget %.0f us, finest level %u, ticks that begin %.0f us late: levels", budget_us,
           finest, tardy_us);
    for (uint32_t l = 0; l <= PALP_SEAM_LEVELS; l++)
        if (at[l] > 0) printf(l < PALP_SEAM_LEVELS ? " %u: %u" : " diagonal (%u): %u", l, at[l]);
    printf("; given up %u times; longest tick %.0f us, %u of 3000 touch\n", aborted, most * 1e-3,
           touching);
    CHECK(late == 0 && touching > 300, "a new posture each tick in a budget of %.0f us: %u late",
          budget_us, late);
    AT_MOST(jump / strongest, 0.05, "largest step of the force over the largest force");
}

int main(void) {
    zoned chain = make_chain(5);
    test_reciprocity(&chain);
    test_compliance(&chain);
    test_moments(&chain);
    test_closed_path(&chain, FINEST);
    test_closed_path(&chain, 1);
    test_pairs();
    run_budget(&chain, 950, 4, 0);
    run_budget(&chain, 700, 4, 0);
    run_budget(&chain, 600, 3, 0);
    run_budget(&chain, 800, 4, 550);
    run_budget(&chain, 100, 4, 0);
    return tap_done();
}
