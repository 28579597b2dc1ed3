/* SPDX-License-Identifier: MIT */
#include "port/host/run_tick.h"
#include <string.h>

void run_begin(const scene_setup *setup, tick_record *t) {
    const palp_scene_config *c = &setup->config;
    t->hands = c->hands;
    t->bodies = c->bodies;
    t->clock_count = t->load_count = 0;
    t->skipped = 0;
    t->clock_full = t->exchanged = false;
    for (uint32_t b = 0; b < c->bodies; b++) t->kind[b] = c->body[b].kind;
    for (uint32_t h = 0; h < c->hands; h++)
        t->hand[h].in_count = t->hand[h].out_count = t->hand[h].events = 0;
}

/* By what it feels of each body. */
static palp_frame tool_at(const palp_scene_report *r, uint32_t bodies, uint32_t tool) {
    const palp_body_felt *most = &r->felt[0][tool];
    for (uint32_t b = 1; b < bodies; b++) {
        const palp_body_felt *f = &r->felt[b][tool];
        if (palp_norm(f->wrench.force_N) > palp_norm(most->wrench.force_N)) most = f;
    }
    return most->tool;
}

void run_tick(const scene_setup *setup, palp_scene *scene, double t_s, tick_record *t,
              uint64_t *digest) {
    palp_can_frame out[PALP_SCENE_HANDS][PALP_SERVO_FRAMES_OUT];
    palp_tick_input in[PALP_SCENE_HANDS];
    uint32_t sent[PALP_SCENE_HANDS];
    palp_scene_report report;
    for (uint32_t h = 0; h < t->hands; h++)
        in[h] = (palp_tick_input){.frames = t->hand[h].in,
                                  .count = t->hand[h].in_count,
                                  .skipped = t->skipped,
                                  .events = t->hand[h].events};
    scene_move(setup, scene, t_s);
    palp_scene_tick(scene, in, out, sent, &report);
    for (uint32_t h = 0; h < t->hands; h++) {
        tick_hand *hand = &t->hand[h];
        hand->out_count = sent[h];
        memcpy(hand->out, out[h], sent[h] * sizeof out[h][0]);
        palp_scene_view(scene, &report, h, &hand->report);
        *digest = record_digest(*digest, hand->out, hand->out_count, &hand->report);
        hand->counters = *palp_scene_counters(scene, h);
        for (uint32_t i = 0; i < PALP_AXES && hand->report.state != PALP_STATE_RUN; i++)
            hand->trouble[i] = palp_scene_trouble(scene, h, i);
    }
    for (uint32_t b = 0; b < t->bodies; b++) t->body[b] = report.body[b];
    for (uint32_t k = 0; k < palp_scene_tools(scene); k++)
        t->tool[k] = tool_at(&report, t->bodies, k);
    t->joint_count = 0;
    for (uint32_t d = 0; d < palp_scene_drives(scene); d++) {
        if (setup->drive[d].by == PALP_DRIVEN_BY_FRAMES)
            t->joint[t->joint_count++] = *palp_scene_setpoint(scene, d);
    }
    t->digest = *digest;
}
