/* SPDX-License-Identifier: MIT */
#include "tools/study/plot.h"
#include "port/host/util.h"
#include <math.h>

#define WIDTH 640.0
#define HEIGHT 400.0
#define LEFT 70.0
#define RIGHT 180.0
#define TOP 34.0
#define BOTTOM 46.0

static const char *const colours[] = {"#0b6e99", "#c4442b", "#3b8132", "#8a4f9e",
                                      "#b8860b", "#444444", "#d0608a", "#20808d"};

typedef struct {
    double low, high;
    bool log;
} axis_range;

static double scaled(const axis_range *a, double v) {
    return a->log ? (log10(v) - log10(a->low)) / (log10(a->high) - log10(a->low))
                  : (v - a->low) / (a->high - a->low);
}

static axis_range range_of(const plot_chart *c, bool x) {
    axis_range a = {HUGE_VAL, -HUGE_VAL, x ? c->log_x : c->log_y};
    for (size_t s = 0; s < c->count; s++) {
        for (size_t i = 0; i < c->series[s].count; i++) {
            double v = x ? c->series[s].x[i] : c->series[s].y[i];
            if (!isfinite(v) || (a.log && !(v > 0))) continue;
            a.low = fmin(a.low, v);
            a.high = fmax(a.high, v);
        }
    }
    if (!(a.high > a.low)) {
        a.low = a.log ? 0.1 : 0;
        a.high = a.log ? 10 : 1;
    }
    if (a.log) {
        a.low = pow(10, log10(a.low) - 0.05);
        a.high = pow(10, log10(a.high) + 0.05);
    } else {
        double room = 0.05 * (a.high - a.low);
        a.low = a.low >= 0 && a.low < room * 4 ? 0 : a.low - room;
        a.high += room;
    }
    return a;
}

/* Round values inside the range, at most about seven. */
static size_t ticks_of(const axis_range *a, double tick[24]) {
    size_t n = 0;
    if (a->log) {
        static const double steps[] = {1, 2, 5};
        double decades = log10(a->high / a->low);
        for (int e = (int)floor(log10(a->low)); e <= (int)ceil(log10(a->high)); e++) {
            for (int k = 0; k < (decades > 2.5 ? 1 : 3) && n < 24; k++) {
                double v = steps[k] * pow(10, e);
                if (v >= a->low && v <= a->high) tick[n++] = v;
            }
        }
        return n;
    }
    double rough = (a->high - a->low) / 6, power = pow(10, floor(log10(rough)));
    double step = power * (rough / power < 1.5 ? 1 : rough / power < 3.5 ? 2 : 5);
    for (double v = ceil(a->low / step) * step; v <= a->high + step * 1e-9 && n < 24; v += step)
        tick[n++] = fabs(v) < step * 1e-9 ? 0 : v;
    return n;
}

static double place_x(const axis_range *a, double v) {
    return LEFT + scaled(a, v) * (WIDTH - LEFT - RIGHT);
}
static double place_y(const axis_range *a, double v) {
    return HEIGHT - BOTTOM - scaled(a, v) * (HEIGHT - TOP - BOTTOM);
}

static void draw_axes(FILE *f, const plot_chart *c, const axis_range *x, const axis_range *y) {
    double tick[24];
    fprintf(f, "<rect x='%g' y='%g' width='%g' height='%g' fill='none' stroke='#999'/>\n", LEFT,
            TOP, WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM);
    size_t n = ticks_of(x, tick);
    for (size_t i = 0; i < n; i++) {
        double at = place_x(x, tick[i]);
        fprintf(f,
                "<path d='M%.1f %gV%g' stroke='#eee'/><text x='%.1f' y='%g' "
                "text-anchor='middle'>%g</text>\n",
                at, TOP, HEIGHT - BOTTOM, at, HEIGHT - BOTTOM + 15, tick[i]);
    }
    n = ticks_of(y, tick);
    for (size_t i = 0; i < n; i++) {
        double at = place_y(y, tick[i]);
        fprintf(f,
                "<path d='M%g %.1fH%g' stroke='#eee'/><text x='%g' y='%.1f' "
                "text-anchor='end'>%g</text>\n",
                LEFT, at, WIDTH - RIGHT, LEFT - 6, at + 4, tick[i]);
    }
    fprintf(f, "<text x='%g' y='%g' text-anchor='middle'>%s</text>\n", (LEFT + WIDTH - RIGHT) / 2,
            HEIGHT - 10, c->x_label);
    fprintf(f, "<text transform='translate(16 %g) rotate(-90)' text-anchor='middle'>%s</text>\n",
            (TOP + HEIGHT - BOTTOM) / 2, c->y_label);
}

static void draw_series(FILE *f, const plot_series *s, size_t number, const axis_range *x,
                        const axis_range *y) {
    const char *colour = colours[number % (sizeof colours / sizeof colours[0])];
    bool begun = false;
    fprintf(f, "<g stroke='%s' fill='%s' opacity='%s'>\n", colour, colour, s->faint ? "0.4" : "1");
    if (!s->dots) fprintf(f, "<path fill='none' stroke-width='1.6' d='");
    for (size_t i = 0; i < s->count && !s->dots; i++) {
        if (!isfinite(s->y[i]) || (y->log && !(s->y[i] > 0)) || (x->log && !(s->x[i] > 0)))
            continue;
        fprintf(f, "%c%.1f %.1f", begun ? 'L' : 'M', place_x(x, s->x[i]), place_y(y, s->y[i]));
        begun = true;
    }
    if (!s->dots) fprintf(f, "'/>\n");
    for (size_t i = 0; i < s->count; i++) {
        if (!isfinite(s->y[i]) || (y->log && !(s->y[i] > 0)) || (x->log && !(s->x[i] > 0)))
            continue;
        fprintf(f, "<circle cx='%.1f' cy='%.1f' r='%s' stroke='none'/>\n", place_x(x, s->x[i]),
                place_y(y, s->y[i]), s->dots ? "1.1" : "2.4");
    }
    fprintf(f, "<text x='%g' y='%g' stroke='none'>", WIDTH - RIGHT + 12,
            TOP + 14 + 17 * (double)number);
    print_escaped(f, s->name);
    fputs("</text></g>\n", f);
}

void plot_svg(FILE *f, const plot_chart *chart) {
    axis_range x = range_of(chart, true), y = range_of(chart, false);
    fprintf(f,
            "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 %g %g' font-family='sans-serif' "
            "font-size='11'>\n<rect width='%g' height='%g' fill='#fff'/>\n"
            "<text x='%g' y='20' font-size='13' font-weight='bold'>%s</text>\n",
            WIDTH, HEIGHT, WIDTH, HEIGHT, LEFT, chart->title);
    draw_axes(f, chart, &x, &y);
    for (size_t i = 0; i < chart->count; i++) draw_series(f, &chart->series[i], i, &x, &y);
    fprintf(f, "</svg>\n");
}
