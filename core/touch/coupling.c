/* SPDX-License-Identifier: MIT */
#include "coupling.h"

#define SETTLED 1e-4f     /* a move this small, over the tool's size, is the last */
#define LARGEST_MOVE 0.5f /* over the tool's size, per solve */

void palp_node_coupling_reset(palp_node_coupling *coupling) {
    for (uint32_t t = 0; t < PALP_MAX_TOOLS; t++) {
        coupling->spring[t].placed = false;
        coupling->spring[t].contact_N = (palp_vec3){0};
        palp_node_friction_reset(&coupling->spring[t].friction);
    }
}

static bool touches(const palp_node_contact *contact, uint32_t tool) {
    palp_vec3 axis;
    return palp_node_contact_normal_force(contact, tool, &axis) > 0.0f;
}

void palp_node_coupling_centers(const palp_node_coupling *coupling,
                                const palp_node_contact *contact, const palp_vec3 *device_m,
                                palp_vec3 *center) {
    for (uint32_t t = 0; t < contact->tool_count; t++) {
        const palp_spring *s = &coupling->spring[t];
        center[t] = s->placed && touches(contact, t) ? s->tool_m : device_m[t];
    }
}

void palp_node_coupling_begin(palp_node_coupling *coupling, palp_node_contact *contact,
                              const palp_vec3 *device_m) {
    coupling->solves = coupling->pivots = 0;
    coupling->solving = false;
    coupling->moved_m = 0.0f;
    for (uint32_t t = 0; t < contact->tool_count; t++) {
        palp_spring *s = &coupling->spring[t];
        bool held = s->placed && touches(contact, t);
        coupling->next_m[t] = device_m[t];
        if (!held) s->tool_m = device_m[t];
        if (contact->tools[t].friction > 0.0f)
            palp_node_friction_prepare(&s->friction, contact, t, s->tool_m);
    }
}

static palp_grip grip_of(const palp_node_coupling *c, uint32_t t) {
    return (palp_grip){c->next_m[t], c->spring[t].stiffness_N_per_m};
}

static void begin_solve(palp_node_coupling *c, palp_node_contact *contact) {
    palp_vec3 about[PALP_MAX_TOOLS];
    palp_grip grip[PALP_MAX_TOOLS];
    for (uint32_t t = 0; t < contact->tool_count; t++) {
        const palp_spring *s = &c->spring[t];
        about[t] = s->tool_m;
        grip[t] = grip_of(c, t);
        grip[t].held_m =
            palp_madd(grip[t].held_m, 1.0f / s->stiffness_N_per_m, s->friction.force_N);
    }
    palp_node_contact_begin(contact, about, grip);
    c->solving = true;
}

/* `to`, or as far towards it as one solve may move the tool. */
static palp_vec3 approach(palp_vec3 from, palp_vec3 to, float farthest) {
    palp_vec3 move = palp_sub(to, from);
    float length = palp_norm(move);
    return length > farthest ? palp_madd(from, farthest / length, move) : to;
}

/* Moves the tools to where their forces let them rest; true when they are settled. */
static bool end_solve(palp_node_coupling *c, const palp_node_contact *contact) {
    bool settled = true;
    c->moved_m = 0.0f;
    for (uint32_t t = 0; t < contact->tool_count; t++) {
        palp_spring *s = &c->spring[t];
        float size = contact->size_m[t];
        s->contact_N = palp_node_contact_force(contact, t);
        if (contact->tools[t].friction > 0.0f)
            palp_node_friction_solve(&s->friction, contact, t, grip_of(c, t), s->contact_N);
        palp_vec3 total = palp_add(s->contact_N, s->friction.force_N);
        palp_vec3 rest = palp_madd(c->next_m[t], 1.0f / s->stiffness_N_per_m, total);
        palp_vec3 from = s->tool_m;
        s->tool_m = approach(from, rest, LARGEST_MOVE * size);
        float moved = palp_norm(palp_sub(s->tool_m, from));
        settled = settled && moved <= SETTLED * size;
        c->moved_m = palp_max(c->moved_m, moved);
    }
    c->solves++;
    c->solving = false;
    return settled;
}

bool palp_node_coupling_step(palp_node_coupling *coupling, palp_node_contact *contact) {
    if (!coupling->solving) begin_solve(coupling, contact);
    const uint32_t most = PALP_NODE_COUPLING_PIVOTS * contact->limits.max_pivots;
    bool spent = ++coupling->pivots >= most, more = palp_node_contact_step(contact);
    if (more && !spent) return true;
    bool settled = end_solve(coupling, contact);
    if (more || (spent && !settled)) contact->flags |= PALP_NODE_CONTACT_PIVOTS_SPENT;
    return !settled && !spent && coupling->solves < PALP_NODE_COUPLING_SOLVES;
}

void palp_node_coupling_end(palp_node_coupling *coupling, palp_node_contact *contact, float dt_s,
                            palp_node_coupling_result *result) {
    if (coupling->solving) (void)end_solve(coupling, contact);
    const float contact_J = palp_node_contact_energy(contact);
    for (uint32_t t = 0; t < contact->tool_count; t++) {
        palp_spring *s = &coupling->spring[t];
        palp_vec3 force = palp_add(s->contact_N, s->friction.force_N);
        float energy = contact_J + palp_node_friction_energy(&s->friction) +
                       0.5f / s->stiffness_N_per_m * palp_dot(force, force);
        palp_node_friction_settle(&s->friction, s->tool_m);
        if (s->placed && touches(contact, t)) {
            palp_vec3 velocity =
                palp_scale(1.0f / dt_s, palp_sub(coupling->next_m[t], s->device_m));
            force = palp_madd(force, -s->damping_Ns_per_m, velocity);
        }
        s->device_m = coupling->next_m[t];
        s->placed = true;
        result[t] = (palp_node_coupling_result){.force_N = force,
                                                .tool_m = s->tool_m,
                                                .energy_J = energy,
                                                .moved_m = coupling->moved_m};
    }
}
