/* SPDX-License-Identifier: MIT */
#include "tools/wcet/scene_bounds.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

#define UNIT 1e-6f /* ns for an instruction or a byte: so little that all levels fit any period */

static uint64_t no_clock(void *context) {
    (void)context;
    return 0;
}

/* What an opened body takes, in the unit of its prices. */
typedef struct {
    double least,
        tick[PALP_CONTACT_LEVELS]; /* on a level of contact; of a dynamic body all the same */
} body_cost;

static body_cost cost_of(const palp_body *body) {
    body_cost c = {.least = (double)(body->least_ns / UNIT)};
    for (uint32_t l = 0; l < PALP_CONTACT_LEVELS; l++) {
        const float tick = body->answer != NULL
                               ? palp_answer_cost_full(&body->answer->bound, l)
                               : palp_dynamic_cost_tick(body->dynamic, PALP_STEP_CLASSES - 1u);
        c.tick[l] = (double)(tick / UNIT);
    }
    return c;
}

void scene_bounds(const scene_setup *setup, const machine *m, wcet_table *t) {
    const palp_target in_bytes = {.name = "bytes", .instructions = palp_bytes_touched};
    const palp_target *target[2] = {&m->target, &in_bytes};
    palp_scene_config config = setup->config;
    const size_t bytes = palp_scene_memsize(&config);
    void *memory = allocate_aligned(bytes, 1);
    body_cost cost[2][PALP_SCENE_BODIES];
    double hands[2], least[2];
    config.port = (palp_port){.now_ns = no_clock};
    for (int k = 0; k < 2; k++) {
        palp_scene *scene;
        config.cost = (palp_cost_table){target[k], UNIT, 0.0f, 1.0f};
        const palp_status status = palp_scene_open(&scene, &config, memory, bytes, NULL);
        if (status != PALP_OK)
            die(EXIT_WORK, "%s: %s", setup->file->name, palp_status_text(status));
        const palp_prices unit = palp_prices_of(&config.cost);
        hands[k] = 0;
        for (uint32_t h = 0; h < config.hands; h++)
            hands[k] += (double)((palp_servo_cost_before(&unit, &config.hand[h].device) +
                                  palp_servo_cost_after(&unit, &config.hand[h].device)) /
                                 UNIT);
        least[k] = hands[k];
        for (uint32_t b = 0; b < config.bodies; b++) {
            if (setup->part[b].kind == PALP_BODY_DYNAMIC)
                palp_dynamic_refine_all(palp_scene_body(scene, b)->dynamic);
            cost[k][b] = cost_of(palp_scene_body(scene, b));
            least[k] += cost[k][b].least;
        }
    }
    wcet_add(t, "devices", "frames in and out, limits", 0, 0, hands[0], hands[1]);
    for (uint32_t b = 0; b < config.bodies; b++) {
        const char *name = setup->file->body[b].name;
        const bool dynamic = setup->part[b].kind == PALP_BODY_DYNAMIC;
        for (uint32_t l = 0; l < (dynamic ? 1u : PALP_CONTACT_FINEST + 1u); l++)
            wcet_add(t, "body", name, (int)l, (int)l, cost[0][b].tick[l], cost[1][b].tick[l]);
        wcet_add(t, "always", name, 0, 0, cost[0][b].least, cost[1][b].least);
    }
    for (uint32_t l = 0; l <= PALP_CONTACT_FINEST; l++) {
        double all[2] = {hands[0], hands[1]};
        for (int k = 0; k < 2; k++) {
            for (uint32_t b = 0; b < config.bodies; b++) all[k] += cost[k][b].tick[l];
        }
        wcet_add(t, "tick", "the whole scene", (int)l, (int)l, all[0], all[1]);
    }
    wcet_add(t, "least", "the least answer of every body", 0, 0, least[0], least[1]);
    t->ram_bytes = bytes;
    t->stack_bytes = PALP_SERVO_STACK;
    free(memory);
}
