/* SPDX-License-Identifier: MIT */
/* What a scene looks like after a tick: the deformed surfaces of its bodies, the points in
 * contact, all in the scene's coordinates. For displays, reports and exports; never in a tick. */
#ifndef PALP_HOST_SHAPE_H
#define PALP_HOST_SHAPE_H

#include "port/host/motion.h"
#include "port/host/openscene.h"

#define SHAPE_PARTS (PALP_SCENE_BODIES * PALP_MAX_ZONES)

/* A surface: an elastostatic body, a zone, the skin of a dynamic body. */
typedef struct {
    uint32_t body, zone, nodes, triangles;
    const uint32_t *triangle; /* [triangles][3] */
    const uint8_t *fixed;     /* [nodes] 1: held */
    float *rest_m, *at_m;     /* [nodes][3]; at rest a zone lies where its joints have put it */
    float *pressure_Pa; /* [nodes] of the tools; 0 of a dynamic body, whose loads are not known */
    palp_field field;   /* not of a skin */
    void *field_memory;
    float *modes; /* of a zone's seams */
} shape_part;

typedef struct {
    float at_m[3], force_N[3]; /* on the body */
} shape_point;

typedef struct {
    const scene_setup *setup;
    palp_scene *scene;
    uint32_t parts;
    shape_part part[SHAPE_PARTS];
    uint32_t points; /* that carry force */
    shape_point point[PALP_SCENE_BODIES * PALP_CONTACT_MAX_POINTS];
} shape;

/* Of an open scene, at rest; both are kept by reference. Exits where there is no memory. */
shape *shape_open(const scene_setup *setup, palp_scene *scene);

/* As the last tick left it. Changes nothing that a tick reads, so it may be called between any two. Cost: a
 * transform of each body. */
void shape_update(shape *s);

/* The parts and tools of a motion, empty so far, that is to show the scene; and a frame as the last tick left
 * it, with the tools tool[tools]. */
void shape_to_motion(const shape *s, motion *m, size_t bytes);
void shape_add_frame(shape *s, motion *m, double t_s, const palp_frame *tool);

void shape_close(shape *s);

#endif
