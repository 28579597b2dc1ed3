/* SPDX-License-Identifier: MIT */
/*
 * palp zwidth: the largest stiffness that the simulated device renders stably, by the whole servo
 * on a stiff body, against rate, delay and the mechanism's damping, beside the line of Colgate and
 * Schenkel, K = b / (T / 2 + t_d); and whether the passivity controller keeps every configuration
 * stable, far beyond that line.
 */
#include "core/servo/servo.h"
#include "sim/virtual_time.h"
#include "port/host/args.h"
#include "tools/cli/commands.h"
#include "port/host/blobfile.h"
#include "port/host/parallel.h"
#include "tools/study/plot.h"
#include "port/host/util.h"
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

static const char help[] =
    "usage: palp zwidth BLOB --device NAME|FILE [-o DIR]\n"
    "\n"
    "Presses the simulated device on a stiff body with a wide flat face (bake one with --young\n"
    "1e9; on a curved one the tool swings aside) at 250 Hz to 4 kHz, with estimates fresh and a\n"
    "period old, with three dampings of the mechanism, and looks for the\n"
    "largest stable stiffness without the passivity controller. Then tries stiffnesses up to 30\n"
    "times as large with it, as far as the servo takes them: exit 1 if any goes unstable. DIR\n"
    "(default: zwidth) gets zwidth.csv and zwidth.svg.\n";

static const option options[] = {{"--device", 1}, {"-o", 1}, {NULL, 0}};

typedef struct {
    const char *blob, *device, *folder;
} zwidth_spec;

static void set_option(void *context, const argument *a) {
    zwidth_spec *s = context;
    if (a->option == NULL) {
        if (s->blob != NULL) die(EXIT_USAGE, "one blob, not also '%s'", a->value[0]);
        s->blob = a->value[0];
    } else if (strcmp(a->option, "--device") == 0) {
        s->device = a->value[0];
    } else {
        s->folder = a->value[0];
    }
}

static const float rates_hz[] = {250, 500, 1000, 2000, 4000};
static const float dampings[] = {0.2f, 0.6f, 2.0f};
#define RATES 5
#define DAMPINGS 3
#define DELAYS 2
#define HANDS 2
#define ENCODER 4194304.0f /* counts: so fine that it does not matter here */
#define LOW_N_PER_M 5.0
#define HIGH_N_PER_M 60000.0
#define TREMOR_M 5e-6 /* encoders that stand still are taken for broken ones */

/* Hands that hardly damp: what stays stable with them does with others. */
static const double hands[HANDS][2] = {{60, 0.1}, {400, 0.3}};

typedef struct {
    const palp_blob *blob;
    const device_file *file;
    float rate_hz, damping;
    uint32_t delay;
} setting;

/* The device as this setting has it. */
static device_file file_of(const setting *s) {
    device_file f = *s->file;
    palp_device *d = &f.device;
    d->drives.protocol = s->delay == 0 ? PALP_PROTOCOL_PALP : PALP_PROTOCOL_MOTEUS;
    d->drives.fd = true;
    d->drives.rate_hz = s->rate_hz;
    d->drives.counts_per_rev = ENCODER;
    d->data_rate_bps = 5e6f;
    d->damping_Ns_per_m = s->damping;
    d->slew_max_N_per_s = 1e6f;
    f.friction_N = 0;
    return f;
}

static double stiffest(const setting *s) {
    device_file f = file_of(s);
    return (double)palp_device_stiffest(&f.device);
}

/* RMS speed of the tip along the surface's normal over `seconds`. */
static double rms_speed(rig *r, double seconds) {
    double sum = 0;
    int n = 0;
    for (double end = r->bus.time_s + seconds; r->bus.time_s < end; n++) {
        rig_tick(r);
        sum += r->bus.device.v_m_s[2] * r->bus.device.v_m_s[2];
    }
    return sqrt(sum / n);
}

/* Touches the body and lets go of nothing: an oscillation that does not die is unstable. */
static bool stable(const setting *s, double stiffness, bool guarded) {
    bool good = true;
    for (int h = 0; h < HANDS && good; h++) {
        rig r = {.file = file_of(s)};
        palp_servo_config config = rig_config(&r, s->blob);
        config.cost.ns_per_instruction = 0.01f;
        config.coupling_N_per_m = (float)stiffness;
        config.unguarded = !guarded;
        rig_open(&r, s->blob, &config, "touch", NULL, 1);
        static const hand_key keys[] = {
            {0, {0, 0, 0.004}}, {0.6, {0, 0, 0.001}}, {0.7, {0, 0, -0.006}}};
        rig_lead(&r, keys, 3, hands[h][0], hands[h][1]);
        r.bus.script.tremor_m = TREMOR_M;
        rig_run(&r, 0.9);
        double early = rms_speed(&r, 0.3);
        rig_run(&r, 2.0);
        double late = rms_speed(&r, 0.3);
        if (!(r.largest_N > 0)) die(EXIT_WORK, "the tool does not reach the body");
        /* One that flies about until a guard ends it is unstable too. */
        good = r.report.state == PALP_STATE_RUN && (late < 0.003 || late < 0.7 * early);
        rig_stop(&r);
    }
    return good;
}

static double largest_stable(const setting *s) {
    double low = LOW_N_PER_M, high = HIGH_N_PER_M;
    if (!stable(s, low, false)) return 0;
    while (high / low > 1.05) {
        double middle = sqrt(low * high);
        if (stable(s, middle, false))
            low = middle;
        else
            high = middle;
    }
    return low;
}

/* Multiples of the unguarded limit up to 30, within what can be asked for. */
static const double multiples[] = {1.2, 2, 4, 8, 15, 30};
#define MULTIPLES 6

typedef struct {
    setting s;
    double limit, line;
    int unstable; /* of the guarded multiples */
    double worst; /* stiffness of the first */
} measurement;

static void measure(void *context, size_t i) {
    measurement *m = (measurement *)context + i;
    double period = 1 / (double)m->s.rate_hz;
    double lag = (double)m->s.file->device.drives.torque_lag_s; /* part of the delay */
    m->line = (double)m->s.damping / (period / 2 + m->s.delay * period + lag);
    m->limit = largest_stable(&m->s);
    for (int k = 0; k < MULTIPLES; k++) {
        double stiffness = fmin(multiples[k] * fmax(m->limit, LOW_N_PER_M), stiffest(&m->s));
        if (stable(&m->s, stiffness, true)) continue;
        if (m->unstable++ == 0) m->worst = stiffness;
    }
}

static void write_chart(FILE *f, const measurement *m) {
    plot_series series[2 * DAMPINGS * DELAYS];
    static double x[RATES], y[2 * DAMPINGS * DELAYS][RATES];
    size_t n = 0;
    for (int i = 0; i < RATES; i++) x[i] = (double)rates_hz[i];
    for (int line = 1; line >= 0; line--) {
        for (int d = 0; d < DELAYS * DAMPINGS; d++, n++) {
            const measurement *row = m + d * RATES;
            for (int i = 0; i < RATES; i++)
                y[n][i] = line == 1 ? row[i].line : fmax(row[i].limit, 1);
            series[n] = (plot_series){.count = RATES, .x = x, .y = y[n], .faint = line == 1};
            snprintf(series[n].name, sizeof series[n].name, "%sb = %.1f Ns/m, %s",
                     line == 1 ? "Colgate: " : "", (double)row->s.damping,
                     row->s.delay == 0 ? "fresh" : "one period old");
        }
    }
    plot_chart chart = {.title = "Largest stable stiffness without the passivity controller",
                        .x_label = "rate, Hz",
                        .y_label = "N/m",
                        .log_x = true,
                        .log_y = true,
                        .series = series,
                        .count = n};
    plot_svg(f, &chart);
}

static output open_in(const char *folder, const char *name) {
    static char path[2][512];
    static int turn;
    snprintf(path[turn], sizeof path[0], "%s/%s", folder, name);
    return open_output(path[turn++ % 2]);
}

int command_zwidth(int argc, char **argv) {
    zwidth_spec s = {.folder = "zwidth"};
    args_parse(argc, argv, options, help, set_option, &s);
    if (s.blob == NULL || s.device == NULL) die(EXIT_USAGE, "need a blob and --device (--help)");
    device_file file = device_load(s.device);
    palp_blob blob = load_blob(s.blob);
    if (mkdir(s.folder, 0777) != 0 && errno != EEXIST)
        die(EXIT_USAGE, "-o: cannot make %s: %s", s.folder, strerror(errno));
    measurement m[DELAYS * DAMPINGS * RATES];
    for (int i = 0; i < DELAYS * DAMPINGS * RATES; i++)
        m[i] = (measurement){.s = {.blob = &blob,
                                   .file = &file,
                                   .rate_hz = rates_hz[i % RATES],
                                   .damping = dampings[i / RATES % DAMPINGS],
                                   .delay = (uint32_t)(i / (RATES * DAMPINGS))}};
    parallel_for(DELAYS * DAMPINGS * RATES, measure, m);
    output csv = open_in(s.folder, "zwidth.csv"), svg = open_in(s.folder, "zwidth.svg");
    fputs("rate_hz,delay_periods,damping_Ns_per_m,largest_stable_N_per_m,colgate_N_per_m,"
          "guarded_up_to_N_per_m,guarded_unstable\n",
          csv.file);
    printf("%8s %6s %8s %12s %12s %14s %s\n", "rate", "delay", "b Ns/m", "stable N/m",
           "Colgate N/m", "guarded up to", "of them unstable");
    int unstable = 0;
    for (int i = 0; i < DELAYS * DAMPINGS * RATES; i++) {
        double most =
            fmin(multiples[MULTIPLES - 1] * fmax(m[i].limit, LOW_N_PER_M), stiffest(&m[i].s));
        fprintf(csv.file, "%g,%u,%.9g,%.6g,%.6g,%.6g,%d\n", (double)m[i].s.rate_hz, m[i].s.delay,
                (double)m[i].s.damping, m[i].limit, m[i].line, most, m[i].unstable);
        printf("%8g %6u %8.1f %12.0f %12.0f %14.0f %d", (double)m[i].s.rate_hz, m[i].s.delay,
               (double)m[i].s.damping, m[i].limit, m[i].line, most, m[i].unstable);
        if (m[i].unstable > 0) printf(" from %.0f N/m", m[i].worst);
        putchar('\n');
        unstable += m[i].unstable;
    }
    write_chart(svg.file, m);
    commit_output(&csv);
    commit_output(&svg);
    printf(
        "with the passivity controller %d of %d configurations are unstable; see %s/zwidth.svg\n",
        unstable, DELAYS * DAMPINGS * RATES * MULTIPLES, s.folder);
    return unstable == 0 ? EXIT_SUCCESS : EXIT_WORK;
}
