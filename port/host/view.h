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

#endif
