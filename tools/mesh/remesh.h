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
    bool crosses; /* itself, near this place */
    double crossing[3];
    uint32_t dropped; /* unused vertices */
} remesh_report;

/* Goals: the base is refined until they are met. */
#define REMESH_MEAN 0.003
#define REMESH_MAX 0.025
#define REMESH_ANGLE_DEG 2.0
/* Larger results, which few machines can bake, are drawn only while the distance is above this. */
#define REMESH_NODES 5200
#define REMESH_MAX_LARGE 0.04

/*
 * Simplifies `in` (put in order: unused vertices go) to a base of about
 * `base_triangles` (0: as few as meet the limits above), splits it `levels` times and draws each
 * level onto the surface. Exits with the element named when the input is no closed manifold
 * component, or when no base without self-intersections is found.
 */
mesh remesh(mesh *in, const char *path, uint32_t levels, uint32_t base_triangles,
            remesh_report *report);

/* Which goals were missed, with the remedy, on stderr. */
void remesh_warn(const remesh_report *r, const char *path);

/* palp remesh, palp subdivide: argv with the command's name first; returns the exit code. */
int command_remesh(int argc, char **argv);
int command_subdivide(int argc, char **argv);

#endif
