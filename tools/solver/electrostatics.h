/* SPDX-License-Identifier: MIT */
/*
 * Green's functions of an electrostatic problem, to show that nothing below depends on elasticity
 * (MR 1, 11.1): charges on the surface of an insulator in free space, some of its nodes grounded.
 *
 *     V = A q,  A_ij = 1 / (4 pi eps0 |x_i - x_j|),  A_ii: a disc of the nodal area, at its centre
 *     G = A_FF - A_FU A_UU^-1 A_UF       potential of the free nodes per charge, U at zero
 */
#ifndef PALP_TOOLS_ELECTROSTATICS_H
#define PALP_TOOLS_ELECTROSTATICS_H

#include "tools/mesh/mesh.h"

/* In units of 1 / (4 pi eps0). Returns G by free nodes in mesh order, [m][m], to be freed. */
double *electrostatic_greens(const mesh *m, const uint8_t *fixed, const double *area);

#endif
