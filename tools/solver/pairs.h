/* SPDX-License-Identifier: MIT */
/*
 * Quadrature over pairs of triangles that touch each other, for kernels like 1 / |x - y|: the
 * transformations of Sauter and Schwab (Boundary Element Methods, 2011, section 5.2) turn the
 * integrand into an analytic one, which Gauss' rule integrates in all four directions.
 */
#ifndef PALP_TOOLS_PAIRS_H
#define PALP_TOOLS_PAIRS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* The barycentric weights of a place in one triangle and those of places in the other that it is
 * paired with, [first, first + count) of `partner`. */
typedef struct {
    double corner[3];
    bool in_x; /* in the triangle of x */
    uint32_t first, count;
} pair_group;

typedef struct {
    double corner[3], weight;
} pair_partner;

/* Common corners come first, and in the same order, in the weights of both triangles. The weights of
 * a rule sum to 1/4: the integral over two triangles of area 1/2. */
typedef struct {
    uint32_t groups, partners;
    pair_group *group;
    pair_partner *partner;
} pair_rule;

/* Numbers of the corners of triangles x and y, those of common vertices first and in the same order;
 * returns how many these are. */
uint32_t pair_common_first(const uint32_t x[3], const uint32_t y[3], uint32_t of_x[3],
                           uint32_t of_y[3]);

/* `common`: corners that the two triangles share, 1 to 3; n Gauss points in each direction but that
 * away from them, at most 32. */
pair_rule pair_rule_build(uint32_t common, uint32_t n);
void pair_rule_free(pair_rule *rule);

#endif
