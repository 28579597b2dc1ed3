/* SPDX-License-Identifier: MIT */
/*
 * Contact of a point, spread by a pressure mask (MR 9).
 *
 * A tip finer than the mesh would fall from node to node. Its force is spread over the nodes within
 * the mask's radius instead, by weights that move smoothly with it:
 *
 *     m_i = a_i (1 - |x_i - c|^2 / r^2)^2 / sum        pressure mask
 *     delta = (x - c).n,  x = sum m_i x_i,  n = sum m_i n_i
 *     g = sum_ij m_i m_j g_ij,  lambda = max(delta, 0) / g
 *     E(c) = delta^2 / (2 g),   F = -dE/dc = -lambda grad delta + lambda^2 / 2 grad g
 *
 * The gradients are exact, so the force is that of an energy: no bumps at nodes and edges, and
 * nothing gained on closed paths.
 */
#ifndef PALP_TOUCH_POINT_H
#define PALP_TOUCH_POINT_H

#include "core/touch/contact.h"

/* The point works on the candidates of a contact with one tool, a sphere of the mask's radius:
 * search and admit as usual, but solve here. */
typedef struct {
    float weight[PALP_MAX_CANDIDATES]; /* m_i of the last solve */
    float lambda_N, depth_m, compliance_m_per_N;
    palp_vec3 axis; /* n */
    palp_vec3 force_N, tool_m;
} palp_point;

/* Where the contact should search for a point at `at`: a little above the surface, so that nodes
 * see the sphere before them. */
palp_vec3 palp_point_center(const palp_point *point, const palp_node_contact *contact, palp_vec3 at);

/*
 * Finds where a point held by `grip` comes to rest, from `from` (its last place, or the device),
 * and the force on it. Stiffness 0: it sits where it is held. Cost: POINT_STEPS + 1 times count
 * (count + 40) multiply-adds.
 */
#define PALP_POINT_STEPS 3u
palp_vec3 palp_point_solve(palp_point *point, palp_node_contact *contact, palp_vec3 from,
                           palp_grip grip);

/* The energy stored under the point (J). */
static inline float palp_point_energy(const palp_point *point) {
    return 0.5f * point->lambda_N * point->depth_m;
}

/*
 * Force shading (MR 9.3): turns the part of a force along the surface normal towards the normal of
 * the detail, keeping its size, by at most `limit` (tangent of the angle). Unit normals. Friction
 * and the tangential part stay.
 */
palp_vec3 palp_force_shade(palp_vec3 force_N, palp_vec3 normal, palp_vec3 detail, float limit);

#endif
