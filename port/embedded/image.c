/* SPDX-License-Identifier: MIT */
/*
 * An image of a scene without an operating system: opens what `palp embed` has written, and ticks with
 * devices whose joints go round, for TICKS. Its devices speak the protocol of this project alone. Prints what it
 * takes, what its ticks took, what was felt of each body, and a hash of every frame and force: with CLOCK_STANDS
 * the same on every machine.
 */
#include "core/device/profile.h"
#include "port/cortexm/print.h"
#include "port/cortexm/systick.h"
#include "port/embedded/embedded_scene.h"

#ifndef TICKS
#define TICKS 2000u
#endif
#ifndef DEPTH_RAD
#define DEPTH_RAD 0.1f
#endif
#define STATE_TICKS 100u /* until the drives are on and the force has risen */
#define RAD_PER_REV 6.28318530718f

int main(void);

/* The drives of a device. */
typedef struct {
    palp_e2e sent[PALP_AXES], received[PALP_AXES];
    bool on[PALP_AXES];
} drives;

static drives of[PALP_SCENE_HANDS];

/* A slow figure about the origin, in and out; each device at a pace of its own. */
static void path(uint32_t hand, float t_s, float depth_rad, float q_rad[PALP_AXES]) {
    float sine, cosine, slow, unused;
    palp_sincos(6.0f * t_s, &sine, &cosine);
    palp_sincos((1.7f + 0.3f * (float)hand) * t_s, &slow, &unused);
    q_rad[0] = 0.03f * cosine;
    q_rad[1] = 0.5f * depth_rad * (slow - 1.0f);
    q_rad[2] = depth_rad * (0.5f * slow - 0.5f) + 0.02f * sine;
    for (uint32_t i = 3; i < PALP_AXES; i++) q_rad[i] = 0.1f * (i % 2u == 0u ? sine : cosine);
}

static uint32_t speak(uint32_t hand, float t_s, float depth_rad, palp_can_frame *out) {
    const palp_device *d = &embedded.hand[hand].device;
    const uint32_t axes = palp_axes(&d->kinematics);
    drives *o = &of[hand];
    float q[PALP_AXES];
    path(hand, t_s, depth_rad, q);
    for (uint32_t i = 0; i < axes; i++) {
        const palp_profile_status s = {.state = o->on[i] ? PALP_DRIVE_IS_ON : PALP_DRIVE_IS_OFF,
                                       .position_rev = (q[i] - d->joint_zero_rad[i]) * d->gear[i] /
                                                       RAD_PER_REV};
        out[i] = palp_profile_encode_status(&o->sent[i], d->node_id[i], d->drives.fd, &s);
    }
    return axes;
}

static void listen(uint32_t hand, const palp_can_frame *frames, uint32_t count) {
    const palp_device *d = &embedded.hand[hand].device;
    drives *o = &of[hand];
    for (uint32_t k = 0; k < count; k++) {
        for (uint32_t i = 0; i < palp_axes(&d->kinematics); i++) {
            palp_profile_command c;
            palp_e2e_verdict verdict;
            if (palp_profile_decode_command(&o->received[i], &frames[k], d->node_id[i],
                                            d->drives.fd, &c, &verdict))
                o->on[i] = c.mode == PALP_MODE_TORQUE;
        }
    }
}

static uint64_t clock_ns(void *unused) {
#ifdef CLOCK_STANDS
    (void)unused;
    return 0;
#else
    return systick_now_ns(unused);
#endif
}

/* What is worth knowing. */
typedef struct {
    uint64_t running, sum, most, late, held;
    float felt_N[PALP_SCENE_BODIES];
    uint64_t hash;
} tally;

static void one_tick(palp_scene *scene, uint32_t i, tally *t) {
    palp_can_frame in[PALP_SCENE_HANDS][PALP_AXES];
    palp_can_frame out[PALP_SCENE_HANDS][PALP_SERVO_FRAMES_OUT];
    palp_tick_input input[PALP_SCENE_HANDS];
    palp_scene_report r;
    uint32_t sent[PALP_SCENE_HANDS];
    const float t_s = (float)i / embedded.rate_hz;
    bool run = true;
    for (uint32_t h = 0; h < embedded.hands; h++)
        input[h] = (palp_tick_input){
            .frames = in[h], .count = speak(h, t_s, i < STATE_TICKS ? 0.0f : DEPTH_RAD, in[h])};
    embedded_move(scene, (double)i / (double)embedded.rate_hz);
    const uint64_t begun = systick_work();
    palp_scene_tick(scene, input, out, sent, &r);
    const uint64_t took = systick_work() - begun;
    for (uint32_t h = 0; h < embedded.hands; h++) {
        listen(h, out[h], sent[h]);
        for (uint32_t k = 0; k < sent[h]; k++)
            t->hash = hash_on(t->hash, out[h][k].data, out[h][k].length);
        t->hash = hash_on(t->hash, &r.hand[h].force_N, sizeof r.hand[h].force_N);
        run = run && r.hand[h].state == PALP_STATE_RUN;
    }
    palp_scene_spare(scene);
    if (!run) return;
    t->running++;
    t->sum += took;
    t->most = took > t->most ? took : t->most;
    t->late += r.elapsed_ns > 0.8e9f / embedded.rate_hz ? 1u : 0u;
    for (uint32_t b = 0; b < embedded.bodies; b++) {
        t->held += r.body[b].held ? 1u : 0u;
        for (uint32_t k = 0; k < embedded.tools; k++)
            t->felt_N[b] = palp_max(t->felt_N[b], palp_norm(r.felt[b][k].wrench.force_N));
    }
}

static void print_tally(const tally *t) {
    print_number("ticks in RUN ", t->running, "\n");
    if (t->running > 0u) {
        print_number(SYSTICK_UNIT " a tick: mean ", t->sum / t->running, "");
        print_number(", most ", t->most, "\n");
    }
    for (uint32_t b = 0; b < embedded.bodies; b++) {
        print_number("body ", b, ": ");
        print_number("largest force ", (uint64_t)(1000.0f * t->felt_N[b]), " mN\n");
    }
    print_number("held as foreseen ", t->held, "\n");
    print_number("late ", t->late, "\n");
    print_hash(t->hash);
}

int main(void) {
    palp_scene *scene;
    tally t = {.hash = HASH_BEGIN};
    float bound_ns = 0.0f;
    const palp_cost_table cost = {SYSTICK_TARGET, SYSTICK_NS, 0.0f, 0.8f};
    const palp_port port = {clock_ns, NULL};
    for (uint32_t h = 0; h < embedded.hands; h++) {
        if (embedded.hand[h].device.drives.protocol == PALP_PROTOCOL_PALP) continue;
        semihost_print("the devices of this image speak protocol palp alone\n");
        return 1;
    }
    systick_start();
    const palp_status status = embedded_open(&scene, &cost, &port, &bound_ns);
    print_number("memory ", embedded.bytes, " bytes");
    print_number(", opened in ", systick_work(), " " SYSTICK_UNIT "\n");
    if (status != PALP_OK) {
        semihost_print(palp_status_text(status));
        print_number(": the coarsest answers take ", (uint64_t)(1e-3f * bound_ns), " us\n");
        return 1;
    }
    for (uint32_t i = 0; i < TICKS; i++) one_tick(scene, i, &t);
    print_tally(&t);
    return 0;
}
