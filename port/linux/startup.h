/* SPDX-License-Identifier: MIT */
/* What the system around the loop lacks for real time: kernel, limits, clock, processor, interrupts
 * and interfaces, as /proc and /sys tell it, each with what mends it. */
#ifndef PALP_PORT_STARTUP_H
#define PALP_PORT_STARTUP_H

#include <stdint.h>

#define STARTUP_BUSES 8u

typedef struct {
    const char *root; /* before every path of /proc and /sys; "" for the system itself */
    int cpu;          /* of the loop; -1: any */
    int priority;     /* SCHED_FIFO; 0: ordinary scheduling */
    const char *bus[STARTUP_BUSES];        /* CAN interfaces */
    uint32_t buses, frames[STARTUP_BUSES]; /* frames: most that one tick sends on each */
} startup_spec;

/* What is missing, and how to mend it: sentences without a full stop. */
typedef void startup_say(void *context, const char *what, const char *mend);

/* Looks at everything and says what is missing; returns how much. What cannot be read (a container,
 * another kernel) is not complained of. It takes some milliseconds: not for the loop's thread. */
uint32_t startup_check(const startup_spec *spec, startup_say *say, void *context);

/* Whether a list as the kernel writes it ("0,2-3") has the number in it. */
int startup_list_has(const char *list, uint32_t number);

#endif
