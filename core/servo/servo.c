/* SPDX-License-Identifier: MIT */
#include "core/servo/servo.h"
#include "core/base/arena.h"

struct palp_servo {
    palp_scene *scene;
};

/* Reports of a tick add up on top of what the scene's own code keeps. */
PALP_STATIC_ASSERT(sizeof(palp_servo) + sizeof(palp_hand) + sizeof(palp_answer) +
                           sizeof(palp_scene_tool) + sizeof(palp_tool) + 8u * PALP_ALIGN +
                           PALP_SCENE_OBJECT <=
                       PALP_SERVO_OBJECT,
                   "PALP_SERVO_BYTES");

static palp_body_config body_of(const palp_blob *blob, uint32_t finest) {
    return (palp_body_config){
        .kind = PALP_BODY_ELASTIC, .at = PALP_FRAME_IDENTITY, .blob = blob, .finest = finest};
}

/* The parts of a scene with one of each. */
typedef struct {
    palp_body_config body;
    palp_scene_tool tool;
    palp_hand_config hand;
    palp_scene_config scene;
} single;

static void describe(single *s, const palp_blob *blob, const palp_servo_config *c) {
    s->body = body_of(blob, c->finest);
    s->tool = (palp_scene_tool){.tool = c->tool, .at = PALP_FRAME_IDENTITY};
    s->hand = (palp_hand_config){.device = c->device,
                                 .placement = c->placement,
                                 .resume = c->resume,
                                 .coupling_N_per_m = c->coupling_N_per_m,
                                 .coupling_Ns_per_m = c->coupling_Ns_per_m,
                                 .unguarded = c->unguarded};
    s->scene = (palp_scene_config){.body = &s->body,
                                   .tool = &s->tool,
                                   .hand = &s->hand,
                                   .bodies = 1,
                                   .tools = 1,
                                   .hands = 1,
                                   .cost = c->cost,
                                   .port = c->port};
}

static palp_servo *lay_out(palp_arena *arena, const palp_blob *blob, uint32_t finest, void **scene,
                           size_t *bytes) {
    palp_servo *s = palp_take(arena, 1, sizeof *s);
    const palp_body_config body = body_of(blob, finest);
    *bytes = palp_scene_memsize(
        &(palp_scene_config){.body = &body, .bodies = 1, .tools = 1, .hands = 1});
    *scene = palp_take(arena, *bytes, 1);
    return s;
}

size_t palp_servo_memsize(const palp_blob *blob, uint32_t finest) {
    palp_arena arena = {0};
    void *scene;
    size_t bytes;
    if (blob->regular.modes == 0u || finest >= PALP_CONTACT_LEVELS) return 0;
    (void)lay_out(&arena, blob, finest, &scene, &bytes);
    return arena.used;
}

palp_status palp_servo_open(palp_servo **servo, const palp_blob *blob,
                            const palp_servo_config *config, void *memory, size_t bytes,
                            float *bound_ns) {
    palp_arena arena = {.base = memory};
    void *scene;
    size_t part;
    single one;
    if (blob->regular.modes == 0u) return PALP_ERR_ABSENT;
    if (config->finest >= PALP_CONTACT_LEVELS) return PALP_ERR_LIMITS;
    palp_status status = palp_check_block(memory, bytes, palp_servo_memsize(blob, config->finest));
    if (status != PALP_OK) return status;
    describe(&one, blob, config);
    palp_servo *s = lay_out(&arena, blob, config->finest, &scene, &part);
    palp_scene *opened;
    status = palp_scene_open(&opened, &one.scene, scene, part, bound_ns);
    if (status != PALP_OK) return status;
    *s = (palp_servo){.scene = opened};
    *servo = s;
    return PALP_OK;
}

const palp_counters *palp_servo_counters(const palp_servo *servo) {
    return palp_scene_counters(servo->scene, 0);
}

palp_drive_trouble palp_servo_trouble(const palp_servo *servo, uint32_t axis) {
    return palp_scene_trouble(servo->scene, 0, axis);
}

uint32_t palp_servo_loads(const palp_servo *servo, palp_load *load) {
    const palp_answer *a = palp_scene_body(servo->scene, 0)->answer;
    palp_load_list list = {.load = load, .capacity = PALP_SERVO_LOADS};
    palp_contact_loads(&a->contact, 0, 0, a->coupling.tool[0].friction.force_N, &list);
    return list.count;
}

/* A tick of the scene, as that of its one hand, tool and body. */
static void report_of(const palp_scene_report *scene, float scale, palp_report *r) {
    const palp_hand_report *h = &scene->hand[0];
    const palp_body_report *b = &scene->body[0];
    const palp_body_felt *f = &scene->felt[0][0];
    *r = (palp_report){.tick = scene->tick,
                       .state = h->state,
                       .faults = h->faults,
                       .level = b->level,
                       .limit = b->limit,
                       .points = b->points,
                       .active = b->active,
                       .iterations = b->iterations,
                       .contact_flags = b->flags,
                       .bound_ns = scene->bound_ns,
                       .elapsed_ns = scene->elapsed_ns,
                       .tip_m = h->tip_m,
                       .tip_velocity_m_s = h->tip_velocity_m_s,
                       .tool = f->tool,
                       .force_N = h->force_N,
                       .moment_Nm = h->moment_Nm,
                       .contact_moment_Nm = h->contact_moment_Nm,
                       .stored_J = h->stored_J,
                       .absorbed_J = h->absorbed_J,
                       .given_J = h->given_J,
                       .doubt_N = scale * b->doubt_N,
                       .unforeseen_m = f->moved_m,
                       .held = b->held,
                       .shortened = b->shortened,
                       .slipping = f->slipping,
                       .braked = h->braked};
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        r->joint_rad[i] = h->joint_rad[i];
        r->joint_rad_s[i] = h->joint_rad_s[i];
        r->motor_torque_Nm[i] = h->motor_torque_Nm[i];
    }
    for (uint32_t e = 0; e < 9u; e++) r->tip_r[e] = h->tip_r[e];
}

uint32_t palp_servo_tick(palp_servo *s, const palp_tick_input *input, palp_can_frame *out,
                         palp_report *r) {
    palp_scene_report report;
    uint32_t sent = 0;
    palp_scene_tick(s->scene, input, (palp_can_frame(*)[PALP_SERVO_FRAMES_OUT])out, &sent, &report);
    report_of(&report, palp_scene_hand(s->scene, 0)->config.placement.scale, r);
    return sent;
}
