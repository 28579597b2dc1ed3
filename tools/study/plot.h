/* SPDX-License-Identifier: MIT */
/* Line charts as self-contained SVG. */
#ifndef PALP_TOOLS_PLOT_H
#define PALP_TOOLS_PLOT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

typedef struct {
    char name[80];
    size_t count;
    const double *x, *y;
    bool faint, dots; /* drawn pale; without lines */
} plot_series;

typedef struct {
    const char *title, *x_label, *y_label;
    bool log_x, log_y;
    const plot_series *series;
    size_t count;
} plot_chart;

void plot_svg(FILE *f, const plot_chart *chart);

#endif
