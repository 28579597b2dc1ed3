/* SPDX-License-Identifier: MIT */
#ifndef PALP_TOOLS_PARTICULAR_H
#define PALP_TOOLS_PARTICULAR_H

#include "port/host/vec3.h"
#include "tools/solver/bem.h"

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
