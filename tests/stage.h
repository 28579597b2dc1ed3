/* SPDX-License-Identifier: MIT */
/* A scene with simulated devices whose hands follow keys, and what is watched of it. */
#ifndef PALP_TESTS_STAGE_H
#define PALP_TESTS_STAGE_H

#include "sim/bus.h"

#define HANDS 2

typedef struct {
    palp_scene *scene;
    void *memory;
    sim_bus bus[HANDS];
    device_file file[HANDS];
    palp_scene_config config;
    palp_hand_config hand[HANDS];
    palp_scene_report report;
    uint32_t more_events[HANDS];
    uint64_t now_ns;
    float ns_per_instruction; /* 0: 0.5 */
    double most_ns;           /* that any tick may take, over the period */
    float last_N[HANDS][3], step_N[HANDS], largest_N[HANDS], least_J;
    bool out;               /* of a hand's limits, or not finite */
    palp_can_frame more[8]; /* that reach hand 0 in the next tick, */
    uint32_t more_count;    /* then 0 */
} stage;

/* A device whose coordinates lie in the scene's turned about z. */
void seat(stage *s, uint32_t h, const char *device, float rate_hz, palp_vec3 origin,
          float turn_rad);

/* After start: the hand's keys, in the coordinates of its device. */
void lead(stage *s, uint32_t h, const hand_key *key, const hand_turn *turn, uint32_t count);

/* With config and hands set. start ends the program where the scene does not open. */
palp_status try_open(stage *s, float *bound_ns);
void start(stage *s);
void stop(stage *s);

void tick(stage *s);
void run(stage *s, double seconds);

#endif
