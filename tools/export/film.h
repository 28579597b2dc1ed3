/* SPDX-License-Identifier: MIT */
/* Surfaces as other programs take them: those of a blob at rest, or of a recorded session at even times. */
#ifndef PALP_TOOLS_FILM_H
#define PALP_TOOLS_FILM_H

#include "port/host/replay.h"
#include "port/host/shape.h"

#define FILM_VALUES 250000000u /* floats that are kept at most */

typedef struct {
    const char *name;
    uint32_t nodes, triangles;
    const uint32_t *triangle; /* [triangles][3] */
    const float *rest_m;      /* [nodes][3] */
    const uint8_t *fixed;     /* [nodes] */
    const palp_blob *blob;    /* NULL: the skin of a dynamic body */
} film_part;

typedef struct {
    double t_s;
    palp_frame tool[PALP_CONTACT_TOOLS];
    float force_N[3];          /* on the first device's hand, device */
    float *at_m, *pressure_Pa; /* [nodes of all parts][3], [nodes of all parts] */
} film_frame;

typedef struct {
    uint32_t parts, tools, nodes; /* nodes: of all parts */
    film_part part[SHAPE_PARTS];
    const palp_tool *tool[PALP_CONTACT_TOOLS];
    size_t frames, room;
    film_frame *frame;
} film;

/* What of a session is wanted. */
typedef struct {
    const char *log, *body, *tool; /* as replay_open */
    double fps, from_s, to_s;
} film_spec;

/* Both exit with what is wrong. */
film *film_of_blob(const char *path);
film *film_of_log(const film_spec *spec);

/* Triangles of a tool's surface in its own frame, for display: x[vertices][3], t[triangles][3]. */
typedef struct {
    uint32_t vertices, triangles;
    float *x;
    uint32_t *t;
} tool_surface;
tool_surface tool_surface_of(const palp_tool *tool);

/* Normals by area: of all parts, from positions laid out like a frame's. */
void film_normals(const film *f, const float *at_m, float *normal);

#endif
