/* SPDX-License-Identifier: MIT */
#ifndef PALP_TOOLS_ORDER_H
#define PALP_TOOLS_ORDER_H

#include "tools/mesh/mesh.h"

/* The same surface in one order, whatever that of its file was: vertices by x, y, z; each triangle
 * from its first vertex; triangles by their vertices. */
void mesh_sort(mesh *m);

#endif
