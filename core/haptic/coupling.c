/* SPDX-License-Identifier: MIT */
#include "core/haptic/coupling.h"

/* Over the tool's size, per tick: how far a free tool moves towards its device, beyond the device's
 * own motion; and a tool in contact, from where it was foreseen. */
#define LARGEST_MOVE 0.05f
#define LARGEST_STEP 0.1f
#define LARGEST_TURN 0.1f /* rad */
#define APART 1.001f      /* of a tool that is put on the surface, over how far it extends to it */

static void let_go(palp_coupling_tool *k) {
    k->placed = k->touching = false;
    k->searched = 0;
    k->contact = k->offset = (palp_wrench){.force_N = {0}};
    k->held_Nm = k->carried_m = (palp_vec3){0};
    k->yield_per_J = 0.0f;
    palp_friction_reset(&k->friction);
}

void palp_coupling_reset(palp_coupling *coupling) {
    for (uint32_t t = 0; t < PALP_CONTACT_TOOLS; t++) let_go(&coupling->tool[t]);
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
static palp_frame outside(const palp_contact *c, uint32_t t, uint32_t nearest, palp_frame at) {
    palp_vec3 n, x = node_position(c, nearest, &n);
    if (palp_dot(palp_sub(at.t, x), n) >= 0.0f) return at;
    const palp_vec3 down = palp_rotate_back(at.r, palp_scale(-1.0f, n));
    at.t = palp_madd(x, APART * palp_max(palp_tool_support(&c->tools[t], down), 0.0f), n);
    return at;
}

/* ---- where a tool will be ---- */

static palp_frame moved_by(const palp_frame *f, palp_vec3 by_m, palp_vec3 turn_rad) {
    palp_frame out = {.t = palp_add(f->t, by_m)};
    palp_turn_by(turn_rad, f->r, out.r);
    return out;
}

/* Without contact: with its device, and towards it. */
static palp_frame follow(const palp_coupling_tool *k, const palp_frame *device, float size) {
    palp_frame at = *device;
    at.t = approach(palp_add(k->tool.t, palp_sub(device->t, k->device.t)), device->t,
                    LARGEST_MOVE * size);
    return at;
}

/* What friction that sticks keeps from the tool of a motion across the contact. */
static palp_vec3 kept_across(const palp_coupling_tool *k, palp_vec3 dx) {
    const palp_vec3 force = k->contact.force_N;
    if (k->friction.regions == 0u || k->friction.slipping) return (palp_vec3){0};
    const palp_vec3 across = palp_madd(dx, -palp_dot(force, dx) / palp_dot(force, force), force);
    return palp_scale(palp_friction_share(&k->friction, k->stiffness_N_per_m), across);
}

/* `carried_m`: how the bodies that press the tool have moved. */
static palp_frame foresee(const palp_coupling_tool *k, const palp_frame *device,
                          palp_vec3 carried_m, float size) {
    if (!k->touching) return follow(k, device, size);
    const palp_vec3 force = k->contact.force_N, moment = k->contact.moment_Nm;
    const palp_vec3 dx = palp_sub(device->t, k->device.t);
    const palp_vec3 turn = palp_turn_between(k->device.r, device->r);
    const float soft = 1.0f / k->stiffness_N_per_m, turns = k->stiffness_Nm_per_rad;
    palp_frame at = moved_by(&k->tool, dx, turn);
    if (!(turns > 0.0f))
        for (uint32_t e = 0; e < 9u; e++) at.r[e] = device->r[e];
    if (!(palp_dot(force, force) > 0.0f)) return at;
    const palp_vec3 against = palp_sub(dx, carried_m);
    float gives = soft * palp_dot(force, force);
    if (turns > 0.0f) gives += palp_dot(moment, moment) / turns;
    const float work = palp_dot(force, against) + palp_dot(moment, turn);
    const float more = -k->yield_per_J * work / (1.0f + k->yield_per_J * gives);
    at.t = palp_madd(at.t, more * soft, force);
    if (turns > 0.0f) at = moved_by(&at, (palp_vec3){0}, palp_scale(more / turns, moment));
    at.t = palp_sub(at.t, kept_across(k, against));
    return at;
}

bool palp_coupling_begin(palp_coupling *coupling, const palp_contact *contact,
                         const palp_frame *device) {
    uint32_t ready = 0;
    for (uint32_t t = 0; t < contact->tool_count; t++) {
        palp_coupling_tool *k = &coupling->tool[t];
        float size = palp_tool_size(&contact->tools[t]);
        coupling->next[t] = device[t];
        k->brought_m = (palp_vec3){0};
        if (k->absent) {
            let_go(k);
            k->tool = k->device = k->expected = coupling->next[t] = palp_tool_away();
            ready++;
            continue;
        }
        if (!k->placed) {
            k->placed = search_on(k, contact, device[t].t);
            k->tool = k->placed ? outside(contact, t, k->nearest, device[t]) : device[t];
            k->expected = k->placed ? k->tool : palp_tool_away();
            k->device = device[t];
            ready += k->placed ? 1u : 0u;
            continue;
        }
        ready++;
        const palp_vec3 all = palp_contact_carried(contact, t);
        const palp_vec3 carried = palp_sub(all, k->carried_m); /* in this tick */
        k->carried_m = all;
        k->brought_m = carried;
        palp_friction_carry(&k->friction, carried);
        k->expected = foresee(k, &device[t], carried, size);
    }
    for (uint32_t t = 0; t < contact->tool_count && ready == 0u; t++)
        coupling->tool[t].expected = coupling->tool[t].tool;
    return ready > 0u;
}

void palp_coupling_springs(const palp_coupling *coupling, const palp_contact *contact,
                           palp_frame *at, palp_contact_spring *spring) {
    for (uint32_t t = 0; t < contact->tool_count; t++) {
        const palp_coupling_tool *k = &coupling->tool[t];
        const palp_vec3 held = palp_add(k->friction.force_N, k->offset.force_N);
        at[t] = k->expected;
        spring[t] = (palp_contact_spring){.held = coupling->next[t],
                                          .stiffness_N_per_m = k->stiffness_N_per_m,
                                          .stiffness_Nm_per_rad = k->stiffness_Nm_per_rad};
        spring[t].held.t = palp_madd(coupling->next[t].t, 1.0f / k->stiffness_N_per_m, held);
        if (!(k->stiffness_Nm_per_rad > 0.0f)) continue;
        const palp_vec3 turn =
            palp_scale(1.0f / k->stiffness_Nm_per_rad, palp_add(k->held_Nm, k->offset.moment_Nm));
        palp_turn_by(turn, coupling->next[t].r, spring[t].held.r);
    }
}

/* ---- the end of a tick ---- */

/* -b v along a force (or moment), at most a share of it. */
static palp_vec3 damp_along(palp_vec3 force, float damping, palp_vec3 velocity) {
    const float size = palp_norm(force), most = PALP_COUPLING_DAMPED * size;
    if (!(size > 0.0f)) return (palp_vec3){0};
    const palp_vec3 n = palp_scale(1.0f / size, force);
    return palp_scale(-palp_clamp(damping * palp_dot(velocity, n), -most, most), n);
}

/* Along the contact's force and, where friction sticks, along that. */
static palp_vec3 damper(const palp_coupling_tool *k, palp_vec3 velocity) {
    const palp_vec3 normal = damp_along(k->contact.force_N, k->damping_Ns_per_m, velocity);
    if (k->friction.regions == 0u || k->friction.slipping) return normal;
    return palp_add(normal, damp_along(k->friction.force_N, k->damping_Ns_per_m, velocity));
}

/* Of the springs between a tool and its device. */
static palp_wrench spring_wrench(const palp_coupling_tool *k, const palp_frame *tool,
                                 const palp_frame *device) {
    palp_wrench w = {.force_N = palp_scale(k->stiffness_N_per_m, palp_sub(tool->t, device->t))};
    if (k->stiffness_Nm_per_rad > 0.0f)
        w.moment_Nm = palp_scale(k->stiffness_Nm_per_rad, palp_turn_between(device->r, tool->r));
    return w;
}

/* Adds the dampers; returns the power that they take up. */
static float damp(const palp_coupling_tool *k, const palp_frame *device, float dt_s,
                  palp_wrench *w) {
    palp_vec3 velocity = k->velocity_m_s, turning = k->velocity_rad_s;
    if (!k->measured) {
        velocity = palp_scale(1.0f / dt_s, palp_sub(device->t, k->device.t));
        turning = palp_scale(1.0f / dt_s, palp_turn_between(k->device.r, device->r));
    }
    const palp_vec3 d = damper(k, velocity);
    w->force_N = palp_add(w->force_N, d);
    if (!(k->stiffness_Nm_per_rad > 0.0f)) return -palp_dot(d, velocity);
    const palp_vec3 r = damp_along(k->contact.moment_Nm, k->damping_Nms_per_rad, turning);
    w->moment_Nm = palp_add(w->moment_Nm, r);
    return -palp_dot(d, velocity) - palp_dot(r, turning);
}

/* Ends a tick for one tool, at rest at `tool`. */
static void end(palp_coupling *coupling, uint32_t t, const palp_frame *tool, float stored_J,
                float dt_s, palp_coupling_result *result) {
    palp_coupling_tool *k = &coupling->tool[t];
    const palp_frame device = coupling->next[t];
    palp_wrench w = {.force_N = {0}};
    float damped = 0.0f;
    float moved = palp_norm(palp_sub(tool->t, k->expected.t));
    k->tool = *tool;
    if (k->touching) w = spring_wrench(k, tool, &device);
    float energy = stored_J + k->friction.energy_J +
                   0.5f / k->stiffness_N_per_m * palp_dot(w.force_N, w.force_N);
    if (k->stiffness_Nm_per_rad > 0.0f)
        energy += 0.5f / k->stiffness_Nm_per_rad * palp_dot(w.moment_Nm, w.moment_Nm);
    if (k->touching) {
        if (!(k->stiffness_Nm_per_rad > 0.0f))
            w.moment_Nm = palp_add(k->contact.moment_Nm, k->friction.moment_Nm);
        damped = damp(k, &device, dt_s, &w);
        /* a tool that lags behind must not pull */
        const palp_vec3 contact = k->contact.force_N;
        const float size2 = palp_dot(contact, contact), along = palp_dot(w.force_N, contact);
        if (along < 0.0f && size2 > 0.0f) w.force_N = palp_madd(w.force_N, -along / size2, contact);
    }
    k->device = device;
    const float fade = 1.0f - palp_min(dt_s / PALP_COUPLING_FADE_S, 1.0f);
    k->offset.force_N = palp_scale(fade, k->offset.force_N);
    k->offset.moment_Nm = palp_scale(fade, k->offset.moment_Nm);
    result[t] = (palp_coupling_result){.force_N = w.force_N,
                                       .moment_Nm = w.moment_Nm,
                                       .tool = *tool,
                                       .moved_m = moved,
                                       .damped_W = damped,
                                       .energy_J = energy};
}

/* What a change of level has changed the answer by goes on as a force of its own. */
static void keep_offset(palp_coupling_tool *k, const palp_contact *c, uint32_t t,
                        palp_frame *rest) {
    const palp_wrench from = spring_wrench(k, &k->expected, rest); /* as if held at rest */
    const palp_vec3 force =
        palp_at_most(from.force_N, PALP_COUPLING_OFFSET * palp_norm(c->force_N[t]));
    const palp_vec3 moment =
        palp_at_most(from.moment_Nm, PALP_COUPLING_OFFSET * palp_norm(c->moment_Nm[t]));
    k->offset.force_N = palp_add(k->offset.force_N, force);
    k->offset.moment_Nm = palp_add(k->offset.moment_Nm, moment);
    rest->t = palp_madd(rest->t, 1.0f / k->stiffness_N_per_m, force);
    if (k->stiffness_Nm_per_rad > 0.0f)
        *rest = moved_by(rest, (palp_vec3){0}, palp_scale(1.0f / k->stiffness_Nm_per_rad, moment));
}

/* Friction's force and moment on the springs. The force is solved with them. The moment comes in as
 * fast as does not make the tool swing against what sticks. */
static void rub(palp_coupling *coupling, palp_contact *c, uint32_t t, palp_frame *rest) {
    palp_coupling_tool *k = &coupling->tool[t];
    const palp_vec3 before = k->friction.force_N;
    palp_friction_solve(&k->friction, &coupling->work, c, t, rest, k->stiffness_N_per_m);
    rest->t =
        palp_madd(rest->t, 1.0f / k->stiffness_N_per_m, palp_sub(k->friction.force_N, before));
    const float turns = k->stiffness_Nm_per_rad;
    if (!(turns > 0.0f)) return;
    const float share = turns / (turns + k->friction.sticking_Nm);
    const palp_vec3 more = palp_scale(share, palp_sub(k->friction.moment_Nm, k->held_Nm));
    k->held_Nm = palp_add(k->held_Nm, more);
    *rest = moved_by(rest, (palp_vec3){0}, palp_scale(1.0f / turns, more));
}

/* Towards where it comes to rest, as far as it may go in a tick. */
static palp_frame step_to(const palp_frame *from, const palp_frame *to, float size) {
    palp_frame at = *to;
    at.t = approach(from->t, to->t, LARGEST_STEP * size);
    const palp_vec3 turn = palp_turn_between(from->r, to->r);
    if (palp_norm(turn) > LARGEST_TURN)
        palp_turn_by(palp_at_most(turn, LARGEST_TURN), from->r, at.r);
    return at;
}

void palp_coupling_take(palp_coupling *coupling, palp_contact *c, float dt_s,
                        palp_coupling_result *result) {
    for (uint32_t t = 0; t < c->tool_count; t++) {
        palp_coupling_tool *k = &coupling->tool[t];
        const bool touches = c->normal_N[t] > 0.0f, rubs = c->tools[t].friction > 0.0f;
        palp_frame rest = c->rest[t];
        if (coupling->settling > 0u && k->touching && touches) keep_offset(k, c, t, &rest);
        if (rubs) rub(coupling, c, t, &rest);
        k->touching = touches;
        k->carried_m = (palp_vec3){0};
        k->contact = (palp_wrench){c->force_N[t], c->moment_Nm[t]};
        const float energy = palp_contact_energy(c, c->normal_N[t]);
        k->yield_per_J = energy > 0.0f ? 0.6f / energy : 0.0f;
        if (touches) {
            rest = step_to(&k->expected, &rest, palp_tool_size(&c->tools[t]));
        } else {
            rest = k->expected;
            k->offset = (palp_wrench){.force_N = {0}};
            k->held_Nm = (palp_vec3){0};
        }
        end(coupling, t, &rest, c->energy_J, dt_s, result);
        if (rubs) palp_friction_settle(&k->friction, &rest);
    }
    if (coupling->settling > 0u) coupling->settling--;
}

/* What the springs now carry is what the contact is taken to give; false when it has let go. */
static bool go_on(palp_coupling_tool *k, const palp_frame *device) {
    const palp_wrench spring = spring_wrench(k, &k->expected, device);
    const palp_vec3 before = k->contact.force_N;
    const palp_vec3 force =
        palp_sub(palp_sub(spring.force_N, k->friction.force_N), k->offset.force_N);
    const float along = palp_dot(force, before);
    if (!(along > 0.0f)) return false;
    k->contact.force_N = force;
    k->contact.moment_Nm =
        k->stiffness_Nm_per_rad > 0.0f
            ? palp_sub(palp_sub(spring.moment_Nm, k->held_Nm), k->offset.moment_Nm)
            : palp_scale(along / palp_dot(before, before), k->contact.moment_Nm);
    return true;
}

void palp_coupling_hold(palp_coupling *coupling, const palp_contact *contact, float dt_s,
                        palp_coupling_result *result) {
    for (uint32_t t = 0; t < contact->tool_count; t++) {
        palp_coupling_tool *k = &coupling->tool[t];
        if (k->touching && !go_on(k, &coupling->next[t])) {
            k->touching = false;
            k->contact = (palp_wrench){.force_N = {0}};
            k->expected = coupling->next[t];
        }
        end(coupling, t, &k->expected, contact->energy_J, dt_s, result);
    }
}
