/* SPDX-License-Identifier: MIT */
/* Totals since the servo was opened; they never go down. */
#ifndef PALP_SERVO_COUNTERS_H
#define PALP_SERVO_COUNTERS_H

#include <stdint.h>

typedef struct {
    uint64_t ticks;
    uint64_t accepted; /* frames from our drives */
    uint64_t rejected; /* frames that are not from our drives, or malformed */
    uint64_t corrupt;  /* protected frames with a wrong CRC or sequence; malformed ones of ours */
    uint64_t repeated; /* a second estimate in one tick, or an old protected frame again */
    uint64_t gaps;     /* protected frames that came after others were lost */
    uint64_t late;     /* axes without an estimate in a tick of RUN */
    uint64_t implausible; /* estimates that were not believed */
    uint64_t frozen;      /* axes whose estimate has stood still for suspiciously long */
    uint64_t shortened;   /* ticks that did less than they would have with more time */
    uint64_t limited;     /* ticks whose force met a limit of the output chain */
    uint64_t braked;      /* ticks in which the passivity controller took force away */
    uint64_t overruns;    /* ticks longer than a period */
    uint64_t tardy;       /* ticks that the caller began more than half a period late */
    uint64_t skipped;     /* periods in which the caller did not tick */
    uint64_t bus_faults;  /* bus-off, link down, frames not taken */
    uint64_t bus_warnings, overflows; /* error-passive; frames that the receiver or the tick had no
                                         room for */
    uint64_t outside;                 /* ticks beyond the workspace or near a singular pose */
    uint64_t held;                    /* ticks that went on as foreseen (palp_report.held) */
    uint64_t coarsened, refined;      /* changes of the level of contact */
    uint64_t resets;                  /* by the operator */
} palp_counters;

#endif
