/* SPDX-License-Identifier: MIT */
/* Better shapes for tetrahedra whose boundary lies on a surface. */
#ifndef PALP_TOOLS_TETSMOOTH_H
#define PALP_TOOLS_TETSMOOTH_H

#include "tools/tet/tetmesh.h"

/*
 * Nodes inside go towards the middle of their neighbours where that helps the worst of their
 * tetrahedra; those of the boundary as well, along the surface, onto which they are put. Dihedral
 * angles stay within those of before, or within 18 to 150 degrees.
 */
void tetmesh_smooth(tetmesh *m, const bvh *on_surface);

#endif
