/* SPDX-License-Identifier: MIT */
/*
 * What a half-space gives way by at a place off its load (Boussinesq, Cerruti), without the factor
 * (1 + nu) / (pi E):
 *
 *     B(r) f = 1/|r| ((1 - nu) f + nu e (e . f) + (1/2 - nu) (e (n . f) - n (e . f))),   e = r / |r|
 *
 * r from the load to the place, n the mean of the outward normals of both. Symmetric: exchanging
 * both places transposes it.
 */
#ifndef PALP_GREEN_HALF_SPACE_H
#define PALP_GREEN_HALF_SPACE_H

#include "core/base/real.h"

/* Displacement by the force f; 0 at the load itself. */
static inline palp_vec3 palp_half_space_displacement(float nu, palp_vec3 r, palp_vec3 n,
                                                     palp_vec3 f) {
    const float r2 = palp_dot(r, r), rest = 0.5f - nu;
    const float inverse = r2 > 0.0f ? 1.0f / palp_sqrt(r2) : 0.0f;
    const palp_vec3 e = palp_scale(inverse, r);
    const float along = palp_dot(e, f), across = palp_dot(n, f);
    const palp_vec3 u = palp_madd(palp_scale(1.0f - nu, f), nu * along + rest * across, e);
    return palp_scale(inverse, palp_madd(u, -rest * along, n));
}

#endif
