/* SPDX-License-Identifier: MIT */
/*
 * Virtual coupling: a spring holds each tool to its device, and the contact finds where it comes
 * to rest on the surface (a proxy, with the device's limit of stiffness).
 *
 *     tool = device + (F + T + O) / k                  F contact, T friction,
 *                                                      O what a change of level left over
 *     force on the hand = k (tool - device) + D        while touching, else 0
 *
 * A device whose wrist has motors may hold the tool's directions by a spring k_r in the same manner,
 * with moments about the reference point for forces and the turn from device to tool for the way.
 * Without it the tool has the directions of the device, and the moment on the hand is that on the
 * tool: what a wrist with encoders alone lets nobody feel.
 *
 * The damper D acts against the velocity v of the device along F alone, and along T where that
 * sticks, by at most half of each:
 *
 *     D_n = - clamp(b v . n, -|F| / 2, |F| / 2) n,   n = F / |F|
 *
 * So it comes in with the force, does not drag across a smooth surface, and never pulls.
 *
 * Where the tool will be is foreseen from what the last contact resisted with: along its force with
 * the stiffness k_c = 0.6 F^2 / E (exact for Hertz' law), not at all across it,
 *
 *     tool' = tool + dx - n n . (dx - db) k_c / (k_c + k)    dx, db: motion of device and body
 *
 * (with a turn: along force and moment together, by the work that the motion does against them).
 *
 * That place serves to lay the contact points, and as the answer of a tick that has no time for
 * more: the body goes on resisting as it did. A tool that leaves the surface is put at the device.
 *
 * A change of the contact level changes F by a few per cent, in the first answers as it settles.
 * The difference O is kept as a force of its own, which fades with PALP_COUPLING_FADE_S. It is
 * never more than PALP_COUPLING_OFFSET of F, so what it gives or takes is bounded in size and in
 * time.
 */
#ifndef PALP_HAPTIC_COUPLING_H
#define PALP_HAPTIC_COUPLING_H

#include "core/contact/friction.h"

#define PALP_COUPLING_SEARCHED 256u /* nodes a tick, while a tool is placed */
#define PALP_COUPLING_FADE_S 0.03f
#define PALP_COUPLING_OFFSET 0.1f
#define PALP_COUPLING_DAMPED 0.5f
#define PALP_COUPLING_SETTLING 3u /* answers after a change of level that O makes up for */

/* One tool on its spring. */
typedef struct {
    float stiffness_N_per_m;                         /* k > 0 */
    float damping_Ns_per_m;                          /* b >= 0 */
    float stiffness_Nm_per_rad, damping_Nms_per_rad; /* k_r; 0: the device's directions */
    palp_frame tool, device;
    palp_vec3 velocity_m_s, velocity_rad_s; /* of the device, set by who measures it better than by
                                               differences of places */
    bool measured;                          /* then this is set too */
    palp_frame expected;                    /* the tool, foreseen for the tick under way */
    palp_wrench contact;                    /* F of the last answer, about the tool */
    palp_wrench offset;                     /* O */
    palp_vec3 held_Nm;                      /* what of friction's moment turns the tool */
    palp_vec3 carried_m;                    /* by the bodies that press it, since that answer, */
    palp_vec3 brought_m;                    /* and of that in this tick */
    float yield_per_J;                      /* k_c / F^2 */
    palp_friction friction;
    bool absent; /* set by the caller: it is far from everything, and let go */
    bool placed, touching;
    uint32_t searched, nearest; /* nodes, before it is placed */
    float least_m2;
} palp_coupling_tool;

typedef struct {
    palp_coupling_tool tool[PALP_CONTACT_TOOLS];
    palp_frame next[PALP_CONTACT_TOOLS]; /* devices in the tick under way */
    uint32_t settling; /* answers that the contact still takes to settle on another level */
    palp_friction_work work;
} palp_coupling;

typedef struct {
    palp_vec3 force_N, moment_Nm; /* on the device, about the tool's reference point */
    palp_frame tool;
    float moved_m;  /* how far the tool came to rest from where it was foreseen */
    float damped_W; /* taken up by D */
    float energy_J; /* stored in the contact, this tool's spring and friction */
} palp_coupling_result;

/* Lets all tools go; the next tick finds them at the device, or on the surface above it. */
void palp_coupling_reset(palp_coupling *coupling);

/*
 * Begins a tick with the devices at device[tool_count]. After a reset a tool is first placed, by
 * the node of the body that is nearest to its device, PALP_COUPLING_SEARCHED of them in a tick;
 * false while none is: there is no contact to be solved yet, and palp_coupling_hold answers 0. One
 * that is not placed while others are, or that is absent, is far away meanwhile. Cost: 60 per tool, or 10 for each node compared.
 */
bool palp_coupling_begin(palp_coupling *coupling, const palp_contact *contact,
                         const palp_frame *device);

/* Where the contact should search, and the springs that it should solve with. */
void palp_coupling_springs(const palp_coupling *coupling, const palp_contact *contact,
                           palp_frame *at, palp_contact_spring *spring);

/* Takes the solved contact over as this tick's answer. Friction: palp_friction_solve. */
void palp_coupling_take(palp_coupling *coupling, palp_contact *contact, float dt_s,
                        palp_coupling_result *result);

/* Goes on without a contact: the answer is what was foreseen. 40 per tool. */
void palp_coupling_hold(palp_coupling *coupling, const palp_contact *contact, float dt_s,
                        palp_coupling_result *result);

#endif
