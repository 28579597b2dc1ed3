/* SPDX-License-Identifier: MIT */
/*
 * Boundary element matrices of linear elastostatics: linear triangles, nodal collocation, Kelvin's solution.
 *
 *     H u = G p,   H_ij = c_ij + int T(x_i, y) phi_j(y) dy,   G_ij = int U(x_i, y) phi_j(y) dy
 *
 * with u and p one 3-vector per vertex. Row-major with the given strides, 3n x 3n. The free term c and the strongly singular part
 * of H_ii come from the row sum: a translation has no traction, so the block rows of H sum to zero.
 */
#ifndef PALP_TOOLS_BEM_H
#define PALP_TOOLS_BEM_H

#include "mesh.h"

typedef struct {
    double young_Pa, poisson;
    double tolerance; /* relative error aimed at in each regular integral; sets the grading */
} bem_material;

#define BEM_TOLERANCE 1e-6

/*
 * Fills H and G. `body` (3n x 3, may be NULL): int U t dGamma over the hats of the
 * vertices with mask != 0, for t = (b . (y - origin)) n_y with b = e_x, e_y, e_z: the traction that
 * balances the hydrostatic particular solution of a body force b, element by element.
 */
void bem_assemble(const mesh *m, const bem_material *material, double *h, size_t h_stride, double *g,
                  size_t g_stride, double *body, const uint8_t *mask, const double origin[3]);

/* Nodes and weights of the n-point Gauss-Legendre rule on [0, 1], n <= 32. */
void gauss_legendre(uint32_t n, double *node, double *weight);

#endif
