/* SPDX-License-Identifier: MIT */
#include "coupling.h"

#define SETTLED 1e-4f     /* a move this small, over the radius, is the last */
#define LARGEST_MOVE 0.5f /* over the radius, per solve */

void palp_coupling_reset(palp_coupling *coupling) { coupling->placed = false; }

/* `to`, or as far towards it as one solve may move the tool. */
static palp_vec3 approach(palp_vec3 from, palp_vec3 to, float farthest) {
    palp_vec3 move = palp_sub(to, from);
    float length = palp_norm(move);
    return length > farthest ? palp_madd(from, farthest / length, move) : to;
}

palp_coupling_result palp_coupling_step(palp_coupling *coupling, palp_contact *contact,
                                        palp_vec3 device_m, float dt_s) {
    palp_coupling *c = coupling;
    palp_grip grip = {.held_m = device_m, .stiffness_N_per_m = c->stiffness_N_per_m};
    bool touched = c->placed && contact->active_count > 0u;
    palp_vec3 tool = touched ? c->tool_m : device_m;
    palp_vec3 force = {0};
    float moved = 0.0f;
    for (uint32_t i = 0; i < PALP_COUPLING_SOLVES; i++) {
        palp_vec3 about = tool;
        force = palp_contact_solve(contact, about, grip);
        palp_vec3 rest = palp_madd(device_m, 1.0f / c->stiffness_N_per_m, force);
        tool = approach(about, rest, LARGEST_MOVE * contact->radius_m);
        moved = palp_norm(palp_sub(tool, about));
        if (moved <= SETTLED * contact->radius_m) break;
    }
    float energy =
        palp_contact_energy(contact) + 0.5f / c->stiffness_N_per_m * palp_dot(force, force);
    if (c->placed && contact->active_count > 0u) {
        palp_vec3 velocity = palp_scale(1.0f / dt_s, palp_sub(device_m, c->device_m));
        force = palp_madd(force, -c->damping_Ns_per_m, velocity);
    }
    c->tool_m = tool;
    c->device_m = device_m;
    c->placed = true;
    return (palp_coupling_result){
        .force_N = force, .tool_m = tool, .energy_J = energy, .moved_m = moved};
}
