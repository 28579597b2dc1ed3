/* SPDX-License-Identifier: MIT */
/*
 * Coulomb friction of one tool: springs of each region that it touches (contact/springs.h), in
 * series with the body at large, which gives way by B P under all of them together.
 *
 *     P = sum of the regions' P(e)             on the body, T = -P on the tool
 *     x = rest - P / k                         where the tool on its spring comes to rest
 *     de = dx + dr x o - B dP                  with the motion and turn of the tool, o: the region
 *
 *     B    what the compliance along the surface has beyond those of the regions, which are taken
 *          as on a half-space (1 / 1.2 of what a force in proportion to the pressure gives, for a
 *          rounded tool: all points moving alike; exact for Hertz)
 *
 * Regions are followed from tick to tick by where they are. One that parts hands its stretches on
 * to both, those that meet take the mean by their forces.
 *
 * What tangential force does to normal gaps and normal force to tangential displacements is left
 * out, on both sides, so the joint problem stays symmetric. Rolling does not relax the springs. To
 * a turn only the springs give way, not the body at large.
 */
#ifndef PALP_CONTACT_FRICTION_H
#define PALP_CONTACT_FRICTION_H

#include "core/contact/springs.h"

typedef struct {
    palp_vec3 force_N;   /* T, on the tool */
    palp_vec3 moment_Nm; /* and its moment about the tool's reference point */
    palp_frame tool;     /* where it was settled */
    palp_vec3 solved_m;  /* where it came to rest */
    palp_vec3 tangent[2];
    palp_symmetric2 far_m_per_N; /* B, across the force of the contact */
    float normal_N;              /* N, all regions together */
    palp_springs region[PALP_CONTACT_REGIONS];
    uint32_t regions;       /* 0: the tool does not touch */
    float sticking_N_per_m; /* of the contact and the body, by what does not slip */
    float sticking_Nm;      /* and against a turn of the tool about its reference point, per rad */
    float energy_J;         /* of springs and B */
    bool slipping;          /* everywhere */
} palp_friction;

/* Room to work in, which keeps nothing from call to call: one serves all tools. */
typedef struct {
    palp_springs before[PALP_CONTACT_REGIONS];
    palp_spring_set set[PALP_CONTACT_REGIONS];
    palp_contact_region region[2][PALP_CONTACT_REGIONS];
} palp_friction_work;

/* Lets go. */
void palp_friction_reset(palp_friction *friction);

/*
 * T for a tool of the solved contact that would come to rest at `rest` with the T of before, on a
 * spring (stiffness 0: rigidly held). It has turned from where it was settled; what turns it more is
 * the caller's. Cost: four times a^2 (50) and twice 9 modes a, and at most
 * PALP_FRICTION_STEPS + 2 passes over the springs (50 each).
 */
void palp_friction_solve(palp_friction *friction, palp_friction_work *work, palp_contact *contact,
                         uint32_t tool, const palp_frame *rest, float stiffness_N_per_m);

#define PALP_FRICTION_STEPS 6u

/* The body that it is on has moved. */
void palp_friction_carry(palp_friction *friction, palp_vec3 by_m);

/* Once the tool is where it comes to rest. */
void palp_friction_settle(palp_friction *friction, const palp_frame *tool);

/* Share of a device's motion across the contact that friction which sticks keeps from the tool. */
float palp_friction_share(const palp_friction *friction, float stiffness_N_per_m);

#endif
