/* SPDX-License-Identifier: MIT */
#include "coupling.h"
#include "core/base/linalg.h"

#define CONVERGED 1e-5f    /* a Newton step this small, over the radius, is the last */
#define LARGEST_STEP 0.5f  /* over the radius */

void palp_coupling_reset(palp_coupling *coupling) { coupling->placed = false; }

/* (k I + H)^-1 r */
static palp_vec3 newton_step(const palp_coupling *c, palp_contact *contact, palp_vec3 r) {
    float h[9];
    float b[3] = {r.x, r.y, r.z};
    palp_contact_stiffness(contact, h);
    for (uint32_t i = 0; i < 3; i++) h[4u * i] += c->stiffness_N_per_m;
    if (palp_chol_factor(h, 3, 3) != PALP_OK) return (palp_vec3){0};
    palp_chol_solve(h, 3, 3, b);
    return palp_vec3_at(b);
}

palp_coupling_result palp_coupling_step(palp_coupling *coupling, palp_contact *contact, palp_vec3 device_m,
                                        float dt_s) {
    palp_coupling *c = coupling;
    float k = c->stiffness_N_per_m;
    bool was_touching = c->placed && contact->active_count > 0u;
    palp_vec3 tool = was_touching ? c->tool_m : device_m;
    palp_vec3 contact_force = {0};
    palp_vec3 residual = {0};
    for (uint32_t step = 0;; step++) {
        contact_force = palp_contact_solve(contact, tool);
        if (contact->active_count == 0u) tool = device_m;
        residual = palp_madd(contact_force, k, palp_sub(device_m, tool));
        if (contact->active_count == 0u || step + 1u == PALP_NEWTON_STEPS) break;
        palp_vec3 move = newton_step(c, contact, residual);
        float length = palp_norm(move);
        if (length < CONVERGED * contact->radius_m) break;
        if (length > LARGEST_STEP * contact->radius_m) {
            move = palp_scale(LARGEST_STEP * contact->radius_m / length, move);
        }
        tool = palp_add(tool, move);
    }
    palp_vec3 stretch = palp_sub(tool, device_m);
    palp_vec3 force = palp_scale(k, stretch);
    float energy = palp_contact_energy(contact) + 0.5f * k * palp_dot(stretch, stretch);
    if (c->placed && contact->active_count > 0u) {
        palp_vec3 tool_velocity = palp_scale(1.0f / dt_s, palp_sub(tool, c->tool_m));
        palp_vec3 device_velocity = palp_scale(1.0f / dt_s, palp_sub(device_m, c->device_m));
        force = palp_madd(force, c->damping_Ns_per_m, palp_sub(tool_velocity, device_velocity));
    }
    c->tool_m = tool;
    c->device_m = device_m;
    c->placed = true;
    return (palp_coupling_result){
        .force_N = force, .tool_m = tool, .energy_J = energy, .residual_N = palp_norm(residual)};
}
