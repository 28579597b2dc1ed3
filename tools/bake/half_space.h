/* SPDX-License-Identifier: MIT */
/*
 * How the nodes of a surface would answer if the body around them were a half-space: the
 * displacement of node k when a unit force is spread over the hat of node l (Boussinesq and
 * Cerruti; n = (n_k + n_l) / 2, outward),
 *
 *     B(r) = (1 + nu) / (pi E |r|) ((1 - nu) I + nu e e^T + (1/2 - nu) (e n^T - n e^T))
 *     e = r / |r|
 */
#ifndef PALP_TOOLS_HALF_SPACE_H
#define PALP_TOOLS_HALF_SPACE_H

#include "tools/mesh/mesh.h"

typedef struct {
    double young_Pa, poisson;
} half_space_material;

typedef struct half_space half_space;

/* `m` and `normal` (of its nodes) must outlive it. `averaged`: displacements are means under the
 * hat of k; else they are those of node k, made symmetric. */
half_space *half_space_build(const mesh *m, double (*normal)[3], bool averaged);
void half_space_free(half_space *h);

/* The block of nodes k and l, row-major; that of l and k is its transpose. By quadrature over the
 * hats where they are near, else from node to node. */
void half_space_block(const half_space *h, half_space_material material, uint32_t k, uint32_t l,
                      double block[9]);

/* The same from point to point, B(x - y); x and y apart. */
void half_space_point(const double x[3], const double y[3], const double normal_x[3],
                      const double normal_y[3], half_space_material material, double block[9]);

#endif
