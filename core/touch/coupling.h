/* SPDX-License-Identifier: MIT */
/*
 * Virtual coupling: each tool hangs on the device by a spring, and the tick finds where it comes to
 * rest on the surface (a god-object, or proxy, with the device's stiffness limit).
 *
 *     tool = device + (F + T) / k,   F(tool), T(tool) the contact and friction forces
 *     force on the hand = F + T - b * velocity of the device     (while touching)
 *
 * F and T are solved together with the spring, linearised about the last tool position, in up to
 * PALP_NODE_COUPLING_SOLVES contact solves with PALP_NODE_COUPLING_PIVOTS max_pivots
 * steps together, taken one pivot at a time so that the caller can stop. The
 * rest position is a function of the device position alone while nothing slips, so the coupling
 * stores energy but makes none. The damper acts on the hand directly and only takes energy.
 */
#ifndef PALP_TOUCH_COUPLING_H
#define PALP_TOUCH_COUPLING_H

#include "core/touch/friction.h"

#define PALP_NODE_COUPLING_SOLVES 3u
#define PALP_NODE_COUPLING_PIVOTS 2u /* of a tick, over max_pivots of one solve */

/* One tool on its spring. */
typedef struct {
    float stiffness_N_per_m; /* k > 0 */
    float damping_Ns_per_m;  /* b >= 0 */
    palp_vec3 tool_m, device_m;
    palp_vec3 contact_N; /* F of the last solve */
    palp_node_friction friction;
    bool placed;
} palp_spring;

typedef struct {
    palp_spring spring[PALP_MAX_TOOLS];
    palp_vec3 next_m[PALP_MAX_TOOLS]; /* device positions of the tick under way */
    uint32_t solves, pivots;          /* finished in it; taken in it */
    bool solving;
    float moved_m; /* last move of a tool */
} palp_node_coupling;

typedef struct {
    palp_vec3 force_N; /* on the device */
    palp_vec3 tool_m;
    float moved_m;  /* last move of the tool: what is left unsettled */
    float energy_J; /* stored in this tool's spring and friction, and in the whole contact */
} palp_node_coupling_result;

/* Lets all tools go; the next tick finds them at the device. */
void palp_node_coupling_reset(palp_node_coupling *coupling);

/* Where the search for a tick should look: the tools that touch stay where they are. */
void palp_node_coupling_centers(const palp_node_coupling *coupling,
                                const palp_node_contact *contact, const palp_vec3 *device_m,
                                palp_vec3 *center);

/* Begins a tick with the devices at device_m[tool_count]; the candidates are up to date. */
void palp_node_coupling_begin(palp_node_coupling *coupling, palp_node_contact *contact,
                              const palp_vec3 *device_m);

/* One pivot, with what begins or ends the solve that it belongs to; false when all is settled. */
bool palp_node_coupling_step(palp_node_coupling *coupling, palp_node_contact *contact);

/* Ends the tick, settled or not, with the forces reached. */
void palp_node_coupling_end(palp_node_coupling *coupling, palp_node_contact *contact, float dt_s,
                            palp_node_coupling_result *result);

#endif
