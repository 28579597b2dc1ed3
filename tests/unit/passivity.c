/* SPDX-License-Identifier: MIT */
/*
 * The passivity observer and controller against books kept in double precision by a mass, a wall
 * and motors that the test integrates itself.
 */
#include "core/servo/passivity.h"
#include "core/servo/safety.h"
#include "tests/tap.h"
#include <math.h>

/* Power cannot come out of a wall that is sampled too slowly: a mass falls on it again and again.
 */
static double bounce(bool guarded, double *last) {
    palp_passivity p = {.energy_J = 0};
    palp_passivity_config c = palp_passivity_configure(1, 0, 0, 0.004f, 0);
    const double k = 1500, mass = 0.1, h = 1e-5;
    double x = 0.004, v = 0, seen = x, force = 0, highest = 0;
    for (int tick = 0; tick < 2000; tick++) {
        const palp_passivity_motion m = {.periods = 1,
                                         .q_rad = {(float)x},
                                         .fresh = {true},
                                         .certain_m_s = {0, 0, (float)((x - seen) / 0.004)}};
        seen = x;
        palp_passivity_observe(&p, &c, &m);
        palp_vec3 wanted = {0, 0, (float)(x < 0 ? -k * x : 0)};
        float stored = (float)(x < 0 ? 0.5 * k * x * x : 0);
        if (guarded)
            wanted = palp_scale(
                palp_passivity_share(&p, &c, &(palp_wrench){.force_N = wanted}, stored, 0, true),
                wanted);
        palp_passivity_sent(&p, &c, (float[PALP_AXES]){wanted.z});
        force = (double)wanted.z;
        for (double t = 0; t < 0.004; t += h) {
            v += h * (force / mass - 9.81);
            x += h * v;
        }
        if (tick > 1000) highest = fmax(highest, x);
    }
    *last = x;
    return highest;
}

static void test_passivity(void) {
    double x;
    double wild = bounce(false, &x);
    CHECK(wild > 0.05, "a stiff wall at 250 Hz throws a mass %.2f m high, dropped from 4 mm", wild);
    AT_MOST(fabs(bounce(true, &x)), 0.0045,
            "with the passivity controller it never rises again, m");
}

/* A joint that turns evenly against a steady torque, seen in every `seen`th tick only; ticks come
 * after 1 or, now and then, 3 periods. The error of the books over what was really given. */
static double books(uint32_t seen, uint32_t delay, float lag_s) {
    const float dt = 0.001f;
    palp_passivity_config c = palp_passivity_configure(1, 0, delay, dt, lag_s);
    palp_passivity p = {.energy_J = 0};
    double q = 0, acting = 0, given = 0, sent[4] = {0, 0, 0, 0};
    for (int tick = 0, period = 0; tick < 300; tick++) {
        const uint32_t periods = tick % 11 == 5 ? 3 : 1;
        for (uint32_t k = 0; k < periods; k++, period++) {
            /* between one reading and the next the motor follows what was sent `delay` ago */
            const double held = sent[delay], h = (double)dt / 100, omega = 0.7;
            for (int i = 0; i < 100; i++) {
                acting = lag_s > 0 ? held + (acting - held) * exp(-h / (double)lag_s) : held;
                given += acting * omega * h;
                q += omega * h;
            }
            if (k + 1 < periods)
                for (int i = 3; i > 0; i--) sent[i] = sent[i - 1];
        }
        const bool fresh = tick % (int)seen == 0 || tick == 299;
        palp_passivity_motion m = {
            .periods = periods, .q_rad = {(float)q}, .fresh = {fresh}, .certain_m_s = {0, 0, 0}};
        palp_passivity_observe(&p, &c, &m);
        const double torque = -0.02 - 0.01 * sin(0.05 * tick);
        palp_passivity_sent(&p, &c, (float[PALP_AXES]){(float)torque});
        for (int i = 3; i > 0; i--) sent[i] = sent[i - 1];
        sent[0] = torque;
    }
    return fabs((double)p.absorbed_J + given) / fabs(given);
}

static void test_books(void) {
    for (uint32_t delay = 0; delay < 3; delay++) {
        AT_MOST(books(1, delay, 0), 1e-3, "books with a delay of %u and skipped periods", delay);
        AT_MOST(books(1, delay, 0.0004f), 3e-3, "and with motors that lag, delay %u", delay);
        AT_MOST(books(4, delay, 0), 1e-3, "and with three of four readings lost, delay %u", delay);
    }
}

/* Whatever comes, the controller only ever takes force away. */
static void test_scales(void) {
    uint32_t seed = 1;
    bool within = true, cut = false;
    palp_passivity_config c = palp_passivity_configure(1, 0.5f, 1, 0.001f, 0.0004f);
    palp_passivity p = {.energy_J = 0};
    float q = 0;
    for (int i = 0; i < 100000; i++) {
        float r[4];
        for (int k = 0; k < 4; k++) {
            seed = seed * 1664525u + 1013904223u;
            r[k] = (float)(seed >> 8) / 8388608.0f - 1.0f;
        }
        q += 1e-3f * r[0];
        palp_passivity_motion m = {.periods = 1u + (seed >> 20) % 9u,
                                   .q_rad = {q},
                                   .certain_rad_s = {r[1]},
                                   .fresh = {r[2] > -0.5f},
                                   .certain_m_s = {0, r[3], r[1]}};
        palp_passivity_observe(&p, &c, &m);
        const palp_vec3 force = {0, 3 * r[0], 5 * r[2]};
        const float share = palp_passivity_share(&p, &c, &(palp_wrench){.force_N = force},
                                                 0.01f * fabsf(r[3]), fabsf(r[0]), i % 50 > 0);
        within = within && share >= 0.0f && share <= 1.0f;
        cut = cut || share < 0.5f;
        palp_passivity_sent(&p, &c, (float[PALP_AXES]){share * force.z});
    }
    CHECK(within && cut, "any motion, any force, readings lost: the share stays in 0..1");
}

/* What was given is forgiven when the tool has been free for half a second, and not before. */
static void test_forgiving(void) {
    palp_passivity_config c = palp_passivity_configure(1, 0, 0, 0.001f, 0);
    palp_passivity p = {.energy_J = 0};
    palp_passivity_motion m = {.periods = 1, .fresh = {true}};
    const palp_vec3 none = {0, 0, 0}, some = {0, 0, 1};
    palp_passivity_observe(&p, &c, &m);
    palp_passivity_sent(&p, &c, (float[PALP_AXES]){1});
    m.q_rad[0] = 0.0005f; /* 0.5 mJ */
    palp_passivity_observe(&p, &c, &m);
    (void)palp_passivity_share(&p, &c, &(palp_wrench){.force_N = some}, 0, 0, true);
    palp_passivity_sent(&p, &c, (float[PALP_AXES]){0});
    const float owed = -p.energy_J;
    for (int i = 0; i < 2000; i++) { /* touched all the time */
        palp_passivity_observe(&p, &c, &m);
        (void)palp_passivity_share(&p, &c, &(palp_wrench){.force_N = some}, 0.01f, 0, true);
        palp_passivity_sent(&p, &c, (float[PALP_AXES]){0});
    }
    CHECK(owed > 0.49e-3f && !(-p.energy_J < owed) && !palp_passivity_exceeded(&p, &c),
          "0.5 mJ given are remembered for as long as there is contact: %.3f mJ",
          -1e3 * (double)p.energy_J);
    int forgiven = -1;
    for (int i = 0; i < 1000 && forgiven < 0; i++) { /* ticks of two periods */
        m.periods = 2;
        palp_passivity_observe(&p, &c, &m);
        (void)palp_passivity_share(&p, &c, &(palp_wrench){.force_N = none}, 0, 0, true);
        palp_passivity_sent(&p, &c, (float[PALP_AXES]){0});
        if (!(-p.energy_J > 0)) forgiven = 2 * i;
    }
    CHECK(forgiven >= 490 && forgiven <= 510, "and let go %d ms after it ended", forgiven);
    m.periods = 1;
    palp_passivity_sent(&p, &c, (float[PALP_AXES]){2});
    m.q_rad[0] += 0.00055f;
    palp_passivity_observe(&p, &c, &m);
    CHECK(palp_passivity_exceeded(&p, &c), "1.1 mJ are more than is allowed");
    c.step_rad[0] = 0.0001f;
    palp_passivity_observe(&p, &c, &m);
    palp_passivity_sent(&p, &c, (float[PALP_AXES]){2});
    palp_passivity_observe(&p, &c, &m);
    CHECK(!palp_passivity_exceeded(&p, &c), "but not with an encoder that leaves 0.2 mJ in doubt");
}

/* A body pressed and let go by the hand along a path, sampled finely: nothing to take away. */
static void test_quiet(void) {
    palp_passivity_config c = palp_passivity_configure(1, 0.6f, 0, 0.001f, 0.0003f);
    palp_passivity p = {.energy_J = 0};
    const double k = 300;
    float least = 1;
    double x = 0, before = 0;
    for (int i = 0; i < 20000; i++) {
        x = 0.004 - 0.01 * (1 - cos(i * 0.006)) / 2;
        const double depth = fmax(-x, 0), v = (x - before) / 0.001;
        palp_passivity_motion m = {.periods = 1,
                                   .q_rad = {(float)x},
                                   .certain_rad_s = {(float)v},
                                   .fresh = {true},
                                   .certain_m_s = {0, 0, (float)v}};
        before = x;
        palp_passivity_observe(&p, &c, &m);
        const palp_vec3 force = {0, 0, (float)(k * depth)};
        const float share = palp_passivity_share(&p, &c, &(palp_wrench){.force_N = force},
                                                 (float)(0.5 * k * depth * depth), 0, true);
        least = fminf(least, share);
        palp_passivity_sent(&p, &c, (float[PALP_AXES]){share * force.z});
    }
    CHECK(least >= 1, "19 presses of 6 mm on 300 N/m at 1 kHz: share %.3f", (double)least);
}

/* Energy given ends in DAMPING, not in FAULT, and stays there until a reset. */
static void test_state(void) {
    palp_safety s;
    palp_safety_init(&s, 0.001f, 0, true);
    const palp_axes_health healthy = {
        .heard = true, .configured = true, .healthy = true, .enabled = true, .homed = true};
    for (int i = 0; i < 1000; i++) (void)palp_safety_tick(&s, 0, 1, &healthy);
    const bool run = s.state == PALP_STATE_RUN;
    palp_safety_latch(&s, PALP_FAULT_ENERGY);
    const bool damping = s.state == PALP_STATE_DAMPING;
    for (int i = 0; i < 1000; i++) (void)palp_safety_tick(&s, 0, 1, &healthy);
    CHECK(run && damping && s.state == PALP_STATE_DAMPING && s.faults == PALP_FAULT_ENERGY,
          "more energy given than allowed: DAMPING, with a fault that stays");
    palp_safety_latch(&s, PALP_FAULT_BUS);
    CHECK(s.state == PALP_STATE_FAULT, "another fault then is FAULT");
    CHECK(palp_safety_tick(&s, PALP_EVENT_RESET, 1, &healthy) && s.state == PALP_STATE_INIT &&
              s.faults == 0,
          "and a reset takes both away");
}

int main(void) {
    test_passivity();
    test_books();
    test_scales();
    test_forgiving();
    test_quiet();
    test_state();
    return tap_done();
}
