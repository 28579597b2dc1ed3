/* SPDX-License-Identifier: MIT */
/*
 * Self-contained pages: a table of what is to be said, then curves over time with one cursor, events, the body
 * at that time, and how often what took how long. One style for all of them (page/).
 *
 * Calls in this order: page_begin; page_row for each line; page_curves; for each chart page_chart and
 * page_curve for each of its curves; page_events and page_event for each; page_end.
 */
#ifndef PALP_HOST_PAGE_H
#define PALP_HOST_PAGE_H

#include "port/host/motion.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#define PAGE_BUCKETS                                                                               \
    8192u /* of a curve that is kept: of a longer one the least and the most of each */
#define PAGE_EVENTS 200u /* that are marked */

typedef struct {
    FILE *file;
    uint32_t charts, curves, events;
    bool in_table;
} page;

void page_begin(page *p, FILE *f, const char *title);
/* A line of the table; word (may be NULL): what it means, shown on hover. */
void page_row(page *p, const char *name, const char *word, const char *text);
/* Ends the table, where something else comes behind it. */
void page_close_table(page *p);
/* What write(file, context) writes, in lines as they are. */
typedef void page_writer(FILE *f, const void *context);
void page_lines(page *p, page_writer *write, const void *context);

void page_curves(page *p);
typedef enum { PAGE_FREE, PAGE_ZERO, PAGE_WHOLE } page_axis; /* zero in sight; whole numbers too */
void page_chart(page *p, const char *title, const char *word, const char *unit, page_axis axis);
/* value(context, i) of sample i, of `count` from t0_s on every dt_s; step: it holds in between. */
typedef double page_value(const void *context, size_t i);
typedef struct {
    const char *name;
    double t0_s, dt_s;
    size_t count;
    bool step;
} page_curve_spec;
void page_curve(page *p, const page_curve_spec *curve, page_value *value, const void *context);

void page_events(page *p);
void page_event(page *p, double t_s, bool bad, const char *text);

/* motion (may be NULL); x[count] (may be NULL) is drawn as a histogram. */
typedef struct {
    const motion *motion;
    const char *histogram, *unit;
    const float *x;
    size_t count;
} page_rest;
void page_end(page *p, const page_rest *rest);

/* Text in a JSON string. */
void page_put_json(FILE *f, const char *text);
/* A part of the page as it is built in (assets.h). */
void page_put_asset(FILE *f, int which);

#endif
