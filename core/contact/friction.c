/* SPDX-License-Identifier: MIT */
#include "core/contact/friction.h"
#include "core/contact/contact_internal.h"

void palp_friction_reset(palp_friction *friction) { *friction = (palp_friction){0}; }

static void find_tangents(palp_friction *f) {
    palp_vec3 n = f->axis;
    palp_vec3 x = {1.0f, 0.0f, 0.0f}, y = {0.0f, 1.0f, 0.0f};
    palp_vec3 t = palp_cross(n, palp_abs(n.x) < 0.6f ? x : y);
    f->tangent[0] = palp_scale(1.0f / palp_norm(t), t);
    f->tangent[1] = palp_cross(n, f->tangent[0]);
}

static palp_vec3 in_plane(const palp_friction *f, float a, float b) {
    return palp_madd(palp_scale(a, f->tangent[0]), b, f->tangent[1]);
}

/* A v for v in the tangent plane */
static palp_vec3 give(const palp_friction *f, palp_vec3 v) {
    float a = palp_dot(v, f->tangent[0]), b = palp_dot(v, f->tangent[1]);
    return in_plane(f, f->compliance[0] * a + f->compliance[1] * b,
                    f->compliance[1] * a + f->compliance[2] * b);
}

float palp_friction_energy(const palp_friction *friction) {
    return 0.5f * palp_dot(friction->force_N, give(friction, friction->force_N));
}

float palp_friction_share(const palp_friction *friction, float stiffness_N_per_m) {
    float mean = 0.5f * (friction->compliance[0] + friction->compliance[2]);
    return 1.0f / (1.0f + mean * stiffness_N_per_m);
}

static void measure_compliance(palp_friction *f, palp_contact *c, uint32_t tool) {
    float entry[3];
    palp_contact_tangential(c, tool, f->tangent, f->normal_N, entry);
    /* No direction is stiffer than a tenth of the softest: truncated modes may leave A slightly
     * indefinite near fixed nodes. */
    float most = palp_max(entry[0], entry[2]), least = 0.1f * most;
    float room = palp_max(entry[0], least) * palp_max(entry[2], least) - least * least;
    bool sound = entry[0] >= least && entry[2] >= least && entry[1] * entry[1] <= room;
    f->compliance[0] = sound ? entry[0] : palp_max(entry[0], least);
    f->compliance[1] = sound ? entry[1] : 0.0f;
    f->compliance[2] = sound ? entry[2] : palp_max(entry[2], least);
}

/* Measures the contact anew and moves the anchor along, so that T is kept; `tool_m`: where a tool
 * that has just touched is. */
static void renew(palp_friction *f, palp_contact *c, uint32_t tool, palp_vec3 tool_m) {
    float stored = palp_friction_energy(f);
    bool touched = f->touching;
    palp_vec3 normal = c->force_N[tool];
    f->touching = true;
    f->axis = palp_scale(1.0f / palp_max(palp_norm(normal), 1e-30f), normal);
    f->normal_N = c->normal_N[tool];
    if (!touched) f->force_N = (palp_vec3){0};
    find_tangents(f);
    measure_compliance(f, c, tool);
    f->force_N =
        in_plane(f, palp_dot(f->force_N, f->tangent[0]), palp_dot(f->force_N, f->tangent[1]));
    float now = palp_friction_energy(f);
    if (now > stored && now > 0.0f) {
        palp_vec3 kept = palp_scale(palp_sqrt(stored / now), f->force_N);
        f->force_N = kept;
    }
    f->anchor_m = palp_add(touched ? f->tool_m : tool_m, give(f, f->force_N));
}

void palp_friction_solve(palp_friction *friction, palp_contact *contact, uint32_t tool,
                         palp_vec3 rest_m, float stiffness_N_per_m) {
    palp_friction *f = friction;
    if (!(contact->normal_N[tool] > 0.0f)) {
        palp_friction_reset(f);
        return;
    }
    float soft = stiffness_N_per_m > 0.0f ? 1.0f / stiffness_N_per_m : 0.0f;
    palp_vec3 before = f->force_N;
    renew(f, contact, tool, rest_m);
    palp_vec3 off = palp_sub(palp_madd(rest_m, -soft, before), f->anchor_m);
    float x = palp_dot(off, f->tangent[0]), y = palp_dot(off, f->tangent[1]);
    float a = f->compliance[0] + soft, b = f->compliance[1], d = f->compliance[2] + soft;
    float inverse = 1.0f / (a * d - b * b);
    palp_vec3 force = in_plane(f, -inverse * (d * x - b * y), -inverse * (a * y - b * x));
    float most = contact->tools[tool].friction * contact->normal_N[tool];
    float length = palp_norm(force);
    f->slipping = length > most;
    f->force_N = f->slipping ? palp_scale(most / length, force) : force;
}

void palp_friction_carry(palp_friction *friction, palp_vec3 by_m) {
    friction->anchor_m = palp_add(friction->anchor_m, by_m);
    friction->tool_m = palp_add(friction->tool_m, by_m);
}

void palp_friction_settle(palp_friction *friction, palp_vec3 tool_m) {
    friction->tool_m = tool_m;
    if (friction->touching && friction->slipping)
        friction->anchor_m = palp_add(tool_m, give(friction, friction->force_N));
}
