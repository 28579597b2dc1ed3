/* SPDX-License-Identifier: MIT */
/* Distances of triangles, and quadrature over one that comes near a point. */
#ifndef PALP_TOOLS_NEAR_FIELD_H
#define PALP_TOOLS_NEAR_FIELD_H

#include "tools/solver/kernel_sums.h"

/* Distance of two flat triangles that do not cross. */
double triangle_distance(const double *const p[3], const double *const q[3]);

/*
 * Points of a triangle for a kernel that is nearly singular at a distance `gap` from its place
 * `apex`: three triangles around the apex, in each of which sinh maps bring the radius and the angle
 * to Gauss' points (Johnston and Elliott, Int. J. Numer. Meth. Engng 62, 2005). Room for 3 n^2
 * points; returns how many.
 */
uint32_t near_points(const quadratic_surface *q, uint32_t triangle, const double apex[3],
                     double gap, uint32_t n, surface_point *to);

#endif
