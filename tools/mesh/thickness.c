/* SPDX-License-Identifier: MIT */
#include "tools/mesh/thickness.h"
#include "port/host/parallel.h"
#include "port/host/util.h"

typedef struct {
    const mesh *m;
    uint32_t step;
    double *thickness;
} measurement;

/* Where the ray from x along the unit vector d meets a triangle (Moeller and Trumbore 1997). */
static double ray_distance(const double x[3], const double d[3], const double a[3],
                           const double b[3], const double c[3]) {
    double ab[3], ac[3], ax[3], p[3], q[3];
    v_sub(b, a, ab);
    v_sub(c, a, ac);
    v_sub(x, a, ax);
    v_cross(d, ac, p);
    double det = v_dot(ab, p);
    if (!(fabs(det) > 0)) return HUGE_VAL;
    double u = v_dot(ax, p) / det;
    if (u < -1e-9 || u > 1 + 1e-9) return HUGE_VAL;
    v_cross(ax, ab, q);
    double v = v_dot(d, q) / det;
    if (v < -1e-9 || u + v > 1 + 1e-9) return HUGE_VAL;
    double t = v_dot(ac, q) / det;
    return t > 0 ? t : HUGE_VAL;
}

static void measure(void *context, size_t i) {
    const measurement *s = context;
    const mesh *m = s->m;
    const uint32_t own = (uint32_t)i * s->step, *v = m->t[own];
    double x[3], d[3], nearest = HUGE_VAL;
    triangle_normal(m->x[v[0]], m->x[v[2]], m->x[v[1]], d); /* inwards */
    v_normalize(d);
    for (int k = 0; k < 3; k++) x[k] = (m->x[v[0]][k] + m->x[v[1]][k] + m->x[v[2]][k]) / 3;
    for (uint32_t t = 0; t < m->triangles; t++) {
        if (t == own) continue;
        nearest =
            fmin(nearest, ray_distance(x, d, m->x[m->t[t][0]], m->x[m->t[t][1]], m->x[m->t[t][2]]));
    }
    s->thickness[i] = nearest;
}

double *mesh_thickness(const mesh *m, uint32_t step) {
    size_t count = (m->triangles + step - 1) / step;
    measurement s = {m, step, allocate(count, sizeof(double))};
    parallel_for(count, measure, &s);
    return s.thickness;
}
