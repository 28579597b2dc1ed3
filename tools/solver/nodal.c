/* SPDX-License-Identifier: MIT */
#include "tools/solver/nodal.h"
#include "core/green/split.h"
#include "tools/mesh/mesh.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define MOST 700       /* nodes near the ball */
#define NEAR 1.25      /* of its radius: nodes that may come to touch */
#define ROUNDS 40      /* of directions */
#define SWEEPS 4000    /* of a round */
#define TOLERANCE 1e-7 /* of the largest force, a sweep */
#define SETTLED 1e-5   /* change of the force in a round */
#define RELAXATION 0.7 /* of displacements from round to round */

typedef struct {
    uint32_t n, node[MOST];
    double (*x)[3], (*u)[3], (*m)[3]; /* [n] rest, displaced by, out of the ball */
    double *block;                    /* [n][n][9] displacement of i by a force on j */
    double *g, *gap, *lambda;         /* [n][n], [n], [n] */
} problem;

/* Free nodes near the ball that face it. */
static bool gather(problem *p, const palp_blob *b, const double at[3], double radius) {
    for (uint32_t i = 0; i < b->meta->nodes; i++) {
        double x[3], n[3], r[3];
        for (int k = 0; k < 3; k++) {
            x[k] = (double)b->rest_m[3 * i + (uint32_t)k];
            n[k] = (double)b->normal[3 * i + (uint32_t)k];
        }
        v_sub(x, at, r);
        if (palp_node_is_fixed(b, i) || v_norm(r) > NEAR * radius || v_dot(r, n) > 0) continue;
        if (p->n == MOST) return false;
        memcpy(p->x[p->n], x, sizeof x);
        p->node[p->n++] = i;
    }
    return true;
}

/* Columns of the blob, made symmetric. */
static void fill_blocks(problem *p, const palp_blob *b) {
    const palp_domain *d = &b->domain[PALP_FREE];
    float *field = allocate_aligned((size_t)PALP_FIELD_LANES * d->slots, sizeof *field);
    for (uint32_t j = 0; j < p->n; j++) {
        for (uint32_t k = 0; k < 3; k++) {
            const float unit[3] = {k == 0, k == 1, k == 2};
            palp_nodal_response(b, palp_node_slot(b, p->node[j]), unit, field);
            for (uint32_t i = 0; i < p->n; i++) {
                const float *u = field + PALP_FIELD_LANES * palp_node_slot(b, p->node[i]);
                for (uint32_t e = 0; e < 3; e++) {
                    p->block[9 * ((size_t)i * p->n + j) + 3 * e + k] += 0.5 * (double)u[e];
                    p->block[9 * ((size_t)j * p->n + i) + 3 * k + e] += 0.5 * (double)u[e];
                }
            }
        }
    }
    free(field);
}

/* Directions out of the ball, depths along them if nothing gave way, compliances along them. */
static void linearise(problem *p, const double at[3], double radius) {
    for (uint32_t i = 0; i < p->n; i++) {
        for (int k = 0; k < 3; k++) p->m[i][k] = p->x[i][k] + p->u[i][k] - at[k];
        double length = v_norm(p->m[i]);
        v_normalize(p->m[i]);
        p->gap[i] = radius - length + v_dot(p->m[i], p->u[i]);
    }
    for (size_t i = 0; i < p->n; i++) {
        for (size_t j = 0; j < p->n; j++) {
            const double *c = p->block + 9 * (i * p->n + j);
            double sum = 0;
            for (size_t e = 0; e < 9; e++) sum += p->m[i][e / 3] * c[e] * p->m[j][e % 3];
            p->g[i * p->n + j] = sum;
        }
    }
}

/* lambda >= 0, g lambda >= gap, one of them equal, by projected Gauss-Seidel. */
static void relax(problem *p) {
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        double most = 0, change = 0;
        for (size_t i = 0; i < p->n; i++) {
            const double *row = p->g + i * p->n;
            double rest = p->gap[i];
            for (size_t j = 0; j < p->n; j++) rest -= row[j] * p->lambda[j];
            double next = fmax(p->lambda[i] + rest / row[i], 0);
            change = fmax(change, fabs(next - p->lambda[i]));
            most = fmax(most, next);
            p->lambda[i] = next;
        }
        if (change <= TOLERANCE * most) return;
    }
}

static void displace(problem *p) {
    for (size_t i = 0; i < p->n; i++) {
        double u[3] = {0};
        for (size_t j = 0; j < p->n; j++) {
            const double *c = p->block + 9 * (i * p->n + j);
            for (size_t e = 0; e < 9; e++) u[e / 3] += c[e] * p->m[j][e % 3] * p->lambda[j];
        }
        for (int k = 0; k < 3; k++) p->u[i][k] += RELAXATION * (u[k] - p->u[i][k]);
    }
}

static void sum_force(const problem *p, double force[3]) {
    memset(force, 0, 3 * sizeof *force);
    for (uint32_t i = 0; i < p->n; i++) {
        for (int k = 0; k < 3; k++) force[k] -= p->lambda[i] * p->m[i][k];
    }
}

nodal_press nodal_hold(const palp_blob *blob, const double at[3], double radius) {
    problem p = {.x = allocate(MOST, sizeof *p.x),
                 .u = allocate(MOST, sizeof *p.u),
                 .m = allocate(MOST, sizeof *p.m),
                 .gap = allocate(MOST, sizeof *p.gap),
                 .lambda = allocate(MOST, sizeof *p.lambda)};
    nodal_press out = {.settled = false};
    bool fits = gather(&p, blob, at, radius);
    p.block = allocate(9 * (size_t)p.n * p.n + 1, sizeof *p.block);
    p.g = allocate((size_t)p.n * p.n + 1, sizeof *p.g);
    out.near = p.n;
    if (fits) fill_blocks(&p, blob);
    for (int round = 0; round < ROUNDS && fits && !out.settled; round++) {
        double force[3], change[3];
        linearise(&p, at, radius);
        relax(&p);
        displace(&p);
        sum_force(&p, force);
        v_sub(force, out.force_N, change);
        out.settled = round > 0 && v_norm(change) <= SETTLED * v_norm(force);
        memcpy(out.force_N, force, sizeof force);
    }
    for (uint32_t i = 0; i < p.n; i++) out.touched += p.lambda[i] > 0;
    free(p.x);
    free(p.u);
    free(p.m);
    free(p.gap);
    free(p.lambda);
    free(p.block);
    free(p.g);
    return out;
}
