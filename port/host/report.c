/* SPDX-License-Identifier: MIT */
#include "port/host/report.h"
#include "port/host/util.h"
#include "port/host/view.h"
#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#define WIDTH 960
#define HEIGHT 220
#define LEFT 70
#define TOP 14
#define BOTTOM 30
#define MAX_POINTS 1500
#define BINS 48

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

/* Writes a line of the summary. */
typedef void line_writer(FILE *f, const char *name, const char *text);

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
    FILE *file;
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
    s->put(s->file, name, text);
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

static void summary_lines(FILE *f, const run_record *r, line_writer *put) {
    const summary s = {f, r, put};
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

static void put_plain(FILE *f, const char *name, const char *text) {
    fprintf(f, "%-18s %s\n", name, text);
}

void report_text(FILE *f, const run_record *r) { summary_lines(f, r, put_plain); }

/* ---- charts ---- */

typedef struct {
    double low, high;
    const char *unit;
} axis_range;

static double y_of(const axis_range *a, double v) {
    return TOP + (HEIGHT - TOP - BOTTOM) * (a->high - v) / (a->high - a->low);
}

static double x_of(const run_record *r, size_t i) {
    return LEFT + (WIDTH - LEFT - 10.0) * (double)i / (double)(r->count > 1 ? r->count - 1 : 1);
}

static void chart_begin(FILE *f, const char *title, const axis_range *a) {
    fprintf(f, "<h2>%s</h2>\n<svg class='chart' viewBox='0 0 %d %d'>\n", title, WIDTH, HEIGHT);
    for (int k = 0; k <= 4; k++) {
        double v = a->low + (a->high - a->low) * k / 4;
        fprintf(f,
                "<line class='grid' x1='%d' x2='%d' y1='%.1f' y2='%.1f'/><text class='tick' x='%d' "
                "y='%.1f'>%.3g</text>\n",
                LEFT, WIDTH - 10, y_of(a, v), y_of(a, v), LEFT - 6, y_of(a, v) + 4, v);
    }
    fprintf(f, "<text class='unit' x='12' y='%d'>%s</text>\n", HEIGHT / 2, a->unit);
}

static void time_axis(FILE *f, const run_record *r) {
    double seconds = (double)r->count / r->rate_hz;
    for (int k = 0; k <= 10; k++) {
        fprintf(f, "<text class='tick' x='%.1f' y='%d'>%.3g s</text>\n",
                LEFT + (WIDTH - LEFT - 10.0) * k / 10 + 10, HEIGHT - 10, seconds * k / 10);
    }
}

/* One curve; every stretch of ticks that shares a point is drawn as its largest excursion. */
static void curve(FILE *f, const run_record *r, uint32_t hand, const axis_range *a,
                  double (*value)(const palp_report *), const char *colour) {
    const palp_report *tick = r->hand[hand].tick;
    size_t stretch = r->count / MAX_POINTS + 1;
    fprintf(f, "<polyline fill='none' stroke='%s' stroke-width='1.3' points='", colour);
    for (size_t i = 0; i < r->count; i += stretch) {
        double v = value(&tick[i]);
        for (size_t k = i; k < i + stretch && k < r->count; k++) {
            double w = value(&tick[k]);
            if (fabs(w) > fabs(v)) v = w;
        }
        fprintf(f, "%.1f,%.1f ", x_of(r, i), y_of(a, v));
    }
    fputs("'/>\n", f);
}

static void extend(axis_range *a, const run_record *r, uint32_t hand,
                   double (*value)(const palp_report *)) {
    for (size_t i = 0; i < r->count; i++) {
        double v = value(&r->hand[hand].tick[i]);
        a->low = fmin(a->low, v);
        a->high = fmax(a->high, v);
    }
    if (!(a->high > a->low)) a->high = a->low + 1;
}

typedef struct {
    double (*value)(const palp_report *);
    const char *colour, *name;
} series;

static void chart(FILE *f, const run_record *r, uint32_t hand, const char *title, const char *unit,
                  const series *s, size_t count) {
    axis_range a = {0, 0, unit};
    char of[160];
    snprintf(of, sizeof of, "%s: device %" PRIu32 ", %s", title, hand, r->hand[hand].device_name);
    for (size_t i = 0; i < count; i++) extend(&a, r, hand, s[i].value);
    chart_begin(f, r->hands > 1 ? of : title, &a);
    for (size_t i = 0; i < count; i++) curve(f, r, hand, &a, s[i].value, s[i].colour);
    time_axis(f, r);
    fputs("</svg>\n<p class='key'>", f);
    for (size_t i = 0; i < count; i++)
        fprintf(f, "<span style='color:%s'>&#9632;</span> %s &nbsp; ", s[i].colour, s[i].name);
    fputs("</p>\n", f);
}

static double force_norm(const palp_report *t) { return (double)palp_norm(t->force_N); }
static double force_x(const palp_report *t) { return (double)t->force_N.x; }
static double force_y(const palp_report *t) { return (double)t->force_N.y; }
static double force_z(const palp_report *t) { return (double)t->force_N.z; }
static double stored(const palp_report *t) { return 1e3 * (double)t->stored_J; }
static double absorbed(const palp_report *t) { return 1e3 * (double)t->absorbed_J; }
static double active(const palp_report *t) { return t->active; }
static double points(const palp_report *t) { return t->points; }
static double level(const palp_report *t) { return t->level; }
static double tip_z(const palp_report *t) { return 1e3 * (double)t->tip_m.z; }

static void histogram(FILE *f, const run_record *r) {
    float *us = tick_times_us(r);
    double count[BINS] = {0};
    /* Bins grow by a constant factor over six decades, from 0.1 us to 100 ms. */
    for (size_t i = 0; i < r->count; i++) {
        double bin = (log10(fmax((double)us[i], 0.1)) + 1) * BINS / 6;
        count[bin >= BINS ? BINS - 1 : (int)bin] += 1;
    }
    axis_range a = {0, log10((double)r->count) + 0.1, "ticks"};
    fprintf(f, "<h2>Latency of the tick</h2>\n<svg class='chart' viewBox='0 0 %d %d'>\n", WIDTH,
            HEIGHT);
    for (int k = 0; k <= (int)a.high; k++) {
        fprintf(f,
                "<line class='grid' x1='%d' x2='%d' y1='%.1f' y2='%.1f'/><text class='tick' x='%d' "
                "y='%.1f'>%.0f</text>\n",
                LEFT, WIDTH - 10, y_of(&a, k), y_of(&a, k), LEFT - 6, y_of(&a, k) + 4, pow(10, k));
    }
    double w = (WIDTH - LEFT - 10.0) / BINS;
    for (int k = 0; k < BINS; k++) {
        double height = count[k] > 0 ? log10(count[k]) + 0.1 : 0;
        fprintf(f, "<rect class='bar' x='%.1f' width='%.1f' y='%.1f' height='%.1f'/>\n",
                LEFT + w * k, w - 1.5, y_of(&a, height), y_of(&a, 0) - y_of(&a, height));
    }
    for (int decade = -1; decade <= 5; decade++) {
        fprintf(f, "<text class='tick' x='%.1f' y='%d'>%g us</text>\n",
                LEFT + w * BINS * (decade + 1) / 6.0 + 14, HEIGHT - 10, pow(10, decade));
    }
    fputs("</svg>\n", f);
    free(us);
}

static void put_row(FILE *f, const char *name, const char *text) {
    fprintf(f, "<tr><td>%s</td><td>", name);
    print_escaped(f, text);
    fputs("</td></tr>\n", f);
}

void report_html(FILE *f, const run_record *r) {
    static const series force[] = {{force_norm, "#222", "norm"},
                                   {force_x, "#c0392b", "x"},
                                   {force_y, "#27853f", "y"},
                                   {force_z, "#2d6cb5", "z"}};
    static const series energy[] = {{absorbed, "#8e44ad", "absorbed from the hand"},
                                    {stored, "#d68910", "stored in body and coupling"}};
    static const series contact[] = {{points, "#bbb", "contact points"},
                                     {active, "#2d6cb5", "in contact"},
                                     {level, "#c0392b", "level"}};
    static const series motion[] = {{tip_z, "#222", "tip height"}};
    fprintf(
        f,
        "<!DOCTYPE html>\n<html lang='en'><head><meta charset='utf-8'><title>Palp "
        "run</title>\n<style>\n"
        "body{font:15px/1.45 system-ui,sans-serif;max-width:1000px;margin:24px auto;padding:0 "
        "16px;color:#222;background:#fff}\n"
        "h1{font-size:24px}h2{font-size:17px;margin:26px 0 "
        "4px}.chart{width:100%%;background:#fbfaf8;border:1px solid #e5e1da}\n"
        ".grid{stroke:#e2ddd4}.tick{font-size:11px;fill:#666;text-anchor:end}.unit{font-size:12px;"
        "fill:#444}.bar{fill:#2d6cb5}\n"
        ".key{margin:2px 0;color:#555;font-size:13px}table{border-collapse:collapse}td{padding:2px "
        "14px 2px 0;vertical-align:top}\n"
        "td:first-child{color:#666;white-space:nowrap}</style></head><body>\n<h1>Palp: ");
    print_escaped(f, r->title);
    fputs("</h1>\n<table>\n", f);
    summary_lines(f, r, put_row);
    fputs("</table>\n", f);
    if (r->displacement_m != NULL) {
        fputs("<h2>At the largest force</h2>\n", f);
        view_draw(f, r->blob, r->displacement_m, r->tool_m, r->tool_radius_m, WIDTH, 560);
    }
    for (uint32_t h = 0; h < r->hands; h++) {
        chart(f, r, h, "Force on the hand", "N", force, 4);
        chart(f, r, h, "Energy", "mJ", energy, 2);
    }
    histogram(f, r);
    chart(f, r, 0, "Contact and level", "", contact, 3);
    for (uint32_t h = 0; h < r->hands; h++) chart(f, r, h, "Motion", "mm", motion, 1);
    fputs("</body></html>\n", f);
}
