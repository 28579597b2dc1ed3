/* SPDX-License-Identifier: MIT */
#include "tools/tet/tetstiff.h"
#include "core/dyna/dyna.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PASSES 120

typedef struct {
    const tetmesh *m;
    double (*gradient)[3][3];
    double lambda; /* mu = 1 */
    double (*u)[3], (*f)[3];
    double *j;
} pencil;

/* f = K u, element by element. */
static void apply(pencil *p) {
    const tetmesh *m = p->m;
    memset(p->f, 0, m->nodes * sizeof *p->f);
    for (uint32_t t = 0; t < m->tets; t++) {
        double h[3][3] = {{0}}, s[3][3], volume = tet_volume(m, t);
        for (int c = 0; c < 3; c++) {
            double d[3];
            v_sub(p->u[m->t[t][c + 1]], p->u[m->t[t][0]], d);
            for (int e = 0; e < 9; e++) h[e / 3][e % 3] += d[e / 3] * p->gradient[t][c][e % 3];
        }
        double pressure = p->lambda * (h[0][0] + h[1][1] + h[2][2]);
        for (int e = 0; e < 9; e++) {
            s[e / 3][e % 3] = volume * (h[e / 3][e % 3] + h[e % 3][e / 3]);
            if (e % 4 == 0) s[e / 3][e % 3] += volume * pressure;
        }
        for (int c = 0; c < 3; c++) {
            for (int a = 0; a < 3; a++) {
                double force = v_dot(s[a], p->gradient[t][c]);
                p->f[m->t[t][c + 1]][a] += force;
                p->f[m->t[t][0]][a] -= force;
            }
        }
    }
}

/* u := J^-1 K u, of length one in J; returns u^T K u / u^T J u before. */
static double iterate(pencil *p) {
    double stiff = 0, own = 0, norm = 0;
    apply(p);
    for (uint32_t i = 0; i < p->m->nodes; i++) {
        stiff += v_dot(p->f[i], p->u[i]);
        own += p->j[i] * v_dot(p->u[i], p->u[i]);
        norm += v_dot(p->f[i], p->f[i]) / p->j[i];
    }
    for (uint32_t i = 0; i < p->m->nodes; i++) {
        for (int a = 0; a < 3; a++) p->u[i][a] = p->f[i][a] / p->j[i] / sqrt(norm);
    }
    return stiff / own;
}

double tet_coupling(const tetmesh *m, const palp_tet_node *node) {
    static const double ratio[] = {0, 0.3, 0.45, 0.49};
    pencil p = {.m = m,
                .gradient = allocate(m->tets, sizeof *p.gradient),
                .u = allocate(m->nodes, sizeof *p.u),
                .f = allocate(m->nodes, sizeof *p.f),
                .j = allocate(m->nodes, sizeof *p.j)};
    double worst = 0;
    uint32_t seed = 1;
    for (uint32_t t = 0; t < m->tets; t++) tet_gradients(m, t, p.gradient[t]);
    for (size_t k = 0; k < sizeof ratio / sizeof ratio[0]; k++) {
        double theta = 0;
        p.lambda = 2 * ratio[k] / (1 - 2 * ratio[k]);
        for (uint32_t i = 0; i < m->nodes; i++) {
            p.j[i] = (double)palp_dyna_bound(node[i].gradient_sum, (float)(p.lambda + 1), 1.0f);
            for (int a = 0; a < 3; a++) {
                seed = seed * 1664525u + 1013904223u;
                p.u[i][a] = seed / 4294967296.0 - 0.5;
            }
        }
        for (int pass = 0; pass < PASSES; pass++) theta = iterate(&p);
        worst = fmax(worst, theta);
    }
    void *owned[] = {p.gradient, p.u, p.f, p.j};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    return fmin(4, 1.1 * worst);
}
