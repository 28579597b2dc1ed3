/* SPDX-License-Identifier: MIT */
/*
 * Two devices on one body: scene BLOB
 *
 * One arm presses on its highest place and holds still; the other, whose tool lies beside it, comes and goes.
 * What the first one feels changes with it: they feel each other through the body.
 */
#define _POSIX_C_SOURCE 199309L /* clock_gettime */
#include "arm.h"

#define TICKS 6000
#define HANDS 2

static _Alignas(PALP_ALIGN) uint8_t memory[1u << 20];

int main(int argc, char **argv) {
    palp_blob blob;
    palp_scene *scene;
    palp_scene_report report = {.tick = 0};
    drive drives[HANDS][AXES] = {{{.on = false}}};
    palp_hand_config hand[HANDS];
    palp_scene_tool tool[HANDS];
    float bound_ns, sum_N[2] = {0, 0}, ticks[2] = {0, 0};
    if (argc != 2) return 2;
    if (!read_blob(&blob, argv[1])) return 1;
    const palp_vec3 top = palp_vec3_at(blob.rest_m + 3u * highest_node(&blob));
    const palp_body_config body = {.kind = PALP_BODY_ELASTIC,
                                   .at = PALP_FRAME_IDENTITY,
                                   .blob = &blob,
                                   .finest = PALP_CONTACT_FINEST};
    for (uint32_t h = 0; h < HANDS; h++) {
        hand[h] = (palp_hand_config){
            .device = arm,
            .placement = {.origin_m = {top.x + (h == 1 ? 0.5f * arm.tool_radius_m : 0.0f), top.y,
                                       top.z + arm.tool_radius_m},
                          .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1},
                          .scale = 1}};
        tool[h] = (palp_scene_tool){.tool = palp_tool_sphere(0.5f * arm.tool_radius_m),
                                    .hand = h,
                                    .at = PALP_FRAME_IDENTITY};
        tool[h].at.t.z = -0.5f * arm.tool_radius_m;
    }
    const palp_scene_config config = {
        .body = &body,
        .tool = tool,
        .hand = hand,
        .bodies = 1,
        .tools = HANDS,
        .hands = HANDS,
        .cost = {.target = &palp_target_x86_64, .ns_per_instruction = 0.25f, .margin = 0.8f},
        .port = {.now_ns = monotonic_ns}};
    const palp_status status = palp_scene_open(&scene, &config, memory, sizeof memory, &bound_ns);
    if (status != PALP_OK) {
        fprintf(stderr, "scene: %s (%zu bytes wanted, %g us)\n", palp_status_text(status),
                palp_scene_memsize(&config), (double)bound_ns * 1e-3);
        return 1;
    }
    for (uint32_t tick = 0; tick < TICKS; tick++) {
        palp_can_frame in[HANDS][AXES], out[HANDS][PALP_SERVO_FRAMES_OUT];
        palp_tick_input input[HANDS];
        uint32_t sent[HANDS];
        for (uint32_t h = 0; h < HANDS; h++) {
            float sine, cosine;
            palp_sincos(3.0f * (float)tick / RATE_HZ, &sine, &cosine);
            speak_all(drives[h], tick, h == 0 ? -0.03f : 0.03f * (cosine - 1.0f), in[h]);
            input[h] = (palp_tick_input){.frames = in[h], .count = AXES};
        }
        palp_scene_tick(scene, input, out, sent, &report);
        for (uint32_t h = 0; h < HANDS; h++) listen_all(drives[h], out[h], sent[h]);
        if (tick < TICKS / 3) continue;
        const int both = palp_norm(report.felt[0][1].wrench.force_N) > 0.005f ? 1 : 0;
        sum_N[both] += palp_norm(report.felt[0][0].wrench.force_N);
        ticks[both] += 1;
    }
    const float alone_N = sum_N[0] / ticks[0], both_N = sum_N[1] / ticks[1];
    printf(
        "%s and %s; a hand that holds still feels %.3f N alone, %.3f N while the other presses\n",
        report.hand[0].state == PALP_STATE_RUN ? "RUN" : "not RUN",
        report.hand[1].state == PALP_STATE_RUN ? "RUN" : "not RUN", (double)alone_N,
        (double)both_N);
    return report.hand[1].state == PALP_STATE_RUN && alone_N > 0.0f && both_N < 0.95f * alone_N ? 0
                                                                                                : 1;
}
