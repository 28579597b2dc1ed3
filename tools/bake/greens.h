/* SPDX-License-Identifier: MIT */
/*
 * Green's functions of the reference boundary value problem, dense and in force form, from the
 * boundary element solver or from a compliance matrix made elsewhere.
 */
#ifndef PALP_TOOLS_GREENS_H
#define PALP_TOOLS_GREENS_H

#include "tools/solver/bem.h"
#include "tools/bake/nearest_spd.h"
#include "tools/bake/hierarchy.h"
#include <stdio.h>

/*
 * v = M v^: rows and columns run over nodes, three each, in mesh order; three more columns hold the
 * response to unit acceleration along x, y, z when `gravity` is set. Rows of free nodes are
 * displacements (m), rows of fixed nodes reaction forces (N); columns of free nodes are forces, of
 * fixed nodes displacements.
 */
typedef struct {
    uint32_t nodes;
    size_t width; /* columns = row stride of m */
    double *m;    /* [3 nodes][width] */
    const uint8_t *fixed;
    bool gravity, reactions; /* what the matrix holds beyond the free-free block */
    /* Loads on the basis functions of one level of the free domain instead: columns are the
     * `basis_count` slots of that level, there are none of fixed nodes. 0: columns are the nodes.
     */
    uint32_t basis_count;
    bool averaged; /* displacements are means under hats, not those of the nodes */
    bool scalar;   /* one unknown per node, held as multiples of the identity */
    double reciprocity_residual, equilibrium_residual;
    definite_report definite;
} greens;

/* Solves the RBVP for every column. Exits when the system is singular. Cost: 8/3 (3n)^3 flops. */
greens greens_from_bem(const mesh *m, const uint8_t *fixed, const bem_material *material,
                       double density_kg_m3);

/* The same by Galerkin boundary elements (tools/solver/galerkin.h): symmetric and positive definite
 * by construction. Displacements are means under hats, forces act spread over them; a fixed patch
 * ends at edges of the body, on a smooth surface halfway to the next node, with material->crisp at
 * its own triangles. Cost: 7/3 (3n)^3 flops and the integrals. */
greens greens_from_galerkin(const mesh *m, const uint8_t *fixed, const bem_material *material,
                            double density_kg_m3);

/*
 * The same for loads on the basis functions of `level` only (MR 7.3): one matrix of order 3n and
 * 3 n_level right-hand sides, made row by row, so that the finest columns are never formed.
 * Memory: 72 n^2 bytes and the result.
 */
greens greens_coarse_from_bem(const mesh *m, const uint8_t *fixed, const bem_material *material,
                              double density_kg_m3, const hierarchy *h, uint32_t level);

/* Reads a .npy matrix: free-free (3 m x 3 m, mesh order) or full (3 n x 3 n, rows of fixed nodes
 * ignored). */
greens greens_from_npy(const char *path, const mesh *m, const uint8_t *fixed);

/* The square matrix x[n][n] in NumPy's format, doubles; greens_from_npy reads it. */
void npy_write(FILE *f, const double *x, size_t n);

/*
 * Measures the reciprocity residual; with `enforce` replaces the matrix by its reciprocal part
 * (free-free and fixed-fixed blocks symmetric, mixed blocks skew: Betti) and makes the free-free
 * block positive definite (nearest_spd.h); exits when that would change it by more than
 * GREENS_CHANGE_MAX.
 */
#define GREENS_CHANGE_MAX 0.01
void greens_reciprocity(greens *g, const mesh *m, bool enforce);

static inline double *greens_row(const greens *g, size_t node, size_t axis) {
    return g->m + (3 * node + axis) * g->width;
}

#endif
