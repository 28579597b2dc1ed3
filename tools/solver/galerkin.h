/* SPDX-License-Identifier: MIT */
/*
 * Galerkin boundary integrals of linear elastostatics.
 *
 * Tractions are unit nodal forces spread over hats, p_j = f_j phi_j / a_j; displacements are the
 * quadratic fields of quadratic.h. With the single layer V, the double layer K and the
 * hypersingular operator D of Kelvin's solution,
 *
 *     V_ij = <phi_i / a_i, V phi_j / a_j>      B_ij = <phi_i / a_i, (1/2 - K) N_j>
 *     D_ij = <N_i, D N_j>
 *
 * where N_j is the displacement field of node j. A body free in space answers forces in equilibrium
 * with the means u_i of its displacements under the hats,
 *
 *     u = (V + B D^+ B^T) f + rigid motion      (D^+: inverse off the rigid motions)
 *
 * which is symmetric and positive definite whatever the mesh, and work-conjugate: f . u is the work.
 *
 * D and K come from the weakly singular kernels 1 / r and r r^T / r^3 and, for the double layer of
 * 1 / r, from an integrand that vanishes in the plane of the load (integration by parts: Kupradze
 * 1979; Han, Numer. Math. 68, 1994; Of, Steinbach and Wendland, Computing 78, 2006). Each pair of
 * triangles is integrated once, by Gauss' rule of an order that fits their distance, or where they
 * touch by pairs.h.
 */
#ifndef PALP_TOOLS_GALERKIN_H
#define PALP_TOOLS_GALERKIN_H

#include "tools/solver/quadratic.h"

typedef struct {
    double young_Pa, poisson;
    const double
        *thickness;   /* [triangles]: of the wall there (tools/mesh/thickness.h); NULL: thick */
    double origin[3]; /* from which the depth in a body's weight counts */
    /* [3 triangles]: hats that a corner's node does not have on that triangle; NULL: none. A fixed
     * node keeps its reaction on the fixed patch, so that none leaks over the rim. */
    const uint8_t *dropped;
} galerkin_problem;

/* The matrices, 3n x 3n, rows and columns 3 node + axis. V and D are symmetric and whole. */
typedef struct {
    size_t order;
    double *v, *b, *d;
    double *area;        /* [n]: integral of each node's hat, where it is not dropped */
    double (*center)[3]; /* [n]: where a unit force spread over the hat acts */
    /* Of unit acceleration b along x, y, z, per unit density: tractions (b . (y - origin)) n on the
     * whole surface, as V t [3n][3] and B^T t [3n][3]. */
    double *v_weight, *b_weight;
} galerkin_matrices;

/* Threaded; the same bits on any number of threads. Cost: about 2 us for each pair of triangles.
 * To be freed by galerkin_free. */
galerkin_matrices galerkin_assemble(const quadratic_surface *q, const galerkin_problem *problem);
void galerkin_free(galerkin_matrices *g);

#endif
