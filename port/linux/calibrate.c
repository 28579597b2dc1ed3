/* SPDX-License-Identifier: MIT */
#include "calibrate.h"
#include "realtime.h"
#include "tools/util.h"
#include <math.h>
#include <stdlib.h>

#define SAFETY 2.0f /* over the slowest of the typical samples */
#define ROUNDS 5

static int compare_floats(const void *a, const void *b) {
    float p = *(const float *)a, q = *(const float *)b;
    return p < q ? -1 : p > q;
}

/* Interrupted samples are not the machine's speed: the 90th percentile leaves them out. */
static float typical(float *sample, size_t count) {
    qsort(sample, count, sizeof *sample, compare_floats);
    return count > 0 ? sample[(size_t)(0.9 * (double)(count - 1))] : 0;
}

float calibrate(const palp_blob *blob, palp_contact_limits limits, const palp_tool *tool,
                uint32_t node) {
    palp_contact contact;
    size_t bytes = palp_contact_memsize(blob, limits);
    void *memory = allocate_aligned(bytes, 1);
    palp_cost_bound bound = palp_cost_of(blob, limits, tool, 1);
    palp_fresh *fresh = allocate(limits.max_candidates, sizeof *fresh);
    float size = palp_tool_size(tool);
    float *admit = allocate(ROUNDS * limits.max_candidates, sizeof *admit);
    float *solve = allocate(ROUNDS * 64, sizeof *solve);
    size_t admits = 0, solves = 0;
    palp_vec3 n = palp_vec3_at(blob->normal + 3 * node);
    palp_vec3 x = palp_vec3_at(blob->rest_m + 3 * node);
    if (palp_contact_init(&contact, blob, blob->rest_m, tool, 1, limits, memory, bytes) !=
        PALP_OK) {
        die(EXIT_WORK, "the contact limits are unsound");
    }
    for (int round = 0; round < ROUNDS; round++) {
        const palp_rung rung = {blob->meta->constraint_level, blob->meta->constraint_level};
        palp_contact_clear(&contact, rung.level);
        for (int step = 0; step < 64; step++) {
            palp_vec3 center = palp_madd(x, size * (1.0f - 0.01f * (float)step), n);
            uint32_t count = palp_contact_search(&contact, &center, fresh);
            for (uint32_t i = 0; i < count; i++) {
                float operations = palp_cost_admit(&bound, rung, contact.count);
                uint64_t start = monotonic_ns(NULL);
                palp_contact_admit(&contact, fresh[i]);
                if (admits < (size_t)ROUNDS * limits.max_candidates) {
                    admit[admits++] = (float)(monotonic_ns(NULL) - start) / operations;
                }
            }
            uint64_t start = monotonic_ns(NULL);
            (void)palp_contact_solve(&contact, center, (palp_grip){.held_m = center});
            float operations = palp_cost_solve(&bound, contact.count, contact.active_count) +
                               (float)(contact.pivots + 1) *
                                   palp_cost_pivot(&bound, contact.count, contact.active_count);
            solve[solves++] = (float)(monotonic_ns(NULL) - start) / operations;
        }
    }
    float slowest = fmaxf(typical(admit, admits), typical(solve, solves));
    free(solve);
    free(admit);
    free(fresh);
    free(memory);
    return SAFETY * slowest;
}
