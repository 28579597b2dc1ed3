/* SPDX-License-Identifier: MIT */
#include "tools/solver/kernel_sums.h"
#include <string.h>

surface_point surface_point_at(const quadratic_surface *q, uint32_t triangle,
                               const double corner[3], double weight) {
    surface_point p;
    p.weight = weight;
    memcpy(p.corner, corner, sizeof p.corner);
    quadratic_shape(corner, p.n, p.n_u, p.n_v);
    const double *x[6];
    for (int i = 0; i < 6; i++) x[i] = quadratic_node(q, triangle, i);
    for (int k = 0; k < 3; k++) {
        double at = 0, u = 0, v = 0;
        for (int i = 0; i < 6; i++) {
            at += p.n[i] * x[i][k];
            u += p.n_u[i] * x[i][k];
            v += p.n_v[i] * x[i][k];
        }
        p.at[k] = at;
        p.along_u[k] = u;
        p.along_v[k] = v;
    }
    v_cross(p.along_u, p.along_v, p.normal);
    p.jacobian = v_norm(p.normal);
    return p;
}

/* weight r r^T / |r|^3; returns weight / |r|^3. */
static inline double outer_product(const double r[3], double weight, double w[OUTER_LANES]) {
    double inverse2 = 1 / (r[0] * r[0] + r[1] * r[1] + r[2] * r[2]);
    double cube = weight * inverse2 * sqrt(inverse2);
    w[0] = cube * r[0] * r[0];
    w[1] = cube * r[1] * r[1];
    w[2] = cube * r[2] * r[2];
    w[3] = cube * r[1] * r[2];
    w[4] = cube * r[0] * r[2];
    w[5] = cube * r[0] * r[1];
    return cube;
}

/* X (t x e_q), [k][q], from r r^T / |r|^3 and its trace. */
static inline void cross_columns(const double w[OUTER_LANES], double iso, double nu2,
                                 const double t[3], double to[9]) {
    double k00 = nu2 * iso + w[0], k11 = nu2 * iso + w[1], k22 = nu2 * iso + w[2];
    to[0] = w[5] * t[2] - w[4] * t[1];
    to[1] = w[4] * t[0] - k00 * t[2];
    to[2] = k00 * t[1] - w[5] * t[0];
    to[3] = k11 * t[2] - w[3] * t[1];
    to[4] = w[3] * t[0] - w[5] * t[2];
    to[5] = w[5] * t[1] - k11 * t[0];
    to[6] = w[3] * t[2] - k22 * t[1];
    to[7] = k22 * t[0] - w[4] * t[2];
    to[8] = w[4] * t[1] - w[3] * t[0];
}

/* Kelvin's solution times 16 pi mu (1 - nu), applied to n. */
static inline void pull_along(const double w[OUTER_LANES], double iso, double poisson,
                              const double n[3], double to[3]) {
    double shear = (3 - 4 * poisson) * iso;
    to[0] = (shear + w[0]) * n[0] + w[5] * n[1] + w[4] * n[2];
    to[1] = w[5] * n[0] + (shear + w[1]) * n[1] + w[3] * n[2];
    to[2] = w[4] * n[0] + w[3] * n[1] + (shear + w[2]) * n[2];
}

WIDE void sum_sources(const kernel_problem *k, const double x[3], const surface_point *y,
                      uint32_t count, source_sums *s) {
    const double nu2 = 1 - 2 * k->poisson;
    for (uint32_t i = 0; i < count; i++, y++) {
        double r[3] = {x[0] - y->at[0], x[1] - y->at[1], x[2] - y->at[2]}, w[OUTER_LANES];
        double cube = outer_product(r, y->weight, w), iso = w[0] + w[1] + w[2];
        double layer = cube * (r[0] * y->normal[0] + r[1] * y->normal[1] + r[2] * y->normal[2]);
        double of_u[12], of_v[12]; /* of the two tangents, and these themselves */
        cross_columns(w, iso, nu2, y->along_u, of_u);
        cross_columns(w, iso, nu2, y->along_v, of_v);
        for (int e = 0; e < 3; e++) {
            of_u[9 + e] = iso * y->along_u[e];
            of_v[9 + e] = iso * y->along_v[e];
        }
        for (int c = 0; c < 6; c++) { /* the curl is n_u along_v - n_v along_u */
            double *to = s->node[c], u = y->n_u[c], v = y->n_v[c];
            for (int e = 0; e < 12; e++) to[e] += u * of_v[e] - v * of_u[e];
            to[SOURCE_LAYER] += layer * y->n[c];
        }
        for (int b = 0; b < 3; b++) {
            double share = y->corner[b] * y->jacobian;
            for (int e = 0; e < OUTER_LANES; e++) s->hat[b][e] += share * w[e];
        }
        double pull[3];
        pull_along(w, iso, k->poisson, y->normal, pull);
        for (int e = 0; e < 3; e++) {
            for (int d = 0; d < 3; d++) s->weight[e][d] += pull[e] * (y->at[d] - k->origin[d]);
        }
    }
}

WIDE void add_row_point(pair_sums *to, const surface_point *x, double weight,
                        const source_sums *s) {
    double hat[3];
    for (int b = 0; b < 3; b++) hat[b] = weight * x->corner[b] * x->jacobian;
    for (int c = 0; c < 6; c++) {
        const double *from = s->node[c];
        double *lane = to->node[c];
        for (int p = 0; p < ROW_POLYNOMIALS; p++, lane += D_LANES) {
            double share = weight * x->n[p];
            for (int e = 0; e < D_LANES; e++) lane[e] += share * from[e];
        }
        for (int b = 0; b < 3; b++, lane += B_LANES) {
            for (int e = 0; e < 9; e++) lane[e] += hat[b] * from[e];
            lane[9] += hat[b] * from[SOURCE_LAYER];
        }
    }
    for (int b = 0; b < 3; b++) {
        for (int c = 0; c < 3; c++) {
            for (int e = 0; e < OUTER_LANES; e++) to->hat[c][b][e] += hat[b] * s->hat[c][e];
        }
        for (int e = 0; e < 9; e++) to->weight[b][e / 3][e % 3] += hat[b] * s->weight[e / 3][e % 3];
    }
}

WIDE void sum_rows(const kernel_problem *k, const surface_point *x, uint32_t count,
                   const surface_point *y, pair_sums *to) {
    /* r r^T / |r|^3 against the six shape functions and the three hats; the double layer against
     * these */
    double outer[ROW_POLYNOMIALS + 3][OUTER_LANES] = {{0}}, layer[3] = {0};
    for (uint32_t i = 0; i < count; i++, x++) {
        double r[3] = {x->at[0] - y->at[0], x->at[1] - y->at[1], x->at[2] - y->at[2]};
        double w[OUTER_LANES], cube = outer_product(r, x->weight, w);
        cube *= r[0] * y->normal[0] + r[1] * y->normal[1] + r[2] * y->normal[2];
        for (int p = 0; p < ROW_POLYNOMIALS; p++) {
            for (int e = 0; e < OUTER_LANES; e++) outer[p][e] += x->n[p] * w[e];
        }
        for (int b = 0; b < 3; b++) {
            double share = x->corner[b] * x->jacobian;
            for (int e = 0; e < OUTER_LANES; e++) outer[ROW_POLYNOMIALS + b][e] += share * w[e];
            layer[b] += share * cube;
        }
    }
    const double nu2 = 1 - 2 * k->poisson;
    for (int p = 0; p < ROW_POLYNOMIALS + 3; p++) {
        const double *w = outer[p];
        const bool of_d = p < ROW_POLYNOMIALS;
        double iso = w[0] + w[1] + w[2], of_u[12], of_v[12];
        cross_columns(w, iso, nu2, y->along_u, of_u);
        cross_columns(w, iso, nu2, y->along_v, of_v);
        for (int e = 0; e < 3; e++) {
            of_u[9 + e] = iso * y->along_u[e];
            of_v[9 + e] = iso * y->along_v[e];
        }
        int b = p - ROW_POLYNOMIALS;
        for (int c = 0; c < 6; c++) {
            double *lane = to->node[c], u = y->n_u[c], v = y->n_v[c];
            lane += of_d ? p * D_LANES : ROW_POLYNOMIALS * D_LANES + b * B_LANES;
            for (int e = 0; e < (of_d ? 12 : 9); e++) lane[e] += u * of_v[e] - v * of_u[e];
            if (!of_d) lane[9] += layer[b] * y->n[c];
        }
        if (of_d) continue;
        for (int c = 0; c < 3; c++) {
            double share = y->corner[c] * y->jacobian;
            for (int e = 0; e < OUTER_LANES; e++) to->hat[c][b][e] += share * w[e];
        }
        double pull[3];
        pull_along(w, iso, k->poisson, y->normal, pull);
        for (int e = 0; e < 9; e++)
            to->weight[b][e / 3][e % 3] += pull[e / 3] * (y->at[e % 3] - k->origin[e % 3]);
    }
}
