/* SPDX-License-Identifier: MIT */
/* Quadrature on an interval and on a triangle. */
#ifndef PALP_TOOLS_GAUSS_H
#define PALP_TOOLS_GAUSS_H

#include <stdint.h>

/* Nodes and weights of the n-point Gauss-Legendre rule on [0, 1], n <= 32. */
void gauss_legendre(uint32_t n, double *node, double *weight);

/* Points of a triangle rule: barycentric weights of the three corners and the weight (sum 1/2). */
typedef struct {
    uint32_t points;
    double (*corner)[3];
    double *weight;
} triangle_rule;

/* Gauss-Legendre in both directions of the collapsed square, n <= 32: n^2 points, exact to degree
 * 2 n - 2. To be freed. */
triangle_rule triangle_rule_collapsed(uint32_t n);

/* The same degree from fewer points, n = 2, 3, 4: 3, 6, 12 points (Dunavant 1985). */
triangle_rule triangle_rule_symmetric(uint32_t n);

/*
 * Points per direction for a kernel whose nearest singularity is `ratio` half-lengths away: Gauss'
 * rule converges like rho^(-2n) with rho the Bernstein ellipse through it. From 2 to 64.
 */
uint32_t gauss_order(double ratio, double tolerance);

#endif
