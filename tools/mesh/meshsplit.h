/* SPDX-License-Identifier: MIT */
/*
 * Surfaces that touch themselves: an edge with four triangles or more, a vertex with several fans.
 * Around such an edge each two triangles that bound the same piece of the solid belong together;
 * vertices are doubled until every edge has two triangles and every vertex one fan. An edge whose
 * pairs are joined at both ends is cut in its middle first.
 */
#ifndef PALP_TOOLS_MESHSPLIT_H
#define PALP_TOOLS_MESHSPLIT_H

#include "tools/mesh/mesh.h"

/* Leaves edges around which not as many triangles run one way as the other, of more than 16
 * triangles, and those of folds.
 * Returns how many vertices were added. */
uint32_t mesh_split_touching(mesh *m);

#endif
