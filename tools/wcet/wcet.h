/* SPDX-License-Identifier: MIT */
/* The parts of palp wcet: the table of bounds (wcet.c) and the search for what comes near them. */
#ifndef PALP_TOOLS_WCET_H
#define PALP_TOOLS_WCET_H

#include "port/host/machine.h"

typedef enum { WCET_BALL, WCET_PAD, WCET_CYLINDER } wcet_tool;

typedef struct {
    const char *blob, *target, *keep, *replay, *device;
    double rate_hz, radius_m, margin, search_s, ns_per_operation;
    wcet_tool tool;
    uint32_t tools;               /* how many */
    bool friction, limited, json; /* limited: --limits was given */
} wcet_spec;

typedef struct {
    char step[12], counts[64];
    int level, outer; /* of contact, of seams, or of meshes; -1: approximate seams */
    double instructions, bytes, cycles; /* cycles: 0 where they are not stated */
} wcet_row;

typedef struct {
    wcet_row *row;
    size_t rows, capacity;
    size_t ram_bytes, stack_bytes;
} wcet_table;

/* One row more. */
void wcet_add(wcet_table *table, const char *step, const char *counts, int level, int outer,
              double instructions, double bytes);

/* Looks for the most expensive tick on each level for so many seconds and says on stderr how near
 * it comes to the bound; writes its path to spec->keep. */
void wcet_search(const wcet_spec *spec, const machine *m, const palp_blob *blob);
/* Goes along a kept path and prints a line per tick. Returns the exit code. */
int wcet_replay(const wcet_spec *spec, const machine *m, const palp_blob *blob);

/* palp wcet: argv with the command's name first; returns the exit code. */
int command_wcet(int argc, char **argv);

#endif
