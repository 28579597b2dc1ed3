/* SPDX-License-Identifier: MIT */
/* What the reference boundary value problem is made of, whichever method solves it. */
#ifndef PALP_TOOLS_RBVP_H
#define PALP_TOOLS_RBVP_H

#include "port/host/vec3.h"
#include "tools/solver/bem.h"
#include <string.h>

static inline bool all_fixed(const mesh *m, const uint8_t *fixed, uint32_t triangle) {
    const uint32_t *t = m->t[triangle];
    return fixed[t[0]] != 0 && fixed[t[1]] != 0 && fixed[t[2]] != 0;
}

/* Rigid mode `mode` (three translations, three rotations about the origin) at x. */
static inline void rigid_mode(const double x[3], size_t mode, double u[3]) {
    double axis[3] = {0};
    memset(u, 0, 3 * sizeof *u);
    if (mode < 3) {
        u[mode] = 1;
        return;
    }
    axis[mode - 3] = 1;
    v_cross(axis, x, u);
}

/*
 * Displacement at y of the hydrostatic particular solution for unit body force along `axis`: its
 * stress is -y_axis I, so its traction is -y_axis n.
 */
static inline void particular_displacement(const bem_material *material, const double y[3],
                                           size_t axis, double u[3]) {
    double a = -(1 - 2 * material->poisson) / material->young_Pa;
    for (size_t k = 0; k < 3; k++) {
        u[k] = a * (y[axis] * y[k] - (k == axis ? 0.5 * v_dot(y, y) : 0));
    }
}

#endif
