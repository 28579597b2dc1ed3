/* SPDX-License-Identifier: MIT */
/* What a run was like: a summary in text, and one self-contained HTML page. */
#ifndef PALP_SIM_REPORT_H
#define PALP_SIM_REPORT_H

#include "port/host/motion.h"
#include "port/host/record.h"
#include <stdio.h>

/* What a device went through. */
typedef struct {
    palp_report *tick; /* [count] */
    uint32_t *events;  /* [count] PALP_EVENT_ bits of its bus and operator; NULL: not kept */
    run_totals totals;
    const char *device_name, *bus_name, *bus_load;
} run_hand;

/* What a body did in all ticks; of one that stands for all, ticks that devices report. */
typedef struct {
    const char *name;
    palp_body_kind kind;
    size_t ticks, at_level[PALP_CONTACT_LEVELS], touching, held, spent, full, shortened;
    uint32_t most_points, most_active;
    float doubt_N;
} run_body;
void run_body_add(run_body *body, const palp_body_report *report);

/* What became of a joint that is driven by frames. */
typedef struct {
    const char *name, *bus;
    uint32_t id;
    palp_setpoint at; /* at the end */
} run_joint;

typedef struct {
    uint32_t joints;
    uint32_t hands, bodies; /* bodies: 0 where the devices' ticks say all of one */
    run_hand hand[PALP_SCENE_HANDS];
    run_body body[PALP_SCENE_BODIES];
    run_joint joint[PALP_SCENE_DRIVES];
    float *late_us; /* [count] wake-up lateness of each tick; NULL when the run was not paced */
    size_t count;
    bool totalled; /* totals are known */
    bool from_log; /* then ticks lack what a log does not hold */
    double rate_hz;
    double first_s;       /* of the first tick that is here */
    const motion *motion; /* of bodies and tools; NULL: not known */
    const char *title;
} run_record;

/* Names the joints of a scene that are driven by frames. */
void run_joints_of(run_record *r, const scene_setup *setup);

void report_text(FILE *f, const run_record *r);
void report_html(FILE *f, const run_record *r);

/* Names of a state and of latched faults, for people. */
const char *report_state(palp_state state);
void report_faults(uint32_t faults, char *text, size_t size);

/* Smallest of absorbed - 0 over the run: how close the hand came to being given energy (J, device
 * units). */
float smallest_energy_margin(const run_record *r, uint32_t hand);

#endif
