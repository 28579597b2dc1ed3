/* SPDX-License-Identifier: MIT */
/* Closest points on a triangle mesh. */
#ifndef PALP_TOOLS_BVH_H
#define PALP_TOOLS_BVH_H

#include "tools/mesh/mesh.h"

/*
 * How a triangle faces is taken from vertex normals that are smoothed over a few rings, so that
 * small folds and defects of a scanned surface do not turn it around.
 */
typedef struct bvh bvh;

bvh *bvh_build(const mesh *m); /* `m` must outlive it */
void bvh_free(bvh *b);
const double *bvh_facing(const bvh *b, uint32_t triangle);

/*
 * The closest point of the surface to x; with `normal` not NULL only triangles whose normal makes a
 * cosine of at least `cosine` with it count. Returns the distance, INFINITY when no triangle
 * qualifies; `facing` (may be NULL) gets the unit normal of the triangle found.
 */
double bvh_closest(const bvh *b, const double x[3], const double *normal, double cosine,
                   double point[3], double facing[3]);

/* The triangle that is closest to x. */
uint32_t bvh_triangle(const bvh *b, const double x[3]);

#endif
