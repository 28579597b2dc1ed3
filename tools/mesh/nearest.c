/* SPDX-License-Identifier: MIT */
#include "tools/mesh/nearest.h"
#include "port/host/vec3.h"

double nearest_on_triangle(const double x[3], const double a[3], const double b[3],
                           const double c[3], double corner[3], double point[3]) {
    double ab[3], ac[3], ax[3], bx[3], cx[3];
    v_sub(b, a, ab);
    v_sub(c, a, ac);
    v_sub(x, a, ax);
    v_sub(x, b, bx);
    v_sub(x, c, cx);
    double d1 = v_dot(ab, ax), d2 = v_dot(ac, ax), d3 = v_dot(ab, bx), d4 = v_dot(ac, bx);
    double d5 = v_dot(ab, cx), d6 = v_dot(ac, cx);
    double va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
    double s, t; /* point = a + s ab + t ac */
    if (d1 <= 0 && d2 <= 0) {
        s = t = 0;
    } else if (d3 >= 0 && d4 <= d3) {
        s = 1;
        t = 0;
    } else if (d6 >= 0 && d5 <= d6) {
        s = 0;
        t = 1;
    } else if (vc <= 0 && d1 >= 0 && d3 <= 0) {
        s = d1 / (d1 - d3);
        t = 0;
    } else if (vb <= 0 && d2 >= 0 && d6 <= 0) {
        s = 0;
        t = d2 / (d2 - d6);
    } else if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        s = 1 - t;
    } else {
        double sum = va + vb + vc;
        s = vb / sum;
        t = vc / sum;
    }
    corner[0] = 1 - s - t;
    corner[1] = s;
    corner[2] = t;
    for (int k = 0; k < 3; k++) point[k] = a[k] + s * ab[k] + t * ac[k];
    return v_distance(x, point);
}
