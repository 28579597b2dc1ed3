/* SPDX-License-Identifier: MIT */
/*
 * Boundary element matrices of linear elastostatics: linear triangles, nodal collocation, Kelvin's
 * solution.
 *
 *     H u = G p,   H_ij = c_ij + int T(x_i, y) phi_j(y) dy,   G_ij = int U(x_i, y) phi_j(y) dy
 *
 * with u and p one 3-vector per vertex. Row-major with the given strides, 3n x 3n. The free term c
 * and the strongly singular part of H_ii come from the row sum: a translation has no traction, so
 * the block rows of H sum to zero.
 */
#ifndef PALP_TOOLS_BEM_H
#define PALP_TOOLS_BEM_H

#include "tools/mesh/mesh.h"

typedef struct {
    double young_Pa, poisson;
    double tolerance; /* relative error aimed at in each regular integral; sets the grading */
    /* Tractions of a fixed node act on triangles with all corners fixed only, where it has any, so
     * that none leaks over the rim of the fixed region. */
    bool crisp;
} bem_material;

#define BEM_TOLERANCE 1e-6

/*
 * Known tractions that jump from triangle to triangle: fields that are linear on each triangle,
 * given at position y on a triangle with unit normal n as t[3][columns], against the hats with
 * known[3 triangle + corner] set.
 */
typedef struct {
    uint32_t columns;
    void (*at)(const void *context, const double y[3], const double normal[3], double *t);
    const void *context;
    const uint8_t *known;
    const uint8_t *dropped; /* the same: hats that G leaves out, having no unknown traction; NULL */
    double *result;         /* [3n][columns]: int U t dGamma at each collocation point */
} bem_traction;

#define BEM_MAX_TRACTIONS 16

/* Fills H, G and, unless it is NULL, traction->result. */
void bem_assemble(const mesh *m, const bem_material *material, double *h, size_t h_stride,
                  double *g, size_t g_stride, const bem_traction *traction);

/* Hands the three rows [3][3n] of each node to `take`, from several threads, instead of keeping
 * them: H and G need not fit in memory. The rows of traction->result are complete by then. */
typedef void (*bem_taker)(void *context, size_t node, const double *h, const double *g);
void bem_stream(const mesh *m, const bem_material *material, bem_taker take, void *context,
                const bem_traction *traction);

#endif
