/* SPDX-License-Identifier: MIT */
/*
 * Every fault, at random times, under every drive protocol, in virtual time: the force stays finite
 * and within limits, is gone in time, what must latch latches, and a reset brings it back. Prints
 * the table of fault, detection time and time to zero force.
 */
#include "port/host/report.h"
#include "tests/models.h"
#include "sim/virtual_time.h"
#include "tests/tap.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

static baked body;
static uint64_t all_ticks;

typedef enum { STAYS, DAMPS, LATCHES, ANY } outcome;

typedef struct {
    const char *name, *list; /* %g: the time of onset */
    outcome outcome;
    uint32_t fault;   /* that latches */
    size_t counter;   /* offset in palp_counters of one that must have moved */
    double detect_ms; /* from onset to the counter or the state */
    double zero_ms;   /* from onset to zero force, when it does not stay in RUN */
} specification;

#define COUNTER(x) offsetof(palp_counters, x)
static const specification specifications[] = {
    {"one period lost", "loss@%g+0.001", STAYS, 0, COUNTER(late), 3.1, 0},
    {"10 ms lost", "loss@%g+0.01", DAMPS, 0, COUNTER(late), 3.1, 20},
    {"50 ms lost", "loss@%g+0.05", LATCHES, PALP_FAULT_LOST, COUNTER(late), 3.1, 20},
    {"1 ms late", "delay@%g+0.05=0.0009", STAYS, 0, COUNTER(late), 3.1, 0},
    {"20 ms late", "delay@%g+0.2=0.02", ANY, 0, COUNTER(late), 3.1, 45},
    {"duplicated", "duplicate@%g+0.1", STAYS, 0, COUNTER(repeated), 3.1, 0},
    {"reordered", "reorder@%g+0.1", STAYS, 0, SIZE_MAX, 0, 0},
    {"corrupted bits", "corrupt@%g+0.1=0.3", ANY, 0, SIZE_MAX, 200, 0},
    {"encoders stuck", "stuck@%g+1", LATCHES, PALP_FAULT_FROZEN, COUNTER(frozen), 300, 560},
    {"encoder jumps 5 turns", "jump@%g+0.1", LATCHES, PALP_FAULT_INPUT, COUNTER(implausible), 3.1,
     6.1},
    {"encoder jumps 0.3 turns", "jump@%g+0.1=0.3", LATCHES, PALP_FAULT_INPUT, COUNTER(implausible),
     3.1, 6.1},
    {"encoder jumps now and then", "glitch@%g+0.5", LATCHES, PALP_FAULT_INPUT, COUNTER(implausible),
     60, 80},
    {"not a number", "nan@%g+0.1", LATCHES, PALP_FAULT_INPUT, COUNTER(implausible), 3.1, 6.1},
    {"drive reports an error", "drive@%g+0.3", LATCHES, PALP_FAULT_DRIVE, SIZE_MAX, 103, 103},
    {"bus-off", "busoff@%g+0.05", LATCHES, PALP_FAULT_BUS, COUNTER(bus_faults), 2.1, 2.1},
    {"frames not taken", "enobufs@%g+0.005", LATCHES, PALP_FAULT_BUS, COUNTER(bus_faults), 2.1,
     2.1},
    {"interface down", "down@%g+0.05", LATCHES, PALP_FAULT_BUS, COUNTER(bus_faults), 2.1, 2.1},
    {"10 periods overrun", "overrun@%g=10", DAMPS, 0, COUNTER(skipped), 12.1, 24},
    {"40 periods overrun", "overrun@%g=40", LATCHES, PALP_FAULT_LOST, COUNTER(skipped), 42.1, 42.1},
};
#define SPECIFICATIONS (sizeof specifications / sizeof specifications[0])

static const char *const devices[] = {"arm3",     "arm3-cia402", "arm3-moteus",
                                      "arm3-mit", "arm3-palp",   "arm3-palp-fd"};
#define DEVICES (sizeof devices / sizeof devices[0])
#ifndef EVERY
#define EVERY 1 /* of so many protocols each fault meets one, in turn: under sanitizers */
#endif
#ifndef TRIALS
#define TRIALS 2 /* of each fault under each protocol; fewer under sanitizers, more in make soak */
#endif

/* A hand that presses, and slides while it presses. */
static void press(hand *h) {
    static const hand_key keys[] = {{0, {0, 0, 0.02}},
                                    {0.4, {0, 0, 0.002}},
                                    {0.8, {0.002, 0.002, -0.008}},
                                    {1.4, {-0.003, 0.004, -0.012}},
                                    {2.0, {0.003, -0.004, -0.009}},
                                    {2.6, {0, 0.003, -0.011}},
                                    {3.2, {0.003, 0, -0.008}}};
    free(h->key);
    h->count = sizeof keys / sizeof keys[0];
    h->key = allocate(h->count, sizeof *h->key);
    memcpy(h->key, keys, sizeof keys);
}

typedef struct {
    double detect_ms, zero_ms; /* -1: never */
    double drives_ms;          /* until no drive turns its motor any more */
    float before_N, given_J;
    bool sound, recovered;
    palp_state state;
    uint32_t faults;
} trial;

static bool drives_are_off(const rig *r) {
    for (uint32_t i = 0; i < r->bus.device.axes; i++) {
        if (fabs(r->bus.device.drive[i].actual_Nm) > 1e-4) return false;
    }
    return true;
}

static uint64_t counter_of(const rig *r, size_t offset) {
    uint64_t v = 0;
    if (offset != SIZE_MAX)
        memcpy(&v, (const char *)palp_servo_counters(r->servo) + offset, sizeof v);
    return v;
}

static trial strike(const specification *s, const char *device, uint64_t seed) {
    char list[64];
    rig r;
    trial t = {.detect_ms = -1, .zero_ms = -1, .drives_ms = -1, .sound = true};
    double onset = 1.0 + 0.0001 * (double)(seed * 7919 % 6000);
    snprintf(list, sizeof list, s->list, onset);
    rig_start(&r, &body.blob, device, 1000, "touch", list, seed);
    press(&r.bus.script);
    while (r.bus.time_s + 0.0011 < onset) {
        rig_tick(&r);
        t.sound = t.sound && rig_is_sound(&r);
    }
    t.before_N = palp_norm(r.report.force_N);
    uint64_t before = counter_of(&r, s->counter);
    t.sound = t.sound && r.report.state == PALP_STATE_RUN;
    while (r.bus.time_s < onset + 1.1) {
        rig_tick(&r);
        t.sound = t.sound && rig_is_sound(&r);
        double ms = 1000 * (r.bus.time_s - onset);
        bool seen = counter_of(&r, s->counter) > before || r.report.state != PALP_STATE_RUN;
        if (t.detect_ms < 0 && seen) t.detect_ms = ms;
        /* In DAMPING what is left brakes the hand. */
        float brake =
            r.report.state == PALP_STATE_DAMPING
                ? r.file.device.damping_max_Ns_per_m * palp_norm(r.report.tip_velocity_m_s)
                : 0;
        bool zero =
            palp_norm(r.report.force_N) <= 0.01f + 1.1f * brake && r.report.state != PALP_STATE_RUN;
        if (!drives_are_off(&r))
            t.drives_ms = -1;
        else if (t.drives_ms < 0)
            t.drives_ms = ms;
        if (!zero) t.zero_ms = -1;
        if (t.zero_ms < 0 && zero) t.zero_ms = ms;
    }
    t.state = r.report.state;
    t.faults = r.report.faults;
    t.given_J = r.report.given_J;
    if (t.state != PALP_STATE_RUN) {
        r.more_events = PALP_EVENT_RESET;
        rig_run(&r, 0.6);
    }
    t.recovered = r.report.state == PALP_STATE_RUN && r.report.faults == 0;
    all_ticks += palp_servo_counters(r.servo)->ticks + palp_servo_counters(r.servo)->skipped;
    rig_stop(&r);
    return t;
}

static bool as_specified(const specification *s, const trial *t) {
    if (s->outcome == STAYS) return t->state == PALP_STATE_RUN && t->faults == 0;
    if (s->outcome == DAMPS) return t->state == PALP_STATE_DAMPING && t->faults == 0;
    return s->outcome == ANY || (t->state == PALP_STATE_FAULT && (t->faults & s->fault) != 0);
}

static void test_fault(const specification *s, uint64_t *seed) {
    double detect[2] = {1e9, 0}, zero[2] = {1e9, 0}, drives[2] = {1e9, 0};
    bool good = true;
    char why[1024] = "", states[128];
    uint32_t seen_faults = 0, seen_states = 0;
    float least_N = 1e9f, given_J = 0;
    for (size_t d = 0; d < DEVICES; d++) {
        if ((d + (size_t)(s - specifications)) % EVERY != 0) continue;
        for (int k = 0; k < (tap_full() ? 2 * TRIALS : TRIALS); k++) {
            trial t = strike(s, devices[d], ++*seed);
            bool in_time = (s->counter == SIZE_MAX && s->outcome == STAYS) || s->outcome == ANY ||
                           (t.detect_ms >= 0 && t.detect_ms <= s->detect_ms);
            if (t.state != PALP_STATE_RUN && s->zero_ms > 0)
                in_time = in_time && t.zero_ms >= 0 && t.zero_ms <= s->zero_ms;
            /* On a cut bus the drives' own watchdogs end it. */
            double backstop = 1000 * (double)device_load(devices[d]).device.drives.watchdog_s + 5;
            if (t.state == PALP_STATE_FAULT && s->outcome == LATCHES) {
                in_time = in_time && t.drives_ms >= 0 && t.drives_ms <= s->zero_ms + backstop;
                drives[0] = fmin(drives[0], t.drives_ms);
                drives[1] = fmax(drives[1], t.drives_ms);
            }
            seen_faults |= t.faults;
            seen_states |= 1u << t.state;
            least_N = fminf(least_N, t.before_N);
            given_J = fmaxf(given_J, t.given_J);
            if (t.detect_ms >= 0) {
                detect[0] = fmin(detect[0], t.detect_ms);
                detect[1] = fmax(detect[1], t.detect_ms);
            }
            if (t.zero_ms >= 0) {
                zero[0] = fmin(zero[0], t.zero_ms);
                zero[1] = fmax(zero[1], t.zero_ms);
            }
            /* Wrong readings that are plausible are believed where the wire has no CRC: what they
             * gave is found afterwards, and latches. */
            const bool believed = strncmp(s->list, "corrupt", 7) == 0;
            const bool found = believed && (t.faults & PALP_FAULT_ENERGY) != 0;
            const bool passive = found || t.given_J <= 1.1f * PALP_PASSIVITY_DEFICIT_J;
            if (t.sound && passive && t.recovered && in_time && as_specified(s, &t)) continue;
            good = false;
            report_faults(t.faults, states, sizeof states);
            snprintf(why, sizeof why,
                     "; %s, seed %llu: %s %s, seen %.1f ms, zero %.1f ms, %.2f mJ%s%s", devices[d],
                     (unsigned long long)*seed, report_state(t.state), states, t.detect_ms,
                     t.zero_ms, 1e3 * (double)t.given_J, t.sound ? "" : ", out of limits",
                     t.recovered ? "" : ", not recovered");
        }
    }
    report_faults(seen_faults, states, sizeof states);
    for (uint32_t i = 0; i <= PALP_STATE_HOMING; i++) {
        size_t used = strlen(states);
        if ((seen_states >> i & 1u) != 0)
            snprintf(states + used, sizeof states - used, " %s", report_state((palp_state)i));
    }
    char times[3][48] = {"-", "-", "-"};
    if (detect[1] > 0) snprintf(times[0], 48, "%.1f-%.1f ms", detect[0], detect[1]);
    if (zero[1] > 0) snprintf(times[1], 48, "%.1f-%.1f ms", zero[0], zero[1]);
    if (drives[1] > 0) snprintf(times[2], 48, "%.1f-%.1f ms", drives[0], drives[1]);
    CHECK(good, "%-24s seen %-16s zero %-16s at the motors %-16s from %.2f N, given %.3f mJ; %s%s",
          s->name, times[0], times[1], times[2], (double)least_N, 1e3 * (double)given_J, states,
          why);
}

/* The controller dies in the middle of a press; its successor finds drives that never let go by
 * themselves (ODrive's watchdog is off when it leaves the factory) and must first make them. */
static void test_death(void) {
    for (size_t d = 0; d < DEVICES; d++) {
        rig r;
        rig_start(&r, &body.blob, devices[d], 1000, "touch", NULL, 1);
        press(&r.bus.script);
        rig_run(&r, 1.3);
        double torque = 0;
        for (uint32_t i = 0; i < 3; i++)
            torque = fmax(torque, fabs(r.bus.device.drive[i].actual_Nm));
        palp_can_frame in[64];
        uint32_t events;
        int ms = 0;
        for (; ms < 200 && !drives_are_off(&r); ms++)
            (void)sim_bus_pass(&r.bus, 0.001, in, 64, &events);
        double limit = 1000 * (double)r.file.device.drives.watchdog_s + 3;
        CHECK(torque > 1e-3 && ms <= limit,
              "%s: controller dead: its watchdogs take %.1f mNm away in %d ms", devices[d],
              1000 * torque, ms);
        rig_stop(&r);

        rig_start(&r, &body.blob, devices[d], 1000, "touch", NULL, 1);
        press(&r.bus.script);
        rig_run(&r, 1.3);
        palp_servo_config config = rig_config(&r, &body.blob);
        size_t bytes = palp_servo_memsize(&body.blob, config.finest);
        void *memory = allocate_aligned(bytes, 1);
        if (palp_servo_open(&r.servo, &body.blob, &config, memory, bytes, NULL) != PALP_OK)
            die(EXIT_WORK, "the servo does not open");
        double worst = 0;
        for (int i = 0; i < 600; i++) {
            for (uint32_t k = 0; k < 3; k++) r.bus.device.drive[k].watchdog_s = 1e9;
            rig_tick(&r);
            for (uint32_t k = 0; k < 3 && i > 2 && r.report.state < PALP_STATE_RUN; k++)
                worst = fmax(worst, fabs(r.bus.device.drive[k].actual_Nm));
        }
        /* MIT's nearest torque to zero is half a step */
        double zero = r.file.device.drives.range.torque_Nm / 4095 * 1.01f + 1e-4f;
        CHECK(r.report.state == PALP_STATE_RUN && worst <= zero,
              "%s: a new controller takes old set-points away before anything else: %.2f mNm",
              devices[d], 1000 * worst);
        /* The same from DAMPING by a reset. */
        r.silent = true;
        rig_run(&r, 0.008);
        r.silent = false;
        rig_run(&r, 0.05);
        bool damping = r.report.state == PALP_STATE_DAMPING;
        r.more_events = PALP_EVENT_RESET;
        worst = 0;
        for (int i = 0; i < 600; i++) {
            for (uint32_t k = 0; k < 3; k++) r.bus.device.drive[k].watchdog_s = 1e9;
            rig_tick(&r);
            for (uint32_t k = 0; k < 3 && i > 2 && r.report.state < PALP_STATE_RUN; k++)
                worst = fmax(worst, fabs(r.bus.device.drive[k].actual_Nm));
        }
        CHECK(damping && r.report.state == PALP_STATE_RUN && worst <= zero,
              "%s: nor does one act after a reset from DAMPING: %.2f mNm", devices[d],
              1000 * worst);
        free(memory);
        rig_stop(&r);
    }
}

/* A hand that presses at an even speed, which no force turns away; the largest step of the force
 * while it does, with `lost` ticks without frames on the way. */
static double largest_step(const char *device, double speed_m_s, int lost, int window,
                           float *given_J, uint64_t *missed) {
    char list[64];
    rig r;
    const double begin = 1.0, depth = 0.012, at = begin + (0.001 + 0.6 * depth) / speed_m_s;
    snprintf(list, sizeof list, "loss@%g+%g", at, 0.001 * window - 0.0003);
    rig_start(&r, &body.blob, device, 1000, "touch", window > 0 ? list : NULL, 3);
    const hand_key keys[] = {{0, {0, 0, 0.01}},
                             {begin - 0.1, {0, 0, 0.001}},
                             {begin, {0, 0, 0.001}},
                             {begin + 100, {0, 0, 0.001 - 100 * speed_m_s}}};
    rig_lead(&r, keys, 4, 2e4, 60);
    r.bus.script.even = true;
    double most = 0;
    palp_vec3 before = {0, 0, 0};
    while (r.bus.time_s < begin + (0.001 + depth) / speed_m_s) {
        rig_tick(&r);
        if (r.bus.time_s > at - 0.003)
            most = fmax(most, (double)palp_norm(palp_sub(r.report.force_N, before)));
        before = r.report.force_N;
    }
    if (r.report.state != PALP_STATE_RUN) most = 1e9;
    const float given = r.report.given_J;
    const uint64_t late = palp_servo_counters(r.servo)->late / 3;
    rig_stop(&r);
    /* boards that answer each set-point are missed for a tick more */
    if (late > (uint64_t)lost)
        return largest_step(device, speed_m_s, lost, window - 1, given_J, missed);
    *missed = late > *missed ? late : *missed;
    *given_J = fmaxf(*given_J, given);
    return most;
}

static void test_continuity(void) {
    static const int lost[] = {1, 2, 3, 5};
    static const double speeds[] = {0.02, 0.05, 0.1, 0.2, 0.5};
    for (size_t d = 0; d < DEVICES; d++) {
        double worst = 0;
        float given_J = 0;
        char where[64] = "";
        uint64_t missed = 0;
        for (int s = 0; s < 5; s++) {
            const double ordinary = largest_step(devices[d], speeds[s], 0, 0, &given_J, &missed);
            for (int k = 0; k < 4; k++) {
                const double ratio =
                    largest_step(devices[d], speeds[s], lost[k], lost[k], &given_J, &missed) /
                    ordinary;
                if (ratio <= worst) continue;
                worst = ratio;
                snprintf(where, sizeof where, "%d at %g mm/s", lost[k], 1000 * speeds[s]);
            }
        }
        CHECK(worst <= 1.5 && !(given_J > 1e-6f) && missed == 5,
              "%s: 1 to 5 frames lost while pressing at 20 to 500 mm/s: step of the force %.2f of "
              "an ordinary one (%s), given %.3g J",
              devices[d], worst, where, (double)given_J);
    }
}

/* A little of everything, all the time. */
static void test_soup(uint64_t seed) {
    bool sound = true;
    uint64_t resets = 0, ticks = 0;
    for (size_t d = 0; d < DEVICES; d++) {
        rig r;
        rig_start(&r, &body.blob, devices[d], 1000, "touch",
                  "loss=0.02,duplicate=0.02,reorder=0.02,corrupt=0.002,delay@2+0.02=0.002",
                  seed + d);
        press(&r.bus.script);
        for (int i = 0; i < 20000; i++) {
            rig_tick(&r);
            sound = sound && rig_is_sound(&r);
            if (palp_state_is_stopped(r.report.state) && i % 100 == 0)
                r.more_events = PALP_EVENT_RESET;
        }
        resets += palp_servo_counters(r.servo)->resets;
        ticks += palp_servo_counters(r.servo)->ticks;
        rig_stop(&r);
    }
    all_ticks += ticks;
    CHECK(sound, "a soup of faults for %llu ticks: force finite and within limits (%llu resets)",
          (unsigned long long)ticks, (unsigned long long)resets);
}

int main(void) {
    progress_quiet(1);
    mesh control = mesh_load("blobs/rabbit.obj");
    mesh once = subdivide_loop(&control), twice = subdivide_loop(&once);
    body = model_bake(twice, 0.004, 0.05, false, false);
    uint64_t seed = 0;
    for (size_t i = 0; i < SPECIFICATIONS; i++) test_fault(&specifications[i], &seed);
    test_continuity();
    test_death();
    test_soup(1000);
    CHECK(all_ticks >= 250000 / EVERY * TRIALS, "%llu ticks in all", (unsigned long long)all_ticks);
    return tap_done();
}
