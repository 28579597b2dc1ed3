/* SPDX-License-Identifier: MIT */
/* A shaded picture of the deformed body and the tool, as SVG. */
#ifndef PALP_SIM_VIEW_H
#define PALP_SIM_VIEW_H

#include "core/blob/blob.h"
#include <stdio.h>

/*
 * Draws the surface rest + displacement (float[nodes][3], m) with the tool as a ball, seen from the
 * side of the tool, coloured by the size of the displacement. Painter's algorithm, flat shading.
 */
void view_draw(FILE *f, const palp_blob *blob, const float *displacement_m, const float tool_m[3],
               float tool_radius_m, int width, int height);

/* A posed surface, and a rigid cylinder. */
typedef struct {
    uint32_t nodes, triangles;
    const uint32_t *triangle;
    const float *position_m, *heat; /* [nodes][3], [nodes] displacement */
} view_body;

typedef struct {
    double center[3], axis[3], radius, half;
} view_cylinder;

/* Draws bodies side on (x to the right, z up, a little from above and before); cylinder: NULL for
 * none. */
void view_posed(FILE *f, const view_body *body, uint32_t bodies, const view_cylinder *cylinder,
                int width, int height);

#endif
