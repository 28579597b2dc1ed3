/* SPDX-License-Identifier: MIT */
/*
 * Coulomb friction of one tool, with stick and slip.
 *
 * The tangential traction is taken in proportion to the pressure: point i carries T lambda_i / N of
 * the tangential force T on the tool, N = sum lambda. So each point keeps |t_i| <= mu lambda_i, all
 * slip at once, and T is a problem of two unknowns whatever the number of points:
 *
 *     A = sum_ij (lambda_i lambda_j / N^2) P C_ij P            tangential compliance of the contact
 *     T = -(A + I / k)^-1 P (tool without T - anchor)         stick, for a tool on a spring k
 *     |T| <= mu N                                   else T is cut back and the anchor follows
 *
 * A is symmetric positive definite like C. What tangential force does to normal gaps and normal
 * force to tangential displacements is left out, on both sides, so the joint problem stays
 * symmetric. When the contact changes, T is kept unless that would store more energy; then it is
 * lowered.
 */
#ifndef PALP_CONTACT_FRICTION_H
#define PALP_CONTACT_FRICTION_H

#include "core/contact/contact.h"

typedef struct {
    palp_vec3 force_N;  /* T, on the tool */
    palp_vec3 anchor_m; /* where the tool would sit with T = 0 */
    palp_vec3 tool_m;   /* where it was settled */
    palp_vec3 axis;     /* direction of the normal force on the tool */
    palp_vec3 tangent[2];
    float compliance[3]; /* A in the tangent plane: 11, 12, 22 */
    float normal_N;      /* N */
    bool touching, slipping;
} palp_friction;

/* Lets go. */
void palp_friction_reset(palp_friction *friction);

/*
 * T for a tool of the solved contact that would come to rest at rest_m with the T of before, on a
 * spring (stiffness 0: rigidly held). Cost: twice a^2 (50) + 9 modes a.
 */
void palp_friction_solve(palp_friction *friction, palp_contact *contact, uint32_t tool,
                         palp_vec3 rest_m, float stiffness_N_per_m);

/* The body that it is on has moved. */
void palp_friction_carry(palp_friction *friction, palp_vec3 by_m);

/* Once the tool is where it comes to rest: while slipping the anchor follows it. */
void palp_friction_settle(palp_friction *friction, palp_vec3 tool_m);

/* Share of a device's motion across the contact that friction which sticks keeps from the tool. */
float palp_friction_share(const palp_friction *friction, float stiffness_N_per_m);

/* T A T / 2 (J). */
float palp_friction_energy(const palp_friction *friction);

#endif
