/* SPDX-License-Identifier: MIT */
/* Everything about a run that is not real time: it follows the loop through its ring, and writes log and
 * telemetry, says what happens, and keeps what the report needs. */
#ifndef PALP_PORT_FOLLOW_H
#define PALP_PORT_FOLLOW_H

#include "port/host/report.h"
#include "port/linux/loop.h"
#include "port/linux/picture.h"
#include "port/linux/telemetry.h"
#include <signal.h>

typedef struct {
    servo_loop *loop;
    FILE *log;      /* NULL: none */
    bool exchanged; /* bodies or tools: what follows is not of those that the record names */
    void (*serve)(void *context); /* called between looks at the ring; NULL: none */
    void *context;
    telemetry *telemetry[PALP_SCENE_HANDS];
    bool home;        /* mechanisms were said to stand at home */
    picture *picture; /* for a page or a view; NULL: none */
    run_record record;
    size_t capacity;
    uint64_t digest, taken, last_tick;
    uint32_t joints; /* driven by frames, in the last tick */
    palp_setpoint joint[PALP_SCENE_DRIVES];
    palp_counters counters[PALP_SCENE_HANDS];
    palp_state last_state[PALP_SCENE_HANDS];
    bool state_shown[PALP_SCENE_HANDS];
    palp_drive_trouble trouble[PALP_SCENE_HANDS][PALP_AXES]; /* of the last tick */
} follower;

/* For at most `capacity` ticks, of which it keeps the last; with setup, loop, log and telemetry set. */
void follow_begin(follower *f, size_t capacity);

/* Until the loop has finished; stops it when *interrupted is set. */
void follow_run(follower *f, const volatile sig_atomic_t *interrupted);

/* Puts what was kept in the order of time, and adds totals. */
void follow_end(follower *f);

/* Says what keeps the drives of a device from working. */
void follow_trouble(const follower *f, uint32_t hand, const palp_drive_trouble *trouble);

#endif
