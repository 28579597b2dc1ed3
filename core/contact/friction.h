/* SPDX-License-Identifier: MIT */
/*
 * Coulomb friction of one tool with partial slip (Cattaneo and Mindlin), by springs of different
 * depths (Jaeger 1998; Popov and Hess, method of dimensionality reduction).
 *
 * Pressed deeper, a contact becomes stiffer: what touches at depth z_j adds a stiffness w_j along
 * the surface and carries up to mu w_j (z - z_j) before it slips, so the rim slips first. Spring j
 * is stretched by e_j, from the material that it holds on to, which the whole body lets go by B P:
 *
 *     P = sum_j w_j clip(M e_j, mu (z - z_j))    on the body, T = -P; clip shortens to that length
 *     x = rest - P / k                            where the tool on its spring comes to rest
 *     de_j = dx - B dP                            with the motion of the tool
 *
 * e_j is a vector of space of which the part in the contact's plane counts, so that a tool that
 * comes back finds the force that it left, also where the plane has turned meanwhile.
 *
 *     A    compliance along the surface of the contact as on a half-space; a = tr A / 2, M = a A^-1
 *     B    the rest of the compliance, of the body at large
 *     w_j  sum_j w_j = 1 / a
 *     z_j  sum_j w_j (z - z_j) = N, so that |T| <= mu N
 *
 * For a rounded tool (K ~ sqrt(z), Hertz) z = 1.5 N a, in PALP_FRICTION_SPRINGS depths that are
 * equidistant in sqrt(z) up to z_top and stay where they are while the load changes: what is
 * stretched stays so, whatever the load does; what loses touch forgets. A depth that has lost touch
 * in part is two springs, what kept it and what has touched since. z_top is laid anew when z leaves
 * it. A flat tool has one spring at depth 0, z = N a. A is what a force in proportion to the
 * pressure gives, over 1.2 for a rounded tool (all points moving alike; exact for Hertz).
 *
 * The coefficient goes from mu (static) to that of sliding over a path of mu z when all slips,
 * and back at once when the tool sticks.
 *
 * What tangential force does to normal gaps and normal force to tangential displacements is left
 * out, on both sides, so the joint problem stays symmetric. All regions of a tool's contact share
 * one set of springs; spin about the normal is not resisted.
 */
#ifndef PALP_CONTACT_FRICTION_H
#define PALP_CONTACT_FRICTION_H

#include "core/contact/contact.h"

#define PALP_FRICTION_SPRINGS 16u

typedef struct {
    palp_vec3 force_N;  /* T, on the tool */
    palp_vec3 tool_m;   /* where it was settled */
    palp_vec3 solved_m; /* where it came to rest */
    palp_vec3 axis;     /* direction of the normal force on the tool */
    palp_vec3 tangent[2];
    palp_symmetric2 near_m_per_N, far_m_per_N; /* A and B, in the tangent plane */
    float normal_N;                            /* N */
    float top_m, root;                         /* z_top, sqrt(z / z_top) */
    float kept[PALP_FRICTION_SPRINGS];         /* share of a depth that has touched for longest */
    palp_vec3 stretch_m[2][PALP_FRICTION_SPRINGS]; /* e_j of that, and of the rest of it */
    float sticking_N_per_m; /* of the contact and the body, by what does not slip */
    float energy_J;         /* (sum_j w_j e_j . M e_j + T . B T) / 2 */
    float slid_m;           /* since all springs slip */
    bool touching, slipping, rounded;
} palp_friction;

/* Lets go. */
void palp_friction_reset(palp_friction *friction);

/*
 * T for a tool of the solved contact that would come to rest at rest_m with the T of before, on a
 * spring (stiffness 0: rigidly held). Cost: twice a^2 (50) + 9 modes a, and at most
 * PALP_FRICTION_STEPS + 2 passes over the springs (40 each).
 */
void palp_friction_solve(palp_friction *friction, palp_contact *contact, uint32_t tool,
                         palp_vec3 rest_m, float stiffness_N_per_m);

#define PALP_FRICTION_STEPS 6u

/* The body that it is on has moved. */
void palp_friction_carry(palp_friction *friction, palp_vec3 by_m);

/* Once the tool is where it comes to rest. */
void palp_friction_settle(palp_friction *friction, palp_vec3 tool_m);

/* Share of a device's motion across the contact that friction which sticks keeps from the tool. */
float palp_friction_share(const palp_friction *friction, float stiffness_N_per_m);

#endif
