/* SPDX-License-Identifier: MIT */
/*
 * Quadratic fields from nodal values alone.
 *
 * Linear elements lock on thin walls: a bent plate of thickness t with elements of size h seems
 * stiffer by a share of about (h / t)^2 / 3. Quadratic ones do not, but have four times the nodes.
 * Here the value in the middle of an edge follows from the nodes around,
 *
 *     u_m = (u_a + u_b) / 2 - D^2 u(b - a, b - a) / 8
 *
 * with D^2 u the mean of the second derivatives of polynomials fitted around a and b, on the smooth
 * piece of the surface on either side of the edge. The surface itself is taken through the same
 * middles, so that every linear field, and with it every rigid motion, is reproduced exactly.
 */
#ifndef PALP_TOOLS_QUADRATIC_H
#define PALP_TOOLS_QUADRATIC_H

#include "tools/mesh/mesh.h"

/* Triangles whose normals make a larger cosine lie on one smooth piece, else across an edge. */
#define QUADRATIC_SMOOTH_COS 0.7071

typedef struct {
    const mesh *m;
    uint32_t edges;
    uint32_t (*edge)[3]; /* [triangles]: the edge that faces each corner */
    uint32_t *offset;    /* [edges + 1] */
    uint32_t *vertex;    /* the middle of edge e is the sum of weight[i] times vertex[i], */
    double *weight;      /* offset[e] <= i < offset[e + 1] */
    double (*middle)[3]; /* [edges]: where the middles lie */
} quadratic_surface;

/* Of a closed mesh; to be freed by quadratic_free. */
quadratic_surface quadratic_build(const mesh *m);
void quadratic_free(quadratic_surface *q);

/* Corner 0 to 2 and middle 3 to 5 (facing corners 0 to 2): place of a triangle's node. */
static inline const double *quadratic_node(const quadratic_surface *q, uint32_t triangle,
                                           int node) {
    if (node < 3) return q->m->x[q->m->t[triangle][node]];
    return q->middle[q->edge[triangle][node - 3]];
}

/* The six shape functions at barycentric weights, and their derivatives along corner 0 -> 1 and
 * 0 -> 2. */
static inline void quadratic_shape(const double corner[3], double n[6], double along_u[6],
                                   double along_v[6]) {
    const double a = corner[0], b = corner[1], c = corner[2];
    for (int k = 0; k < 3; k++) n[k] = corner[k] * (2 * corner[k] - 1);
    n[3] = 4 * b * c;
    n[4] = 4 * c * a;
    n[5] = 4 * a * b;
    along_u[0] = along_v[0] = 1 - 4 * a;
    along_u[1] = 4 * b - 1;
    along_v[1] = 0;
    along_u[2] = 0;
    along_v[2] = 4 * c - 1;
    along_u[3] = 4 * c;
    along_v[3] = 4 * b;
    along_u[4] = -4 * c;
    along_v[4] = 4 * (a - c);
    along_u[5] = 4 * (a - b);
    along_v[5] = -4 * b;
}

#endif
