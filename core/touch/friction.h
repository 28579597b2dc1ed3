/* SPDX-License-Identifier: MIT */
/*
 * Coulomb friction of one tool, with stick and slip.
 *
 * The tangential traction is taken in proportion to the pressure: node i carries T lambda_i / N of
 * the tangential force T on the tool, N = sum lambda. So each node keeps |t_i| <= mu lambda_i, all
 * slip at once, and T is a problem of two unknowns whatever the number of nodes:
 *
 *     A = sum_ij (lambda_i lambda_j / N^2) P G_ij P        tangential compliance of the patch
 *     T = -(A + I / k)^-1 P (held + F_n / k - anchor)      stick, for a tool on a spring k
 *     |T| <= mu N                                          else T is cut back and the anchor
 * follows
 *
 * A is symmetric positive definite like G. What tangential force does to normal gaps and normal
 * force to tangential displacements is left out, on both sides, so the joint problem stays
 * symmetric. When the patch changes, T is kept unless that would store more energy; then it is
 * lowered.
 */
#ifndef PALP_TOUCH_FRICTION_H
#define PALP_TOUCH_FRICTION_H

#include "core/touch/contact.h"

typedef struct {
    palp_vec3 force_N;  /* T, on the tool */
    palp_vec3 anchor_m; /* where the tool would sit with T = 0 */
    palp_vec3 axis;     /* normal of the patch */
    palp_vec3 tangent[2];
    float compliance[3]; /* A in the tangent plane: 11, 12, 22 */
    float normal_N;      /* N */
    bool touching, slipping;
} palp_node_friction;

/* Lets go. */
void palp_node_friction_reset(palp_node_friction *friction);

/*
 * Before the solves of a tick: measures the patch of the last one and moves the anchor along with
 * it. `tool_m`: where the tool is. Cost: 9 active^2 multiply-adds.
 */
void palp_node_friction_prepare(palp_node_friction *friction, palp_node_contact *contact,
                                uint32_t tool, palp_vec3 tool_m);

/* T for a tool held at `held` by a spring (stiffness 0: rigidly) with normal forces adding up to
 * `contact_N`. */
void palp_node_friction_solve(palp_node_friction *friction, const palp_node_contact *contact,
                              uint32_t tool, palp_grip grip, palp_vec3 contact_N);

/* After the solves: while slipping the anchor follows the tool. */
void palp_node_friction_settle(palp_node_friction *friction, palp_vec3 tool_m);

/* T A T / 2 (J). */
float palp_node_friction_energy(const palp_node_friction *friction);

#endif
