/* SPDX-License-Identifier: MIT */
/*
 * The spherical tool as seen by one surface node.
 *
 * A node at x with outward unit normal n is pushed along -n until it leaves the tool at centre c:
 *
 *     d(c) = (x - c).n + psi(t),   t = |(I - n n^T)(x - c)|
 *     psi(t) = sqrt(r^2 - t^2)                for t <= beta r
 *              its tangent line               beyond, so that the slope stays bounded
 *
 * The constraint is n.u <= -d, normal-only as in MR: no friction. d depends on c alone, so the
 * contact force sum lambda (-dd/dc) is the gradient of an energy and a closed path of the tool
 * gains nothing.
 */
#ifndef PALP_TOUCH_SPHERE_H
#define PALP_TOUCH_SPHERE_H

#include "core/base/real.h"

#define PALP_SPHERE_BETA 0.8f /* psi is the sphere's up to 53 degrees from the normal */
#define PALP_SPHERE_REACH                                                                          \
    1.6f /* nodes farther than this from the normal axis, over r, are not considered */

typedef struct {
    float depth_m;  /* d, negative outside */
    float offset_m; /* t */
    palp_vec3 push; /* -dd/dc: force on the tool per newton of normal force */
} palp_sphere_contact;

/* Evaluates the above. Cost: two square roots and about 40 flops. */
palp_sphere_contact palp_sphere_at(float radius_m, palp_vec3 center, palp_vec3 x, palp_vec3 n);

#endif
