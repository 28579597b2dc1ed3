/* SPDX-License-Identifier: MIT */
/*
 * Simplification by edge collapse under quadric error (Garland and Heckbert 1997), with a
 * one-to-one map from the simplified surface back to the original: every collapse flattens the
 * patch that it changes, before and after, into the same convex polygon, and a point goes through
 * all of them in reverse (successive self-parameterisation, Liu et al. 2021).
 */
#ifndef PALP_TOOLS_SIMPLIFY_H
#define PALP_TOOLS_SIMPLIFY_H

#include "tools/mesh/mesh.h"

/* A point of a surface: a triangle and barycentric weights of its corners. */
typedef struct {
    uint32_t triangle;
    double weight[3];
} surface_point;

typedef struct collapse_log collapse_log;

typedef struct {
    mesh base;
    uint32_t *triangle_of; /* triangle number in the original of each base triangle */
    collapse_log *log;
} simplified;

/*
 * Collapses edges of a closed manifold mesh until at most `triangles` remain or no collapse is left
 * that keeps the surface manifold and unflipped. The genus does not change.
 */
simplified simplify(const mesh *m, uint32_t triangles);
void simplified_free(simplified *s);

/* Carries points of the base (triangle = base triangle) to the original surface, in place. */
void simplified_map(const simplified *s, surface_point *point, size_t count);

#endif
