/* SPDX-License-Identifier: MIT */
/*
 * Forces of linear tetrahedra with Green's strain (AD 1 to 8), PALP_LANES elements side by side.
 *
 *     D = I + sum u_k b_k^T      eps = D^T D - I      nu = d eps / dt
 *     sigma = lambda tr(eps) I + 2 mu eps + phi tr(nu) I + 2 psi nu
 *     f_k = -V/2 D sigma b_k
 *
 * Displacements u stand in the place of positions, so that small strains keep their digits.
 *
 * Green's strain alone does not know an element from its mirror image, and gives way when it is
 * crushed. So elements with det D below PALP_CRUSHED carry an energy V PALP_WALL kappa/2
 * (PALP_CRUSHED - det D)^2 with kappa = lambda + 2 mu besides: a force towards the right side from
 * anywhere, and none in ordinary motion. It depends on D^T D and the orientation alone, so momenta
 * are kept.
 *
 * And it stiffens with the square of the stretch, so that an overstretched body could
 * store any energy and throw a node any distance. With U the energy per volume, what is stored is
 * instead 2 W (sqrt(1 + U / W) - 1), W = PALP_YIELDING kappa: the same for small U (forces 0.1 %
 * lower at 10 % strain, 5 % at 50 %), with a stiffness that no longer grows.
 */
#ifndef PALP_DYNA_ELEMENT_H
#define PALP_DYNA_ELEMENT_H

#include "core/blob/format.h"
#include "core/dyna/material.h"

#define PALP_CRUSHED 0.3f
#define PALP_WALL 2.0f
#define PALP_YIELDING 2.0f

typedef struct {
    float u[4][3][PALP_LANES]; /* displacements of the four nodes, m */
    float v[4][3][PALP_LANES]; /* velocities, m/s */
    float b[9][PALP_LANES];
    float volume[PALP_LANES];
    /* out */
    float f[4][3][PALP_LANES];  /* forces on the nodes, N */
    float stretch[PALP_LANES];  /* bound on the growth of the stiffness over that at rest, >= 1 */
    float energy_J[PALP_LANES]; /* stored */
} palp_element_lanes;

/* Cost: about 150 operations per lane, no branches. */
void palp_element_forces(palp_element_lanes *e, const palp_material *material);

#endif
