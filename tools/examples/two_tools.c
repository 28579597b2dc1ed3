/* SPDX-License-Identifier: MIT */
/*
 * Two spheres in bounded time, with a clock of our own and static memory only: two_tools BLOB
 *
 * Both are held by springs to devices that close upon the body from two sides. The clock that the
 * answer looks at is the work that it has done; a real controller gives it a monotonic one.
 */
#include "blob.h"

#define TOOLS 2
#define RATE_HZ 1000.0f
#define TICKS 500

static _Alignas(PALP_ALIGN) uint8_t memory[PALP_ANSWER_BYTES(TOOLS, PALP_CONTACT_FINEST)];
static palp_answer answer;

static uint64_t work_clock(void *context) {
    const palp_answer *a = context;
    return (uint64_t)(0.1 * (double)palp_answer_work(a)); /* 0.1 ns an operation */
}

int main(int argc, char **argv) {
    palp_blob blob;
    float bound_ns;
    if (argc != 2) return 2;
    if (!read_blob(&blob, argv[1])) return 1;
    const float radius = 3.0f * blob.meta->mean_edge_m;
    const palp_tool tools[TOOLS] = {palp_tool_sphere(radius), palp_tool_sphere(radius)};
    const palp_answer_config config = {
        .contact = {.blob = &blob,
                    .tools = tools,
                    .tool_count = TOOLS,
                    .finest = PALP_CONTACT_FINEST},
        .cost = {.target = &palp_target_counted, .ns_per_instruction = 0.1f, .margin = 0.8f},
        .port = {.now_ns = work_clock, .context = &answer},
        .dt_s = 1.0f / RATE_HZ};
    const palp_status status = palp_answer_init(&answer, &config, memory, sizeof memory, &bound_ns);
    if (status != PALP_OK) {
        fprintf(stderr, "answer: %s (%zu bytes wanted; %g us of %g)\n", palp_status_text(status),
                palp_answer_memsize(&config.contact), (double)bound_ns * 1e-3,
                1e6 / (double)RATE_HZ);
        return 1;
    }
    const palp_vec3 top = palp_vec3_at(blob.rest_m + 3u * highest_node(&blob));
    const float lowest = blob.meta->box_min_m[0], highest = blob.meta->box_max_m[0];
    for (int t = 0; t < TOOLS; t++) answer.coupling.tool[t].stiffness_N_per_m = 500;
    for (int tick = 0; tick < TICKS; tick++) {
        const float way = 0.5f * (float)tick / TICKS; /* 0: apart; 0.5: half closed */
        const palp_vec3 left = {lowest - radius + way * (top.x - lowest), top.y, top.z - radius};
        const palp_vec3 right = {highest + radius - way * (highest - top.x), top.y, top.z - radius};
        const palp_frame device[TOOLS] = {palp_frame_at(left), palp_frame_at(right)};
        palp_coupling_result result[TOOLS];
        palp_answer_report report;
        palp_answer_tick(&answer, work_clock(&answer), device, result, &report);
        if (tick % 50 == 49)
            printf("tick %d: %.3f N and %.3f N, level %u, %u points in contact\n", tick,
                   (double)palp_norm(result[0].force_N), (double)palp_norm(result[1].force_N),
                   (unsigned)report.level, (unsigned)report.active);
    }
    return 0;
}
