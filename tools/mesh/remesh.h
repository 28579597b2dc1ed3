/* SPDX-License-Identifier: MIT */
/* A mesh with subdivision connectivity that approximates a given surface.
 */
#ifndef PALP_TOOLS_REMESH_H
#define PALP_TOOLS_REMESH_H

#include "tools/mesh/mesh.h"

typedef struct {
    uint32_t base_triangles;
    double mean, max; /* distance between the surfaces, both ways, over the bounding box diagonal */
    uint32_t flipped; /* triangles that face against their neighbours */
    double smallest_angle_deg;
    uint32_t dropped; /* unused vertices */
} remesh_report;

#define REMESH_MEAN 0.005 /* what a result must reach; otherwise the base is refined */
#define REMESH_MAX 0.04

/*
 * Simplifies `in` (whose unused vertices go) to a base of about
 * `base_triangles` (0: as few as meet the limits above), splits it `levels` times and draws each
 * level onto the surface. Exits with the element named when the input is no closed manifold
 * component, or when no base without self-intersections is found.
 */
mesh remesh(mesh *in, const char *path, uint32_t levels, uint32_t base_triangles,
            remesh_report *report);

/* palp remesh, palp subdivide: argv with the command's name first; returns the exit code. */
int command_remesh(int argc, char **argv);
int command_subdivide(int argc, char **argv);

#endif
