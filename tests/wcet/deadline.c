/* SPDX-License-Identifier: MIT */
/*
 * Ticks in virtual time, one after another, under contact that keeps changing and with a budget
 * that changes every tick: deadline BLOB TICKS SEED. The clock is what was done: the counters of
 * the code at the prices of the target "counted", or, built with -DINSTRUCTIONS and run under
 * counter.c, instructions at the prices of the target that it is built for.
 *
 * Two things make ticks run out of time. Budgets go from the least that the servo accepts to the
 * most that the limits allow. And while a solve is under way on a rung that can be given up, the
 * clock leaps, at a look chosen at random, to where nothing is left but what is kept back for
 * giving it up. After either the answer must be there in time.
 */
#include "blobfile.h"
#include "tools/hunt.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef INSTRUCTIONS
#include "instructions.h"
#endif

#define QUANTA 64u

typedef struct {
    palp_bounded bounded;
    palp_tool tool;
    uint64_t leapt_ns; /* so far */
    uint32_t looks, leap_at;
    uint32_t rung, quantum; /* of the last look while solving on the finest rung of this tick */
    bool leaps;
    float left_over; /* share of the quantum that a leap leaves besides */
} trial;

static uint64_t done_ns(const trial *t) {
#ifdef INSTRUCTIONS
    (void)t;
    return instructions();
#else
    return palp_bounded_work(&t->bounded);
#endif
}

static bool solving(const palp_bounded *b) { return b->coupling.pivots > 0u; }

static uint64_t now_ns(void *context) {
    trial *t = context;
    palp_bounded *b = &t->bounded;
    uint64_t now = done_ns(t) + t->leapt_ns;
    if (solving(b) && b->ladder.rung >= t->rung) {
        t->rung = b->ladder.rung;
        t->quantum = b->coupling.pivots;
    }
    if (!t->leaps || !solving(b) || b->ladder.rung == 0u || !(b->retreat_ns > 0.0f)) return now;
    if (t->looks++ != t->leap_at) return now;
    float whole = b->config.cost.margin * 1e9f * b->config.dt_s - b->tail_ns;
    float left = whole - (float)(now - b->start_ns) - b->retreat_ns * (1.0f + t->left_over) - 2.0f;
    if (left > 0.0f) t->leapt_ns += (uint64_t)left;
    return done_ns(t) + t->leapt_ns;
}

int main(int argc, char **argv) {
    if (argc < 4) return 2;
    palp_blob blob;
    size_t bytes;
    void *data = load(argv[1], &bytes);
    if (palp_blob_open(&blob, data, bytes) != PALP_OK) return 1;
    uint64_t ticks = strtoull(argv[2], NULL, 10);
    dice d = {strtoull(argv[3], NULL, 10)};
#ifdef INSTRUCTIONS
    const palp_target *target = &palp_target_x86_64;
    instructions_open();
#else
    const palp_target *target = &palp_target_counted;
#endif
    const palp_node_contact_limits limits = {24, 12, 4, 12, false};
    static trial t;
    float edge = blob.meta->mean_edge_m, least_ns = 0.0f;
    t.tool = palp_tool_sphere(4.0f * edge);
    palp_bounded_config config = {.blob = &blob,
                                  .tools = &t.tool,
                                  .tool_count = 1,
                                  .limits = limits,
                                  .cost = {target, 1.0f, 0.0f, 1.0f},
                                  .port = {now_ns, &t},
                                  .dt_s = 1e-3f};
    palp_prices prices = target->instructions;
    palp_touch_cost cost = palp_touch_cost_of(&blob, limits, &t.tool, 1, &prices);
    uint32_t finest = blob.meta->constraint_level;
    float full_ns = palp_cost_full(&cost, (palp_rung){finest, finest});
    config.dt_s = full_ns * 1e-9f;
    size_t room = palp_bounded_memsize(&blob, limits);
    if (palp_bounded_init(&t.bounded, &config, aligned_alloc(64, room), room, &least_ns) != PALP_OK)
        return 1;
    t.bounded.coupling.spring[0].stiffness_N_per_m = blob.meta->stiffness_max_N_per_m;
    uint64_t late = 0, late_spare = 0, aborted = 0, shortened = 0, at_quantum[QUANTA] = {0};
    uint64_t level[PALP_MAX_LEVELS] = {0};
    double closest = 0;
    uint32_t node = 0, phase = 0, dwell = 1;
    float depth = 0.0f, tremble = 0.0f, share = 1.0f;
    for (uint64_t i = 0; i < ticks; i++) {
        if (phase == 0u) { /* another place, another depth and pace */
            node = blob.domain[PALP_FREE].node[dice_below(&d, blob.domain[PALP_FREE].slots)];
            dwell = 8u + dice_below(&d, 60);
            depth = 0.5f + 0.4f * dice_float(&d);
            tremble = 0.3f * (1.0f + dice_float(&d));
        }
        float in = (float)phase / (float)dwell, sunk = 4.0f * depth * in * (1.0f - in) - 0.05f;
        phase = phase + 1u < dwell ? phase + 1u : 0u;
        palp_vec3 at = palp_madd(palp_vec3_at(blob.rest_m + 3u * node),
                                 (1.0f - sunk) * t.tool.ball[0].radius_m,
                                 palp_vec3_at(blob.normal + 3u * node));
        at = palp_madd(at, tremble * edge,
                       (palp_vec3){dice_float(&d), dice_float(&d), dice_float(&d)});
        if (dice_below(&d, 100) == 0u) share = 0.5f + 0.5f * dice_float(&d);
        float budget_ns = least_ns + share * (full_ns - least_ns);
        t.bounded.config.cost.margin = budget_ns / full_ns;
        t.leaps = dice_below(&d, 2) == 0u;
        t.looks = t.rung = 0;
        t.bounded.coupling.pivots = 0; /* not of the tick before */
        t.leap_at = dice_below(&d, 24);
        t.left_over = 1e-3f * (float)dice_below(&d, 50);
        palp_node_coupling_result result;
        palp_bounded_report r;
        uint64_t start = now_ns(&t);
        uint32_t drops = t.bounded.ladder.dropped;
        palp_bounded_tick(&t.bounded, start, &at, &result, &r);
        t.leaps = false;
        double used = (double)(now_ns(&t) - start) / (double)budget_ns;
        late += used > 1;
        closest = fmax(closest, used);
        aborted += t.bounded.ladder.dropped - drops;
        shortened += r.shortened;
        level[r.level]++;
        if (t.bounded.ladder.rung < t.rung)
            at_quantum[t.quantum < QUANTA ? t.quantum : QUANTA - 1u]++;
        palp_bounded_spare(&t.bounded);
        late_spare += (double)(now_ns(&t) - start) > (double)budget_ns;
        if (!palp_vec3_is_finite(result.force_N)) late++;
    }
    printf("%llu ticks, %llu late, %llu late after spare time, nearest %.4f of the budget, %llu "
           "levels aborted, %llu cut short; on levels",
           (unsigned long long)ticks, (unsigned long long)late, (unsigned long long)late_spare,
           closest, (unsigned long long)aborted, (unsigned long long)shortened);
    for (uint32_t l = 0; l <= finest; l++) printf(" %u: %llu", l, (unsigned long long)level[l]);
    printf("; given up while solving, after quantum");
    for (uint32_t q = 0; q < QUANTA; q++) {
        if (at_quantum[q] > 0) printf(" %u: %llu", q, (unsigned long long)at_quantum[q]);
    }
    printf("\n");
    return late + late_spare > 0 ? 1 : 0;
}
