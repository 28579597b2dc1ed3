/* SPDX-License-Identifier: MIT */
/* What `palp play` was asked for; it serves multizone models (play.c) and dynamic bodies
 * (dynamic_scene.c).
 */
#ifndef PALP_TOOLS_PLAY_H
#define PALP_TOOLS_PLAY_H

#include "port/host/machine.h"
#include "port/host/scenefile.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define MOST_TICKS 1000000

typedef struct {
    const char *blob, *scene, *csv, *report, *target;
    double budget_us, ns_per_operation; /* the latter: as asked for, 0 if it was not */
    machine machine;
    bool wall, alone;
    uint32_t finest;
    bool finest_given;
    /* of dynamic bodies */
    const char *material;
    double young_Pa, poisson, damping_s, drag_per_s; /* below 0: that of the blob or the material */
    bool uniform;
    uint32_t most_class;
    double refine_share; /* gamma_max over the diagonal; 0: the default */
} play_spec;

/* Microseconds of each tick: median, 99th percentile and largest; x is sorted. */
typedef struct {
    double p50, p99, max;
} percentiles;
percentiles percentiles_of(double *x, size_t count);

/* The budget of a tick in us; exits if it is longer than the period. */
double play_budget_us(const play_spec *s, double rate_hz);

/* One line: whose prices these are. */
void play_print_machine(FILE *f, const play_spec *s);

/* A scene with devices, in virtual time; returns the exit code. */
int play_scene(const play_spec *s, scene_file *file);

/* A dynamic body follows a scene; returns the exit code. */
int play_dynamic(const play_spec *s, const void *data, size_t bytes);

#endif
