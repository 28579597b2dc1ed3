/* SPDX-License-Identifier: MIT */
/* What the measures of felt quality share: the body, where it is pressed, and the table. */
#ifndef PALP_TOOLS_FEEL_BENCH_H
#define PALP_TOOLS_FEEL_BENCH_H

#include "core/surface/surface.h"
#include "tools/feel/table.h"

#define FEEL_FORCE_THRESHOLD 7.0 /* per cent of a force, just noticeable */

typedef struct {
    const palp_blob *blob;
    const palp_blob *finer; /* the same body on a finer mesh; NULL: none */
    uint32_t every;         /* tick of the script that is disturbed */
    feel_table table;
    double edge_m;
    uint64_t seed;
    uint32_t *place; /* [places] free nodes, away from fixed ones */
    uint32_t places;
    uint32_t *free_node; /* [free_nodes] all there are of these */
    uint32_t free_nodes;
} bench;

/* Chooses `places` of the free nodes whose surroundings of so many edges are free as well; exits
 * when there are none. */
void bench_open(bench *b, uint32_t places, double edges);
void bench_close(bench *b);

/* The next of a fixed sequence of numbers, 0 to below 1. */
double bench_roll(bench *b);
uint32_t bench_roll_node(bench *b);

/* A unit vector at right angles to n, and near `wanted`. */
palp_vec3 bench_tangent(palp_vec3 wanted, palp_vec3 n);

/* Sorts, and returns the median. */
double bench_median(double *x, size_t count);

/* ---- the measures, each adding its rows ---- */

void feel_hertz(bench *b);
void feel_ripple(bench *b);
void feel_levels(bench *b);
void feel_hard_places(bench *b);
void feel_finer_mesh(bench *b);
void feel_closed_paths(bench *b);
/* The answer with its budget, in virtual time: touch and release, stalls, late starts, slow
 * controllers, teleports. */
void feel_disturbances(bench *b);

#endif
