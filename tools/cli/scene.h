/* SPDX-License-Identifier: MIT */
/* A scene for a multizone model or a dynamic body: joints, a rigid object and a probe along key
 * frames. */
#ifndef PALP_SIM_SCENE_H
#define PALP_SIM_SCENE_H

#include "core/contact/tool.h"
#include "core/zone/configuration.h"
#include <stdbool.h>
#include <stddef.h>

#define SCENE_OBJECT 0 /* the rigid cylinder */
#define SCENE_PROBE 1  /* a ball */
#define SCENE_TRACKS 2

/* Values at ascending times, with a smooth step (no velocity) at each. */
typedef struct {
    double t_s, value[3];
} scene_key;

typedef struct {
    size_t count, room;
    scene_key *key;
} scene_track;

typedef struct {
    double seconds, rate_hz, stiffness_N_per_m, gravity_m_s2[3];
    bool has[SCENE_TRACKS]; /* shapes that were described */
    double cylinder[5];     /* radius, half length, axis */
    double probe_radius_m;
    scene_track joint[PALP_MAX_JOINTS];
    scene_track track[SCENE_TRACKS];
} scene;

/*
 * Reads a scene: lines of
 *   seconds S | rate HZ | stiffness N/m (of the springs on which object and probe hang) |
 *   gravity X Y Z (m/s^2)
 *   pose T JOINT VALUE           the joint's value at time T, rad or m
 *   cylinder RADIUS HALF X Y Z   and   object T X Y Z
 *   probe RADIUS                 and   touch T X Y Z
 * Exits 2 with the offending line. zones == NULL: a dynamic body, which has no joints.
 */
scene scene_read(const char *path, const palp_zones *zones);
void scene_free(scene *s);

/* The tools of a scene, and the track of each; without any a small ball on track SCENE_TRACKS, to
 * be put far away. */
void scene_tools(const scene *s, palp_tool tool[SCENE_TRACKS], uint32_t which[SCENE_TRACKS],
                 uint32_t *count);

/* Where they are at time t. */
void scene_tools_at(const scene *s, const uint32_t *which, uint32_t count, double t_s,
                    palp_frame *at);

/* The track at time t; its first value before that, zero if it has none. */
void scene_at(const scene_track *track, double t_s, double value[3]);

#endif
