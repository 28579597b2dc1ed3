/* SPDX-License-Identifier: MIT */
#include "tools/solver/electrostatics.h"
#include "tools/solver/dense.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>

#define PI 3.141592653589793

static double potential(const mesh *m, const double *area, uint32_t i, uint32_t j) {
    return i == j ? 2 * sqrt(PI / area[i]) : 1 / v_distance(m->x[i], m->x[j]);
}

double *electrostatic_greens(const mesh *m, const uint8_t *fixed, const double *area) {
    uint32_t n = 0, u = 0;
    uint32_t *node = allocate(m->vertices, sizeof *node),
             *held = allocate(m->vertices, sizeof *held);
    for (uint32_t i = 0; i < m->vertices; i++) {
        if (fixed[i] == 0) node[n++] = i;
        if (fixed[i] != 0) held[u++] = i;
    }
    double *uu = allocate_aligned((size_t)u * u, sizeof *uu);
    double *uf = allocate_aligned((size_t)u * n, sizeof *uf);
    double *fu = allocate_aligned((size_t)n * u, sizeof *fu);
    double *g = allocate_aligned((size_t)n * n, sizeof *g);
    uint32_t *perm = allocate(u, sizeof *perm);
    for (size_t i = 0; i < u; i++) {
        for (size_t j = 0; j < u; j++) uu[i * u + j] = potential(m, area, held[i], held[j]);
        for (size_t j = 0; j < n; j++)
            fu[j * u + i] = uf[i * n + j] = potential(m, area, held[i], node[j]);
    }
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < n; j++) g[i * n + j] = potential(m, area, node[i], node[j]);
    }
    if (dense_lu(uu, u, u, perm) < u) die(EXIT_WORK, "the grounded nodes' potentials are singular");
    dense_lu_solve(uu, u, u, perm, uf, n, n);
    dense_subtract_product(g, n, fu, u, uf, n, n, n, u);
    void *owned[] = {node, held, uu, uf, fu, perm};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    return g;
}
