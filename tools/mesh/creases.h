/* SPDX-License-Identifier: MIT */
#ifndef PALP_TOOLS_CREASES_H
#define PALP_TOOLS_CREASES_H

#include "tools/mesh/reach.h"

/*
 * Sharp edges of the original (more than 40 degrees) that part it into facets become chains of
 * edges of the mesh: its corners get a vertex each, and where an edge of the mesh leads from one
 * facet to another, the end that is nearer to the crease goes there. Those vertices are held then.
 */
void reach_creases(reach *r);

#endif
