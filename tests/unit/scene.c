/* SPDX-License-Identifier: MIT */
/* Scenes at the devices: several hands, tools and bodies of all engines in one tick. What a hand feels
 * through a body is what the contact alone gives at the same places; none gives energy away. */
#include "core/green/field.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include "tests/models.h"
#include "tests/stage.h"
#include "tests/tap.h"
#include <string.h>

#define RADIUS 0.02f /* of the ball that is touched, m */
#define TIP 0.005f   /* of the tools, m */

#define EDGE 0.016 /* of the bar that a gripper holds, m */

static baked ball, bar;

/* The largest step of a hand's force from here on. */
static void forget_steps(stage *s) {
    for (uint32_t h = 0; h < HANDS; h++) s->step_N[h] = 0;
}

static palp_body_config elastic(const palp_blob *blob, palp_frame at) {
    return (palp_body_config){
        .kind = PALP_BODY_ELASTIC, .at = at, .blob = blob, .finest = PALP_CONTACT_FINEST};
}

/* ---- two hands on one body ---- */

/* Both come from their device's -x: hand 0 to the ball's -x side, hand 1, turned by 180 degrees, to
 * its +x side. */
static const hand_key press_ball[] = {
    {0, {-0.010, 0, 0}}, {1, {-0.010, 0, 0}}, {2, {0.004, 0, 0}}, {60, {0.004, 0, 0}}};

static void seat_two(stage *s, const palp_body_config *body, palp_scene_tool tool[HANDS]) {
    seat(s, 0, "arm3-palp-fd", 1000, (palp_vec3){-RADIUS - TIP, 0, 0}, 0);
    seat(s, 1, "arm3-palp-fd", 1000, (palp_vec3){RADIUS + TIP, 0, 0}, 3.14159265f);
    for (uint32_t t = 0; t < HANDS; t++)
        tool[t] =
            (palp_scene_tool){.tool = palp_tool_sphere(TIP), .hand = t, .at = PALP_FRAME_IDENTITY};
    s->config.body = body;
    s->config.tool = tool;
    s->config.bodies = 1;
    s->config.tools = s->config.hands = HANDS;
}

/* What the contact alone answers to tools held where the scene's were, by the same springs. */
static void alone(const stage *s, palp_vec3 force_N[HANDS]) {
    const palp_body *b = palp_scene_body(s->scene, 0);
    palp_contact_config config = {.blob = &ball.blob,
                                  .tools = b->answer->contact.tools,
                                  .tool_count = HANDS,
                                  .finest = PALP_CONTACT_FINEST};
    const size_t bytes = palp_contact_memsize(&config);
    void *memory = allocate_aligned(bytes, 1);
    palp_contact contact;
    palp_frame at[HANDS];
    palp_contact_spring spring[HANDS];
    if (palp_contact_init(&contact, &config, memory, bytes) != PALP_OK) die(EXIT_WORK, "contact");
    for (uint32_t t = 0; t < HANDS; t++) {
        at[t] = s->report.felt[0][t].tool;
        spring[t] = (palp_contact_spring){.held = palp_frame_at(at[t].t)};
    }
    for (int i = 0; i < 60; i++) palp_contact_solve(&contact, at, spring);
    for (uint32_t t = 0; t < HANDS; t++) force_N[t] = contact.force_N[t];
    free(memory);
}

static void test_two_hands(void) {
    const palp_body_config body = elastic(&ball.blob, PALP_FRAME_IDENTITY);
    palp_scene_tool tool[HANDS];
    stage s = {.now_ns = 0};
    palp_vec3 expected[HANDS];
    seat_two(&s, &body, tool);
    start(&s);
    lead(&s, 0, press_ball, NULL, 4);
    lead(&s, 1, press_ball, NULL, 4);
    run(&s, 4);
    alone(&s, expected);
    for (uint32_t h = 0; h < HANDS; h++) {
        const palp_vec3 felt = s.report.felt[0][h].wrench.force_N;
        CHECK(s.report.hand[h].state == PALP_STATE_RUN && palp_norm(felt) > 0.2f,
              "hand %u presses with %.3f N, feels (%.3f, %.3f, %.3f) N", h, (double)palp_norm(felt),
              (double)s.report.hand[h].force_N.x, (double)s.report.hand[h].force_N.y,
              (double)s.report.hand[h].force_N.z);
        AT_MOST(palp_norm(palp_sub(felt, expected[h])) / palp_norm(felt), 0.02,
                "off the contact alone, tools held where they came to rest");
    }
    /* one hand is stopped: the other goes on */
    const double before = (double)s.report.felt[0][0].wrench.force_N.x;
    const palp_vec3 rests = s.report.felt[0][0].tool.t;
    forget_steps(&s);
    s.more_events[1] = PALP_EVENT_ESTOP;
    run(&s, 0.5);
    CHECK(s.report.hand[1].state != PALP_STATE_RUN && s.report.hand[0].state == PALP_STATE_RUN,
          "one is stopped, the other feels on");
    AT_MOST(s.step_N[0] / s.largest_N[0], 0.03, "largest step of its force meanwhile");
    CHECK(!s.report.felt[0][1].touching, "what is stopped presses on nothing");
    CHECK(fabs((double)s.report.felt[0][0].wrench.force_N.x) < fabs(before) &&
              s.report.felt[0][0].tool.t.x >= rests.x,
          "the body gives way to the other: %.4f N for %.4f N",
          (double)s.report.felt[0][0].wrench.force_N.x, before);
    forget_steps(&s);
    s.more_events[1] = PALP_EVENT_RESET;
    run(&s, 2);
    CHECK(s.report.hand[1].state == PALP_STATE_RUN && s.report.felt[0][1].touching,
          "it is reset, and feels again");
    AT_MOST(s.step_N[0] / s.largest_N[0], 0.03, "largest step of the other's force meanwhile");
    AT_MOST(s.step_N[1] / s.largest_N[1], 0.1, "and of its own");
    CHECK(!s.out, "forces within the devices' limits");
    AT_MOST(s.most_ns, 0.8001, "bound of a tick over the period");
    stop(&s);
}

/* Hands that press and let go against each other: what the body takes from one the other may get. */
static void test_through_the_body(void) {
    static const hand_key still[] = {
        {0, {-0.010, 0, 0}}, {1, {-0.010, 0, 0}}, {2, {0.003, 0, 0}}, {60, {0.003, 0, 0}}};
    const palp_body_config body = elastic(&ball.blob, PALP_FRAME_IDENTITY);
    hand_key moved[40];
    palp_scene_tool tool[HANDS];
    stage s = {.now_ns = 0};
    seat_two(&s, &body, tool);
    start(&s);
    for (uint32_t k = 0; k < 40; k++)
        moved[k] = (hand_key){2 + 0.25 * k, {k % 2 == 0 ? -0.004 : 0.006, 0.002 * sin(k), 0}};
    lead(&s, 0, still, NULL, 4);
    lead(&s, 1, moved, NULL, 40);
    double given = 0, low = 1e9, high = 0;
    for (int i = 0; i < 12000; i++) {
        tick(&s);
        for (uint32_t h = 0; h < HANDS; h++) given = fmax(given, (double)s.report.hand[h].given_J);
        if (i < 3000) continue;
        low = fmin(low, (double)palp_norm(s.report.hand[0].force_N));
        high = fmax(high, (double)palp_norm(s.report.hand[0].force_N));
    }
    CHECK(high > low && low > 0, "a hand that holds still feels the other: %.4f to %.4f N", low,
          high);
    AT_MOST(given, 2e-6, "energy given to any of them, J");
    CHECK(palp_scene_counters(s.scene, 0)->overruns == 0 &&
              palp_scene_counters(s.scene, 1)->overruns == 0,
          "no tick is late");
    stop(&s);
}

/* ---- a gripper ---- */

/* Two jaws close on a bar and pull along it, until both slip: friction holds twice mu N. */
/* ---- another body while it is touched ---- */

/* Hands that press, let go a little, and stroke, again and again. */
static void lead_on(stage *s, double seconds) {
    static const hand_key stroke[] = {
        {0.7, {0.0045, 0.001, 0}}, {1.5, {0.001, 0, 0.001}}, {2.4, {0.004, 0, 0}}};
    const uint32_t rounds = (uint32_t)(seconds / 2.4) + 2u, count = 3u + 3u * rounds;
    hand_key *key = allocate(count, sizeof *key);
    key[0] = (hand_key){0, {-0.010, 0, 0}};
    key[1] = (hand_key){1, {-0.010, 0, 0}};
    key[2] = (hand_key){1.5, {0.003, 0, 0}};
    for (uint32_t i = 3; i < count; i++) {
        key[i] = stroke[i % 3u];
        key[i].time_s += 1.5 + 2.4 * (i / 3u - 1u);
    }
    for (uint32_t h = 0; h < HANDS; h++) lead(s, h, key, NULL, count);
    free(key);
}

/* Bodies and tools that are exchanged: in turn another place, another size of tool, a thin bar. */
static void choose_next(stage *s, uint32_t number, palp_body_config *body, palp_scene_tool *tool) {
    const palp_frame nearer = palp_frame_at((palp_vec3){0.001f, 0, 0.002f});
    *body = elastic(&ball.blob, number % 3u == 1u ? nearer : PALP_FRAME_IDENTITY);
    for (uint32_t t = 0; t < HANDS; t++) {
        tool[t].tool = palp_tool_sphere(number % 3u == 2u ? 0.8f * TIP : TIP);
        if (number % 2u == 1u)
            tool[t].tool = palp_tool_capsule((palp_vec3){0, 0, 1}, 0.5f * TIP, TIP);
    }
    s->config.body = body;
    s->config.tool = tool;
}

/* The largest step of an ordinary tick: hands that touch and let go, with each tool. */
static float ordinary_step(void) {
    float most = 0;
    for (uint32_t number = 0; number < 4u; number++) {
        palp_body_config body = elastic(&ball.blob, PALP_FRAME_IDENTITY);
        palp_scene_tool tool[HANDS];
        stage s = {.now_ns = 0};
        hand_key key[14] = {{0, {-0.010, 0, 0}}, {1, {-0.010, 0, 0}}};
        for (uint32_t i = 2; i < 14; i++) /* at 2 cm/s at most */
            key[i] = (hand_key){0.7 + 0.4 * i, {i % 2u ? -0.002 : 0.002, 0, 0.0005 * i}};
        seat_two(&s, &body, tool);
        choose_next(&s, number, &body, tool);
        start(&s);
        for (uint32_t h = 0; h < HANDS; h++) lead(&s, h, key, NULL, 14);
        run(&s, 1.2);
        forget_steps(&s);
        run(&s, 5);
        most = fmaxf(most, fmaxf(s.step_N[0], s.step_N[1]));
        stop(&s);
    }
    return most;
}

static bool all_touch(const stage *s) {
    bool all = true;
    for (uint32_t h = 0; h < s->config.hands; h++) all = all && s->report.felt[0][h].touching;
    return all;
}

static void test_exchange(uint32_t hands, uint32_t exchanges) {
    palp_body_config body = elastic(&ball.blob, PALP_FRAME_IDENTITY);
    palp_scene_tool tool[HANDS];
    stage s = {.now_ns = 0};
    seat_two(&s, &body, tool);
    s.config.hands = s.config.tools = hands;
    start(&s);
    lead_on(&s, 0.46 * exchanges + 12);
    run(&s, 1.2);
    forget_steps(&s);
    run(&s, 9);
    const float ordinary = fmaxf(ordinary_step(), fmaxf(s.step_N[0], s.step_N[1]));
    const float pressed = fmaxf(s.largest_N[0], s.largest_N[1]);
    const size_t bytes = palp_scene_memsize(&s.config);
    void *other = allocate_aligned(bytes, 1);
    float given = 0;
    uint32_t refused = 0, touching = 0;
    uint64_t ticks = s.report.tick;
    forget_steps(&s);
    for (uint32_t i = 0; i < exchanges; i++) {
        palp_scene *next;
        choose_next(&s, i, &body, tool);
        if (palp_scene_open(&next, &s.config, other, bytes, NULL) != PALP_OK)
            die(EXIT_WORK, "next");
        refused += palp_scene_take_over(next, s.scene) == PALP_ERR_ARGUMENT ? 1u : 0u;
        touching += all_touch(&s) ? 1u : 0u;
        palp_scene_leave(s.scene);
        while (!palp_scene_has_left(s.scene)) tick(&s);
        refused += palp_scene_take_over(next, s.scene) == PALP_OK ? 1u : 0u;
        other = s.memory;
        s.memory = next;
        s.scene = next;
        run(&s, 0.25);
        for (uint32_t h = 0; h < hands; h++) given = fmaxf(given, s.report.hand[h].given_J);
    }
    ticks = s.report.tick - ticks;
    const float step = fmaxf(s.step_N[0], s.step_N[1]);
    printf("# %u hands, %u exchanges, %u of them while all touched, %llu ticks: largest step %.3g "
           "N, in "
           "ordinary ticks %.3g N, largest force %.3g N, given %.3g J\n",
           hands, exchanges, touching, (unsigned long long)ticks, (double)step, (double)ordinary,
           (double)pressed, (double)given);
    CHECK(refused == 2u * exchanges, "each was refused before the scene was left, and made after");
    CHECK(touching > exchanges / 2u, "bodies are exchanged while they are touched");
    CHECK(palp_scene_counters(s.scene, 0)->overruns == 0 && s.most_ns <= 0.8001,
          "no tick is late: bounds up to %.3g of the period", s.most_ns);
    CHECK(step <= ordinary, "no step of force beyond an ordinary tick's: %g N", (double)step);
    CHECK(given <= 1e-6f, "energy given to the hands: %g J", (double)given);
    for (uint32_t h = 0; h < hands; h++)
        CHECK(s.report.hand[h].state == PALP_STATE_RUN, "device %u goes on", h);
    free(other);
    stop(&s);
}

static void test_gripper(void) {
    static const hand_key key[] = {
        {0, {0, 0, 0}}, {1, {0, 0, 0}}, {2, {0, 0, 0}}, {3, {0, 0, 0}}, {9, {0, 0, 0.008}}};
    static const hand_turn turn[] = {
        {{0}, 1.45}, {{0}, 1.45}, {{0}, 1.26}, {{0}, 1.26}, {{0}, 1.26}};
    const double mu = 0.4;
    const palp_frame at =
        palp_frame_at((palp_vec3){-0.5f * (float)EDGE, -0.5f * (float)EDGE, -1.5f * (float)EDGE});
    const palp_body_config body = elastic(&bar.blob, at);
    palp_scene_tool tool[2];
    stage s = {.now_ns = 0};
    seat(&s, 0, "arm7-palp-fd", 500, (palp_vec3){0, 0, 0}, 0);
    for (uint32_t t = 0; t < 2; t++) {
        tool[t] = (palp_scene_tool){
            .tool = palp_tool_sphere(TIP), .at = PALP_FRAME_IDENTITY, .jaw = t == 0 ? -0.5f : 0.5f};
        tool[t].tool.friction = (float)mu;
    }
    s.config.body = &body;
    s.config.tool = tool;
    s.config.bodies = s.config.hands = 1;
    s.config.tools = 2;
    start(&s);
    lead(&s, 0, key, turn, 5);
    const palp_kinematics *k = &s.file[0].device.kinematics;
    const uint32_t gripper = palp_gripper_axis(k);
    double beyond = 0, pull = 0, slips = 0, squeeze = 0, torque = 0;
    for (int i = 0; i < 4800; i++) {
        tick(&s);
        const palp_body_felt *f = s.report.felt[0];
        const palp_hand_report *r = &s.report.hand[0];
        const double n = 0.5 * (double)(f[1].wrench.force_N.y - f[0].wrench.force_N.y);
        const double along = -(double)(f[0].wrench.force_N.z + f[1].wrench.force_N.z);
        const double motor = (double)(r->motor_torque_Nm[gripper] * s.file[0].device.gear[gripper]);
        squeeze = fmax(squeeze, n);
        const palp_coupling_tool *c = palp_scene_body(s.scene, 0)->answer->coupling.tool;
        const double holds = -(double)(c[0].friction.force_N.z + c[1].friction.force_N.z);
        if (n > 0.02) beyond = fmax(beyond, holds / (2 * mu * n) - 1);
        if (i > 1200 && i < 1500)
            torque = fmax(torque, fabs(motor / (n * (double)k->gripper_m_per_rad) - 1));
        if (!f[0].slipping || !f[1].slipping || n < 0.02 || i < 1500) continue;
        slips++;
        pull = fmax(pull, fabs(along / (2 * mu * n) - 1));
    }
    CHECK(squeeze > 0.02 && slips > 100, "two jaws squeeze with %.3f N each and slip for %g ticks",
          squeeze, slips);
    AT_MOST(beyond, 0.03, "friction of both beyond twice mu N, the tips being curved");
    AT_MOST(pull, 0.03, "pull off it while both slip");
    AT_MOST(torque, 0.01,
            "the gripper's motor: torque off the squeeze times what it opens by per rad");
    stop(&s);
}

/* ---- all engines ---- */

/* Hand 0 on the ball; hand 1 with one tool on a block that moves and one on a model of two zones, whose
 * joint follows the first axis of hand 0. */
static void test_engines(void) {
    static const double block_m[3] = {0.03, 0.03, 0.03};
    static const uint32_t parts[2][3] = {{2, 2, 2}, {4, 4, 4}};
    tetmesh level[2];
    for (int l = 0; l < 2; l++) level[l] = tetmesh_block(block_m, parts[l], false);
    const dynamic_body block = model_dynamic_body(level, 2, 1e-6, 1e4, 0.4, 1e-3);
    const mesh box = model_box(0.06, 4);
    const zoned arm =
        model_zones(&box,
                    "young 3e4\npoisson 0.4\nzone a\nfix-below x 1e-6\nzone b\n"
                    "fix-above x 0.0599\ncut a b 0.03 0 0 1 0 0\njoint j revolute a b\n"
                    "axis 0 1 0\norigin 0.03 0 0\nlimits -1 1\n",
                    0.05);
    const palp_body_config body[3] = {
        elastic(&ball.blob, PALP_FRAME_IDENTITY),
        {.kind = PALP_BODY_DYNAMIC,
         .at = palp_frame_at((palp_vec3){0.1f, -0.015f, -0.015f}),
         .tets = &block.tets,
         .material = palp_material_of(1e4f, 0.4f, 1000.0f, 1e-3f, 6.0f),
         .adapt = palp_adapt_defaults(&block.tets),
         .max_points = 64,
         .most_class = PALP_STEP_CLASSES - 1},
        {.kind = PALP_BODY_ZONES,
         .at = {{0, -1, 0, 1, 0, 0, 0, 0, 1}, {0.13f, 0.065f, -0.03f}},
         .assembly = model_assembly(arm.zones, 2),
         .finest = PALP_CONTACT_FINEST}};
    const palp_scene_drive drive = {.body = 2, .hand = 0, .axis = 0, .offset = 0.1f, .scale = 0.5f};
    const palp_frame beside = palp_frame_at((palp_vec3){0, -0.08f, 0});
    const palp_scene_tool tool[3] = {
        {.tool = palp_tool_sphere(TIP), .hand = 0, .at = PALP_FRAME_IDENTITY},
        {.tool = palp_tool_sphere(TIP), .hand = 1, .at = PALP_FRAME_IDENTITY},
        {.tool = palp_tool_sphere(TIP), .hand = 1, .at = beside}};
    stage s = {.ns_per_instruction = 0.25f};
    seat(&s, 0, "arm3-palp-fd", 1000, (palp_vec3){-RADIUS - TIP, 0, 0}, 0);
    seat(&s, 1, "arm3-palp-fd", 1000, (palp_vec3){0.13f + TIP, 0, 0}, 3.14159265f);
    s.config = (palp_scene_config){.body = body,
                                   .tool = tool,
                                   .drive = &drive,
                                   .bodies = 3,
                                   .tools = 3,
                                   .hands = 2,
                                   .drives = 1};
    start(&s);
    lead(&s, 0, press_ball, NULL, 4);
    lead(&s, 1, press_ball, NULL, 4);
    run(&s, 4);
    const palp_hand_report *r = s.report.hand;
    const float each[3] = {palp_norm(s.report.felt[0][0].wrench.force_N),
                           palp_norm(s.report.felt[1][1].wrench.force_N),
                           palp_norm(s.report.felt[2][2].wrench.force_N)};
    CHECK(each[0] > 0.05f && each[1] > 0.05f && each[2] > 0.05f,
          "an elastic body, a moving one and a multizone one press back: %.3f, %.3f, %.3f N",
          (double)each[0], (double)each[1], (double)each[2]);
    palp_vec3 sum = {0, 0, 0};
    for (uint32_t b = 0; b < 3; b++)
        sum = palp_add(
            sum, palp_add(s.report.felt[b][1].wrench.force_N, s.report.felt[b][2].wrench.force_N));
    sum = (palp_vec3){-sum.x, -sum.y, sum.z};
    AT_MOST(palp_norm(palp_sub(sum, r[1].force_N)) / palp_norm(sum), 0.01,
            "hand 1 feels what its tools feel of all of them: off by");
    const palp_assembly *a = body[2].assembly;
    const float value = 0.1f + 0.5f * r[0].joint_rad[0];
    AT_MOST(fabsf(a->configuration->value[0] - value), 1e-4,
            "the joint follows the axis: off by, rad");
    CHECK(!s.out && palp_scene_counters(s.scene, 0)->overruns == 0, "within limits, and in time");
    AT_MOST(fmaxf(r[0].given_J, r[1].given_J), 2e-6, "energy given, J");
    const float moving = s.report.body[1].stored_J;
    for (uint32_t h = 0; h < 2; h++) s.more_events[h] = PALP_EVENT_ESTOP;
    run(&s, 3);
    CHECK(s.report.body[1].stored_J < 0.05f * moving,
          "let go, the one that moves goes back: %.2g J of %.2g J left",
          (double)s.report.body[1].stored_J, (double)moving);
    stop(&s);
}

/* ---- a thin part ---- */

/* The least distance of a body's surface from a ball, displaced by all loads of the last tick: summed in full,
 * not by the contact. Looked at in corners, edges and middles of triangles. */
static double nearest_place(const palp_blob *blob, palp_field *field, const palp_scene *scene,
                            palp_vec3 center, double radius) {
    static const float weight[7][3] = {{1, 0, 0},
                                       {0, 1, 0},
                                       {0, 0, 1},
                                       {0.5f, 0.5f, 0},
                                       {0, 0.5f, 0.5f},
                                       {0.5f, 0, 0.5f},
                                       {1 / 3.0f, 1 / 3.0f, 1 / 3.0f}};
    palp_load load[PALP_SERVO_LOADS];
    double least = 1;
    palp_vec3 *y = allocate(blob->meta->nodes, sizeof *y);
    palp_field_update(field, load, palp_scene_loads(scene, 0, load));
    const float *u = palp_field_reconstruct(field, blob->meta->levels - 1);
    for (uint32_t n = 0; n < blob->meta->nodes; n++)
        y[n] = palp_vec3_at(blob->rest_m + 3 * (size_t)n);
    for (uint32_t k = 0; k < blob->domain[PALP_FREE].slots; k++) {
        const uint32_t node = blob->domain[PALP_FREE].node[k];
        y[node] = palp_add(y[node], palp_vec3_at(u + PALP_FIELD_LANES * (size_t)k));
    }
    for (uint32_t t = 0; t < blob->meta->triangles; t++) {
        const uint32_t *v = blob->triangle + 3 * (size_t)t;
        for (int k = 0; k < 7; k++) {
            palp_vec3 at = palp_scale(weight[k][0], y[v[0]]);
            at = palp_madd(at, weight[k][1], y[v[1]]);
            at = palp_madd(at, weight[k][2], y[v[2]]);
            least = fmin(least, (double)palp_norm(palp_sub(at, center)) - radius);
        }
    }
    free(y);
    return least;
}

/* Both on the tip of an ear that bends by more than a tool; one holds still, the other comes and goes. It must
 * be felt where the bent ear is, and nowhere else, and take over from the other without a leap. */
static void test_thin_part(double deep_m) {
    static const hand_key still[] = {
        {0, {0, 0, 0.004}}, {1, {0, 0, 0.004}}, {2, {0, 0, -0.0042}}, {60, {0, 0, -0.0042}}};
    const double radius = 0.006;
    hand_key moved[12];
    mesh control = mesh_load("blobs/rabbit.obj");
    mesh once = subdivide_loop(&control);
    const baked rabbit = model_bake_young(subdivide_loop(&once), 0.004, 3e4);
    uint32_t top = rabbit.blob.domain[PALP_FREE].node[0];
    for (uint32_t k = 0; k < rabbit.blob.meta->domain_nodes[PALP_FREE]; k++) {
        const uint32_t node = rabbit.blob.domain[PALP_FREE].node[k];
        if (rabbit.blob.rest_m[3 * node + 2] > rabbit.blob.rest_m[3 * top + 2]) top = node;
    }
    const palp_vec3 x = palp_vec3_at(rabbit.blob.rest_m + 3 * (size_t)top);
    const palp_body_config body = elastic(&rabbit.blob, PALP_FRAME_IDENTITY);
    palp_scene_tool tool[HANDS];
    stage s = {.ns_per_instruction = 0.25f};
    for (uint32_t h = 0; h < HANDS; h++) {
        const palp_vec3 at = {x.x + 0.006f * (float)h, x.y, x.z + 0.006f};
        seat(&s, h, "arm3-palp-fd", 1000, at, 0);
        tool[h] = (palp_scene_tool){
            .tool = palp_tool_sphere((float)radius), .hand = h, .at = PALP_FRAME_IDENTITY};
    }
    s.config.body = &body;
    s.config.tool = tool;
    s.config.bodies = 1;
    s.config.tools = s.config.hands = HANDS;
    start(&s);
    for (uint32_t k = 0; k < 12; k++)
        moved[k] = (hand_key){1 + k, {0, 0, k % 2 == 0 ? 0 : -deep_m}};
    lead(&s, 0, still, NULL, 4);
    lead(&s, 1, moved, NULL, 12);
    run(&s, 2.5);
    palp_field field;
    const size_t bytes = palp_field_memsize(&rabbit.blob);
    void *memory = allocate_aligned(bytes, 1);
    if (palp_field_init(&field, &rabbit.blob, memory, bytes) != PALP_OK) die(EXIT_WORK, "field");
    uint32_t leaps = 0, looks = 0, phantoms = 0, missed = 0;
    float last[HANDS] = {0}, largest = 0, together = 0;
    double deepest = 0;
    for (uint32_t i = 0; i < 9000; i++) {
        bool leapt = false;
        tick(&s);
        for (uint32_t h = 0; h < HANDS; h++) {
            const palp_body_felt *felt = &s.report.felt[0][h];
            const float now = palp_norm(felt->wrench.force_N);
            leapt = leapt || (i > 0 && fabsf(now - last[h]) > 0.02f);
            largest = fmaxf(largest, now);
            if (h == 1) together += now > 0.005f ? 1 : 0;
            last[h] = now;
            if (i % 20 != 0) continue;
            const double gap = nearest_place(&rabbit.blob, &field, s.scene, felt->tool.t, radius);
            looks++;
            phantoms += now > 0.005f && gap > 0.0007 ? 1 : 0; /* the surface is smooth in between */
            missed += !(now > 0.002f) && gap < -0.0005 ? 1 : 0;
            deepest = fmax(deepest, -gap);
        }
        leaps += leapt ? 1 : 0;
    }
    CHECK(together > 500,
          "two tools on an ear, %g mm: both press in %g of 9000 ticks, up to %.3f N", 1e3 * deep_m,
          (double)together, (double)largest);
    AT_MOST(phantoms, 0.005 * looks, "looks of %u in which one is felt off the bent ear", looks);
    AT_MOST(missed, 0.005 * looks, "in which one is in it and not felt");
    AT_MOST(leaps, 30, "ticks in which a force leaps by more than 0.02 N");
    printf("# up to %.2f mm of it in a tool\n", 1e3 * deepest);
    free(memory);
    stop(&s);
}

/* ---- for long ---- */

/* Two devices with two tips each, as fast as they are let; hours with FULL. */
static void test_long(void) {
    const palp_body_config body = elastic(&ball.blob, PALP_FRAME_IDENTITY);
    const palp_frame up = palp_frame_at((palp_vec3){0, 0, 0.012f});
    hand_key key[2][64];
    palp_scene_tool tool[4];
    stage s = {.now_ns = 0};
    uint64_t seed = 77;
    const uint32_t ticks = tap_full() ? 1000000 : 100000;
    seat_two(&s, &body, tool);
    tool[2] = tool[0];
    tool[3] = tool[1];
    tool[2].at = tool[3].at = up;
    s.config.tools = 4;
    start(&s);
    for (int h = 0; h < 2; h++) {
        for (int k = 0; k < 64; k++)
            key[h][k] = (hand_key){2 + (double)ticks / 64000 * k,
                                   {0.001 + 0.005 * tap_random(&seed), 0.008 * tap_random(&seed),
                                    0.008 * tap_random(&seed)}};
        key[h][0] = (hand_key){0, {-0.01, 0, 0}};
        lead(&s, (uint32_t)h, key[h], NULL, 64);
    }
    double given = 0;
    uint32_t most = 0, outside = 0;
    for (uint32_t i = 0; i < ticks; i++) {
        tick(&s);
        for (uint32_t h = 0; h < 2; h++) {
            given = fmax(given, (double)s.report.hand[h].given_J);
            outside += s.report.hand[h].state != PALP_STATE_RUN ? 1 : 0;
        }
        most = s.report.body[0].active > most ? s.report.body[0].active : most;
    }
    CHECK(most > 20, "%u ticks of two devices with four tips: %u points in contact", ticks, most);
    AT_MOST(outside, 200, "ticks outside RUN, those of the start among them");
    CHECK(palp_scene_counters(s.scene, 0)->overruns == 0, "none is late");
    AT_MOST(s.most_ns, 0.8001, "bound of a tick over the period");
    AT_MOST(given, tap_full() ? 1e-4 : 2e-6,
            "energy given to any hand, J"); /* a tenth of what is stored, once */
    AT_MOST(fmaxf(s.step_N[0], s.step_N[1]) / fmaxf(s.largest_N[0], s.largest_N[1]), 0.05,
            "largest step of a force over the largest force");
    CHECK(!s.out, "forces within the devices' limits, and finite");
    stop(&s);
}

static baked bake_ball(float radius_m) {
    mesh m = model_sphere(2);
    for (uint32_t v = 0; v < m.vertices; v++)
        for (int k = 0; k < 3; k++) m.x[v][k] *= (double)radius_m;
    return model_bake_young(m, -0.6 * (double)radius_m, 4e4);
}

int main(void) {
    progress_quiet(1);
    ball = bake_ball(RADIUS);
    static const int column[3][3] = {{0, 0, 0}, {0, 0, 1}, {0, 0, 2}};
    uint32_t *cell;
    bar = model_bake_young(model_voxels(column, 3, EDGE, 4, &cell), 1e-6, 4e4);
    test_two_hands();
    test_through_the_body();
    test_exchange(2, getenv("FULL") != NULL ? 10000u : 150u);
    test_exchange(1, 60); /* along the way that it was pushed, not up */
    test_gripper();
    test_engines();
    test_thin_part(0.0084);
    test_thin_part(0.0125);
    test_long();
    return tap_done();
}
