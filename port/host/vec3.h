/* SPDX-License-Identifier: MIT */
/* Vectors of three doubles. */
#ifndef PALP_HOST_VEC3_H
#define PALP_HOST_VEC3_H

#include <math.h>

static inline void v_sub(const double a[3], const double b[3], double c[3]) {
    for (int k = 0; k < 3; k++) c[k] = a[k] - b[k];
}
static inline double v_dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
static inline void v_cross(const double a[3], const double b[3], double c[3]) {
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}
static inline double v_norm(const double a[3]) { return sqrt(v_dot(a, a)); }
static inline double v_distance(const double a[3], const double b[3]) {
    double d[3];
    v_sub(a, b, d);
    return v_norm(d);
}
static inline void v_normalize(double a[3]) {
    double n = v_norm(a);
    for (int k = 0; k < 3; k++) a[k] = n > 0 ? a[k] / n : 0;
}
/* Twice the area times the unit normal of a triangle given by its corners. */
static inline void triangle_normal(const double a[3], const double b[3], const double c[3],
                                   double n[3]) {
    double u[3], v[3];
    v_sub(b, a, u);
    v_sub(c, a, v);
    v_cross(u, v, n);
}

#endif
