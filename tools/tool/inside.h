/* SPDX-License-Identifier: MIT */
/* Which places lie inside a closed mesh of any number of components. */
#ifndef PALP_TOOLS_INSIDE_H
#define PALP_TOOLS_INSIDE_H

#include "tools/mesh/mesh.h"

/* A regular grid of places, x running fastest. */
typedef struct {
    double origin[3], step;
    uint32_t count[3];
} place_grid;

/*
 * inside[place]: whether the mesh goes around it at least once, by the crossings of one line along x
 * for each row of places. Lines lie beside their rows by a millionth of the step, so that none meets
 * an edge of a mesh whose vertices lie on the grid. To be freed.
 */
uint8_t *mesh_inside(const mesh *m, const place_grid *grid);

/* The same of one place; its cost is one look at every triangle. */
bool mesh_holds(const mesh *m, const double x[3]);

#endif
