/* SPDX-License-Identifier: MIT */
/* Surfaces and tools in motion, kept as frames for a page or a file: at even times, as many as there is room
 * for. When it is full every second frame goes, and the time between frames doubles. */
#ifndef PALP_HOST_MOTION_H
#define PALP_HOST_MOTION_H

#include "core/contact/tool.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#define MOTION_PARTS 128u
#define MOTION_PAGE_BYTES 900000u /* of displacements in a page, before they are text */
#define MOTION_FRAME_S 0.0334     /* between frames, at least */

/* A surface; pointers are kept. */
typedef struct {
    uint32_t nodes, triangles;
    const uint32_t *triangle; /* [triangles][3] */
    const uint8_t *fixed;     /* [nodes]; NULL: none is */
    const float *rest_m;      /* [nodes][3] */
    bool far_off;             /* moves by more than a part of its size: kept to 16 bits, not 8 */
    const char *name;         /* NULL: none */
} motion_part;

typedef struct {
    double t_s;
    palp_frame tool[4];
    float *scale_m; /* [parts] that a step of the displacements counts */
    uint8_t *step;  /* of all parts: displacements from rest, int8 or int16 */
    uint8_t *level; /* [nodes of all parts] of a motion with levels */
} motion_frame;

typedef struct {
    uint32_t parts, tools;
    motion_part part[MOTION_PARTS];
    const palp_tool *tool[4];
    size_t frame_bytes, frames, room, most;
    motion_frame *frame;
    double interval_s, next_s;
    const uint8_t
        *level; /* [nodes of all parts] taken with each frame: on which mesh a node is at work;
                             NULL: there are none */
} motion;

/* With parts and tools set; at most `bytes` of displacements. */
void motion_begin(motion *m, size_t bytes);
/* Whether a frame is wanted at this time. */
bool motion_wants(const motion *m, double t_s);
/* The frame there: at_m[part] is [nodes][3]; tool_at[tools]. */
void motion_add(motion *m, double t_s, const float *const *at_m, const palp_frame *tool_at);
/* One frame more, between those that are there, whatever room there is. */
void motion_insert(motion *m, double t_s, const float *const *at_m, const palp_frame *tool_at);
/* Displacement of a node in a frame. */
void motion_displacement(const motion *m, size_t frame, uint32_t part, uint32_t node, float u_m[3]);
/* As JSON, for report.js. */
void motion_write(FILE *f, const motion *m);
void motion_free(motion *m);

#endif
