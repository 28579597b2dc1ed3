/* SPDX-License-Identifier: MIT */
#include "tools/solver/pairs.h"
#include "port/host/util.h"
#include "tools/solver/gauss.h"
#include <stdlib.h>

/* Along xi the integrand is a polynomial on flat triangles: of degree 3 from the Jacobian, 2 from
 * each shape function or curl, -1 from the kernel. */
#define RADIAL 4u

/* A place on the triangle 0 <= v <= u <= 1, corners (0, 0), (1, 0), (1, 1), over xi. */
typedef struct {
    double u, v;
} place;

/* The image of (a, b, c) in the unit cube, and what of the Jacobian is not xi^3. `group` is the side
 * that the inner directions of the loop leave alone. */
typedef struct {
    place group, partner;
    double jacobian;
} image;

enum { SAME_IMAGES = 6, EDGE_IMAGES = 5, CORNER_IMAGES = 2 };

/* Directions that the side of the group depends on beside xi: 1 (a) or 2 (a and b). */
typedef struct {
    bool in_x;
    int depends;
} layout;

static const layout layouts[4][SAME_IMAGES] = {
    [1] = {{true, 1}, {false, 1}},
    [2] = {{true, 2}, {true, 1}, {true, 2}, {false, 1}, {false, 2}},
    [3] = {{true, 2}, {false, 2}, {true, 2}, {false, 2}, {false, 2}, {true, 2}},
};

static image image_of(uint32_t common, uint32_t which, double a, double b, double c) {
    if (common == 1) return (image){{1, a}, {b, b * c}, b};
    if (common == 2) {
        switch (which) {
        case 0:
            return (image){{1, a * b}, {1 - a * c, a * (1 - c)}, a * a};
        case 1:
        case 3:
            return (image){{1, a}, {1 - a * b * c, a * b * (1 - c)}, a * a * b};
        case 2:
            return (image){{1 - a * b, a * (1 - b)}, {1, a * b * c}, a * a * b};
        default:
            return (image){{1, a * b}, {1 - a * b * c, a * (1 - b * c)}, a * a * b};
        }
    }
    switch (which) {
    case 0:
    case 1:
        return (image){{1, 1 - a + a * b}, {1 - a * b * c, 1 - a}, a * a * b};
    case 2:
    case 3:
        return (image){{1 - a * b, a * (1 - b)}, {1, a * (1 - b + b * c)}, a * a * b};
    default:
        return (image){{1, a * (1 - b)}, {1 - a * b * c, a * (1 - b * c)}, a * a * b};
    }
}

static void barycentric(double xi, place p, double corner[3]) {
    corner[0] = 1 - xi * p.u;
    corner[1] = xi * (p.u - p.v);
    corner[2] = xi * p.v;
}

pair_rule pair_rule_build(uint32_t common, uint32_t n) {
    static const uint32_t images[4] = {0, CORNER_IMAGES, EDGE_IMAGES, SAME_IMAGES};
    double node[32], weight[32], radius[RADIAL], radial[RADIAL];
    gauss_legendre(n, node, weight);
    gauss_legendre(RADIAL, radius, radial);
    pair_rule rule = {.groups = 0};
    size_t most = (size_t)images[common] * RADIAL * n * n * n;
    rule.group = allocate(most, sizeof *rule.group);
    rule.partner = allocate(most, sizeof *rule.partner);
    for (uint32_t k = 0; k < images[common]; k++) {
        const layout *l = &layouts[common][k];
        const uint32_t inner = l->depends == 1 ? n * n : n, outer = RADIAL * n * n * n / inner;
        for (uint32_t i = 0; i < outer; i++) {
            pair_group *g = &rule.group[rule.groups++];
            *g = (pair_group){.in_x = l->in_x, .first = rule.partners, .count = inner};
            for (uint32_t j = 0; j < inner; j++) {
                const uint32_t all = i * inner + j, r = all / n / n / n, ia = all / n / n % n,
                               ib = all / n % n, ic = all % n;
                double xi = radius[r];
                image to = image_of(common, k, node[ia], node[ib], node[ic]);
                pair_partner *p = &rule.partner[rule.partners++];
                if (j == 0) barycentric(xi, to.group, g->corner);
                barycentric(xi, to.partner, p->corner);
                p->weight =
                    radial[r] * weight[ia] * weight[ib] * weight[ic] * xi * xi * xi * to.jacobian;
            }
        }
    }
    return rule;
}

uint32_t pair_common_first(const uint32_t x[3], const uint32_t y[3], uint32_t of_x[3],
                           uint32_t of_y[3]) {
    uint32_t common = 0;
    bool in_x[3] = {0}, in_y[3] = {0};
    for (uint32_t i = 0; i < 9; i++) {
        if (x[i / 3] != y[i % 3]) continue;
        in_x[i / 3] = in_y[i % 3] = true;
        of_x[common] = i / 3;
        of_y[common++] = i % 3;
    }
    uint32_t nx = common, ny = common;
    for (uint32_t i = 0; i < 3; i++) {
        if (!in_x[i]) of_x[nx++] = i;
        if (!in_y[i]) of_y[ny++] = i;
    }
    return common;
}

void pair_rule_free(pair_rule *rule) {
    free(rule->group);
    free(rule->partner);
}
