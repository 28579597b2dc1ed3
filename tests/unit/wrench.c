/* SPDX-License-Identifier: MIT */
/* Tools with directions: shapes and their fields, the wrench against differences of the energy,
 * closed paths in place and direction, springs that hold a turn. */
#include "core/contact/cost.h"
#include "tests/models.h"
#include "tests/tap.h"
#include "tools/press/press.h"
#include "tools/tool/toolbake.h"
#include "port/host/opencontact.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

#define SETTLE 240 /* ticks of a rigid press; what is repaid takes that long to fade */

/* ---- meshes of tools ---- */

/* The unit sphere stretched, of about 10,000 triangles. */
static mesh ellipsoid(double a, double b, double c) {
    mesh m = model_sphere(5);
    for (uint32_t i = 0; i < m.vertices; i++) {
        m.x[i][0] *= a;
        m.x[i][1] *= b;
        m.x[i][2] *= c;
    }
    return m;
}

/* The tool of a mesh; its bytes stay. */
static palp_tool field_of(const mesh *m, uint32_t cells, double radius_m, tool_report *r) {
    static const uint8_t sha[32];
    const tool_options o = {
        .cells = cells, .radius_given = radius_m >= 0, .radius_m = radius_m < 0 ? 0 : radius_m};
    size_t bytes;
    const uint8_t *data = tool_bake(m, &o, sha, r, &bytes);
    palp_tool t = {.shape = PALP_TOOL_FIELD};
    const palp_status status = palp_tool_field_open(&t.field, data, bytes);
    if (status != PALP_OK) die(EXIT_WORK, "%s", palp_status_text(status));
    return t;
}

/* ---- the wrench ---- */

typedef struct {
    double of[6]; /* force, then moment */
} six;

static palp_frame moved(const palp_frame *at, int k, double by) {
    palp_frame out = *at;
    float turn[3] = {0};
    if (k < 3) {
        float *t[3] = {&out.t.x, &out.t.y, &out.t.z};
        *t[k] += (float)by;
        return out;
    }
    turn[k - 3] = (float)by;
    palp_turn_by(palp_vec3_at(turn), at->r, out.r);
    return out;
}

static double energy_at(palp_contact *c, const palp_frame *at) {
    const palp_contact_spring held = {.held = *at};
    for (int i = 0; i < SETTLE; i++) palp_contact_solve(c, at, &held);
    return (double)c->energy_J;
}

/* Minus the gradient of the energy, by differences of fourth order. */
static six by_differences(palp_contact *c, const palp_frame *at, double step_m, double step_rad) {
    six g;
    for (int k = 0; k < 6; k++) {
        const double h = k < 3 ? step_m : step_rad;
        double d[2];
        for (int n = 0; n < 2; n++) {
            const palp_frame up = moved(at, k, (n + 1) * h), down = moved(at, k, -(n + 1) * h);
            d[n] = (energy_at(c, &up) - energy_at(c, &down)) / (2 * (n + 1) * h);
        }
        g.of[k] = -(4 * d[0] - d[1]) / 3;
    }
    return g;
}

static six wrench_of(const palp_contact *c) {
    const palp_vec3 f = c->force_N[0], m = c->moment_Nm[0];
    return (six){{(double)f.x, (double)f.y, (double)f.z, (double)m.x, (double)m.y, (double)m.z}};
}

typedef struct {
    const char *name;
    double step;  /* of the differences, over the size */
    double limit; /* of force over force, and of moment over force times arm */
} claim;

static void compare(const baked *b, const palp_tool *tool, palp_frame at, double arm_m,
                    claim about) {
    palp_contact *c = contact_open(&b->blob, tool, 1, PALP_CONTACT_FINEST);
    const double step = about.step * (double)palp_tool_size(tool);
    (void)energy_at(c, &at);
    const six w = wrench_of(c);
    const six g = by_differences(c, &at, step, step / arm_m);
    double off[2] = {0}, force = 0;
    for (int k = 0; k < 3; k++) force += w.of[k] * w.of[k];
    force = sqrt(force);
    for (int k = 0; k < 6; k++) off[k / 3] = fmax(off[k / 3], fabs(g.of[k] - w.of[k]));
    AT_MOST(off[0] / force, about.limit, "%s: force against differences of the energy", about.name);
    AT_MOST(off[1] / (force * arm_m), about.limit, "%s: moment, over force times arm", about.name);
    contact_close(c);
}

static palp_frame turned(double x, double y, double z, double rx, double ry, double rz) {
    palp_frame f = palp_frame_at((palp_vec3){(float)x, (float)y, (float)z});
    palp_turn_by((palp_vec3){(float)rx, (float)ry, (float)rz}, PALP_FRAME_IDENTITY.r, f.r);
    return f;
}

static void test_wrench(const baked *b) {
    const double e = (double)b->blob.meta->mean_edge_m;
    const float f = (float)e;
    const palp_vec3 x = {1, 0, 0};
    palp_tool t = palp_tool_sphere(2 * f);
    compare(b, &t, turned(0.05, -0.02, 1 + 1.7 * e, 0.3, -0.2, 0.5), 2 * e,
            (claim){"ball", 0.01, 1e-4});
    t.ball[0].center_m = (palp_vec3){0.8f * f, 0, -f};
    compare(b, &t, turned(0, 0.02, 1 + 2.6 * e, 0.1, 0.2, 0.3), 2 * e,
            (claim){"ball off its reference", 0.003, 3e-4});
    t = palp_tool_sphere(f);
    t.balls = 3;
    for (uint32_t k = 1; k < 3; k++)
        t.ball[k] = (palp_ball){{(k == 1 ? 1.0f : -1.0f) * 1.2f * f, 0, 0}, f};
    compare(b, &t, turned(0.05, -0.02, 1 + 0.85 * e, 0.05, 0.03, 0.4), e,
            (claim){"three balls, grooves between them", 0.01, 8e-3});
    t = palp_tool_capsule(x, 2 * f, 1.5f * f);
    compare(b, &t, turned(0.03, -0.02, 1 + 1.3 * e, 0.1, 0.06, 0.3), 2 * e,
            (claim){"capsule", 0.003, 3e-4});
    t = (palp_tool){.shape = PALP_TOOL_PAD,
                    .pad = {.axis = {{1, 0, 0}, {0, -1, 0}, {0, 0, -1}},
                            .half_m = {2 * f, 1.5f * f},
                            .edge_m = f}};
    compare(b, &t, turned(0.02, -0.02, 1 - 0.2 * e, 0.05, 0.04, 0.3), 2 * e,
            (claim){"pad", 0.003, 5e-4});
}

static void test_field_wrench(const baked *b) {
    const double e = (double)b->blob.meta->mean_edge_m;
    tool_report r;
    mesh m = ellipsoid(3 * e, 1.5 * e, 2 * e);
    const palp_tool egg = field_of(&m, 0, -1, &r);
    compare(b, &egg, turned(0.03, -0.02, 1 + 1.7 * e, 0.3, 0.2, 0.4), 2 * e,
            (claim){"ellipsoid as a field", 0.006, 1e-4});
    mesh_free(&m);
}

/* ---- shapes as fields ---- */

/* A field of a ball against the ball: what it says of distances, and what is felt. */
static void test_ball(const baked *b) {
    const double e = (double)b->blob.meta->mean_edge_m, radius = 2 * e;
    tool_report r;
    mesh m = ellipsoid(radius, radius, radius);
    const palp_tool field = field_of(&m, 0, -1, &r), ball = palp_tool_sphere((float)radius);
    AT_MOST(r.error_max_m / r.diagonal_m, TOOL_ERROR, "a ball: distance off, over the diagonal");
    AT_MOST(2.0 * r.count[0] * r.count[1] * r.count[2], TOOL_BYTES, "its bytes");
    uint64_t seed = 3;
    double off = 0, turn = 0;
    for (int i = 0; i < 20000; i++) {
        const palp_vec3 x = {(float)(1.2 * radius * tap_random(&seed)),
                             (float)(1.2 * radius * tap_random(&seed)),
                             (float)(1.2 * radius * tap_random(&seed))};
        const palp_frame at = turned(0.1 * radius, 0, 0, tap_random(&seed), tap_random(&seed), 0);
        const palp_gap is = palp_tool_gap(&field, &at, x), wanted = palp_tool_gap(&ball, &at, x);
        if (wanted.gap_m < -0.4f * (float)radius || wanted.gap_m > 0.05f * (float)radius) continue;
        off = fmax(off, fabs((double)(is.gap_m - wanted.gap_m)));
        turn = fmax(turn, (double)palp_norm(palp_sub(is.normal, wanted.normal)));
    }
    AT_MOST(off / (2 * radius), TOOL_ERROR, "a ball anywhere near: gap off, over its size");
    AT_MOST(turn, 0.02, "and its direction, rad");
    palp_contact *c[2] = {contact_open(&b->blob, &ball, 1, PALP_CONTACT_FINEST),
                          contact_open(&b->blob, &field, 1, PALP_CONTACT_FINEST)};
    double worst = 0, aside = 0;
    for (int i = 0; i < 12; i++) {
        const double depth = radius * (0.02 + 0.02 * i);
        const palp_frame at = turned(0.02 * i, 0.01 * i, 1 + radius - depth, 0.2 * i, 0.1 * i, 0);
        for (int k = 0; k < 2; k++) (void)energy_at(c[k], &at);
        const double force = (double)palp_norm(c[0]->force_N[0]);
        worst =
            fmax(worst, (double)palp_norm(palp_sub(c[0]->force_N[0], c[1]->force_N[0])) / force);
        aside = fmax(aside, (double)palp_norm(c[1]->moment_Nm[0]) / (force * radius));
    }
    AT_MOST(worst, 0.02, "pressed by the field and by the ball: force differs, over itself");
    AT_MOST(aside, 0.005, "and gives no moment, over force times radius");
    for (int k = 0; k < 2; k++) contact_close(c[k]);
    mesh_free(&m);
}

/* A pure turn of a ball changes nothing and gives no moment. */
static void test_symmetry(const baked *b) {
    const double e = (double)b->blob.meta->mean_edge_m;
    const palp_tool ball = palp_tool_sphere((float)(2 * e));
    palp_contact *c = contact_open(&b->blob, &ball, 1, PALP_CONTACT_FINEST);
    palp_frame at = turned(0.05, -0.02, 1 + 1.7 * e, 0, 0, 0);
    (void)energy_at(c, &at);
    const palp_vec3 before = c->force_N[0];
    double most = 0, changed = 0;
    for (int i = 0; i < 200; i++) {
        palp_turn_by((palp_vec3){0.02f, -0.01f, 0.03f}, at.r, at.r);
        const palp_contact_spring held = {.held = at};
        palp_contact_solve(c, &at, &held);
        const double force = (double)palp_norm(c->force_N[0]);
        most = fmax(most, (double)palp_norm(c->moment_Nm[0]) / (force * 2 * e));
        changed = fmax(changed, (double)palp_norm(palp_sub(c->force_N[0], before)) / force);
    }
    AT_MOST(most, 1e-5, "a ball that turns: moment over force times radius");
    AT_MOST(changed, 1e-4, "and the force changes by");
    contact_close(c);
}

/* ---- closed paths ---- */

/* In place and direction, without a spring; work over what is stored, in the third round. */
static void test_loop(const baked *b, const palp_tool *tool, palp_frame start, double way_m,
                      double turn_rad, const char *name, double limit) {
    enum { TICKS = 2000 };
    palp_contact *c = contact_open(&b->blob, tool, 1, PALP_CONTACT_FINEST);
    palp_frame before = start;
    palp_wrench last = {.force_N = {0}};
    double work = 0, stored = 0, went = 0;
    for (int i = 0; i <= 3 * TICKS; i++) {
        const double s = 2 * M_PI * (double)(i % TICKS) / TICKS;
        const double in = way_m * sin(s), aside = way_m * (1 - cos(s));
        palp_frame at = start;
        at.t = palp_add(start.t, (palp_vec3){(float)aside, (float)(0.5 * in), (float)(-0.2 * in)});
        palp_turn_by((palp_vec3){(float)(turn_rad * sin(s)), (float)(turn_rad * (1 - cos(s))),
                                 (float)(0.5 * turn_rad * sin(2 * s))},
                     start.r, at.r);
        const palp_contact_spring held = {.held = at};
        palp_contact_solve(c, &at, &held);
        const palp_wrench now = {c->force_N[0], c->moment_Nm[0]};
        if (i > 2 * TICKS) {
            const double by_force =
                (double)palp_dot(palp_add(last.force_N, now.force_N), palp_sub(at.t, before.t));
            const double by_moment = (double)palp_dot(palp_add(last.moment_Nm, now.moment_Nm),
                                                      palp_turn_between(before.r, at.r));
            work += 0.5 * (by_force + by_moment);
            went += 0.5 * (fabs(by_force) + fabs(by_moment));
        }
        stored = fmax(stored, (double)c->energy_J);
        before = at;
        last = now;
    }
    printf("# %s: %.3g of what was stored went in and out\n", name, went / stored);
    AT_MOST(fabs(work) / stored, limit, "%s: a closed path, work over stored", name);
    contact_close(c);
}

static void test_loops(const baked *b) {
    const double e = (double)b->blob.meta->mean_edge_m;
    const float f = (float)e;
    const palp_vec3 x = {1, 0, 0};
    tool_report r;
    const palp_tool ball = palp_tool_sphere(2 * f), capsule = palp_tool_capsule(x, 2 * f, 1.5f * f);
    mesh m = ellipsoid(3 * e, 1.5 * e, 2 * e);
    const palp_tool egg = field_of(&m, 0, -1, &r);
    test_loop(b, &ball, turned(0, 0, 1 + 1.7 * e, 0, 0, 0), 0.3 * e, 0.2, "ball", 1e-5);
    test_loop(b, &capsule, turned(0, 0, 1 + 1.2 * e, 0, 0, 0), 0.3 * e, 0.1, "capsule", 1e-5);
    test_loop(b, &egg, turned(0, 0, 1 + 1.7 * e, 0, 0, 0.4), 0.3 * e, 0.1, "ellipsoid", 1e-5);
    mesh_free(&m);
}

int main(void) {
    progress_quiet(1);
    baked ball = model_bake(model_sphere(3), -0.7, 0, false, false);
    test_wrench(&ball);
    test_field_wrench(&ball);
    test_ball(&ball);
    test_symmetry(&ball);
    test_loops(&ball);
    return tap_done();
}
