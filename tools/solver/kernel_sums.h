/* SPDX-License-Identifier: MIT */
/*
 * Sums of Kelvin's kernels over points of two triangles, for the rows of one of them.
 *
 * With r = x - y, X = (1 - 2 nu) / |r| I + r r^T / |r|^3 and c = n x grad N the surface curl of a
 * shape function at y, one source node needs X (c x e_q), c / |r| and N (r . n) / |r|^3, times what
 * the row has at x: its shape functions for D, its hats for B.
 */
#ifndef PALP_TOOLS_KERNEL_SUMS_H
#define PALP_TOOLS_KERNEL_SUMS_H

#include "tools/solver/quadratic.h"
#include "tools/solver/gauss.h"
#include "tools/solver/wide.h"

enum {
    SOURCE_LAYER = 12, /* where the double layer of 1 / |r| stands, behind 9 + 3 lanes */
    SOURCE_LANES = 13,
    ROW_POLYNOMIALS = 6, /* shape functions of the row triangle */
    D_LANES = 12,        /* X (c x e_q), [k][q], and c / |r| */
    B_LANES = 10,        /* X (c x e_q) and the double layer */
    ROW_LANES = ROW_POLYNOMIALS * D_LANES + 3 * B_LANES,
    OUTER_LANES = 6 /* r r^T / |r|^3: xx yy zz yz xz xy; their trace is 1 / |r| */
};

/* A point of a curved triangle; derivatives along corner 0 -> 1 and 0 -> 2. */
typedef struct {
    double at[3], along_u[3], along_v[3];
    double normal[3], jacobian; /* along_u x along_v and its length */
    double n[6], n_u[6], n_v[6], corner[3];
    double weight;
} surface_point;

surface_point surface_point_at(const quadratic_surface *q, uint32_t triangle,
                               const double corner[3], double weight);

/* Six source nodes, three source hats, and tractions (y - origin)_d n, as seen from one x. */
typedef struct {
    double node[6][SOURCE_LANES];
    double hat[3][OUTER_LANES];
    double weight[3][3]; /* [row][d] */
} source_sums;

/* The same summed for the rows of one triangle. */
typedef struct {
    double node[6][ROW_LANES];
    double hat[3][3][OUTER_LANES]; /* [source][row] */
    double weight[3][3][3];        /* [row][axis][d] */
} pair_sums;

typedef struct {
    double poisson, origin[3];
} kernel_problem;

/* s += the kernels between x and `count` points, each with its weight. */
void sum_sources(const kernel_problem *k, const double x[3], const surface_point *y, uint32_t count,
                 source_sums *s);
/* to += what the source sums at x give to its triangle's rows. */
void add_row_point(pair_sums *to, const surface_point *x, double weight, const source_sums *s);
/* to += one source point against `count` points of the row triangle, each with its weight. */
void sum_rows(const kernel_problem *k, const surface_point *x, uint32_t count,
              const surface_point *y, pair_sums *to);

#endif
