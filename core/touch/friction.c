/* SPDX-License-Identifier: MIT */
#include "friction.h"

void palp_node_friction_reset(palp_node_friction *friction) { *friction = (palp_node_friction){0}; }

static void find_tangents(palp_node_friction *f) {
    palp_vec3 n = f->axis;
    palp_vec3 aside =
        palp_abs(n.x) < 0.6f ? (palp_vec3){1.0f, 0.0f, 0.0f} : (palp_vec3){0.0f, 1.0f, 0.0f};
    palp_vec3 t = palp_cross(n, aside);
    f->tangent[0] = palp_scale(1.0f / palp_norm(t), t);
    f->tangent[1] = palp_cross(n, f->tangent[0]);
}

static palp_vec3 in_plane(const palp_node_friction *f, float a, float b) {
    return palp_madd(palp_scale(a, f->tangent[0]), b, f->tangent[1]);
}

/* A v for v in the tangent plane */
static palp_vec3 give(const palp_node_friction *f, palp_vec3 v) {
    float a = palp_dot(v, f->tangent[0]), b = palp_dot(v, f->tangent[1]);
    return in_plane(f, f->compliance[0] * a + f->compliance[1] * b,
                    f->compliance[1] * a + f->compliance[2] * b);
}

float palp_node_friction_energy(const palp_node_friction *friction) {
    return 0.5f * palp_dot(friction->force_N, give(friction, friction->force_N));
}

/* A from the full compliances and the pressures of the last solve. */
static void measure_compliance(palp_node_friction *f, palp_node_contact *c, uint32_t tool) {
    float sum[9] = {0};
    for (uint32_t a = 0; a < c->active_count; a++) {
        uint32_t i = c->active[a];
        if (c->candidate[i].tool != tool) continue;
        for (uint32_t b = 0; b < c->active_count; b++) {
            uint32_t j = c->active[b];
            if (c->candidate[j].tool != tool) continue;
            const float *block = c->block + 9u * ((size_t)i * c->limits.max_candidates + j);
            float weight = c->candidate[i].force_N * c->candidate[j].force_N;
            for (uint32_t e = 0; e < 9; e++) sum[e] += weight * block[e];
        }
    }
    c->work_done += 9u * (uint64_t)c->active_count * c->active_count;
    float scale = 1.0f / (f->normal_N * f->normal_N), entry[3];
    for (uint32_t k = 0; k < 3; k++) {
        palp_vec3 left = f->tangent[k / 2u], right = f->tangent[(k + 1u) / 2u];
        palp_vec3 u = {palp_dot(palp_vec3_at(sum), right), palp_dot(palp_vec3_at(sum + 3), right),
                       palp_dot(palp_vec3_at(sum + 6), right)};
        entry[k] = scale * palp_dot(left, u);
    }
    /* Compression may leave it slightly indefinite: no direction is stiffer than a tenth of the
     * softest. */
    float most = palp_max(entry[0], entry[2]), least = 0.1f * most;
    float room = palp_max(entry[0], least) * palp_max(entry[2], least) - least * least;
    bool sound = entry[0] >= least && entry[2] >= least && entry[1] * entry[1] <= room;
    f->compliance[0] = sound ? entry[0] : palp_max(entry[0], least);
    f->compliance[1] = sound ? entry[1] : 0.0f;
    f->compliance[2] = sound ? entry[2] : palp_max(entry[2], least);
}

void palp_node_friction_prepare(palp_node_friction *friction, palp_node_contact *contact,
                                uint32_t tool, palp_vec3 tool_m) {
    palp_node_friction *f = friction;
    float stored = palp_node_friction_energy(f);
    bool touched = f->touching;
    palp_vec3 axis;
    float normal_N = palp_node_contact_normal_force(contact, tool, &axis);
    if (!(normal_N > 0.0f)) {
        palp_node_friction_reset(f);
        return;
    }
    f->touching = true;
    f->axis = axis;
    f->normal_N = normal_N;
    if (!touched) f->force_N = (palp_vec3){0};
    find_tangents(f);
    measure_compliance(f, contact, tool);
    f->force_N =
        in_plane(f, palp_dot(f->force_N, f->tangent[0]), palp_dot(f->force_N, f->tangent[1]));
    float now = palp_node_friction_energy(f);
    if (now > stored) f->force_N = palp_scale(palp_sqrt(stored / now), f->force_N);
    f->anchor_m = palp_add(tool_m, give(f, f->force_N));
}

void palp_node_friction_solve(palp_node_friction *friction, const palp_node_contact *contact,
                              uint32_t tool, palp_grip grip, palp_vec3 contact_N) {
    palp_node_friction *f = friction;
    if (!f->touching) return;
    float soft = grip.stiffness_N_per_m > 0.0f ? 1.0f / grip.stiffness_N_per_m : 0.0f;
    palp_vec3 off = palp_sub(palp_madd(grip.held_m, soft, contact_N), f->anchor_m);
    float x = palp_dot(off, f->tangent[0]), y = palp_dot(off, f->tangent[1]);
    float a = f->compliance[0] + soft, b = f->compliance[1], d = f->compliance[2] + soft;
    float inverse = 1.0f / (a * d - b * b);
    palp_vec3 force = in_plane(f, -inverse * (d * x - b * y), -inverse * (a * y - b * x));
    palp_vec3 axis;
    float most =
        contact->tools[tool].friction * palp_node_contact_normal_force(contact, tool, &axis);
    float length = palp_norm(force);
    f->slipping = length > most;
    f->force_N = f->slipping ? palp_scale(most / length, force) : force;
}

void palp_node_friction_settle(palp_node_friction *friction, palp_vec3 tool_m) {
    if (friction->touching && friction->slipping)
        friction->anchor_m = palp_add(tool_m, give(friction, friction->force_N));
}
