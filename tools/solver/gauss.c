/* SPDX-License-Identifier: MIT */
#include "tools/solver/gauss.h"
#include "port/host/util.h"
#include <math.h>
#include <string.h>

#define PI 3.14159265358979323846

void gauss_legendre(uint32_t n, double *node, double *weight) {
    for (uint32_t i = 0; i < n; i++) {
        double x = cos(PI * (i + 0.75) / (n + 0.5));
        double slope = 1;
        for (int step = 0; step < 20; step++) {
            double p0 = 1, p1 = x;
            for (uint32_t k = 2; k <= n; k++) {
                double p2 = ((2.0 * k - 1) * x * p1 - (k - 1.0) * p0) / k;
                p0 = p1;
                p1 = p2;
            }
            slope = n * (x * p1 - p0) / (x * x - 1);
            x -= p1 / slope;
        }
        node[i] = 0.5 * (1 - x);
        weight[i] = 1 / ((1 - x * x) * slope * slope);
    }
}

static triangle_rule empty_rule(uint32_t points) {
    triangle_rule r = {.points = points};
    r.corner = allocate(points, sizeof *r.corner);
    r.weight = allocate(points, sizeof *r.weight);
    return r;
}

triangle_rule triangle_rule_collapsed(uint32_t n) {
    triangle_rule r = empty_rule(n * n);
    double node[32], weight[32];
    gauss_legendre(n, node, weight);
    for (uint32_t i = 0; i < n; i++) {
        for (uint32_t k = 0; k < n; k++) {
            double s = node[i], t = node[k];
            double *c = r.corner[i * n + k];
            c[0] = 1 - s;
            c[1] = s * (1 - t);
            c[2] = s * t;
            r.weight[i * n + k] = weight[i] * weight[k] * s;
        }
    }
    return r;
}

/* Adds the three places (a, a, 1 - 2 a), or with b the six of (a, b, 1 - a - b). */
static void add_orbit(triangle_rule *r, double a, double b, double weight) {
    const double c[3] = {a, b, 1 - a - b};
    static const int order[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1},
                                    {1, 0, 2}, {0, 2, 1}, {2, 1, 0}};
    for (int i = 0; i < (fabs(a - b) > 0 ? 6 : 3); i++) {
        for (int k = 0; k < 3; k++) r->corner[r->points][k] = c[order[i][k]];
        r->weight[r->points++] = 0.5 * weight;
    }
}

triangle_rule triangle_rule_symmetric(uint32_t n) {
    triangle_rule r = empty_rule(12);
    r.points = 0;
    if (n == 2) {
        add_orbit(&r, 1.0 / 6, 1.0 / 6, 1.0 / 3);
    } else if (n == 3) {
        add_orbit(&r, 0.445948490915965, 0.445948490915965, 0.223381589678011);
        add_orbit(&r, 0.091576213509771, 0.091576213509771, 0.109951743655322);
    } else {
        add_orbit(&r, 0.249286745170910, 0.249286745170910, 0.116786275726379);
        add_orbit(&r, 0.063089014491502, 0.063089014491502, 0.050844906370207);
        add_orbit(&r, 0.053145049844817, 0.310352451033784, 0.082851075618374);
    }
    return r;
}

uint32_t gauss_order(double ratio, double tolerance) {
    double rho = ratio + sqrt(1 + ratio * ratio);
    double n = ceil(-log(tolerance) / (2 * log(rho)));
    return n < 2 ? 2 : n > 64 ? 64 : (uint32_t)n;
}
