/* SPDX-License-Identifier: MIT */
/* What a run was like: a summary in text, and one self-contained HTML page. */
#ifndef PALP_SIM_REPORT_H
#define PALP_SIM_REPORT_H

#include "port/host/record.h"
#include <stdio.h>

typedef struct {
    palp_report *tick; /* one per tick */
    float *late_us;    /* wake-up lateness of each tick; NULL when the run was not paced */
    size_t count;
    run_totals totals;
    bool totalled; /* they are known */
    bool from_log; /* then ticks lack what a log does not hold */
    double rate_hz;
    /* The instant of the largest force, for the picture. */
    float *displacement_m; /* [nodes][3] */
    float tool_m[3], tool_radius_m;
    const char *blob_name, *device_name, *bus_name, *bus_load;
    const palp_blob *blob;
} run_record;

void report_text(FILE *f, const run_record *r);
void report_html(FILE *f, const run_record *r);

/* Names of a state and of latched faults, for people. */
const char *report_state(palp_state state);
void report_faults(uint32_t faults, char *text, size_t size);

/* Smallest of absorbed - 0 over the run: how close the hand came to being given energy (J, device
 * units). */
float smallest_energy_margin(const run_record *r);

#endif
