/* SPDX-License-Identifier: MIT */
#include "tools/solver/near_field.h"
#include "tools/mesh/nearest.h"
#include "tools/solver/gauss.h"
#include <string.h>

/* Where the nearest places of two segments lie inside both; HUGE_VAL where an end is nearer. */
static double inner_distance(const double a[3], const double b[3], const double c[3],
                             const double d[3]) {
    double u[3], v[3], w[3], gap[3];
    v_sub(b, a, u);
    v_sub(d, c, v);
    v_sub(a, c, w);
    double uu = v_dot(u, u), uv = v_dot(u, v), vv = v_dot(v, v), uw = v_dot(u, w), vw = v_dot(v, w);
    double det = uu * vv - uv * uv;
    if (det <= 1e-12 * uu * vv) return HUGE_VAL;
    double s = (uv * vw - vv * uw) / det, t = (uu * vw - uv * uw) / det;
    if (s <= 0 || s >= 1 || t <= 0 || t >= 1) return HUGE_VAL;
    for (int k = 0; k < 3; k++) gap[k] = w[k] + s * u[k] - t * v[k];
    return v_norm(gap);
}

double triangle_distance(const double *const p[3], const double *const q[3]) {
    double nearest = HUGE_VAL, corner[3], place[3];
    for (int i = 0; i < 3; i++) {
        nearest = fmin(nearest, nearest_on_triangle(p[i], q[0], q[1], q[2], corner, place));
        nearest = fmin(nearest, nearest_on_triangle(q[i], p[0], p[1], p[2], corner, place));
        for (int j = 0; j < 3; j++)
            nearest = fmin(nearest, inner_distance(p[i], p[(i + 1) % 3], q[j], q[(j + 1) % 3]));
    }
    return nearest;
}

uint32_t near_points(const quadratic_surface *q, uint32_t triangle, const double apex[3],
                     double gap, uint32_t n, surface_point *to) {
    double node[32], weight[32], at[3] = {0};
    const double *c[3];
    uint32_t count = 0;
    gauss_legendre(n, node, weight);
    for (int i = 0; i < 3; i++) {
        c[i] = quadratic_node(q, triangle, i);
        for (int k = 0; k < 3; k++) at[k] += apex[i] * c[i][k];
    }
    for (int side = 0; side < 3; side++) {
        const int first = side, second = (side + 1) % 3;
        const double share = apex[(side + 2) % 3];
        if (share < 1e-9) continue;
        double along[3], out[3];
        v_sub(c[second], c[first], along);
        v_sub(at, c[first], out);
        double length2 = v_dot(along, along), t0 = v_dot(out, along) / length2;
        double height2 = fmax(v_dot(out, out) - t0 * t0 * length2, 0);
        double scale = sqrt((height2 + gap * gap) / length2);
        double begin = asinh(-t0 / scale), range = asinh((1 - t0) / scale) - begin;
        for (uint32_t i = 0; i < n; i++) {
            double t = t0 + scale * sinh(begin + range * node[i]);
            double dt = scale * cosh(begin + range * node[i]) * range * weight[i];
            double off = t - t0, reach = sqrt(height2 + off * off * length2);
            double near = gap / reach, top = asinh(1 / near);
            for (uint32_t k = 0; k < n; k++) {
                double s = near * sinh(top * node[k]);
                double ds = near * cosh(top * node[k]) * top * weight[k], corner[3];
                for (int e = 0; e < 3; e++) corner[e] = (1 - s) * apex[e];
                corner[first] += s * (1 - t);
                corner[second] += s * t;
                to[count++] = surface_point_at(q, triangle, corner, share * s * ds * dt);
            }
        }
    }
    return count;
}
