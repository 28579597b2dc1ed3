/* SPDX-License-Identifier: MIT */
#include "core/haptic/coupling.h"

/* Over the tool's size, per tick: how far a free tool moves towards its device, beyond the device's
 * own motion; and a tool in contact, from where it was foreseen. */
#define LARGEST_MOVE 0.05f
#define LARGEST_STEP 0.1f
#define APART 1.001f /* of a tool that is put on the surface, over its extent */

void palp_coupling_reset(palp_coupling *coupling) {
    for (uint32_t t = 0; t < PALP_CONTACT_TOOLS; t++) {
        palp_coupling_tool *k = &coupling->tool[t];
        k->placed = k->touching = false;
        k->searched = 0;
        k->contact_N = k->offset_N = k->carried_m = (palp_vec3){0};
        k->contact_stiffness_N_per_m = 0.0f;
        palp_friction_reset(&k->friction);
    }
    coupling->settling = 0;
}

/* `to`, or as far towards it as `farthest`. */
static palp_vec3 approach(palp_vec3 from, palp_vec3 to, float farthest) {
    palp_vec3 move = palp_sub(to, from);
    float length = palp_norm(move);
    return length > farthest ? palp_madd(from, farthest / length, move) : to;
}

/* How many nodes the bodies have together; the place of one of them, and its normal, when at rest
 * in this configuration. */
static uint32_t nodes_of(const palp_contact *c) {
    return c->assembly != NULL ? c->assembly->zones->nodes : c->surface[0].blob->meta->nodes;
}

static palp_vec3 node_position(const palp_contact *c, uint32_t node, palp_vec3 *normal) {
    if (c->assembly == NULL) {
        const palp_blob *b = c->surface[0].blob;
        *normal = palp_vec3_at(b->normal + 3u * (size_t)node);
        return palp_vec3_at(b->rest_m + 3u * (size_t)node);
    }
    const palp_zones *z = c->assembly->zones;
    uint32_t zone = 0;
    /* at most zones */
    while (zone + 1u < c->bodies && node >= z->part[zone + 1u].first_node) zone++;
    const palp_frame *frame = &c->assembly->world[zone];
    const size_t at = 3u * (size_t)(node - z->part[zone].first_node);
    *normal = palp_rotate(frame->r, palp_vec3_at(z->blob[zone].normal + at));
    return palp_carry(frame, palp_vec3_at(z->blob[zone].rest_m + at));
}

/* Searches further for the node nearest to where a tool was found; true when all have been
 * compared. */
static bool search_on(palp_coupling_tool *k, const palp_contact *c, palp_vec3 at) {
    const uint32_t nodes = nodes_of(c);
    uint32_t end =
        k->searched + PALP_COUPLING_SEARCHED < nodes ? k->searched + PALP_COUPLING_SEARCHED : nodes;
    for (uint32_t i = k->searched; i < end; i++) {
        palp_vec3 normal;
        palp_vec3 d = palp_sub(node_position(c, i, &normal), at);
        float distance2 = palp_dot(d, d);
        if (i > 0u && distance2 >= k->least_m2) continue;
        k->nearest = i;
        k->least_m2 = distance2;
    }
    k->searched = end;
    return end == nodes;
}

/* A place for a tool that is found at `at`: there, or above the surface if that is inside a body,
 * seen from the nearest node. */
static palp_vec3 outside(const palp_contact *c, uint32_t t, uint32_t nearest, palp_vec3 at) {
    palp_vec3 n, x = node_position(c, nearest, &n);
    if (palp_dot(palp_sub(at, x), n) >= 0.0f) return at;
    return palp_madd(x, APART * palp_tool_extent(&c->tools[t]), n);
}

/* `carried_m`: how the bodies that press the tool have moved. */
static palp_vec3 foresee(const palp_coupling_tool *k, palp_vec3 device_m, palp_vec3 carried_m,
                         float size) {
    if (!k->touching)
        return approach(palp_add(k->tool_m, palp_sub(device_m, k->device_m)), device_m,
                        LARGEST_MOVE * size);
    palp_vec3 dx = palp_sub(device_m, k->device_m);
    float force = palp_norm(k->contact_N);
    palp_vec3 moved = palp_add(k->tool_m, dx);
    if (!(force > 0.0f)) return moved;
    dx = palp_sub(dx, carried_m);
    float along = palp_dot(k->contact_N, dx) / (force * force);
    float share =
        k->contact_stiffness_N_per_m / (k->contact_stiffness_N_per_m + k->stiffness_N_per_m);
    moved = palp_madd(moved, -along * share, k->contact_N);
    /* friction that sticks holds the tool across the contact, too */
    if (k->friction.regions == 0u || k->friction.slipping) return moved;
    palp_vec3 across = palp_madd(dx, -along, k->contact_N);
    return palp_madd(moved, -palp_friction_share(&k->friction, k->stiffness_N_per_m), across);
}

bool palp_coupling_begin(palp_coupling *coupling, const palp_contact *contact,
                         const palp_vec3 *device_m) {
    bool ready = true;
    for (uint32_t t = 0; t < contact->tool_count; t++) {
        palp_coupling_tool *k = &coupling->tool[t];
        float size = palp_tool_size(&contact->tools[t]);
        coupling->next_m[t] = device_m[t];
        if (!k->placed) {
            k->placed = search_on(k, contact, device_m[t]);
            k->tool_m = k->placed ? outside(contact, t, k->nearest, device_m[t]) : device_m[t];
            k->expected_m = k->tool_m;
            k->device_m = device_m[t];
            ready = ready && k->placed;
            continue;
        }
        const palp_vec3 all = palp_contact_carried(contact, t);
        const palp_vec3 carried = palp_sub(all, k->carried_m); /* in this tick */
        k->carried_m = all;
        palp_friction_carry(&k->friction, carried);
        k->expected_m = foresee(k, device_m[t], carried, size);
    }
    return ready;
}

void palp_coupling_springs(const palp_coupling *coupling, const palp_contact *contact,
                           palp_vec3 *tool_m, palp_contact_spring *spring) {
    for (uint32_t t = 0; t < contact->tool_count; t++) {
        const palp_coupling_tool *k = &coupling->tool[t];
        palp_vec3 held = palp_add(k->friction.force_N, k->offset_N);
        tool_m[t] = k->expected_m;
        spring[t].stiffness_N_per_m = k->stiffness_N_per_m;
        spring[t].held_m = palp_madd(coupling->next_m[t], 1.0f / k->stiffness_N_per_m, held);
    }
}

/* -b v along a force, at most a share of it. */
static palp_vec3 damp_along(palp_vec3 force, float damping, palp_vec3 velocity) {
    const float size = palp_norm(force), most = PALP_COUPLING_DAMPED * size;
    if (!(size > 0.0f)) return (palp_vec3){0};
    const palp_vec3 n = palp_scale(1.0f / size, force);
    return palp_scale(-palp_clamp(damping * palp_dot(velocity, n), -most, most), n);
}

/* Along the contact's force and, where friction sticks, along that. */
static palp_vec3 damper(const palp_coupling_tool *k, palp_vec3 velocity) {
    const palp_vec3 normal = damp_along(k->contact_N, k->damping_Ns_per_m, velocity);
    if (k->friction.regions == 0u || k->friction.slipping) return normal;
    return palp_add(normal, damp_along(k->friction.force_N, k->damping_Ns_per_m, velocity));
}

/* Ends a tick for one tool, at rest at `tool_m`. */
static void end(palp_coupling *coupling, uint32_t t, palp_vec3 tool_m, float stored_J, float dt_s,
                palp_coupling_result *result) {
    palp_coupling_tool *k = &coupling->tool[t];
    const palp_vec3 device = coupling->next_m[t];
    palp_vec3 force = {0};
    float damped = 0.0f;
    float moved = palp_norm(palp_sub(tool_m, k->expected_m));
    k->tool_m = tool_m;
    if (k->touching) force = palp_scale(k->stiffness_N_per_m, palp_sub(tool_m, device));
    float energy =
        stored_J + k->friction.energy_J + 0.5f / k->stiffness_N_per_m * palp_dot(force, force);
    if (k->touching) {
        palp_vec3 velocity = palp_scale(1.0f / dt_s, palp_sub(device, k->device_m));
        if (k->measured) velocity = k->velocity_m_s;
        const palp_vec3 d = damper(k, velocity);
        damped = -palp_dot(d, velocity);
        force = palp_add(force, d);
        /* a tool that lags behind must not pull */
        const float size2 = palp_dot(k->contact_N, k->contact_N),
                    along = palp_dot(force, k->contact_N);
        if (along < 0.0f && size2 > 0.0f) force = palp_madd(force, -along / size2, k->contact_N);
    }
    k->device_m = device;
    k->offset_N = palp_scale(1.0f - palp_min(dt_s / PALP_COUPLING_FADE_S, 1.0f), k->offset_N);
    result[t] = (palp_coupling_result){.force_N = force,
                                       .tool_m = tool_m,
                                       .moved_m = moved,
                                       .damped_W = damped,
                                       .energy_J = energy};
}

void palp_coupling_take(palp_coupling *coupling, palp_contact *c, float dt_s,
                        palp_coupling_result *result) {
    for (uint32_t t = 0; t < c->tool_count; t++) {
        palp_coupling_tool *k = &coupling->tool[t];
        const float size = palp_tool_size(&c->tools[t]), force = palp_norm(c->force_N[t]);
        palp_vec3 rest = c->rest_m[t];
        if (coupling->settling > 0u && k->touching && c->normal_N[t] > 0.0f) {
            palp_vec3 foreseen = palp_sub(k->expected_m, rest);
            palp_vec3 offset = palp_scale(k->stiffness_N_per_m, foreseen);
            float most = PALP_COUPLING_OFFSET * force, length = palp_norm(offset);
            if (length > most) offset = palp_scale(most / length, offset);
            k->offset_N = palp_add(k->offset_N, offset);
            rest = palp_madd(rest, 1.0f / k->stiffness_N_per_m, offset);
        }
        if (c->tools[t].friction > 0.0f) {
            palp_vec3 before = k->friction.force_N;
            palp_friction_solve(&k->friction, &coupling->work, c, t, rest, k->stiffness_N_per_m);
            rest =
                palp_madd(rest, 1.0f / k->stiffness_N_per_m, palp_sub(k->friction.force_N, before));
        }
        k->touching = c->normal_N[t] > 0.0f;
        k->carried_m = (palp_vec3){0};
        k->contact_N = c->force_N[t];
        const float energy = palp_contact_energy(c, c->normal_N[t]);
        k->contact_stiffness_N_per_m = energy > 0.0f ? 0.6f * force * force / energy : 0.0f;
        if (!k->touching) k->offset_N = (palp_vec3){0};
        if (k->touching) {
            rest = approach(k->expected_m, rest, LARGEST_STEP * size);
        } else {
            rest = k->expected_m;
        }
        end(coupling, t, rest, c->energy_J, dt_s, result);
        if (c->tools[t].friction > 0.0f) palp_friction_settle(&k->friction, rest);
    }
    if (coupling->settling > 0u) coupling->settling--;
}

void palp_coupling_hold(palp_coupling *coupling, const palp_contact *contact, float dt_s,
                        palp_coupling_result *result) {
    for (uint32_t t = 0; t < contact->tool_count; t++) {
        palp_coupling_tool *k = &coupling->tool[t];
        if (k->touching) { /* what the spring now carries is what the contact is taken to give */
            palp_vec3 spring =
                palp_scale(k->stiffness_N_per_m, palp_sub(k->expected_m, coupling->next_m[t]));
            palp_vec3 contact_N = palp_sub(palp_sub(spring, k->friction.force_N), k->offset_N);
            if (palp_dot(contact_N, k->contact_N) > 0.0f) {
                k->contact_N = contact_N;
            } else { /* it has let go */
                k->touching = false;
                k->contact_N = (palp_vec3){0};
                k->expected_m = coupling->next_m[t];
            }
        }
        end(coupling, t, k->expected_m, contact->energy_J, dt_s, result);
    }
}
