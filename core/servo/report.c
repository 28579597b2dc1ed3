/* SPDX-License-Identifier: MIT */
#include "core/servo/report.h"

/* What all bodies did. */
static void add_bodies(const palp_scene *s, const palp_scene_report *tick, palp_report *r) {
    float doubt_N = 0.0f;
    for (uint32_t b = 0; b < palp_scene_bodies(s); b++) {
        const palp_body_report *of = &tick->body[b];
        if (b == 0u || of->level < r->level) {
            r->level = of->level;
            r->limit = of->limit;
        }
        r->points += of->points;
        r->active += of->active;
        r->iterations = of->iterations > r->iterations ? of->iterations : r->iterations;
        r->contact_flags |= of->flags;
        r->held = r->held || of->held;
        r->shortened = r->shortened || of->shortened;
        doubt_N += of->doubt_N;
    }
    r->doubt_N = doubt_N;
}

/* How the tools of one device fared. */
static void add_tools(const palp_scene *s, const palp_scene_report *tick, uint32_t hand,
                      palp_report *r) {
    bool first = true;
    for (uint32_t t = 0; t < palp_scene_tools(s); t++) {
        if (palp_scene_mount(s, t)->hand != hand) continue;
        for (uint32_t b = 0; b < palp_scene_bodies(s); b++) {
            const palp_body_felt *f = &tick->felt[b][t];
            if (first) r->tool = f->tool;
            if (first || f->moved_m > r->unforeseen_m) r->unforeseen_m = f->moved_m;
            r->slipping = r->slipping || f->slipping;
            first = false;
        }
    }
}

void palp_scene_view(const palp_scene *scene, const palp_scene_report *tick, uint32_t hand,
                     palp_report *r) {
    const palp_hand_report *h = &tick->hand[hand];
    *r = (palp_report){.tick = tick->tick,
                       .state = h->state,
                       .faults = h->faults,
                       .bound_ns = tick->bound_ns,
                       .elapsed_ns = tick->elapsed_ns,
                       .tip_m = h->tip_m,
                       .tip_velocity_m_s = h->tip_velocity_m_s,
                       .force_N = h->force_N,
                       .moment_Nm = h->moment_Nm,
                       .contact_moment_Nm = h->contact_moment_Nm,
                       .stored_J = h->stored_J,
                       .absorbed_J = h->absorbed_J,
                       .given_J = h->given_J,
                       .braked = h->braked};
    add_bodies(scene, tick, r);
    r->doubt_N *= palp_scene_hand(scene, hand)->config.placement.scale;
    add_tools(scene, tick, hand, r);
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        r->joint_rad[i] = h->joint_rad[i];
        r->joint_rad_s[i] = h->joint_rad_s[i];
        r->motor_torque_Nm[i] = h->motor_torque_Nm[i];
    }
    for (uint32_t e = 0; e < 9u; e++) r->tip_r[e] = h->tip_r[e];
}

uint32_t palp_scene_loads(const palp_scene *scene, uint32_t body, palp_load *load) {
    const palp_body *b = palp_scene_body(scene, body);
    palp_load_list list = {.load = load, .capacity = PALP_SERVO_LOADS};
    if (b->config.kind != PALP_BODY_ELASTIC) return 0;
    for (uint32_t t = 0; t < palp_scene_tools(scene); t++)
        palp_contact_loads(&b->answer->contact, t, 0, b->answer->coupling.tool[t].friction.force_N,
                           &list);
    return list.count;
}
