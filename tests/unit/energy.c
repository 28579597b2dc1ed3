/* SPDX-License-Identifier: MIT */
/*
 * Energy given to the hand, by the books of the simulated mechanism, without its Coulomb friction:
 * random closed paths through the body, at 60 Hz to 4 kHz, on every device and protocol, with
 * bodies from 1 Pa to 200 GPa and ticks that are preempted at random. From one touch to the end of
 * it at most 1e-5 of what was stored (0.05 mJ where ticks were preempted), or DAMPING within 1 mJ.
 * Each failure is told with its seed.
 */
#include "port/host/report.h"
#include "sim/virtual_time.h"
#include "tests/models.h"
#include "tests/tap.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define BODIES 6
static const double young_Pa[BODIES] = {1, 1e3, 3e4, 1e6, 1e9, 2e11};
static baked body[BODIES];

static const char *const devices[] = {"arm3",     "arm3-cia402", "arm3-moteus",
                                      "arm3-mit", "arm3-palp",   "arm3-palp-fd",
                                      "delta3",   "pantograph",  "desk3"};
#define DEVICES (sizeof devices / sizeof devices[0])
static device_file file[DEVICES];
static const float rates_hz[] = {60, 250, 500, 1000, 2000, 4000};
#define MISSED_J 5e-5
#define RATES (sizeof rates_hz / sizeof rates_hz[0])

typedef struct {
    double given_J, stored_J; /* most in one touch, and stored in it */
    uint64_t touches;
    uint64_t ticks, preempted;
    bool damped;
} outcome;

/* Through the body and back out; returns when it ends. */
#define KEYS 12
static double random_path(hand_key keys[KEYS], uint64_t *seed, double begin, double radius) {
    double t = begin;
    keys[0] = (hand_key){0, {0, 0, 0.4 * radius}};
    keys[1] = (hand_key){t, {0, 0, 0.4 * radius}};
    for (int i = 2; i < KEYS - 2; i++) {
        t += 0.15 + 0.25 * tap_random(seed) * tap_random(seed);
        keys[i] = (hand_key){t,
                             {0.25 * radius * tap_random(seed), 0.25 * radius * tap_random(seed),
                              radius * (0.15 * tap_random(seed) - 0.05)}};
    }
    keys[KEYS - 2] = (hand_key){t + 0.3, {0, 0, 0.4 * radius}};
    keys[KEYS - 1] = (hand_key){t + 0.6, {0, 0, 0.4 * radius}};
    return t + 0.6;
}

/* What a wire that cannot say 0 gives while joints turn: MIT mode rounds to half a step of torque.
 */
static double rounded_J(const rig *r, const float from_rad[PALP_AXES]) {
    const palp_device *d = &r->file.device;
    double sum = 0;
    if (d->drives.protocol != PALP_PROTOCOL_MIT) return 0;
    for (uint32_t i = 0; i < r->bus.device.axes; i++)
        sum += (double)(d->drives.range.torque_Nm / 4095 * fabsf(d->gear[i])) *
               fabs((double)(r->report.joint_rad[i] - from_rad[i]));
    return sum;
}

static void note_touch(outcome *o, double given_J, double stored_J) {
    if (given_J <= o->given_J && o->stored_J > 0) return;
    o->given_J = given_J;
    o->stored_J = stored_J;
}

/* False where the device does not carry the body, or the bus the rate. */
static bool run(outcome *o, const palp_blob *blob, const device_file *device, float rate_hz,
                bool preempted, uint64_t seed) {
    rig r = {.file = *device};
    *o = (outcome){.given_J = -1};
    r.file.device.drives.rate_hz = rate_hz;
    r.file.friction_N = 0;
    if (palp_bus_load_of(&r.file.device).load > 1.0f) /* a bus that is quick enough */
        r.file.device.bit_rate_bps = r.file.device.data_rate_bps = 2e7f;
    palp_servo_config config = rig_config(&r, blob);
    config.cost.ns_per_instruction = 0.01f;
    if (!rig_opens(blob, &config)) return false;
    char faults[64];
    const double radius = (double)r.file.device.workspace_radius_m;
    uint64_t dice = seed;
    const double at = 1.6 + 0.3 * fabs(tap_random(&dice));
    snprintf(faults, sizeof faults, "overrun@%g=%d,overrun@%g=%d", at,
             1 + (int)(3 * fabs(tap_random(&dice))), at + 0.7,
             1 + (int)(8 * fabs(tap_random(&dice))));
    rig_open(&r, blob, &config, "touch", preempted ? faults : NULL, seed);
    hand_key keys[KEYS];
    const double end = random_path(keys, &dice, 1.2, radius);
    rig_lead(&r, keys, KEYS, 2000, 12);
    double zero = r.bus.device.given_J, stored = 0;
    float from_rad[PALP_AXES] = {0};
    const int apart = 2 + (int)(0.004 * (double)rate_hz);
    int without = 0; /* ticks in a row without force */
    while (r.bus.time_s < end) {
        const double before = r.bus.device.given_J;
        rig_tick(&r);
        const bool forced = palp_norm(r.report.force_N) > 0.0f;
        without = forced ? 0 : without + 1;
        if (forced && !(stored > 0)) { /* a touch begins */
            zero = before;
            memcpy(from_rad, r.report.joint_rad, sizeof from_rad);
            o->touches++;
        }
        if (forced || stored > 0) stored = fmax(stored, (double)r.report.stored_J);
        if (without > apart && stored > 0) { /* it has ended */
            note_touch(o, before - zero - rounded_J(&r, from_rad), stored);
            stored = 0;
        }
        o->damped = o->damped || r.report.state == PALP_STATE_DAMPING;
    }
    if (stored > 0) note_touch(o, r.bus.device.given_J - zero - rounded_J(&r, from_rad), stored);
    o->ticks = palp_servo_counters(r.servo)->ticks;
    o->preempted = palp_servo_counters(r.servo)->skipped;
    rig_stop(&r);
    return true;
}

typedef struct {
    float rate_hz;
    bool preempted;
    uint64_t ticks, skipped, touches;
    double worst, most_J; /* over what was stored */
    char where[128];
    int runs, damped, failed;
} sweep;

static void run_sweep(void *context, size_t i) {
    sweep *s = (sweep *)context + i;
    for (size_t d = 0; d < DEVICES; d++) {
        for (int b = 0; b < BODIES; b++) {
            if ((i / 2 + d + (size_t)b) % 2 != 0 && !tap_full()) continue; /* every other path */
            const uint64_t seed = 1000 * (i + 1) + 10 * d + (uint64_t)b;
            outcome o;
            if (!run(&o, &body[b].blob, &file[d], s->rate_hz, s->preempted, seed)) continue;
            const double share = o.given_J / fmax(o.stored_J, 1e-6);
            s->touches += o.touches;
            s->runs++;
            s->ticks += o.ticks;
            s->skipped += o.preempted;
            s->damped += o.damped;
            s->most_J = fmax(s->most_J, o.given_J);
            /* a touch that ends while ticks are missing may have been given what the last force did
             * meanwhile */
            const double missed_J = s->preempted ? MISSED_J : 0;
            const bool bad =
                o.given_J > 1e-3 || (!o.damped && share > 1e-5 && o.given_J > missed_J);
            s->failed += bad;
            if (!bad || (s->failed > 1 && share <= s->worst)) continue;
            s->worst = share;
            snprintf(s->where, sizeof s->where, "; %s, %g Pa, seed %llu: given %.3g of %.3g mJ%s",
                     devices[d], young_Pa[b], (unsigned long long)seed, 1e3 * o.given_J,
                     1e3 * o.stored_J, o.damped ? ", DAMPING" : "");
        }
    }
}

int main(void) {
    progress_quiet(1);
    for (size_t d = 0; d < DEVICES; d++) file[d] = device_load(devices[d]);
    for (int b = 0; b < BODIES; b++) {
        mesh m = model_sphere(2);
        for (uint32_t i = 0; i < m.vertices; i++)
            for (int k = 0; k < 3; k++) m.x[i][k] *= b == 3 ? 0.004 : 0.03; /* one of 8 mm */
        body[b] = model_bake_young(m, b == 3 ? -0.0028 : -0.021, young_Pa[b]);
    }
    sweep sweeps[2 * RATES] = {{0}};
    for (size_t i = 0; i < 2 * RATES; i++) {
        sweeps[i].rate_hz = rates_hz[i / 2];
        sweeps[i].preempted = i % 2 == 1;
    }
    parallel_for(2 * RATES, run_sweep, sweeps);
    uint64_t ticks = 0;
    for (size_t i = 0; i < 2 * RATES; i++) {
        const sweep *s = &sweeps[i];
        ticks += s->ticks + s->skipped;
        CHECK(s->failed == 0 && s->runs > (tap_full() ? 8 : 4),
              "%g Hz%s: %d of %d paths (%llu touches) gave energy, %d ended in DAMPING; most %.3g "
              "mJ%s",
              (double)s->rate_hz, s->preempted ? ", preempted" : "", s->failed, s->runs,
              (unsigned long long)s->touches, s->damped, 1e3 * s->most_J, s->where);
    }
    CHECK(ticks > (tap_full() ? 1000000u : 500000u), "%llu ticks in all",
          (unsigned long long)ticks);
    return tap_done();
}
