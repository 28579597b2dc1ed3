/* SPDX-License-Identifier: MIT */
#include "port/host/report.h"
#include "core/servo/safety.h"
#include "port/host/page.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

static int compare_floats(const void *a, const void *b) {
    float p = *(const float *)a, q = *(const float *)b;
    return p < q ? -1 : p > q;
}

typedef struct {
    double p50, p99, p999, max;
} quantiles;

static quantiles quantiles_of(const float *x, size_t n) {
    quantiles q = {0};
    if (n == 0) return q;
    float *sorted = allocate(n, sizeof *sorted);
    memcpy(sorted, x, n * sizeof *sorted);
    qsort(sorted, n, sizeof *sorted, compare_floats);
    q.p50 = (double)sorted[n / 2];
    q.p99 = (double)sorted[(size_t)(0.99 * (double)(n - 1))];
    q.p999 = (double)sorted[(size_t)(0.999 * (double)(n - 1))];
    q.max = (double)sorted[n - 1];
    free(sorted);
    return q;
}

void run_body_add(run_body *b, const palp_body_report *r) {
    b->ticks++;
    b->at_level[r->level < PALP_CONTACT_LEVELS ? r->level : PALP_CONTACT_LEVELS - 1u]++;
    b->touching += r->active > 0 ? 1 : 0;
    b->held += r->held ? 1 : 0;
    b->shortened += r->shortened ? 1 : 0;
    b->spent += (r->flags & PALP_CONTACT_SPENT) != 0 ? 1 : 0;
    b->full += (r->flags & PALP_CONTACT_FULL) != 0 ? 1 : 0;
    b->most_points = r->points > b->most_points ? r->points : b->most_points;
    b->most_active = r->active > b->most_active ? r->active : b->most_active;
    b->doubt_N = fmaxf(b->doubt_N, r->doubt_N);
}

static float *tick_times_us(const run_record *r) {
    float *us = allocate(r->count, sizeof *us);
    for (size_t i = 0; i < r->count; i++) us[i] = r->hand[0].tick[i].elapsed_ns * 1e-3f;
    return us;
}

float smallest_energy_margin(const run_record *r, uint32_t hand) {
    float smallest = 0;
    for (size_t i = 0; i < r->count; i++)
        smallest = fminf(smallest, r->hand[hand].tick[i].absorbed_J);
    return smallest;
}

/* The largest deficit of the run that was not a doubt of the encoders. */
static float largest_given(const run_record *r, uint32_t hand) {
    float most = 0;
    for (size_t i = 0; i < r->count; i++) most = fmaxf(most, r->hand[hand].tick[i].given_J);
    return most;
}

const char *report_state(palp_state state) {
    static const char *const names[] = {PALP_STATE_NAMES};
    return names[state];
}

void report_faults(uint32_t faults, char *text, size_t size) {
    const char *name = PALP_FAULT_NAMES;
    size_t used = 0;
    text[0] = '\0';
    for (uint32_t bit = 1; *name != '\0'; bit <<= 1) {
        int length = (int)strcspn(name, " ");
        if ((faults & bit) != 0 && used < size) {
            used += (size_t)snprintf(text + used, size - used, "%s%.*s", used > 0 ? ", " : "",
                                     length, name);
        }
        name += length + (name[length] == ' ' ? 1 : 0);
    }
}

static float largest_force(const run_record *r, uint32_t hand) {
    float largest = 0;
    for (size_t i = 0; i < r->count; i++)
        largest = fmaxf(largest, palp_norm(r->hand[hand].tick[i].force_N));
    return largest;
}

/* Writes a line of the summary to a file or a page. */
typedef void line_writer(void *to, const char *name, const char *text);

#define NOT_IN_LOG "not in the log, which ends before the run does"

/* "level 4 in 9000 ticks, 3 in 200", finest first. */
static void describe_levels(const size_t count[PALP_CONTACT_LEVELS], char *text, size_t size) {
    size_t used = 0;
    text[0] = '\0';
    for (uint32_t l = PALP_CONTACT_LEVELS; l-- > 0 && used < size;) {
        if (count[l] == 0) continue;
        int n = snprintf(text + used, size - used, "%s%" PRIu32 " in %zu%s",
                         used == 0 ? "level " : ", ", l, count[l], used == 0 ? " ticks" : "");
        used += n > 0 ? (size_t)n : 0;
    }
}

/* Writes the lines of a summary, one after the other. */
typedef struct {
    void *to;
    const run_record *r;
    line_writer *put;
} summary;

static void line(const summary *s, const char *name, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

static void line(const summary *s, const char *name, const char *format, ...) {
    char text[512];
    va_list values;
    va_start(values, format);
    vsnprintf(text, sizeof text, format, values);
    va_end(values);
    s->put(s->to, name, text);
}

/* What a run is, and in which state it ended. */
static void lines_of_run(const summary *s) {
    const run_record *r = s->r;
    for (uint32_t h = 0; h < r->hands; h++) {
        const run_hand *of = &r->hand[h];
        const palp_report *last = &of->tick[r->count - 1];
        char faults[128];
        report_faults(last->faults, faults, sizeof faults);
        if (h == 0)
            line(s, "ticks", "%zu at %g Hz over bus %s, device %s", r->count, r->rate_hz,
                 of->bus_name, of->device_name);
        else
            line(s, "and", "over bus %s, device %s", of->bus_name, of->device_name);
        line(s, "state", "%s, faults latched: %s", report_state(last->state),
             last->faults != 0 ? faults : "none");
    }
}

static void lines_of_time(const summary *s) {
    const run_record *r = s->r;
    const palp_counters *c = &r->hand[0].totals.counters;
    float *us = tick_times_us(r);
    const quantiles q = quantiles_of(us, r->count);
    if (r->totalled)
        line(s, "overruns",
             "%" PRIu64 " ticks longer than the period, %" PRIu64 " periods skipped, %" PRIu64
             " ticks shortened by the clock",
             c->overruns, c->skipped, c->shortened);
    else
        line(s, "overruns", NOT_IN_LOG);
    line(s, "tick latency", "p50 %.1f us, p99 %.1f us, p99.9 %.1f us, max %.1f us", q.p50, q.p99,
         q.p999, q.max);
    if (r->late_us != NULL) {
        const quantiles w = quantiles_of(r->late_us, r->count);
        line(s, "wake-up lateness", "p50 %.1f us, p99 %.1f us, p99.9 %.1f us, max %.1f us", w.p50,
             w.p99, w.p999, w.max);
    }
    free(us);
}

/* A body, from what was added up of it. */
static void lines_of_body(const summary *s, const run_body *b) {
    static const char *const kind[] = {"elastic", "zones", "dynamic"};
    char levels[256];
    describe_levels(b->at_level, levels, sizeof levels);
    line(s, "body", "%s (%s): %s, %zu ticks held as foreseen, %zu shortened", b->name,
         kind[b->kind], levels, b->held, b->shortened);
    line(s, "contact",
         "%zu ticks touching, at most %" PRIu32 " of %" PRIu32
         " points in contact; %zu ticks with an active set not settled, %zu short of room; forces "
         "may have been off by %.3g N at most",
         b->touching, b->most_active, b->most_points, b->spent, b->full, (double)b->doubt_N);
}

/* The one body, from the ticks. */
static void lines_of_contact(const summary *s) {
    const run_record *r = s->r;
    const palp_counters *c = &r->hand[0].totals.counters;
    run_body sum = {.name = ""};
    for (uint32_t b = 0; b < r->bodies; b++) lines_of_body(s, &r->body[b]);
    if (r->bodies > 0) return;
    for (size_t i = 0; i < r->count; i++) {
        const palp_report *t = &r->hand[0].tick[i];
        const palp_body_report of = {.level = t->level,
                                     .points = t->points,
                                     .active = t->active,
                                     .flags = t->contact_flags,
                                     .held = t->held,
                                     .doubt_N = t->doubt_N};
        run_body_add(&sum, &of);
    }
    char levels[256];
    describe_levels(sum.at_level, levels, sizeof levels);
    if (r->totalled)
        line(s, "levels",
             "%s; made coarser %" PRIu64 " times, finer again %" PRIu64
             "; %zu ticks held as foreseen",
             levels, c->coarsened, c->refined, sum.held);
    else
        line(s, "levels", "%s; %zu ticks held as foreseen", levels, sum.held);
    if (r->from_log)
        line(s, "contact",
             "%zu ticks touching, at most %" PRIu32 " of %" PRIu32
             " points in contact; how well they were settled is not in a log",
             sum.touching, sum.most_active, sum.most_points);
    else
        line(s, "contact",
             "%zu ticks touching, at most %" PRIu32 " of %" PRIu32
             " points in contact; %zu ticks with an active set not settled, %zu short of room; the "
             "force may have been off by %.3g N at most",
             sum.touching, sum.most_active, sum.most_points, sum.spent, sum.full,
             (double)sum.doubt_N);
}

void run_joints_of(run_record *r, const scene_setup *s) {
    r->joints = 0;
    for (uint32_t d = 0; d < s->config.drives; d++) {
        const palp_scene_drive *of = &s->drive[d];
        if (of->by != PALP_DRIVEN_BY_FRAMES) continue;
        const char *bus = s->file->device[of->hand].bus;
        /* scenes come and go */
        r->joint[r->joints++] = (run_joint){.name = copy_string(s->file->follow[d].joint),
                                            .bus = copy_string(bus[0] != '\0' ? bus : "loop"),
                                            .id = of->id};
    }
}

static void lines_of_joints(const summary *s) {
    for (uint32_t j = 0; j < s->r->joints; j++) {
        const run_joint *of = &s->r->joint[j];
        const palp_setpoint *p = &of->at;
        line(s, "joint",
             "%s: %" PRIu64 " set-points in frames 0x%" PRIx32 " on %s, the last %.3g s before the "
             "end, %" PRIu64 " not finite; stands at %.4g",
             of->name, p->taken, of->id, of->bus, (double)p->age / s->r->rate_hz, p->left,
             (double)p->value);
    }
}

static void lines_of_bus(const summary *s, uint32_t hand) {
    const run_record *r = s->r;
    const run_totals *total = &r->hand[hand].totals;
    const palp_counters *c = &total->counters;
    if (r->totalled)
        line(s, "frames",
             "%" PRIu64 " accepted, %" PRIu64 " rejected, %" PRIu64 " repeated, %" PRIu64
             " late, %" PRIu64 " implausible; %" PRIu64 " sent, %" PRIu64 " lost; %" PRIu64
             " dropped by the kernel",
             c->accepted, c->rejected, c->repeated, c->late, c->implausible, total->frames_sent,
             total->frames_lost, total->frames_dropped);
    else
        line(s, "frames", NOT_IN_LOG);
    line(s, "bus", "%s", r->hand[hand].bus_load);
    if (r->totalled)
        line(s, "guards",
             "%" PRIu64 " corrupt, %" PRIu64 " gaps, %" PRIu64 " frozen; %" PRIu64
             " ticks braked for passivity, %" PRIu64 " outside, %" PRIu64 " tardy; bus: %" PRIu64
             " faults, %" PRIu64 " warnings, %" PRIu64 " overflows; %" PRIu64 " resets",
             c->corrupt, c->gaps, c->frozen, c->braked, c->outside, c->tardy, c->bus_faults,
             c->bus_warnings, c->overflows, c->resets);
    else
        line(s, "guards", NOT_IN_LOG);
    if (r->totalled)
        line(s, "loop",
             "%" PRIu64 " minor page faults after the start, %" PRIu64 " ticks not on record",
             total->minor_faults, total->unrecorded);
    else
        line(s, "loop", NOT_IN_LOG);
}

static void lines_of_force(const summary *s, uint32_t hand) {
    const run_record *r = s->r;
    const palp_report *last = &r->hand[hand].tick[r->count - 1];
    if (r->totalled)
        line(s, "largest force", "%.3f N (limited in %" PRIu64 " ticks)",
             (double)largest_force(r, hand), r->hand[hand].totals.counters.limited);
    else
        line(s, "largest force", "%.3f N", (double)largest_force(r, hand));
    line(s, "energy",
         "given to the hand: %.3g J (beyond what it had put in); absorbed from it %.4g J at the "
         "end, smallest margin %.3g J",
         (double)largest_given(r, hand), (double)last->absorbed_J,
         (double)smallest_energy_margin(r, hand));
}

static void summary_lines(void *to, const run_record *r, line_writer *put) {
    const summary s = {to, r, put};
    lines_of_run(&s);
    lines_of_time(&s);
    lines_of_contact(&s);
    lines_of_joints(&s);
    for (uint32_t h = 0; h < r->hands; h++) {
        if (r->hands > 1)
            line(&s, "device", "%" PRIu32 ": %s on %s", h, r->hand[h].device_name,
                 r->hand[h].bus_name);
        lines_of_bus(&s, h);
        lines_of_force(&s, h);
    }
}

static void put_plain(void *file, const char *name, const char *text) {
    fprintf((FILE *)file, "%-18s %s\n", name, text);
}

void report_text(FILE *f, const run_record *r) { summary_lines(f, r, put_plain); }

/* ---- the page ---- */

/* What the lines of the summary mean, shown on hover. */
static const char *const words[][2] = {
    {"ticks", "How many periods of the controller, how often, on which bus and device"},
    {"and", "A further device of the scene"},
    {"state", "RUN is what should be; DAMPING, FAULT and ESTOP take the force away until a reset"},
    {"overruns", "Ticks longer than the period, periods without a tick, ticks that did less for "
                 "want of time: should be 0"},
    {"tick latency", "From the beginning of a tick to its frames: median, 99 %, 99.9 %, longest; "
                     "should stay below the period"},
    {"wake-up lateness", "How much later than asked the system woke the loop"},
    {"levels",
     "Ticks on each level of contact: coarser ones have fewer contact points and take less time"},
    {"contact",
     "Ticks that touch; points of the surface that carry force; how well they were settled"},
    {"body",
     "One body of the scene: its kind, ticks on each level, ticks held as foreseen or shortened"},
    {"joint", "A joint that another controller moves by set-points in frames"},
    {"device", "The lines that follow are of this device"},
    {"frames", "CAN frames: all but accepted and sent should be 0"},
    {"bus", "Share of the bus that the frames of one period take at worst"},
    {"guards", "What the guards met: protected frames damaged or missing, encoders frozen, ticks "
               "braked for passivity"},
    {"loop", "Page faults in the loop after its start, ticks that came too fast to be recorded: "
             "should be 0"},
    {"largest force", "At the hand"},
    {"energy", "Given to the hand beyond what it put in: should be 0; absorbed from it at the end"},
};

static void put_row(void *to, const char *name, const char *text) {
    const char *word = NULL;
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++)
        if (strcmp(words[i][0], name) == 0) word = words[i][1];
    page_row(to, name, word, text);
}

/* What a curve shows of a device's ticks. */
typedef struct {
    const run_record *r;
    const palp_report *tick;
    double (*value)(const palp_report *);
} curve;

static double curve_value(const void *context, size_t i) {
    const curve *c = context;
    return c->value(&c->tick[i]);
}
static double late_value(const void *context, size_t i) {
    const curve *c = context;
    return (double)c->r->late_us[i];
}

static double force_norm(const palp_report *t) { return (double)palp_norm(t->force_N); }
static double force_x(const palp_report *t) { return (double)t->force_N.x; }
static double force_y(const palp_report *t) { return (double)t->force_N.y; }
static double force_z(const palp_report *t) { return (double)t->force_N.z; }
static double stored(const palp_report *t) { return 1e3 * (double)t->stored_J; }
static double absorbed(const palp_report *t) { return 1e3 * (double)t->absorbed_J; }
static double given(const palp_report *t) { return 1e3 * (double)t->given_J; }
static double active(const palp_report *t) { return t->active; }
static double points(const palp_report *t) { return t->points; }
static double level(const palp_report *t) { return t->level; }
static double tip_x(const palp_report *t) { return 1e3 * (double)t->tip_m.x; }
static double tip_y(const palp_report *t) { return 1e3 * (double)t->tip_m.y; }
static double tip_z(const palp_report *t) { return 1e3 * (double)t->tip_m.z; }
static double bound_us(const palp_report *t) { return 1e-3 * (double)t->bound_ns; }
static double latency(const palp_report *t) { return 1e-3 * (double)t->elapsed_ns; }

typedef struct {
    double (*value)(const palp_report *);
    const char *name;
    bool step;
} series;

static const series of_force[] = {{force_norm, "force", false},
                                  {force_x, "x", false},
                                  {force_y, "y", false},
                                  {force_z, "z", false}};
static const series of_place[] = {{tip_z, "z", false}, {tip_x, "x", false}, {tip_y, "y", false}};
static const series of_level[] = {{level, "level", true}};
static const series of_points[] = {{active, "in contact", true}, {points, "laid", true}};
static const series of_energy[] = {{absorbed, "absorbed from the hand", false},
                                   {stored, "stored in body and coupling", false},
                                   {given, "given to the hand", false}};

typedef struct {
    const char *title, *word, *unit;
    page_axis axis;
    const series *series;
    size_t count;
    bool of_each; /* device */
} chart;

#define CHART(title, word, unit, axis, list, of_each)                                              \
    { title, word, unit, axis, list, sizeof list / sizeof list[0], of_each }

static const chart charts[] = {
    CHART("Force on the hand",
          "What the device renders at its tip, and its parts along the device's axes", "N",
          PAGE_ZERO, of_force, true),
    CHART("Place of the tip",
          "In the device's coordinates: z = 0 is where the tool just touches, above 0 is away from "
          "the body",
          "mm", PAGE_FREE, of_place, true),
    CHART("Level of contact",
          "Coarser levels, with smaller numbers, have fewer contact points and take less time", "",
          PAGE_WHOLE, of_level, false),
    CHART("Contact points",
          "Places of the surface under the tool: those that carry force, of those that were laid",
          "", PAGE_WHOLE, of_points, false),
    CHART("Energy",
          "Absorbed and stored may rise and fall; given to the hand, beyond what it has put in, "
          "should stay 0",
          "mJ", PAGE_ZERO, of_energy, true)};

static void put_curve(page *p, const run_record *r, uint32_t hand, const series *s) {
    const curve c = {r, r->hand[hand].tick, s->value};
    const page_curve_spec spec = {s->name, r->first_s, 1 / r->rate_hz, r->count, s->step};
    page_curve(p, &spec, curve_value, &c);
}

static void put_chart(page *p, const run_record *r, const chart *of, uint32_t hand) {
    char title[160];
    snprintf(title, sizeof title, "%s: device %" PRIu32 ", %s", of->title, hand,
             r->hand[hand].device_name);
    page_chart(p, r->hands > 1 && of->of_each ? title : of->title, of->word, of->unit, of->axis);
    for (size_t i = 0; i < of->count; i++) put_curve(p, r, hand, &of->series[i]);
}

static void put_latency(page *p, const run_record *r) {
    static const series tick = {latency, "tick", false};
    const curve c = {r, NULL, NULL};
    page_chart(
        p, "Latency",
        "From the beginning of a tick to its frames; the most that it could take, known before it "
        "began; and how much later than asked the system woke the loop",
        "us", PAGE_ZERO);
    put_curve(p, r, 0, &tick);
    static const series bound = {bound_us, "bound", true};
    if (!r->from_log) put_curve(p, r, 0, &bound);
    const page_curve_spec late = {"wake-up", r->first_s, 1 / r->rate_hz, r->count, false};
    if (r->late_us != NULL) page_curve(p, &late, late_value, &c);
}

/* ---- what happened ---- */

static const struct {
    uint32_t bit;
    bool bad;
    const char *text;
} bus_events[] = {{PALP_EVENT_BUS_OFF, true, "bus off"},
                  {PALP_EVENT_BUS_DOWN, true, "bus down"},
                  {PALP_EVENT_BUS_FULL, true, "bus full: a frame was not sent"},
                  {PALP_EVENT_BUS_WARNING, true, "bus warns of errors"},
                  {PALP_EVENT_OVERFLOW, true, "frames were dropped on the way in"},
                  {PALP_EVENT_LATE, true, "begun late"},
                  {PALP_EVENT_RESET, false, "reset by the operator"},
                  {PALP_EVENT_ESTOP, true, "emergency stop"}};

/* What begins in tick i, and was not so in the one before. */
static void put_events_at(page *p, const run_record *r, uint32_t hand, size_t i) {
    const run_hand *h = &r->hand[hand];
    const palp_report *now = &h->tick[i], *before = i > 0 ? &h->tick[i - 1] : NULL;
    const double t_s = r->first_s + (double)i / r->rate_hz;
    char text[192], which[24] = "", faults[128];
    if (r->hands > 1) snprintf(which, sizeof which, "device %" PRIu32 ": ", hand);
    if (before == NULL || now->state != before->state) {
        snprintf(text, sizeof text, "%s%s", which, report_state(now->state));
        page_event(p, t_s, palp_state_is_stopped(now->state), text);
    }
    const uint32_t fresh = now->faults & ~(before != NULL ? before->faults : 0);
    if (fresh != 0) {
        report_faults(fresh, faults, sizeof faults);
        snprintf(text, sizeof text, "%s%s", which, faults);
        page_event(p, t_s, true, text);
    }
    if (h->events == NULL) return;
    const uint32_t new_events = h->events[i] & ~(i > 0 ? h->events[i - 1] : 0);
    for (size_t k = 0; k < sizeof bus_events / sizeof bus_events[0]; k++) {
        if ((new_events & bus_events[k].bit) == 0) continue;
        snprintf(text, sizeof text, "%s%s", which, bus_events[k].text);
        page_event(p, t_s, bus_events[k].bad, text);
    }
}

void report_html(FILE *f, const run_record *r) {
    page p;
    page_begin(&p, f, r->title);
    summary_lines(&p, r, put_row);
    page_curves(&p);
    for (size_t c = 0; c < sizeof charts / sizeof charts[0]; c++) {
        for (uint32_t h = 0; h < (charts[c].of_each ? r->hands : 1); h++)
            put_chart(&p, r, &charts[c], h);
        if (charts[c].series == of_points) put_latency(&p, r);
    }
    page_events(&p);
    for (size_t i = 0; i < r->count; i++)
        for (uint32_t h = 0; h < r->hands; h++) put_events_at(&p, r, h, i);
    float *us = tick_times_us(r);
    page_end(&p, &(page_rest){.motion = r->motion,
                              .histogram = "Latency of the tick: how often",
                              .unit = "us",
                              .x = us,
                              .count = r->count});
    free(us);
}
