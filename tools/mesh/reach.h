/* SPDX-License-Identifier: MIT */
/* Single vertices of a fitted mesh taken to where they should be. */
#ifndef PALP_TOOLS_REACH_H
#define PALP_TOOLS_REACH_H

#include "tools/mesh/fit.h"

typedef struct {
    const fit *f;
    const mesh *original;
    bvh *on; /* the original's */
    bool
        folds; /* moves must not turn a triangle against the original's own: not for scanned surfaces,
                   whose triangles face anywhere */
    uint32_t *offset, *star; /* triangles around each vertex */
    bool *held;              /* vertices that stay where they are */
    double (*before)[3];     /* where they were at the beginning */
} reach;

reach reach_begin(const fit *f, const mesh *original);

/* Takes vertex v to x, alone or with those around it evened out; false, and all as it was, where v is
 * held or a triangle there turns over or becomes a needle (5 degrees). */
bool reach_take(const reach *r, uint32_t v, const double x[3], const double facing[3]);

/*
 * What evening out and repair have taken from tips and rims is given back: the original vertices
 * that are farthest from the mesh get the nearest mesh vertex, where that leaves the triangles sound.
 */
void reach_rims(const reach *r);

/* Where the mesh now crosses itself and did not at the beginning, it goes back; frees what `r` holds. */
void reach_end(reach *r);

#endif
