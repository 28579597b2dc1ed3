/* SPDX-License-Identifier: MIT */
/* How thick a body is at each place of its surface. */
#ifndef PALP_TOOLS_THICKNESS_H
#define PALP_TOOLS_THICKNESS_H

#include "tools/mesh/mesh.h"

/*
 * Distance from the middle of each `step`-th triangle straight inwards to the other side,
 * [ceil(triangles / step)]; HUGE_VAL where there is none. Of a closed mesh with outward triangles.
 * Threaded. Cost: triangles^2 / step ray tests. To be freed.
 */
double *mesh_thickness(const mesh *m, uint32_t step);

#endif
