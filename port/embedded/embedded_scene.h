/* SPDX-License-Identifier: MIT */
/*
 * A scene as constants in flash, which `palp embed` writes, and how it comes to life on a controller
 * without files. The generated file defines `embedded`; blobs and tools lie in the section .blob, as they are.
 */
#ifndef PALP_EMBEDDED_SCENE_H
#define PALP_EMBEDDED_SCENE_H

#include "core/palp.h"

/* A joint along a track: values at ascending times, with a smooth step between them. */
typedef struct {
    double t_s, value;
} embedded_key;

typedef struct {
    uint32_t joint, count;
    const embedded_key *key;
} embedded_track;

typedef struct {
    palp_body_config config; /* without what is opened: blob, assembly, tets, adapt */
    const uint8_t *data, *end;
    uint32_t seams_finest; /* of a multizone model */
    const embedded_track *track;
    uint32_t tracks;
} embedded_body;

typedef struct {
    palp_scene_tool mount; /* without a field's samples */
    const uint8_t *data, *end;
} embedded_tool;

typedef struct {
    uint32_t bodies, tools, hands, drives;
    float rate_hz;
    embedded_body body[PALP_SCENE_BODIES];
    embedded_tool tool[PALP_CONTACT_TOOLS];
    palp_hand_config hand[PALP_SCENE_HANDS];
    palp_scene_drive drive[PALP_SCENE_DRIVES];
    uint8_t *memory; /* of all that is opened, aligned */
    size_t bytes;
} embedded_scene;

extern const embedded_scene embedded;

/* Opens it, once. Errors: those of what is opened; *bound_ns as palp_scene_open. */
palp_status embedded_open(palp_scene **scene, const palp_cost_table *cost, const palp_port *port,
                          float *bound_ns);

/* Puts the joints that have tracks where they are at time t, for the next tick. */
void embedded_move(palp_scene *scene, double t_s);

#endif
