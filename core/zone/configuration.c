/* SPDX-License-Identifier: MIT */
#include "configuration.h"

static palp_frame motion(const palp_joint_entry *j, float value) {
    palp_vec3 axis = palp_vec3_at(j->axis);
    if (j->kind == PALP_REVOLUTE) return palp_frame_turn(axis, palp_vec3_at(j->origin_m), value);
    palp_frame f = PALP_FRAME_IDENTITY;
    if (j->kind == PALP_PRISMATIC) f.t = palp_scale(value, axis);
    return f;
}

/* How far the motion between two zones is from one that the joint allows. */
static void measure_closure(palp_configuration *p, const palp_joint_entry *j) {
    palp_frame f = palp_frame_between(&p->frame[j->parent], &p->frame[j->child]);
    palp_vec3 axis = palp_vec3_at(j->axis), origin = palp_vec3_at(j->origin_m);
    palp_vec3 moved = palp_sub(palp_carry(&f, origin), origin);
    float turned = 0.0f;
    if (j->kind == PALP_REVOLUTE) {
        turned = palp_norm(palp_sub(palp_rotate(f.r, axis), axis));
    } else {
        const palp_frame rest = PALP_FRAME_IDENTITY;
        for (uint32_t e = 0; e < 9; e++) turned = palp_max(turned, palp_abs(f.r[e] - rest.r[e]));
        if (j->kind == PALP_PRISMATIC) moved = palp_madd(moved, -palp_dot(axis, moved), axis);
    }
    p->open_m = palp_max(p->open_m, palp_norm(moved));
    p->open_rad = palp_max(p->open_rad, turned);
}

void palp_configuration_set(palp_configuration *p, const palp_zones *zones, const float *value,
                            const palp_frame *root) {
    p->clamped = 0;
    p->open_m = p->open_rad = 0.0f;
    if (palp_vec3_is_finite(root->t) && palp_is_rotation(root->r)) {
        p->root = *root;
    } else {
        p->clamped++;
    }
    p->frame[0] = PALP_FRAME_IDENTITY;
    for (uint32_t j = 0; j < zones->meta->joints; j++) {
        const palp_joint_entry *e = &zones->joint[j];
        if (e->closure != 0u) continue;
        float wanted = e->kind == PALP_FIXED_JOINT ? 0.0f : value[j];
        if (!palp_is_finite(wanted)) {
            wanted = p->value[j];
            p->clamped++;
        }
        p->value[j] = palp_clamp(wanted, e->low, e->high);
        if (wanted < e->low || wanted > e->high) p->clamped++;
    }
    for (uint32_t i = 1; i < zones->meta->zones; i++) {
        uint32_t j = zones->zone[i].joint;
        palp_frame turned = motion(&zones->joint[j], p->value[j]);
        p->frame[i] = palp_frame_compose(&p->frame[zones->joint[j].parent], &turned);
    }
    for (uint32_t s = 0; s < zones->meta->seams; s++) {
        const palp_seam_entry *e = &zones->seam[s];
        p->relative[s] = e->joint != PALP_NONE
                             ? motion(&zones->joint[e->joint], p->value[e->joint])
                             : palp_frame_between(&p->frame[e->zone[0]], &p->frame[e->zone[1]]);
    }
    for (uint32_t j = 0; j < zones->meta->joints; j++) {
        if (zones->joint[j].closure != 0u) measure_closure(p, &zones->joint[j]);
    }
}

void palp_configuration_rest(palp_configuration *configuration, const palp_zones *zones) {
    const float zero[PALP_MAX_JOINTS] = {0};
    const palp_frame rest = PALP_FRAME_IDENTITY;
    *configuration = (palp_configuration){.clamped = 0};
    palp_configuration_set(configuration, zones, zero, &rest);
}

palp_frame palp_configuration_world(const palp_configuration *configuration, uint32_t zone) {
    return palp_frame_compose(&configuration->root, &configuration->frame[zone]);
}
