/* SPDX-License-Identifier: MIT */
/* The same surface in triangles of better shape. */
#ifndef PALP_TOOLS_REFINE_H
#define PALP_TOOLS_REFINE_H

#include "tools/mesh/mesh.h"

/*
 * Programs fill a flat facet with a fan of needles. Here edges longer than `longest` are halved, and
 * edges between two triangles in one plane are turned where that makes the smallest angle larger
 * (Delaunay), until neither is left. The surface stays where it is, to 1e-5 of the diagonal. `m` is
 * closed; vertices keep their numbers, new ones follow. To be freed.
 */
mesh mesh_refined(const mesh *m, double longest);

#endif
