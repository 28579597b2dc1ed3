/* SPDX-License-Identifier: MIT */
/* Surfaces that cross themselves. */
#ifndef PALP_TOOLS_CROSSING_H
#define PALP_TOOLS_CROSSING_H

#include "tools/mesh/mesh.h"

/* A triangle that another one cuts, UINT32_MAX if there is none. Triangles that share a vertex, or
 * only touch, do not count. */
uint32_t mesh_self_intersection(const mesh *m);

/* [triangles]: 1 for each such triangle. To be freed. */
uint8_t *mesh_crossings(const mesh *m);

#endif
