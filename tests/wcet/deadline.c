/* SPDX-License-Identifier: MIT */
/*
 * Ticks in virtual time, one after another, under contact that keeps changing and with a budget
 * that changes every tick: deadline BLOB TICKS SEED [TIMES]. The clock is what was done: the counters of
 * the code at the prices of the target "counted", or, built with -DINSTRUCTIONS and run under
 * counter.c, instructions at the prices of the target that it is built for. With TIMES the prices are
 * so many times as high, and so are the budgets.
 *
 * Two things make ticks run out of time. Budgets go from the least that the answer accepts to the
 * most that a tick can ask for. And the clock leaps, at a look chosen at random, to where nothing
 * is left, or a little. Whatever there was to do, what a tick does after a leap must fit what was
 * kept back.
 */
#include "tests/wcet/blobfile.h"
#include "tools/wcet/tool_path.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef INSTRUCTIONS
#include "tests/wcet/instructions.h"
#endif

#define LOOKS 32u

typedef struct {
    palp_answer answer;
    palp_tool tool;
    uint64_t leapt_ns; /* so far */
    uint32_t looks, leap_at;
    bool leaps;
    float left_ns; /* that a leap leaves, besides what is kept back for the end */
} trial;

static uint64_t done_ns(const trial *t) {
#ifdef INSTRUCTIONS
    (void)t;
    return instructions();
#else
    return t->answer.contact.work_done;
#endif
}

static uint64_t now_ns(void *context) {
    trial *t = context;
    const palp_answer *a = &t->answer;
    uint64_t now = done_ns(t) + t->leapt_ns;
    if (!t->leaps || t->looks++ != t->leap_at) return now;
    float whole = a->config.cost.margin * 1e9f * a->config.dt_s - a->tail_ns;
    float left = whole - (float)(now - a->start_ns) - t->left_ns;
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
    palp_target target = palp_target_x86_64;
    instructions_open();
#else
    palp_target target = palp_target_counted;
#endif
    const float times = argc > 4 ? (float)atof(argv[4]) : 1.0f;
    for (uint32_t k = 0; k < PALP_WORKS; k++) target.instructions.of[k] *= times;
    static trial t;
    float edge = blob.meta->mean_edge_m, least_ns = 0.0f;
    t.tool = palp_tool_sphere(2.5f * edge);
    palp_answer_config config = {.contact = {.blob = &blob,
                                             .tools = &t.tool,
                                             .tool_count = 1,
                                             .finest = PALP_CONTACT_FINEST},
                                 .cost = {&target, 1.0f, 0.0f, 1.0f},
                                 .port = {now_ns, &t}};
    palp_prices prices = target.instructions;
    palp_contact_cost cost = palp_contact_cost_of(&blob, &t.tool, 1, &prices);
    float full_ns = palp_answer_cost_full(&cost, PALP_CONTACT_FINEST);
    config.dt_s = full_ns * 1e-9f;
    size_t room = palp_answer_memsize(&config.contact);
    if (palp_answer_init(&t.answer, &config, aligned_alloc(64, (room + 63u) / 64u * 64u), room,
                         &least_ns) != PALP_OK)
        return 1;
    t.answer.coupling.tool[0].stiffness_N_per_m = blob.meta->stiffness_max_N_per_m;
    uint64_t late = 0, held = 0, shortened = 0, at_look[LOOKS] = {0};
    uint64_t level[PALP_CONTACT_LEVELS] = {0};
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
        t.answer.config.cost.margin = budget_ns / full_ns;
        t.leaps = dice_below(&d, 2) == 0u;
        t.looks = 0;
        t.leap_at = dice_below(&d, 16);
        t.left_ns = budget_ns * (dice_below(&d, 2) == 0u ? 0.0f : 0.1f * (1.0f + dice_float(&d)));
        palp_coupling_result result;
        palp_answer_report r;
        uint64_t start = now_ns(&t);
        t.looks = 0;
        const palp_frame device = palp_frame_at(at);
        palp_answer_tick(&t.answer, start, &device, &result, &r);
        bool leapt = t.leaps && t.looks > t.leap_at;
        t.leaps = false;
        double used = (double)(now_ns(&t) - start) / (double)budget_ns;
        late += used > 1 || !palp_vec3_is_finite(result.force_N);
        closest = fmax(closest, used);
        held += r.held;
        shortened += r.shortened;
        level[r.level]++;
        if (r.held && leapt) at_look[t.leap_at < LOOKS ? t.leap_at : LOOKS - 1u]++;
    }
    printf("%llu ticks, %llu late, nearest %.4f of the budget, %llu held as foreseen, %llu cut "
           "short; on levels",
           (unsigned long long)ticks, (unsigned long long)late, closest, (unsigned long long)held,
           (unsigned long long)shortened);
    for (uint32_t l = 0; l <= PALP_CONTACT_FINEST; l++)
        printf(" %u: %llu", l, (unsigned long long)level[l]);
    printf("; held after a leap at look");
    for (uint32_t q = 0; q < LOOKS; q++) {
        if (at_look[q] > 0) printf(" %u: %llu", q, (unsigned long long)at_look[q]);
    }
    printf("\n");
    return late > 0 ? 1 : 0;
}
