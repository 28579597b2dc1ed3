/* SPDX-License-Identifier: MIT */
#include "port/cortexm/test_trajectory.h"
#include "core/device/profile.h"

#define RAD_PER_REV 6.28318530718f

palp_device trajectory_device(float rate_hz) {
    return (palp_device){.kinematics = {PALP_ARM3, 0.14f, 0.14f, 0},
                         .drives = {.protocol = PALP_PROTOCOL_PALP,
                                    .counts_per_rev = 65536,
                                    .torque_max_Nm = 0.35f,
                                    .watchdog_s = 0.05f,
                                    .rate_hz = rate_hz},
                         .node_id = {1, 2, 3},
                         .gear = {10, 10, 10},
                         .joint_min_rad = {-2, -2, -2},
                         .joint_max_rad = {2, 2, 2},
                         .force_max_N = 8.5f,
                         .slew_max_N_per_s = 4000,
                         .speed_max_m_s = 1.5f,
                         .workspace_radius_m = 0.06f,
                         .tool_radius_m = 0.012f,
                         .stiffness_max_N_per_m = 700,
                         .damping_max_Ns_per_m = 1.5f,
                         .mass_kg = 0.12f,
                         .damping_Ns_per_m = 0.6f,
                         .bit_rate_bps = 1000000};
}

static uint32_t highest(const palp_blob *b) {
    uint32_t top = b->domain[PALP_FREE].node[0];
    for (uint32_t i = 0; i < b->meta->nodes; i++) {
        bool higher = b->rest_m[3u * i + 2u] > b->rest_m[3u * top + 2u];
        if (!palp_node_is_fixed(b, i) && higher) top = i;
    }
    return top;
}

palp_servo_config trajectory_config(const palp_blob *blob, float rate_hz, float ball_m) {
    palp_vec3 top = palp_vec3_at(blob->rest_m + 3u * highest(blob));
    return (palp_servo_config){.device = trajectory_device(rate_hz),
                               .placement = {.origin_m = {top.x, top.y, top.z + ball_m},
                                             .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1},
                                             .scale = 1},
                               .finest = PALP_CONTACT_FINEST,
                               .tool = palp_tool_sphere(ball_m)};
}

void trajectory_path(uint32_t tick, float depth_rad, float q_rad[PALP_AXES]) {
    for (uint32_t i = TRAJECTORY_AXES; i < PALP_AXES; i++) q_rad[i] = 0.0f;
    float t = 1e-3f * (float)(tick % 1000000u), sine, cosine, slow, unused;
    palp_sincos(6.0f * t, &sine, &cosine);
    palp_sincos(1.7f * t, &slow, &unused);
    q_rad[0] = 0.03f * cosine;
    q_rad[1] = 0.5f * depth_rad * (slow - 1.0f);
    q_rad[2] = depth_rad * (0.5f * slow - 0.5f) + 0.02f * sine;
}

void trajectory_speak(test_trajectory *o, const palp_device *device, const float q_rad[PALP_AXES],
                      palp_can_frame *out) {
    for (uint32_t i = 0; i < TRAJECTORY_AXES; i++) {
        palp_profile_status s = {.state = o->on[i] ? PALP_DRIVE_IS_ON : PALP_DRIVE_IS_OFF,
                                 .position_rev = q_rad[i] * device->gear[i] / RAD_PER_REV};
        out[i] = palp_profile_encode_status(&o->sent[i], device->node_id[i], false, &s);
    }
}

void trajectory_listen(test_trajectory *o, const palp_device *device, const palp_can_frame *frames,
                       uint32_t count) {
    for (uint32_t k = 0; k < count; k++) {
        for (uint32_t i = 0; i < TRAJECTORY_AXES; i++) {
            palp_profile_command c;
            palp_e2e_verdict verdict;
            if (palp_profile_decode_command(&o->received[i], &frames[k], device->node_id[i], false,
                                            &c, &verdict))
                o->on[i] = c.mode == PALP_MODE_TORQUE;
        }
    }
}
