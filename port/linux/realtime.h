/* SPDX-License-Identifier: MIT */
/* Clock, pacing and real-time set-up. */
#ifndef PALP_PORT_REALTIME_H
#define PALP_PORT_REALTIME_H

#include <stdbool.h>
#include <stdint.h>

uint64_t monotonic_ns(void *context);

/* Sleeps until `deadline_ns` (monotonic) and returns how late it woke, in ns. */
uint64_t sleep_until(uint64_t deadline_ns);

/*
 * Locks memory, moves to SCHED_FIFO at `priority` (0: not) on processor `cpu` (-1: any), switches
 * subnormals off, and says on stderr what could not be had and how to mend it. With `strict` any of
 * these is fatal (exit 1).
 */
void realtime_setup(int cpu, int priority, bool strict);

#endif
