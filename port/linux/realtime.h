/* SPDX-License-Identifier: MIT */
/* Clock, pacing and real-time set-up. */
#ifndef PALP_PORT_REALTIME_H
#define PALP_PORT_REALTIME_H

#include "port/linux/startup.h"
#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>

uint64_t monotonic_ns(void *context);

/* Sleeps until `deadline_ns` (monotonic) and returns how late it woke, in ns. */
uint64_t sleep_until(uint64_t deadline_ns);

typedef struct {
    int cpu;      /* -1: any */
    int priority; /* SCHED_FIFO; 0: ordinary scheduling */
    bool strict;  /* refuse to go on without what real time needs */
    const char
        *bus[STARTUP_BUSES]; /* CAN interfaces of the devices; none where they are simulated */
    uint32_t buses, frames[STARTUP_BUSES]; /* frames: most that one tick sends on each */
} realtime_spec;

/*
 * Before any thread: looks at the system (startup.h) and at what this process may do, says on
 * stderr all that is missing and how to mend it (with `strict` exits 1 then), locks memory, and
 * keeps the processors out of deep sleep. Without a priority or `strict` it only says, where there
 * is a bus, that nothing is guaranteed.
 */
void realtime_prepare(const realtime_spec *spec);

/*
 * Runs `body` in a thread of its own with the scheduling asked for, its stack touched beforehand;
 * the thread's `name` (15 characters) is what ps -L shows.
 * Exits 2 when the processor does not exist; without the right to SCHED_FIFO it warns and runs in
 * ordinary scheduling, or exits 1 when strict.
 */
pthread_t realtime_start(const realtime_spec *spec, const char *name, void *(*body)(void *),
                         void *context);

/* Page faults of the calling thread so far that needed no disk. */
uint64_t minor_faults(void);

#endif
