/* SPDX-License-Identifier: MIT */
#ifndef PALP_TOOLS_NEAREST_H
#define PALP_TOOLS_NEAREST_H

/* The place of triangle (a, b, c) that is nearest to x, and its barycentric weights, by the Voronoi
 * regions of the triangle's features (Ericson 2005); returns the distance. */
double nearest_on_triangle(const double x[3], const double a[3], const double b[3],
                           const double c[3], double corner[3], double point[3]);

#endif
