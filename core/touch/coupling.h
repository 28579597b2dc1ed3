/* SPDX-License-Identifier: MIT */
/*
 * The virtual coupling: a spring between the device and the tool that it holds (Colgate's virtual
 * coupling).
 *
 * The tool has no mass, so it rests where the contact force F balances the spring k at device
 * position p: c = p + F / k. The contact problem is solved with the spring's give in it, about the
 * last tool position, and again about each new one, so that the active set and the tool settle
 * together.
 *
 * The device feels f = k (c - p) - b dp/dt while it touches. The spring part is the gradient of the
 * joint minimum of contact and spring energy, so it gains nothing on a closed path. The damper
 * holds on to the ground, not to the tool: between tool and device it would act on the spring force
 * alone, and give energy where a convex body lets that force fall along the way.
 */
#ifndef PALP_TOUCH_COUPLING_H
#define PALP_TOUCH_COUPLING_H

#include "core/touch/contact.h"

#define PALP_COUPLING_SOLVES 3u /* contact solves per tick */

typedef struct {
    float stiffness_N_per_m, damping_Ns_per_m;
    palp_vec3 tool_m, device_m; /* of the last step */
    bool placed;
} palp_coupling;

typedef struct {
    palp_vec3 force_N; /* on the device */
    palp_vec3 tool_m;
    float energy_J; /* contact and spring */
    float moved_m;  /* by the tool in the last solve: what is left of its settling */
} palp_coupling_result;

/* Starts over with the tool at the device. */
void palp_coupling_reset(palp_coupling *coupling);

/*
 * One tick of `dt_s` with the device at `device_m`: at most PALP_COUPLING_SOLVES contact solves.
 * Search and admit have been done around the tool (coupling->tool_m, or the device if nothing
 * touches).
 */
palp_coupling_result palp_coupling_step(palp_coupling *coupling, palp_contact *contact,
                                        palp_vec3 device_m, float dt_s);

#endif
