/* SPDX-License-Identifier: MIT */
/*
 * Whether the numbers in an input change what a tick costs: timing BLOB, the same press with
 * ordinary numbers, with a spring so soft that forces and energies are subnormal, at rest, and with
 * devices that jump far beyond the body. What is not a number never comes so far
 * (core/servo/axes.c). Prints the median time of a tick in each, over the ordinary one; built with
 * -DINSTRUCTIONS, the most instructions.
 */
#include "tests/wcet/blobfile.h"
#include "core/palp.h"
#include "port/host/subnormals.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#ifdef INSTRUCTIONS
#include "tests/wcet/instructions.h"
#endif

#ifdef INSTRUCTIONS /* exact, so few will do */
#define TICKS 700
#define ROUNDS 1
#else
#define TICKS 4000
#define ROUNDS 3
#endif
#define KINDS 4

static uint64_t no_time(void *context) {
    (void)context;
    return 0;
}

static double cost_now(void) {
#ifdef INSTRUCTIONS
    return (double)instructions();
#else
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
#endif
}

static int compare(const void *a, const void *b) {
    double p = *(const double *)a, q = *(const double *)b;
    return (p > q) - (p < q);
}

/* Cost of a tick: the median, or of instructions the most; after the tool has sunk in. */
static double press(const palp_blob *blob, uint32_t kind, uint32_t *active) {
    static palp_answer b;
    static double cost[TICKS];
    const float edge = blob->meta->mean_edge_m, radius = 4.0f * edge;
    const palp_tool tool = palp_tool_sphere(radius);
    const palp_answer_config config = {
        .contact = {.blob = blob, .tools = &tool, .tool_count = 1, .finest = PALP_CONTACT_FINEST},
        .cost = {&palp_target_counted, 1e-6f, 0.0f, 1.0f},
        .port = {.now_ns = no_time},
        .dt_s = 1e-3f};
    size_t room = palp_answer_memsize(&config.contact);
    void *memory = aligned_alloc(64, (room + 63) / 64 * 64);
    if (palp_answer_init(&b, &config, memory, room, NULL) != PALP_OK) exit(1);
    float stiffness = 0.5f * blob->meta->stiffness_max_N_per_m;
    b.coupling.tool[0].stiffness_N_per_m = stiffness;
    uint32_t top = blob->domain[PALP_FREE].node[0];
    for (uint32_t i = 0; i < blob->meta->nodes; i++) {
        if (!palp_node_is_fixed(blob, i) && blob->rest_m[3 * i + 2] > blob->rest_m[3 * top + 2])
            top = i;
    }
    palp_vec3 x = palp_vec3_at(blob->rest_m + 3 * top), n = palp_vec3_at(blob->normal + 3 * top);
    for (int i = 0; i < TICKS; i++) {
        float sink = 0.4f * palp_min((float)i / 400.0f, 1.0f);
        palp_vec3 at = palp_madd(x, (1.0f - sink) * radius, n);
        if (i > 400 && kind == 0) at.x += 1e-3f * edge * (float)(i % 7);
        if (i > 400 && kind == 1) b.coupling.tool[0].stiffness_N_per_m = 1e-38f;
        if (i > 400 && kind == 2) at.x += 1e-41f * (float)(i % 7);
        if (i > 400 && kind == 3) at.x += i % 3 == 0 ? 1e30f : i % 3 == 1 ? -1e30f : 0.0f;
        palp_coupling_result result;
        palp_answer_report r;
        double before = cost_now();
        const palp_frame device = palp_frame_at(at);
        palp_answer_tick(&b, 0, &device, &result, &r);
        cost[i] = cost_now() - before;
        if (i == 400) *active = r.active;
    }
    free(memory);
    qsort(cost + 500, TICKS - 500, sizeof cost[0], compare);
#ifdef INSTRUCTIONS
    return cost[TICKS - 1];
#else
    return cost[500 + (TICKS - 500) / 2];
#endif
}

int main(int argc, char **argv) {
    static const char *const kinds[KINDS] = {"ordinary", "subnormal forces", "at rest", "far away"};
    palp_blob blob;
    size_t bytes;
    if (argc < 2) return 2;
    void *data = load(argv[1], &bytes);
    if (palp_blob_open(&blob, data, bytes) != PALP_OK) return 1;
#ifdef INSTRUCTIONS
    instructions_open();
#endif
    subnormals_off(); /* as the controller does */
    double base = 0, worst = 0;
    for (uint32_t k = 0; k < KINDS; k++) {
        uint32_t active = 0;
        double least = HUGE_VAL;
        for (int round = 0; round < ROUNDS; round++) least = fmin(least, press(&blob, k, &active));
        if (k == 0) base = least;
        worst = fmax(worst, least / base);
        printf("%s %.0f (%.3f times, %u in contact)%s", kinds[k], least, least / base, active,
               k + 1 < KINDS ? ", " : "\n");
    }
    return worst <= 1.2 ? 0 : 1;
}
