/* SPDX-License-Identifier: MIT */
#include "tests/stage.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static uint64_t clock_of(void *context) { return *(uint64_t *)context += 100; }

void seat(stage *s, uint32_t h, const char *device, float rate_hz, palp_vec3 origin,
          float turn_rad) {
    const float c = cosf(turn_rad), si = sinf(turn_rad);
    s->file[h] = device_load(device);
    s->file[h].device.drives.rate_hz = rate_hz;
    s->hand[h] = (palp_hand_config){
        .device = s->file[h].device,
        .placement = {.origin_m = origin, .rotation = {c, -si, 0, si, c, 0, 0, 0, 1}, .scale = 1}};
}

void lead(stage *s, uint32_t h, const hand_key *key, const hand_turn *turn, uint32_t count) {
    hand *of = &s->bus[h].script;
    *of = (hand){.count = count,
                 .key = allocate(count, sizeof *key),
                 .turn = turn != NULL ? allocate(count, sizeof *turn) : NULL,
                 .stiffness_N_per_m = 800,
                 .damping_Ns_per_m = 10,
                 .stiffness_Nm_per_rad = 0.5,
                 .damping_Nms_per_rad = 0.005,
                 .tremor_m = 2e-5};
    memcpy(of->key, key, count * sizeof *key);
    if (turn != NULL) memcpy(of->turn, turn, count * sizeof *turn);
    hand_pose at;
    hand_target(of, 0, &at);
    sim_device_init(&s->bus[h].device, &s->file[h], &at);
}

palp_status try_open(stage *s, float *bound_ns) {
    s->config.hand = s->hand;
    s->config.cost = (palp_cost_table){.target = &palp_target_counted,
                                       .ns_per_instruction =
                                           s->ns_per_instruction > 0 ? s->ns_per_instruction : 0.5f,
                                       .margin = 0.8f};
    s->config.port = (palp_port){.now_ns = clock_of, .context = &s->now_ns};
    const size_t bytes = palp_scene_memsize(&s->config);
    s->memory = allocate_aligned(bytes > 0 ? bytes : PALP_ALIGN, 1);
    return palp_scene_open(&s->scene, &s->config, s->memory, bytes, bound_ns);
}

void start(stage *s) {
    float bound_ns = 0;
    const palp_status status = try_open(s, &bound_ns);
    if (status != PALP_OK)
        die(EXIT_WORK, "the scene does not open: status %d, %g ns", (int)status, (double)bound_ns);
    for (uint32_t h = 0; h < s->config.hands; h++)
        sim_bus_init(&s->bus[h], &s->file[h], hand_load("touch"), (fault_list){.seed = h + 1});
}

void stop(stage *s) {
    for (uint32_t h = 0; h < s->config.hands; h++) {
        free(s->bus[h].script.key);
        free(s->bus[h].script.turn);
    }
    free(s->memory);
}

static void watch(stage *s, uint32_t h) {
    const palp_hand_report *r = &s->report.hand[h];
    const float now[3] = {r->force_N.x, r->force_N.y, r->force_N.z};
    float step = 0;
    for (int k = 0; k < 3; k++) {
        step += (now[k] - s->last_N[h][k]) * (now[k] - s->last_N[h][k]);
        s->last_N[h][k] = now[k];
    }
    s->step_N[h] = fmaxf(s->step_N[h], sqrtf(step));
    s->largest_N[h] = fmaxf(s->largest_N[h], palp_norm(r->force_N));
    s->least_J = fminf(s->least_J, r->absorbed_J);
    s->out = s->out || !palp_vec3_is_finite(r->force_N) || !palp_vec3_is_finite(r->moment_Nm) ||
             palp_norm(r->force_N) > s->file[h].device.force_max_N * 1.0001f;
}

void tick(stage *s) {
    palp_can_frame in[HANDS][64], out[HANDS][PALP_SERVO_FRAMES_OUT];
    palp_tick_input input[HANDS];
    uint32_t sent[HANDS];
    const double dt = 1 / (double)s->file[0].device.drives.rate_hz;
    for (uint32_t h = 0; h < s->config.hands; h++) {
        uint32_t events = 0;
        uint32_t n = sim_bus_pass(&s->bus[h], dt, in[h], 64, &events);
        for (uint32_t i = 0; i < s->more_count && h == 0; i++) in[h][n++] = s->more[i];
        input[h] =
            (palp_tick_input){.frames = in[h], .count = n, .events = events | s->more_events[h]};
        s->more_events[h] = 0;
    }
    s->more_count = 0;
    palp_scene_tick(s->scene, input, out, sent, &s->report);
    s->most_ns = fmax(s->most_ns, (double)s->report.bound_ns / (1e9 * dt));
    for (uint32_t h = 0; h < s->config.hands; h++) {
        for (uint32_t i = 0; i < sent[h]; i++)
            if (!sim_bus_send(&s->bus[h], &out[h][i])) s->more_events[h] |= PALP_EVENT_BUS_FULL;
        watch(s, h);
    }
}

void run(stage *s, double seconds) {
    const double end = s->bus[0].time_s + seconds;
    while (s->bus[0].time_s < end) tick(s);
}
