/* SPDX-License-Identifier: MIT */
/* Holes of a surface: rims of edges that belong to one triangle only. */
#ifndef PALP_TOOLS_HOLES_H
#define PALP_TOOLS_HOLES_H

#include "tools/mesh/mesh.h"

typedef struct {
    double rim_m, middle[3]; /* length of the rim, and the mean of its vertices */
    uint32_t edges;
} mesh_hole;

/*
 * Makes neighbours run alike, then closes the holes whose rim is at most `longest_m`: by the triangles of least area over the rim's
 * own vertices (dynamic programming, in the cube of the edges) where it has at most 300, by a fan
 * about its middle where it has more. Returns how many; `longest` is the longest of those, `left`
 * the longest that stays open (edges 0: none).
 */
uint32_t mesh_close_holes(mesh *m, double longest_m, mesh_hole *longest, mesh_hole *left);

#endif
