/* SPDX-License-Identifier: MIT */
/* Friction of tools on dynamic bodies: Coulomb's law in sliding, what sticks holds and gives back, and no motion
 * across the contact is driven on. */
#include "core/servo/dynamic.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include "tests/models.h"
#include "tests/tap.h"
#include <stdlib.h>
#include <string.h>

#define RATE 1000.0f
#define RADIUS 0.008f
#define SIDE 0.03

static dynamic_body block;

static uint64_t no_time(void *context) {
    (void)context;
    return 0;
}

/* A ball on the face of a block that is held at the opposite one. */
typedef struct {
    palp_dynamic body;
    palp_tool tool;
    palp_vec3 at;
    palp_wrench on;
    palp_dynamic_report report;
} rubbed;

static rubbed *begin(float mu, float sliding) {
    rubbed *r = allocate(1, sizeof *r);
    r->tool = palp_tool_sphere(RADIUS);
    r->tool.friction = mu;
    r->tool.sliding = sliding;
    r->at = (palp_vec3){(float)SIDE + RADIUS + 0.001f, 0.015f, 0.013f};
    const palp_dynamic_config c = {.tets = &block.tets,
                                   .material = palp_material_of(2e4f, 0.4f, 1000.0f, 2e-3f, 20.0f),
                                   .adapt = palp_adapt_defaults(&block.tets),
                                   .tools = &r->tool,
                                   .tool_count = 1,
                                   .max_points = 64,
                                   .most_class = PALP_STEP_CLASSES - 1,
                                   .uniform = true,
                                   .cost = {&palp_target_counted, 0.01f, 0.0f, 0.8f},
                                   .port = {.now_ns = no_time},
                                   .tick_s = 1 / RATE};
    const palp_frame at = palp_frame_at(r->at);
    const size_t bytes = palp_dynamic_memsize(&block.tets, c.max_points);
    if (palp_dynamic_init(&r->body, &c, &at, allocate_aligned(bytes, 1), bytes, NULL) != PALP_OK)
        die(EXIT_WORK, "the body does not open");
    return r;
}

static void tick(rubbed *r) {
    const palp_frame at = palp_frame_at(r->at);
    palp_dynamic_tick(&r->body, 0, &at, &r->on, &r->report);
}

/* To a place in so many ticks; returns the work that the tool has done. */
static double go(rubbed *r, palp_vec3 to, int ticks) {
    const palp_vec3 from = r->at;
    double work = 0;
    for (int i = 1; i <= ticks; i++) {
        const palp_vec3 before = r->at;
        r->at = palp_madd(from, (float)i / (float)ticks, palp_sub(to, from));
        tick(r);
        work -= (double)palp_dot(r->on.force_N, palp_sub(r->at, before));
    }
    return work;
}

/* Forces over a time: mean along x (out of the face) and y. */
static void mean(rubbed *r, int ticks, double *normal, double *along) {
    *normal = *along = 0;
    for (int i = 0; i < ticks; i++) {
        tick(r);
        *normal += (double)r->on.force_N.x / ticks;
        *along += (double)r->on.force_N.y / ticks;
    }
}

static palp_vec3 pressed(double deep_m, double y) {
    return (palp_vec3){(float)(SIDE + (double)RADIUS - deep_m), (float)y, 0.013f};
}

/* `smooth`: T / N without friction, by the mesh's lack of symmetry. */
static double test_sliding(float mu, float sliding, double smooth) {
    rubbed *r = begin(mu, sliding);
    double normal = 0, along = 0;
    const double expected = (double)(sliding > 0 ? sliding : mu);
    go(r, pressed(0.003, 0.010), 200);
    go(r, pressed(0.003, 0.010), 100);
    const int ticks = 1000;
    for (int i = 1; i <= ticks; i++) { /* at 1 cm/s */
        r->at = pressed(0.003, 0.010 + 0.010 * i / ticks);
        tick(r);
        if (i <= ticks / 2) continue;
        normal += (double)r->on.force_N.x;
        along -= (double)r->on.force_N.y;
    }
    CHECK(normal > 50, "pressed with %.3f N", normal / ticks * 2);
    if (mu > 0)
        AT_MOST(fabs((along / normal - smooth) / expected - 1), 0.1,
                "mu %.2f: T / N in sliding %.3f, off by", expected, along / normal - smooth);
    else
        AT_MOST(fabs(along / normal), 0.05, "without friction T / N");
    free(r);
    return along / normal;
}

/* Within what sticks: the same force as from a surface that cannot slip, held, and given back. */
static void test_sticking(void) {
    rubbed *r = begin(0.8f, 0), *glued = begin(10, 0);
    double normal, along, held, glued_N, glued_T, back, start[2];
    rubbed *both[2] = {r, glued};
    for (int k = 0; k < 2; k++) {
        go(both[k], pressed(0.003, 0.015), 200);
        go(both[k], pressed(0.003, 0.015), 200);
        mean(both[k], 50, &normal, &start[k]);
        go(both[k], pressed(0.003, 0.0156), 200);
    }
    mean(r, 50, &normal, &along);
    mean(glued, 50, &glued_N, &glued_T);
    along -= start[0];
    glued_T -= start[1];
    CHECK(fabs(along) < 0.8 * 0.8 * normal && fabs(along) > 0.05 * normal,
          "moved aside by 0.6 mm within what sticks: T %.3f of N %.3f", along, normal);
    AT_MOST(fabs(along / glued_T - 1), 0.1, "against a surface that cannot slip, %.3f: off by",
            glued_T);
    go(r, r->at, 1000);
    mean(r, 50, &normal, &held);
    AT_MOST(fabs((held - start[0]) / along - 1), 0.02, "held for 1 s: changed by");
    go(r, pressed(0.003, 0.015), 200);
    go(r, r->at, 200);
    mean(r, 50, &normal, &back);
    AT_MOST(fabs((back - start[0]) / along), 0.1, "and back: left over, of what it was");
    free(r);
    free(glued);
}

/* To and fro: sliding takes, nothing gives. */
static void test_cycles(void) {
    rubbed *r = begin(0.5f, 0);
    go(r, pressed(0.003, 0.015), 200);
    go(r, pressed(0.003, 0.015), 200);
    double least = 0, work = 0;
    uint64_t seed = 9;
    for (int k = 0; k < 25; k++) {
        const double y = 0.015 + 0.005 * tap_random(&seed),
                     deep = 0.003 + 0.001 * tap_random(&seed);
        work += go(r, pressed(deep, y), 100 + (int)(80 * tap_random(&seed)));
        least = fmin(least, work);
    }
    work += go(r, pressed(0.003, 0.015), 200);
    CHECK(work > 0, "25 random ways: the tool puts in %.3g J", work);
    AT_MOST(-least / work, 0.02, "and gets back at any time of what it has not put in");
    for (int k = 0; k < 500; k++) tick(r);
    AT_MOST((double)r->report.kinetic_J, 1e-7, "at rest afterwards: kinetic energy, J");
    free(r);
}

int main(void) {
    static const double size_m[3] = {SIDE, SIDE, SIDE};
    static const uint32_t parts[2][3] = {{3, 3, 3}, {6, 6, 6}};
    tetmesh level[2];
    progress_quiet(1);
    for (int l = 0; l < 2; l++) level[l] = tetmesh_block(size_m, parts[l], false);
    block = model_dynamic_body(level, 2, 1e-6, 2e4, 0.4, 2e-3);
    const double smooth = test_sliding(0, 0, 0);
    (void)test_sliding(0.2f, 0, smooth);
    (void)test_sliding(0.5f, 0, smooth);
    (void)test_sliding(0.6f, 0.4f, smooth);
    test_sticking();
    test_cycles();
    return tap_done();
}
