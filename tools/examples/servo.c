/* SPDX-License-Identifier: MIT */
/*
 * A whole servo over CAN frames: servo BLOB
 *
 * The tick takes the frames that came since the last one and gives those to be sent.
 */
#define _POSIX_C_SOURCE 199309L /* clock_gettime */
#include "arm.h"

#define TICKS 3000

static _Alignas(PALP_ALIGN) uint8_t memory[PALP_SERVO_BYTES(PALP_CONTACT_FINEST)];

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
        .cost = {.target = &palp_target_x86_64, .ns_per_instruction = 0.4f, .margin = 0.8f},
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
        speak_all(drives, tick, 0.04f * (down - 1.0f), in);
        const palp_tick_input input = {.frames = in, .count = AXES};
        const uint32_t n = palp_servo_tick(servo, &input, out, &report);
        listen_all(drives, out, n);
        largest_N = palp_max(largest_N, palp_norm(report.force_N));
    }
    static const char *const states[] = {PALP_STATE_NAMES};
    printf("%s after %d ticks, largest force %.3f N, faults %#x\n", states[report.state], TICKS,
           (double)largest_N, (unsigned)report.faults);
    return report.state == PALP_STATE_RUN && largest_N > 0.05f ? 0 : 1;
}
