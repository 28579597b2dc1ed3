/* SPDX-License-Identifier: MIT */
/*
 * palp feel, the part with a device: the whole servo on the simulated arm at 1 kHz. Frames that are
 * lost, energy that the hand is given on random paths (by the mechanism's own books, without its
 * Coulomb friction), what is left of it at rest, a tap, and a force held by friction while the load
 * swings.
 */
#include "tools/feel/feel_device.h"
#include "sim/virtual_time.h"
#include "sim/spectrum.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>

#define RATE_HZ 1000.0f
#define PATHS 8
#define TREMOR_M 6e-5

/* The arm on the body; false when it cannot be felt at this rate. */
static bool open_device(rig *r, const bench *b, float friction, const char *faults) {
    *r = (rig){.file = device_load("arm3")};
    r->file.device.drives.rate_hz = RATE_HZ;
    r->file.friction_N = 0;
    palp_servo_config config = rig_config(r, b->blob);
    config.cost.ns_per_instruction = 0.01f;
    config.tool.friction = friction;
    const bool opens = rig_opens(b->blob, &config);
    if (opens) rig_open(r, b->blob, &config, "touch", faults, 7);
    return opens;
}

/* Leads the device at even speeds, and hardly lets itself be turned away. */
static void lead(rig *r, const hand_key *keys, uint32_t count) {
    rig_lead(r, keys, count, 2e4, 60);
    r->bus.script.even = true;
}

/* Largest step of the force while the hand presses evenly. */
static double step_pressing(const bench *b, double speed_m_s, int lost) {
    char list[64];
    rig r;
    const double depth = 0.012, at = 1 + (0.001 + 0.6 * depth) / speed_m_s;
    snprintf(list, sizeof list, "loss@%g+%g", at, 0.001 * lost - 0.0003);
    if (!open_device(&r, b, 0, lost > 0 ? list : NULL)) return 0;
    const hand_key keys[] = {{0, {0, 0, 0.01}},
                             {0.9, {0, 0, 0.001}},
                             {1, {0, 0, 0.001}},
                             {101, {0, 0, 0.001 - 100 * speed_m_s}}};
    lead(&r, keys, 4);
    double most = 0;
    palp_vec3 before = {0};
    while (r.bus.time_s < 1 + (0.001 + depth) / speed_m_s) {
        rig_tick(&r);
        if (r.bus.time_s > at - 0.003)
            most = fmax(most, (double)palp_norm(palp_sub(r.report.force_N, before)));
        before = r.report.force_N;
    }
    if (r.report.state != PALP_STATE_RUN) most = INFINITY;
    rig_stop(&r);
    return most;
}

static void lost_frames(bench *b) {
    static const int lost[] = {1, 2, 3, 5};
    static const double speeds[] = {0.02, 0.1, 0.5};
    for (int k = 0; k < 4; k++) {
        double worst = 0;
        for (int s = 0; s < 3; s++)
            worst =
                fmax(worst, step_pressing(b, speeds[s], lost[k]) / step_pressing(b, speeds[s], 0));
        char of[72];
        snprintf(of, sizeof of, "%d while pressing at 20 to 500 mm/s, step over ordinary", lost[k]);
        feel_add(&b->table, "frames lost", of, worst, "times", NAN, 1.5);
    }
}

/* Most that one random path into the body and out again gives, over what it stores. */
static double path_given(bench *b, const char *faults, bool *damped) {
    rig r;
    if (!open_device(&r, b, 0, faults)) return 0;
    const double reach = (double)r.file.device.workspace_radius_m, top = 0.4 * reach;
    hand_key keys[12] = {{0, {0, 0, top}}, {1.2, {0, 0, top}}};
    double t = 1.2;
    for (int i = 2; i < 10; i++) {
        t += 0.15 + 0.25 * bench_roll(b);
        keys[i] = (hand_key){t,
                             {0.25 * reach * (2 * bench_roll(b) - 1),
                              0.25 * reach * (2 * bench_roll(b) - 1),
                              reach * (0.3 * bench_roll(b) - 0.2)}};
    }
    keys[10] = (hand_key){t + 0.3, {0, 0, top}};
    keys[11] = (hand_key){t + 0.6, {0, 0, top}};
    rig_lead(&r, keys, 12, 2000, 12);
    rig_run(&r, 1.2);
    const double begun = r.bus.device.given_J;
    double stored = 1e-9;
    while (r.bus.time_s < t + 0.6) {
        rig_tick(&r);
        stored = fmax(stored, (double)r.report.stored_J);
    }
    *damped = *damped || r.report.state != PALP_STATE_RUN;
    const double given = r.bus.device.given_J - begun;
    rig_stop(&r);
    return fmax(given, 0) / stored;
}

static void energy(bench *b) {
    static const char *const faults[] = {NULL, "overrun@1.5=2,overrun@2.1=3,overrun@2.6=4"};
    static const char *const of[] = {"random paths of the arm, over stored",
                                     "and 2 to 4 ticks preempted on the way"};
    for (int k = 0; k < 2; k++) {
        double worst = 0;
        bool damped = false;
        for (int i = 0; i < PATHS; i++) worst = fmax(worst, path_given(b, faults[k], &damped));
        feel_add(&b->table, "energy given", of[k], worst, "1", NAN, 1e-5);
    }
}

/* Largest rise of the force over 5 ms after touch at `speed`, over what a spring of the coupling's
 * stiffness alone gives at that speed: rate-hardness (Lawrence and others 2000). */
static void tap(bench *b) {
    rig r;
    const double speed = 0.3;
    if (!open_device(&r, b, 0, NULL)) return;
    const palp_servo_config config = rig_config(&r, b->blob);
    const double spring = (double)palp_min(palp_device_coupling(&config.device),
                                           palp_device_stiffest(&config.device));
    const hand_key keys[] = {
        {0, {0, 0, 0.03}}, {1, {0, 0, 0.03}}, {101, {0, 0, 0.03 - 100 * speed}}};
    lead(&r, keys, 3);
    double touched = -1, most = 0, last = 0;
    while (touched < 0 || r.bus.time_s < touched + 0.005) {
        rig_tick(&r);
        const double now = (double)palp_norm(r.report.force_N);
        if (touched < 0 && now > 0) touched = r.bus.time_s;
        most = fmax(most, now - last);
        last = now;
        if (r.bus.time_s > 2) break;
    }
    rig_stop(&r);
    feel_add(&b->table, "tap, rate-hardness", "0.3 m/s, over the coupling's spring alone",
             most * (double)RATE_HZ / (speed * spring), "1", NAN, NAN);
    feel_add(&b->table, "tap, force after 5 ms", "the same", last / (speed * 0.005 * spring), "1",
             NAN, NAN);
}

/* Largest line between 20 and 500 Hz of the force while the hand holds still, after two preempted
 * ticks. */
static void at_rest(bench *b) {
    enum { TICKS = 1000 };
    static double force_N[TICKS];
    rig r;
    const hand_key keys[] = {{0, {0, 0, 0.01}}, {1, {0, 0, 0.01}}, {1.4, {0, 0, -0.006}}};
    if (!open_device(&r, b, 0, "overrun@1.5=1,overrun@1.6=1")) return;
    rig_lead(&r, keys, 3, 400, 6);
    r.bus.script.tremor_m = TREMOR_M; /* encoders that stand still are taken for broken ones */
    rig_run(&r, 2.4);
    for (int i = 0; i < TICKS; i++) {
        rig_tick(&r);
        force_N[i] = (double)palp_norm(r.report.force_N);
    }
    double most = spectrum_largest(force_N, TICKS, RATE_HZ, 20, 500);
    if (r.report.state != PALP_STATE_RUN || !(force_N[0] > 0)) most = INFINITY;
    rig_stop(&r);
    feel_add(&b->table, "force at rest", "largest line, 20 to 500 Hz", most, "N", NAN, 0.01);
}

/* The tool pushed aside by `aside_m` while it sticks, then the load swung 100 times: mean force
 * across and along over a cycle before that, after the first and after 99. False: not felt, or it
 * slipped. */
static bool swing(const bench *b, double aside_m, double across_N[3], double along_N[3]) {
    rig r;
    const double deep = -0.006, by = 0.0009, cycle = 0.1, begin = 2;
    const double from[3] = {begin - cycle, begin + cycle, begin + 99 * cycle};
    hand_key keys[256] = {{0, {0, 0, 0.01}}, {1, {0, 0, 0.001}}, {1.5, {0, 0, deep}}};
    uint32_t n = 3;
    keys[n++] = (hand_key){begin - 0.2, {aside_m, 0, deep}};
    for (int k = 0; k < 100; k++) {
        keys[n++] = (hand_key){begin + cycle * k, {aside_m, 0, deep + (k > 0 ? by : 0)}};
        keys[n++] = (hand_key){begin + cycle * (k + 0.5), {aside_m, 0, deep - by}};
    }
    keys[n++] = (hand_key){begin + 100 * cycle, {aside_m, 0, deep + by}};
    keys[n++] = (hand_key){begin + 102 * cycle, {aside_m, 0, deep}};
    if (!open_device(&r, b, 1.0f, NULL)) return false;
    lead(&r, keys, n);
    for (int k = 0; k < 3; k++) {
        rig_run(&r, from[k] - r.bus.time_s);
        across_N[k] = along_N[k] = 0;
        for (int i = 0; i < (int)(cycle * (double)RATE_HZ); i++) {
            rig_tick(&r);
            across_N[k] += (double)r.report.force_N.x;
            along_N[k] += (double)r.report.force_N.z;
        }
    }
    const bool good = !r.report.slipping && r.report.state == PALP_STATE_RUN;
    rig_stop(&r);
    return good;
}

/* Friction along the push: half of what pushes to either side differ by, so that a surface that
 * leans does not count. */
static void held_by_friction(bench *b) {
    double x[2][3], z[2][3], ratio[3];
    if (!swing(b, 0.0018, x[0], z[0]) || !swing(b, -0.0018, x[1], z[1])) return;
    for (int k = 0; k < 3; k++) ratio[k] = (x[0][k] - x[1][k]) / (z[0][k] + z[1][k]);
    feel_add(&b->table, "held by friction", "change in the first swing of the load by a fifth",
             100 * (ratio[1] / ratio[0] - 1), "%", FEEL_FORCE_THRESHOLD, 8.5);
    feel_add(&b->table, "held by friction", "from swing 1 to 99", 100 * (ratio[2] / ratio[1] - 1),
             "%", FEEL_FORCE_THRESHOLD, 1);
}

void feel_device(bench *b) {
    lost_frames(b);
    energy(b);
    at_rest(b);
    tap(b);
    held_by_friction(b);
}
