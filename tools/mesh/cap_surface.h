/* SPDX-License-Identifier: MIT */
/*
 * Triangulates what closed loops in space bound: the surface where a body is cut. Interior points
 * on a hexagonal lattice of the loops' edge length, Delaunay's triangulation of the projection with
 * the loops' edges enforced, heights by harmonic interpolation.
 */
#ifndef PALP_TOOLS_CAP_SURFACE_H
#define PALP_TOOLS_CAP_SURFACE_H

#include <stdint.h>

typedef struct {
    uint32_t points, boundary; /* the first `boundary` are the loops' vertices, in their order */
    double (*x)[3];
    uint32_t triangles;
    uint32_t (*t)[3];
} cap;

/*
 * Loops one after the other: loop k has length[k] vertices. Triangles run against the loops, so
 * that they close the surface that the loops bound. `what` names the cut in messages; exits when a
 * loop crosses itself.
 */
cap cap_build(double (*loop)[3], const uint32_t *length, uint32_t loops, const char *what);
void cap_free(cap *c);

#endif
