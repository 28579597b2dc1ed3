/* SPDX-License-Identifier: MIT */
/* The table of felt quality: rows of a measure, its case and value, what a hand just notices, and
 * the goal. */
#ifndef PALP_TOOLS_FEEL_TABLE_H
#define PALP_TOOLS_FEEL_TABLE_H

#include <stddef.h>
#include <stdio.h>

typedef struct {
    char measure[32], of[80];
    double value;
    const char *unit;
    double threshold, goal; /* NAN: none; a goal is met by a magnitude of at most that */
} feel_row;

typedef struct {
    feel_row *row;
    size_t count, room;
} feel_table;

void feel_add(feel_table *table, const char *measure, const char *of, double value,
              const char *unit, double threshold, double goal);
void feel_text(FILE *f, const feel_table *table);
void feel_json(FILE *f, const feel_table *table);
void feel_html(FILE *f, const feel_table *table);

#endif
