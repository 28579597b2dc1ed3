/* SPDX-License-Identifier: MIT */
/* An arm whose drives are a few lines that speak the Palp profile, and that moves by itself; and a clock. On a
 * controller the frames come from the bus, and each tick begins when its period does. */
#ifndef PALP_EXAMPLES_ARM_H
#define PALP_EXAMPLES_ARM_H

#include "blob.h"
#include <time.h>

#define AXES 3
#define RATE_HZ 1000.0f
#define RAD_PER_REV 6.28318530718f

typedef struct {
    palp_e2e sent, received;
    bool on;
} drive;

static uint64_t monotonic_ns(void *context) {
    struct timespec t;
    (void)context;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1000000000ull * (uint64_t)t.tv_sec + (uint64_t)t.tv_nsec;
}

static const palp_device arm = {
    .kinematics = {.mechanism = PALP_ARM3, .upper_m = 0.14f, .fore_m = 0.14f},
    .drives = {.protocol = PALP_PROTOCOL_PALP,
               .counts_per_rev = 65536,
               .torque_max_Nm = 0.35f,
               .watchdog_s = 0.05f,
               .rate_hz = RATE_HZ},
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

/* What a drive says of its joint, and what it is told. */
static palp_can_frame speak(drive *d, uint32_t axis, float joint_rad) {
    const palp_profile_status s = {.state = d->on ? PALP_DRIVE_IS_ON : PALP_DRIVE_IS_OFF,
                                   .position_rev = joint_rad * arm.gear[axis] / RAD_PER_REV};
    return palp_profile_encode_status(&d->sent, arm.node_id[axis], false, &s);
}
static void listen(drive *d, uint32_t axis, const palp_can_frame *frames, uint32_t count) {
    for (uint32_t k = 0; k < count; k++) {
        palp_profile_command c;
        palp_e2e_verdict verdict;
        if (palp_profile_decode_command(&d->received, &frames[k], arm.node_id[axis], false, &c,
                                        &verdict))
            d->on = c.mode == PALP_MODE_TORQUE;
    }
}

/* What the drives of an arm say when its second joint is at `down_rad`, and what it takes of their answers. */
static void speak_all(drive drives[AXES], uint32_t tick, float down_rad, palp_can_frame in[AXES]) {
    for (uint32_t i = 0; i < AXES; i++)
        in[i] = speak(&drives[i], i, i == 1 ? down_rad : 2e-5f * (float)(tick % 50u));
}
static void listen_all(drive drives[AXES], const palp_can_frame *frames, uint32_t count) {
    for (uint32_t i = 0; i < AXES; i++) listen(&drives[i], i, frames, count);
}

#endif
