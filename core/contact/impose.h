/* SPDX-License-Identifier: MIT */
/*
 * Tools that touch a dynamic body: motion is imposed and forces are handed back (AD 4.2).
 *
 * Skin vertices inside a tool are moved out along their normals, and with them the active nodes
 * that they are embedded in; what the elements push those nodes with goes to the tool instead, at
 * every step. Vertices are taken one after the other, each seeing what the ones before it have
 * left, so that a node shared by several vertices is not counted twice. Contact only pushes.
 *
 * Friction: with v the speed of a vertex across its normal against the tool, and 1 / m its answer to an impulse,
 * the tool gives it the impulse - m v, which lets it stick, or where that is more than mu of the push
 * along the normal, as much of it as sliding gives: mu' of the push. So it never drives a vertex on.
 *
 * A tool goes straight from where it was to where its device is in the course of a tick, and turns
 * evenly, no faster than PALP_IMPOSE_SPEED at its far end: a reading that jumps does not shoot
 * through the body. Nor does a vertex that is found inside move faster. Vertices are
 * looked for once a tick; families near a tool are held at the finest level (adapt.h).
 */
#ifndef PALP_CONTACT_IMPOSE_H
#define PALP_CONTACT_IMPOSE_H

#include "core/dyna/adapt.h"
#include "core/contact/contact.h"
#include "core/contact/tool.h"

#define PALP_IMPOSE_SPEED 2.0f      /* m/s */
#define PALP_IMPOSE_RUBS 2.0f       /* cost of a point with friction, over one without */
#define PALP_IMPOSE_NARROW_TESTS 8u /* narrow-phase tests per tick, times max_points */

typedef struct {
    uint32_t skin, tool;
    palp_vec3 n; /* outward normal, of this tick */
    uint32_t node[4];
    float weight[4];
    palp_vec3 rest_m;
    float per_w2; /* 1 / sum of squared weights of the nodes that can be moved */
    float depth_m;
} palp_imposed;

typedef struct {
    palp_dyna *dyna;
    palp_adapt *adapt; /* NULL: nothing is held */
    const palp_tool *tools;
    uint32_t tool_count, max_points, count;
    palp_imposed *point;
    uint8_t *pressed; /* [skin] bit per tool: was inside in this tick or the last */
    float reach_m[PALP_CONTACT_TOOLS], size_m[PALP_CONTACT_TOOLS];
    palp_frame from[PALP_CONTACT_TOOLS], to[PALP_CONTACT_TOOLS];
    palp_vec3 turn_rad[PALP_CONTACT_TOOLS];    /* from the one to the other */
    palp_vec3 impulse_Ns[PALP_CONTACT_TOOLS];  /* on the tools, in this tick, */
    palp_vec3 impulse_Nms[PALP_CONTACT_TOOLS]; /* and its moment about the reference point */
    uint32_t narrow_tests;                     /* narrow-phase tests left in this tick */
    uint32_t inside;                           /* points that were moved in the last step, */
    uint32_t slid[PALP_CONTACT_TOOLS], stuck[PALP_CONTACT_TOOLS]; /* and of those, by friction */
    uint64_t overflow; /* vertices that had no room among the points, so far */
} palp_impose;

size_t palp_impose_memsize(const palp_tets *tets, uint32_t max_points);

/* Pointers are kept, but for `at`. */
typedef struct {
    palp_dyna *dyna;
    palp_adapt *adapt;      /* NULL: families near a tool are not held */
    const palp_tool *tools; /* [tool_count], as palp_tool_is_sound */
    uint32_t tool_count;    /* 1 to PALP_CONTACT_TOOLS */
    const palp_frame *at;   /* [tool_count] where they begin; finite, with rotations */
    uint32_t max_points;    /* 1 to PALP_MAX_NODES */
} palp_impose_config;

/* Errors: ARGUMENT (any of these out of its range), MEMORY, ALIGNMENT. */
palp_status palp_impose_init(palp_impose *impose, const palp_impose_config *config, void *memory,
                             size_t bytes);

/* Tools are to be at to[tool_count] at the end of this tick. Vertices near a tool beyond the
 * narrow-phase tests there are, or the points, are counted in overflow. Cost: 40 per skin vertex,
 * 60 more per tool, 260 + max_points per narrow-phase test. */
void palp_impose_begin(palp_impose *impose, const palp_frame *to);

/* A tool is there without having gone there: put down, or taken away. */
void palp_impose_place(palp_impose *impose, uint32_t tool, const palp_frame *at);

/* After palp_dyna_move in step s of `steps`. Cost: 100 per point, 100 more with friction, and the tool's. */
void palp_impose_step(palp_impose *impose, uint32_t s, uint32_t steps);

/* After the last step: force on each tool and moment about its reference point, the mean over the
 * tick. */
void palp_impose_end(const palp_impose *impose, palp_wrench *on_tool);

#endif
