/* SPDX-License-Identifier: MIT */
/*
 * A whole servo over CAN frames: servo BLOB
 *
 * The tick takes the frames that came since the last one and gives those to be sent. Here the three
 * drives are a few lines that speak the Palp profile, and their arm moves by itself; on a
 * controller the frames come from the bus, and each tick begins when its period does.
 */
#define _POSIX_C_SOURCE 199309L /* clock_gettime */
#include "blob.h"
#include <time.h>

#define AXES 3
#define RATE_HZ 1000.0f
#define TICKS 3000
#define RAD_PER_REV 6.28318530718f

static _Alignas(PALP_ALIGN) uint8_t memory[PALP_SERVO_BYTES(PALP_CONTACT_FINEST)];

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

int main(int argc, char **argv) {
    palp_blob blob;
    palp_servo *servo;
    palp_report report = {.tick = 0};
    drive drives[AXES] = {{.on = false}};
    float bound_ns, largest_N = 0;
    if (argc != 2) return 2;
    if (!read_blob(&blob, argv[1])) return 1;
    const palp_vec3 top = palp_vec3_at(blob.rest_m + 3u * highest_node(&blob));
    const palp_servo_config config = {
        .device = arm,
        .placement = {.origin_m = {top.x, top.y, top.z + arm.tool_radius_m},
                      .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1},
                      .scale = 1},
        .finest = PALP_CONTACT_FINEST,
        .cost = {.target = &palp_target_x86_64, .ns_per_instruction = 0.5f, .margin = 0.8f},
        .port = {.now_ns = monotonic_ns},
        .tool = palp_tool_sphere(arm.tool_radius_m)};
    const palp_status status =
        palp_servo_open(&servo, &blob, &config, memory, sizeof memory, &bound_ns);
    if (status != PALP_OK) {
        fprintf(stderr, "servo: %s (%zu bytes wanted, %g us)\n", palp_status_text(status),
                palp_servo_memsize(&blob, config.finest), (double)bound_ns * 1e-3);
        return 1;
    }
    for (uint32_t tick = 0; tick < TICKS; tick++) {
        float down, unused;
        palp_can_frame in[AXES], out[PALP_SERVO_FRAMES_OUT];
        palp_sincos(2.0f * (float)tick / RATE_HZ, &unused, &down);
        for (uint32_t i = 0; i < AXES; i++)
            in[i] =
                speak(&drives[i], i, i == 1 ? 0.04f * (down - 1.0f) : 1e-4f * (float)(tick % 50u));
        const palp_tick_input input = {.frames = in, .count = AXES};
        const uint32_t n = palp_servo_tick(servo, &input, out, &report);
        for (uint32_t i = 0; i < AXES; i++) listen(&drives[i], i, out, n);
        largest_N = palp_max(largest_N, palp_norm(report.force_N));
    }
    static const char *const states[] = {PALP_STATE_NAMES};
    printf("%s after %d ticks, largest force %.3f N, faults %#x\n", states[report.state], TICKS,
           (double)largest_N, (unsigned)report.faults);
    return report.state == PALP_STATE_RUN && largest_N > 0.05f ? 0 : 1;
}
