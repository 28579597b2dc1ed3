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
    return palp_scene_loads(servo->scene, 0, load);
}

uint32_t palp_servo_tick(palp_servo *s, const palp_tick_input *input, palp_can_frame *out,
                         palp_report *r) {
    palp_scene_report report;
    uint32_t sent = 0;
    palp_scene_tick(s->scene, input, (palp_can_frame(*)[PALP_SERVO_FRAMES_OUT])out, &sent, &report);
    palp_scene_view(s->scene, &report, 0, r);
    return sent;
}
