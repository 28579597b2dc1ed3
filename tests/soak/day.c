/* SPDX-License-Identifier: MIT */
/*
 * A day of work in virtual time: HOURS (24) at 1 kHz, minute by minute. In each a hand comes, goes
 * along a random path through the body, rests on it, and leaves; in four minutes of five something
 * goes wrong meanwhile. The servo is never opened anew. A minute draws the same whatever was before
 * it: FIRST_MINUTE lives one again.
 *
 *   - forces and torques are finite and within limits, in every tick
 *   - every counter that moves is explained by what went wrong in that minute
 *   - the hand is given at most 1 mJ in a touch, or the device damps; but where bits of frames are
 *     wrong (ODrive's frames have no checksum, its drives turn as a wrong one says), and while
 *     encoders are stuck that have not yet been found out
 *   - the force at rest has no line above 0.01 N from 20 to 500 Hz
 *   - a reset brings it back to RUN, every time
 */
#include "port/host/report.h"
#include "sim/virtual_time.h"
#include "sim/spectrum.h"
#include "tests/tap.h"
#include "port/host/blobfile.h"
#include "port/host/util.h"
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#define MINUTE_S 60.0
#define RATE_HZ 1000
#define REST_S 3.0 /* on the body; the last second of it is listened to */
#define LISTENED 1000
#define BUZZ_N 0.01
#define GIVEN_J 1e-3
#define SLIP_TICKS 8           /* in which a contact is looked for anew (core/servo/answer.c) */
#define MADE_J (0.2 * GIVEN_J) /* from which the guard brakes */
#define MADE_MOST_J 0.01

typedef struct {
    const char *name;
    size_t offset;
} counter;
#define COUNTER(x)                                                                                 \
    { #x, offsetof(palp_counters, x) }
static const counter counters[] = {COUNTER(rejected),    COUNTER(corrupt),   COUNTER(repeated),
                                   COUNTER(gaps),        COUNTER(late),      COUNTER(frozen),
                                   COUNTER(implausible), COUNTER(braked),    COUNTER(overruns),
                                   COUNTER(tardy),       COUNTER(skipped),   COUNTER(bus_faults),
                                   COUNTER(outside),     COUNTER(overflows), COUNTER(bus_warnings),
                                   COUNTER(held),        COUNTER(shortened), COUNTER(limited)};
#define COUNTERS (sizeof counters / sizeof counters[0])

/* What may go wrong, with the time of onset, and the counters that it explains. */
typedef struct {
    const char *list, *explains;
} trouble;
static const trouble troubles[] = {
    {"loss@%.3f+0.005", "late repeated"},
    {"loss@%.3f+2=0.05", "late repeated"},
    {"loss@%.3f+0.05", "late repeated"},
    {"delay@%.3f+0.05=0.0009", "late repeated"},
    {"delay@%.3f+0.2=0.02", "late repeated braked"},
    {"duplicate@%.3f+0.5", "repeated"},
    {"reorder@%.3f+0.5", "repeated late"},
    {"corrupt@%.3f+0.1=0.3",
     "rejected corrupt implausible late repeated outside limited braked held"},
    {"stuck@%.3f+1", "frozen late repeated implausible braked limited held"},
    {"jump@%.3f+0.1", "implausible late"},
    {"glitch@%.3f+0.5", "implausible late"},
    {"nan@%.3f+0.1", "implausible late repeated"},
    {"drive@%.3f+0.3", "late"},
    {"busoff@%.3f+0.05", "bus_faults late"},
    {"enobufs@%.3f+0.005", "bus_faults late"},
    {"overrun@%.3f=1", "skipped repeated late tardy braked"},
    {"overrun@%.3f=3", "skipped repeated late tardy braked"},
    {"overrun@%.3f=10", "skipped repeated late tardy braked"},
    {"overrun@%.3f=40", "skipped repeated late tardy braked"}};
#define TROUBLES (sizeof troubles / sizeof troubles[0])

typedef struct {
    char list[256];      /* of faults */
    char explains[1024]; /* names of counters */
} plan;

/* Up to three troubles between two times; none in one minute of five. */
static plan make_plan(uint64_t minute, uint64_t *dice, double from, double to) {
    plan p = {.list = ""};
    if (minute % 5 == 0) return p;
    const int count = 1 + (int)(3 * fabs(tap_random(dice)));
    for (int i = 0; i < count && i < 3; i++) {
        const trouble *t =
            &troubles[(size_t)((double)TROUBLES * fabs(tap_random(dice))) % TROUBLES];
        char one[64];
        snprintf(one, sizeof one, t->list, from + (to - from) * fabs(tap_random(dice)));
        snprintf(p.list + strlen(p.list), sizeof p.list - strlen(p.list), "%s%s", i > 0 ? "," : "",
                 one);
        snprintf(p.explains + strlen(p.explains), sizeof p.explains - strlen(p.explains), " %s",
                 t->explains);
    }
    return p;
}

/* A servo that is new or was reset looks for its tool among all nodes first. */
static uint64_t looks(const palp_blob *blob, uint64_t begun) {
    return begun * ((blob->meta->nodes + PALP_COUPLING_SEARCHED - 1u) / PALP_COUPLING_SEARCHED);
}

static bool explains(const plan *p, const char *name) {
    const size_t n = strlen(name);
    for (const char *at = p->explains; (at = strstr(at, name)) != NULL; at += n) {
        if (at[-1] == ' ' && (at[n] == ' ' || at[n] == '\0')) return true;
    }
    return false;
}

/* A hand that comes, wanders, rests, and leaves. *rest_s: when it begins to rest. */
#define KEYS 16
static void make_keys(hand_key keys[KEYS], uint64_t *dice, double begin, double radius,
                      double *rest_s) {
    const double away = 0.5 * radius;
    double t = begin;
    keys[0] = (hand_key){t, {0, 0, away}};
    for (int i = 1; i < KEYS - 4; i++) {
        t += 0.2 + 0.5 * fabs(tap_random(dice));
        keys[i] = (hand_key){t,
                             {0.25 * radius * tap_random(dice), 0.25 * radius * tap_random(dice),
                              radius * (0.15 * tap_random(dice) - 0.05)}};
    }
    keys[KEYS - 4] = (hand_key){t + 0.5, {0, 0, -0.1 * radius}};
    keys[KEYS - 3] = (hand_key){t + 0.5 + REST_S, {0, 0, -0.1 * radius}};
    keys[KEYS - 2] = (hand_key){t + 1 + REST_S, {0, 0, away}};
    keys[KEYS - 1] = (hand_key){begin + 2 * MINUTE_S, {0, 0, away}};
    *rest_s = t + 0.5;
}

typedef struct {
    uint64_t minutes, troubled, unexplained, unsound, resets, stuck, damped, buzzing, touches;
    uint64_t made, slipped;
    double given_J, most_J, blind_J, buzz_N, made_J;
    char first[512]; /* of what was wrong */
} day;

static void note(day *d, const char *what, uint64_t minute, const plan *p, double value) {
    if (d->first[0] != '\0') return;
    snprintf(d->first, sizeof d->first, "; first: %s (%g) in minute %llu of '%s'", what, value,
             (unsigned long long)minute, p->list);
}

static uint64_t value_of(const palp_counters *c, size_t offset) {
    uint64_t v;
    memcpy(&v, (const char *)c + offset, sizeof v);
    return v;
}

/* Energy of the mechanism's own books, touch by touch. */
typedef struct {
    double zero_J, most_J;
    int without;
    bool touching;
} books;

static void keep_books(books *b, const rig *r, double before_J, day *d) {
    const bool forced = palp_norm(r->report.force_N) > 0;
    b->without = forced ? 0 : b->without + 1;
    if (forced && !b->touching) {
        *b = (books){.zero_J = before_J, .touching = true};
        d->touches++;
    }
    if (b->touching) b->most_J = fmax(b->most_J, r->bus.device.given_J - b->zero_J);
    if (b->touching && b->without > 6) b->touching = false;
}

/*
 * What the contact stores and what its force has done along the tip's path, between readings, can
 * together only fall. Where they rise, the contact made energy: it came late upon a part of the
 * surface, or its path did not close (`make feel`). The guard brakes for that as for any other; so
 * the largest rise before it brakes explains that it does. A tool that slips off a tip is held
 * where it was for a few ticks, until the contact is found again or given up.
 */
typedef struct {
    palp_vec3 tip_m, force_N;
    double work_J, least_J, made_J;
    bool braked;
    uint32_t held, longest_held; /* ticks in a row, with a force */
    uint64_t slips;              /* contacts that were lost after such */
} contact_books;

static void keep_contact_books(contact_books *b, const palp_report *report) {
    const palp_vec3 mean_N = palp_scale(0.5f, palp_add(b->force_N, report->force_N));
    b->braked = b->braked || report->braked;
    const bool forced = palp_norm(report->force_N) > 0;
    b->slips += b->held > 0 && !forced; /* given up */
    b->held = report->held && forced ? b->held + 1 : 0;
    if (b->held > b->longest_held) b->longest_held = b->held;
    b->work_J += (double)palp_dot(mean_N, palp_sub(report->tip_m, b->tip_m));
    b->tip_m = report->tip_m;
    b->force_N = report->force_N;
    const double sum_J = b->work_J + (double)report->stored_J;
    b->least_J = fmin(b->least_J, sum_J);
    if (!b->braked) b->made_J = fmax(b->made_J, sum_J - b->least_J);
}

/* Whether the contact itself says why this counter moved, without a fault. */
static bool contact_explains(day *d, const contact_books *c, size_t offset, uint64_t moved) {
    if (offset == offsetof(palp_counters, braked) && c->made_J > MADE_J) {
        d->made++;
        d->made_J = fmax(d->made_J, c->made_J);
        return true;
    }
    if (offset == offsetof(palp_counters, held) && c->longest_held <= SLIP_TICKS &&
        moved <= SLIP_TICKS * (c->slips + 1)) {
        d->slipped++;
        return true;
    }
    return false;
}

/* Draws what a minute draws, without living it. */
static void skip_a_minute(uint64_t minute, uint64_t *dice) {
    hand_key keys[KEYS];
    double rest_s;
    make_keys(keys, dice, 0, 1, &rest_s);
    make_plan(minute, dice, 0, 1);
}

static void live_a_minute(rig *r, const palp_blob *blob, day *d, uint64_t minute, uint64_t *dice) {
    static double force_N[LISTENED];
    hand_key keys[KEYS];
    const double begin = r->bus.time_s, radius = (double)r->file.device.workspace_radius_m;
    double rest_s;
    make_keys(keys, dice, begin + 0.5, radius, &rest_s);
    const plan p = make_plan(minute, dice, begin + 1, rest_s - 0.5);
    r->bus.faults = p.list[0] != '\0' ? faults_read(p.list, minute) : (fault_list){.seed = minute};
    rig_lead(r, keys, KEYS, 800, 10);
    r->bus.script.tremor_m = 2e-5; /* encoders that stand still are taken for broken ones */
    const palp_counters before = *palp_servo_counters(r->servo);
    books b = {.touching = false};
    contact_books c = {.tip_m = r->report.tip_m};
    uint32_t listened = 0;
    bool damped = false, sound = true;
    while (r->bus.time_s < begin + MINUTE_S) {
        const double before_J = r->bus.device.given_J;
        rig_tick(r);
        sound = sound && rig_is_sound(r);
        keep_books(&b, r, before_J, d);
        keep_contact_books(&c, &r->report);
        damped = damped || r->report.state != PALP_STATE_RUN;
        if (r->report.state != PALP_STATE_RUN && r->bus.time_s > rest_s + REST_S + 1)
            r->more_events = PALP_EVENT_RESET;
        if (r->bus.time_s > rest_s + REST_S - 1.1 && listened < LISTENED)
            force_N[listened++] = (double)palp_norm(r->report.force_N);
    }
    const palp_counters *after = palp_servo_counters(r->servo);
    d->minutes++;
    d->troubled += p.list[0] != '\0';
    d->damped += damped;
    d->resets += after->resets - before.resets;
    const uint64_t begun = after->resets - before.resets + (d->minutes == 1 ? 1u : 0u);
    for (size_t i = 0; i < COUNTERS; i++) {
        uint64_t moved =
            value_of(after, counters[i].offset) - value_of(&before, counters[i].offset);
        if (counters[i].offset == offsetof(palp_counters, held)) /* looking for the tool */
            moved -= moved < looks(blob, begun) ? moved : looks(blob, begun);
        if (moved == 0 || explains(&p, counters[i].name)) continue;
        if (contact_explains(d, &c, counters[i].offset, moved)) continue;
        d->unexplained++;
        note(d, counters[i].name, minute, &p, (double)moved);
    }
    if (!sound) d->unsound++, note(d, "out of limits", minute, &p, 0);
    if (r->report.state != PALP_STATE_RUN) d->stuck++, note(d, "not in RUN again", minute, &p, 0);
    const bool blind = strstr(p.list, "corrupt") != NULL || strstr(p.list, "stuck") != NULL;
    if (blind) d->blind_J = fmax(d->blind_J, b.most_J);
    if (!blind) d->most_J = fmax(d->most_J, b.most_J);
    if (!damped && !blind) d->given_J = fmax(d->given_J, b.most_J);
    if (!blind && b.most_J > 1.1 * GIVEN_J) note(d, "energy given, J", minute, &p, b.most_J);
    const double line = damped ? 0 : spectrum_largest(force_N, LISTENED, RATE_HZ, 20, 500);
    d->buzz_N = fmax(d->buzz_N, line);
    if (line > BUZZ_N) d->buzzing++, note(d, "a line of the force at rest, N", minute, &p, line);
}

int main(int argc, char **argv) {
    if (argc < 2) {
        fprintf(stderr, "usage: day BLOB [HOURS [DEVICE [FIRST_MINUTE]]]\n");
        return EXIT_USAGE;
    }
    program_name = "day";
    double hours = 24;
    if (argc > 2 && (!parse_double(argv[2], &hours) || !(hours > 0)))
        die(EXIT_USAGE, "'%s' is no number of hours", argv[2]);
    const char *device = argc > 3 ? argv[3] : "arm3";
    double first = 0;
    if (argc > 4 && (!parse_double(argv[4], &first) || !(first >= 0)))
        die(EXIT_USAGE, "'%s' is no minute", argv[4]);
    const palp_blob blob = load_blob(argv[1]);
    rig r = {.file = device_load(device)};
    r.file.device.drives.rate_hz = RATE_HZ;
    palp_servo_config config = rig_config(&r, &blob);
    config.cost.ns_per_instruction = 0.01f;
    rig_open(&r, &blob, &config, "touch", NULL, 1);
    day d = {.minutes = 0};
    uint64_t dice = 20261129;
    const uint64_t from = (uint64_t)first, end = from + (uint64_t)ceil(60 * hours);
    for (uint64_t m = 0; m < from; m++) skip_a_minute(m, &dice);
    for (uint64_t m = from; m < end; m++) {
        live_a_minute(&r, &blob, &d, m, &dice);
        if (m % 60 == 59) {
            printf("# hour %llu\n", (unsigned long long)(m / 60 + 1));
            fflush(stdout);
        }
    }
    const unsigned long long all = d.minutes;
    CHECK(d.unsound == 0,
          "%s, %llu minutes, %llu with faults, %llu touches: out of limits in %llu%s", device, all,
          (unsigned long long)d.troubled, (unsigned long long)d.touches,
          (unsigned long long)d.unsound, d.first);
    CHECK(d.unexplained == 0,
          "counters that nothing explains: %llu; minutes in which the tool slipped off: %llu, in "
          "which the contact made energy: %llu, at most %.3g mJ",
          (unsigned long long)d.unexplained, (unsigned long long)d.slipped,
          (unsigned long long)d.made, 1e3 * d.made_J);
    CHECK(d.slipped + d.made <= 2 + all / 100 && d.made_J <= MADE_MOST_J,
          "and those are about 1 in 100 minutes at most, and %.3g mJ", 1e3 * MADE_MOST_J);
    CHECK(d.buzzing == 0, "force at rest: largest line %.4f N from 20 to 500 Hz", d.buzz_N);
    CHECK(d.given_J <= GIVEN_J, "energy given in a touch: at most %.3g mJ", 1e3 * d.given_J);
    CHECK(
        d.most_J <= 1.1 * GIVEN_J,
        "and where the device damped (%llu minutes): %.3g mJ; with frames corrupted on the wire or "
        "encoders stuck, which nobody can see at once, %.3g mJ",
        (unsigned long long)d.damped, 1e3 * d.most_J, 1e3 * d.blind_J);
    CHECK(d.stuck == 0, "in RUN again after every fault (%llu resets)",
          (unsigned long long)d.resets);
    rig_stop(&r);
    return tap_done();
}
