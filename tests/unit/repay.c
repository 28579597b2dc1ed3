/* SPDX-License-Identifier: MIT */
/* Energy over closed paths: whatever the body, the speed and the level, the hand gets back what it
 * gave, within bounds on what the force is changed by for it. */
#include "core/contact/repay.h"
#include "tests/models.h"
#include "tests/tap.h"
#include "port/host/parallel.h"
#include "tools/press/press.h"
#include <math.h>

/* A round about a place on a body: in and out while it goes round, so that nothing cancels. */
typedef struct {
    const baked *body;
    palp_vec3 top, n, side[2];
    double radius;
} round_path;

static round_path round_about(const baked *b, palp_vec3 top, palp_vec3 n, double radius) {
    round_path p = {.body = b, .top = top, .n = palp_scale(1.0f / palp_norm(n), n)};
    const palp_vec3 t = palp_cross(p.n, (palp_vec3){0.3f, 0.5f, 0.8f});
    p.side[0] = palp_scale(1.0f / palp_norm(t), t);
    p.side[1] = palp_cross(p.n, p.side[0]);
    p.radius = radius;
    return p;
}

static palp_vec3 on_path(const round_path *p, double share) {
    const double q = 2 * acos(-1.0) * share, depth = 0.15 * (1 + 0.5 * sin(2 * q));
    palp_vec3 at = palp_madd(p->top, (float)(p->radius * (1 - depth)), p->n);
    at = palp_madd(at, (float)(0.3 * p->radius * cos(q)), p->side[0]);
    return palp_madd(at, (float)(0.3 * p->radius * sin(q)), p->side[1]);
}

typedef struct {
    double work, share, step; /* over stored; of what is repaid over the force, and its change */
} round_result;

/* The second of two rounds, in so many ticks; the tool is held rigidly, or on a spring that the
 * force stretches by `soft` cells of its lattice, about. `levels`: a change of level every 50
 * ticks. */
static round_result go_round(const round_path *p, int ticks, uint32_t level, uint32_t levels,
                             double soft) {
    const palp_tool tool = palp_tool_sphere((float)p->radius);
    palp_contact *c = contact_open(&p->body->blob, &tool, 1, level);
    palp_vec3 before_m = {0}, before_N = {0}, repaid_N = {0};
    round_result r = {.work = 0};
    double stored = 0, stiffness = 0;
    palp_frame rest = palp_frame_at(on_path(p, 0));
    for (int k = 0; k <= 2 * ticks; k++) {
        palp_vec3 at = on_path(p, (double)k / ticks);
        if (levels > 0) c->now = level - (uint32_t)(k / 50) % levels;
        if (soft > 0 && k == 1)
            stiffness = (double)(palp_norm(c->force_N[0]) /
                                 (c->patch[0].lattice.used.spacing * (float)p->radius)) /
                        soft;
        const palp_contact_spring spring = {.held = palp_frame_at(at),
                                            .stiffness_N_per_m = (float)stiffness};
        if (!(stiffness > 0)) rest.t = at;
        palp_contact_solve(c, &rest, &spring);
        rest = c->rest[0];
        at = rest.t;
        if (k > ticks) {
            const double size = (double)palp_norm(c->force_N[0]);
            r.share = fmax(r.share, (double)palp_norm(c->repaid_N[0]) / size);
            r.step = fmax(r.step, (double)palp_norm(palp_sub(c->repaid_N[0], repaid_N)) / size);
            const palp_vec3 mean = palp_scale(0.5f, palp_add(before_N, c->force_N[0]));
            r.work += (double)palp_dot(mean, palp_sub(at, before_m));
            stored = fmax(stored, (double)c->energy_J);
        }
        before_m = at;
        before_N = c->force_N[0];
        repaid_N = c->repaid_N[0];
    }
    contact_close(c);
    r.work = fabs(r.work) / stored;
    return r;
}

static void test_rounds(const round_path *p, const char *name, double slow, double fast) {
    round_result all = {.work = 0};
    for (uint32_t l = 0; l < PALP_CONTACT_LEVELS; l++) {
        const round_result r = go_round(p, 3000, l, 0, 0);
        all = (round_result){fmax(all.work, r.work), fmax(all.share, r.share),
                             fmax(all.step, r.step)};
    }
    AT_MOST(all.work, slow, "%s, round in 3000 ticks, all levels: net work over stored", name);
    AT_MOST(all.share, 0.0202, "%s: what is repaid over the force", name);
    AT_MOST(all.step, 0.00102, "%s: its change in a tick", name);
    const round_result quick = go_round(p, 40, 3, 0, 0);
    AT_MOST(quick.work, fast, "%s, round in 40 ticks: net work over stored", name);
    const round_result changing = go_round(p, 3000, 4, 3, 0);
    AT_MOST(changing.work, 10 * slow, "%s, through three levels in turn: net work over stored",
            name);
}

/* A hand on a spring stops on a sharp edge: what was being repaid fades and the force stays. */
static void test_rest(const round_path *p) {
    const palp_tool tool = palp_tool_sphere((float)p->radius);
    palp_contact *c = contact_open(&p->body->blob, &tool, 1, 1);
    palp_vec3 at = {0}, felt = {0};
    double owed = 0, drift = 0, repaid = 0;
    const float stiffness = 2.0f * p->body->blob.meta->stiffness_max_N_per_m;
    palp_frame rest = palp_frame_at(on_path(p, 0));
    for (int k = 0; k < 1300; k++) {
        if (k < 1000) at = on_path(p, k / 1500.0);
        const palp_contact_spring spring = {.held = palp_frame_at(at),
                                            .stiffness_N_per_m = stiffness};
        palp_contact_solve(c, &rest, &spring);
        rest = c->rest[0];
        if (k < 1000) owed = fmax(owed, fabs((double)c->owed_J) / (double)c->energy_J);
        if (k == 1100) felt = c->force_N[0];
        if (k <= 1100) continue;
        repaid = fmax(repaid, (double)palp_norm(c->repaid_N[0]));
        drift = fmax(drift, (double)(palp_norm(palp_sub(c->force_N[0], felt)) / palp_norm(felt)));
    }
    CHECK(owed > 1e-4, "over a sharp edge something is owed: %.2g of the energy", owed);
    AT_MOST(repaid, 0, "a hand that rests is repaid nothing (N)");
    AT_MOST(drift, 1e-3, "and its force stays, within");
    contact_close(c);
}

/* Two tools go round at once: what one owes the other may repay, so both together are counted. */
static void test_two(const round_path p[2]) {
    enum { TICKS = 3000 };
    const palp_tool tool[2] = {palp_tool_sphere((float)p[0].radius),
                               palp_tool_sphere((float)p[1].radius)};
    palp_contact *c = contact_open(&p[0].body->blob, tool, 2, 2);
    palp_vec3 before_m[2] = {{0}}, before_N[2] = {{0}};
    double work = 0, stored = 0;
    for (int k = 0; k <= 2 * TICKS; k++) {
        palp_frame at[2];
        palp_contact_spring spring[2];
        for (int t = 0; t < 2; t++) {
            at[t] = palp_frame_at(on_path(&p[t], (t + 1.0) * k / TICKS));
            spring[t] = (palp_contact_spring){.held = at[t]};
        }
        palp_contact_solve(c, at, spring);
        for (int t = 0; t < 2; t++) {
            const palp_vec3 mean = palp_scale(0.5f, palp_add(before_N[t], c->force_N[t]));
            if (k > TICKS) work += (double)palp_dot(mean, palp_sub(at[t].t, before_m[t]));
            before_m[t] = at[t].t;
            before_N[t] = c->force_N[t];
        }
        stored = fmax(stored, (double)c->energy_J);
    }
    AT_MOST(fabs(work) / stored, 5e-3, "two tools, one on an edge: net work over stored");
    contact_close(c);
}

/* On a spring: the work is that on the tool, and little is repaid where little is owed. */
static void test_spring(const round_path *p, double soft) {
    const round_result r = go_round(p, 2000, 3, 0, soft);
    AT_MOST(r.work, 1e-4, "on a spring stretched by %g cells: net work over stored", soft);
    AT_MOST(r.share, 0.005, "what is repaid over the force");
}

/* Round an edge again and again, too fast to repay: what is owed does not grow. */
static void test_many(const round_path *p) {
    const palp_tool tool = palp_tool_sphere((float)p->radius);
    palp_contact *c = contact_open(&p->body->blob, &tool, 1, 3);
    double most = 0, owed = 0;
    for (int k = 0; k < 1600; k++) {
        press_hold(c, on_path(p, k / 40.0), 1);
        most = fmax(most, (double)c->energy_J);
        owed = fmax(owed, fabs((double)c->owed_J));
    }
    AT_MOST(owed, 0.501 * most, "40 rounds in 40 ms each: owed of %.3g J at most, J", most);
    contact_close(c);
}

/* One of two tools lets go: its energy is not repaid to the other. */
static void test_one_lets_go(const round_path p[2]) {
    const palp_tool tool[2] = {palp_tool_sphere((float)p[0].radius),
                               palp_tool_sphere((float)p[1].radius)};
    palp_contact *c = contact_open(&p[0].body->blob, tool, 2, 3);
    double before = 0, jump = 0;
    for (int k = 0; k < 600; k++) {
        palp_frame at[2] = {palp_frame_at(on_path(&p[0], k / 3000.0)),
                            palp_frame_at(on_path(&p[1], k / 3000.0))};
        if (k >= 400) at[1].t = palp_madd(p[1].top, 2.0f * (float)p[1].radius, p[1].n);
        const palp_contact_spring spring[2] = {{.held = at[0]}, {.held = at[1]}};
        palp_contact_solve(c, at, spring);
        const double now = (double)c->owed_J;
        if (k >= 400 && k < 403) jump = fmax(jump, fabs(now - before) / (double)c->energy_J);
        before = now;
    }
    AT_MOST(jump, 0.02, "one of two tools lets go: what is owed changes, over what is stored, by");
    contact_close(c);
}

/* What is not touched any more owes nothing. */
static void test_release(const round_path *p) {
    const palp_tool tool = palp_tool_sphere((float)p->radius);
    palp_contact *c = contact_open(&p->body->blob, &tool, 1, 1);
    for (int k = 0; k < 500; k++) press_hold(c, on_path(p, k / 1500.0), 1);
    press_hold(c, palp_madd(p->top, 2.0f * (float)p->radius, p->n), 2);
    AT_MOST(fabs((double)c->owed_J), 0, "let go: nothing is owed (J)");
    press_hold(c, on_path(p, 0), 1);
    AT_MOST((double)palp_norm(c->repaid_N[0]), 0, "nor repaid when it is touched again (N)");
    contact_close(c);
}

int main(void) {
    progress_quiet(1);
    const baked ball = model_bake(model_sphere(3), -0.7, 0, false, false);
    const baked box = model_bake(model_box(1, 8), 1e-6, 0, false, false);
    const double of_ball = 2 * (double)ball.blob.meta->mean_edge_m,
                 of_box = 2 * (double)box.blob.meta->mean_edge_m;
    const palp_vec3 up = {0, 0, 1}, edge = {0.7f, 0, 0.7f}, corner = {0.6f, 0.55f, 0.6f};
    const round_path on_ball = round_about(&ball, up, up, of_ball),
                     on_face = round_about(&box, (palp_vec3){0.5f, 0.45f, 1}, up, of_box),
                     on_edge = round_about(&box, (palp_vec3){1, 0.52f, 1}, edge, of_box),
                     on_corner = round_about(&box, (palp_vec3){1, 1, 1}, corner, of_box);
    test_rounds(&on_ball, "ball", 1e-4, 2e-3);
    test_rounds(&on_face, "face of a box", 1e-4, 2e-3);
    /* in 40 ticks there is no time to repay what sharp edges owe */
    test_rounds(&on_edge, "edge of a box", 1e-3, 0.3);
    test_rounds(&on_corner, "corner of a box", 6e-3, 0.3);
    test_rest(&on_edge);
    test_spring(&on_face, 2);
    test_spring(&on_face, 5);
    test_many(&on_edge);
    const round_path both[2] = {on_face, on_edge};
    test_two(both);
    test_one_lets_go(both);
    test_release(&on_edge);
    return tap_done();
}
