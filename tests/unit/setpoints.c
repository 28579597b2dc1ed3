/* SPDX-License-Identifier: MIT */
/* Joints that another controller moves by frames on a device's bus: what is followed, what is not, and what
 * a hand on the body feels of a controller that sends anything. */
#include "port/host/parallel.h"
#include "port/host/util.h"
#include "tests/models.h"
#include "tests/stage.h"
#include "tests/tap.h"
#include <math.h>
#include <string.h>

#define ID 0x3a0u
#define DT_S 0.001f
#define TIP 0.010f

static palp_can_frame frame_of(uint32_t id, uint32_t byte, float value) {
    palp_can_frame f = {
        .id = id, .flags = id > 0x7ffu ? PALP_CAN_EXTENDED : 0, .length = (uint8_t)(byte + 4u)};
    palp_put_f32(f.data + byte, value);
    return f;
}

static void test_frames(void) {
    const palp_joint_entry joint = {.low = -0.5f, .high = 1.0f};
    palp_scene_drive d = {
        .by = PALP_DRIVEN_BY_FRAMES, .id = ID, .byte = 4, .fastest = 2, .offset = 0.2f};
    palp_setpoint s;
    palp_setpoint_init(&s, &d);
    CHECK(palp_scene_drive_is_sound(&d) && palp_same_bits(s.value, 0.2f) && s.taken == 0,
          "a joint stands at its offset until it hears a set-point");
    palp_can_frame f = frame_of(ID, 4, 0.7f);
    CHECK(palp_setpoint_take(&s, &d, &joint, &f) && palp_same_bits(s.goal, 0.7f) && s.taken == 1,
          "is heard");
    palp_can_frame other[] = {frame_of(ID + 1u, 4, 0.1f), frame_of(ID, 0, 0.1f), f, f, f};
    other[2].flags = PALP_CAN_EXTENDED;
    other[3].flags = PALP_CAN_REMOTE;
    other[4].flags = PALP_CAN_ERROR;
    for (uint32_t i = 0; i < 5; i++)
        CHECK(!palp_setpoint_take(&s, &d, &joint, &other[i]) && palp_same_bits(s.goal, 0.7f),
              "frame %u of another id, length or kind is not for it", i);
    static const float bad[] = {NAN, INFINITY, -INFINITY};
    for (uint32_t i = 0; i < 3; i++) {
        f = frame_of(ID, 4, bad[i]);
        CHECK(palp_setpoint_take(&s, &d, &joint, &f) && palp_same_bits(s.goal, 0.7f) &&
                  s.left == i + 1u,
              "%g is left aside, and counted", (double)bad[i]);
    }
    f = frame_of(ID, 4, 1e30f);
    CHECK(palp_setpoint_take(&s, &d, &joint, &f) && palp_same_bits(s.goal, 1.0f),
          "too far ends at the range");
    f = frame_of(ID, 4, -7.0f);
    CHECK(palp_setpoint_take(&s, &d, &joint, &f) && palp_same_bits(s.goal, -0.5f), "on both sides");
    d.id = 0x12345u;
    f = frame_of(d.id, 4, 0.5f);
    CHECK(palp_setpoint_take(&s, &d, &joint, &f) && palp_same_bits(s.goal, 0.5f),
          "ids of 29 bits too");
    f.flags |= PALP_CAN_FD;
    CHECK(palp_setpoint_take(&s, &d, &joint, &f), "and FD frames");
}

/* value' = clamp((goal - value) / lag, -fastest, fastest), against its solution: a ramp at `fastest` until
 * fastest lag short of the goal, then exponential. */
static void test_course(void) {
    const palp_joint_entry joint = {.low = -1, .high = 1};
    const palp_scene_drive d = {.by = PALP_DRIVEN_BY_FRAMES, .id = ID, .fastest = 2};
    const palp_can_frame f = frame_of(ID, 0, 0.9f);
    const float rates[] = {100, 1000, 8000};
    for (uint32_t r = 0; r < 3; r++) {
        palp_setpoint s;
        float off = 0, fastest = 0;
        palp_setpoint_init(&s, &d);
        (void)palp_setpoint_take(&s, &d, &joint, &f);
        for (uint32_t i = 1; i <= (uint32_t)rates[r]; i++) {
            const float before = s.value, t = (float)i / rates[r];
            const float knee_s = (0.9f - 2 * PALP_SETPOINT_LAG_S) / 2;
            palp_setpoint_step(&s, &d, 1 / rates[r]);
            const float exact = t < knee_s ? 2 * t
                                           : 0.9f - 2 * PALP_SETPOINT_LAG_S *
                                                        expf((knee_s - t) / PALP_SETPOINT_LAG_S);
            off = fmaxf(off, fabsf(s.value - exact));
            fastest = fmaxf(fastest, rates[r] * fabsf(s.value - before));
        }
        AT_MOST(off, 2 * 2 / rates[r], "%g Hz: off the exact course by, rad", (double)rates[r]);
        AT_MOST(fastest, 2.001, "fastest, rad/s");
        CHECK(s.age == (uint32_t)rates[r], "%u ticks since the last set-point", s.age);
    }
}

static void test_bad_drives(void) {
    const palp_scene_drive good = {.by = PALP_DRIVEN_BY_FRAMES, .id = ID, .fastest = 2};
    palp_scene_drive d[7];
    for (int i = 0; i < 7; i++) d[i] = good;
    d[0].id = 0x20000000u;
    d[1].byte = 61;
    d[2].fastest = 0;
    d[3].fastest = NAN;
    d[4].fastest = 1e9f;
    d[5].offset = NAN;
    d[6].by = PALP_DRIVEN_BY_AXIS;
    d[6].scale = INFINITY;
    CHECK(palp_scene_drive_is_sound(&good), "a drive by frames is sound");
    for (int i = 0; i < 7; i++)
        CHECK(!palp_scene_drive_is_sound(&d[i]), "what is out of its range is not: %d", i);
}

/* ---- felt ---- */

static zoned arm;

/* A tool pressed 4 mm into the far end of an arm of two zones. */
static void set_stage(stage *s, palp_body_config *body, palp_scene_tool *tool,
                      palp_scene_drive *drive) {
    *body = (palp_body_config){.kind = PALP_BODY_ZONES,
                               .at = {{0, -1, 0, 1, 0, 0, 0, 0, 1}, {0.03f, -0.045f, -0.03f}},
                               .assembly = model_assembly(arm.zones, 2),
                               .finest = PALP_CONTACT_FINEST};
    *drive = (palp_scene_drive){.by = PALP_DRIVEN_BY_FRAMES, .id = ID, .byte = 4, .fastest = 1};
    *tool = (palp_scene_tool){.tool = palp_tool_sphere(TIP), .at = PALP_FRAME_IDENTITY};
    *s = (stage){.ns_per_instruction = 0.25f};
    seat(s, 0, "arm3-palp-fd", 1000, (palp_vec3){0, 0, 0.03f + TIP}, 0);
    s->config = (palp_scene_config){.body = body,
                                    .tool = tool,
                                    .drive = drive,
                                    .bodies = 1,
                                    .tools = 1,
                                    .hands = 1,
                                    .drives = 1};
}

static const hand_key press[] = {
    {0, {0, 0, 0.01}}, {1, {0, 0, 0.01}}, {2, {0, 0, -0.004}}, {600, {0, 0, -0.004}}};

/* What the controller sends at tick i, at most 8 frames. */
typedef uint32_t (*sender)(uint32_t i, uint64_t *seed, palp_can_frame frames[8]);

static uint32_t send_steady(uint32_t i, uint64_t *seed, palp_can_frame frames[8]) {
    (void)seed;
    frames[0] = frame_of(ID, 4, 0.1f * sinf(2 * 3.14159265f * (float)i / 2000));
    return i % 10 == 0 ? 1 : 0;
}

/* From 0 to 1. */
static double share(uint64_t *seed) { return 0.5 + 0.5 * tap_random(seed); }

/* Anything: leaps from end to end, what is not finite, short frames, floods. */
static uint32_t send_wild(uint32_t i, uint64_t *seed, palp_can_frame frames[8]) {
    const uint32_t n = (uint32_t)(share(seed) * share(seed) * 8);
    (void)i;
    for (uint32_t k = 0; k < n; k++) {
        const double die = share(seed);
        const float value = die > 0.9   ? NAN
                            : die > 0.8 ? INFINITY
                            : die > 0.7 ? 1e30f
                                        : (float)(0.6 * die - 0.2);
        frames[k] = frame_of(ID, 4, value);
        if (share(seed) > 0.9) frames[k].length = 5;
    }
    return n;
}

typedef struct {
    float given_J, largest_N, step_N, off_rad, fastest_rad_s;
    double passed_J; /* through the joint, to and fro */
    uint32_t away;
} felt;

static felt feel(const char *what, sender send, uint32_t ticks) {
    palp_body_config body;
    palp_scene_tool tool;
    palp_scene_drive drive;
    stage s;
    felt f = {0};
    uint64_t seed = 5;
    set_stage(&s, &body, &tool, &drive);
    start(&s);
    lead(&s, 0, press, NULL, 4);
    run(&s, 3);
    s.step_N[0] = s.largest_N[0] = 0;
    float last = body.assembly->configuration->value[0];
    uint64_t accepted = palp_scene_counters(s.scene, 0)->accepted;
    for (uint32_t i = 0; i < ticks; i++) {
        s.more_count = send(i, &seed, s.more);
        tick(&s);
        const float value = body.assembly->configuration->value[0];
        f.given_J = fmaxf(f.given_J, s.report.hand[0].given_J);
        f.passed_J += (double)fabsf(s.report.felt[0][0].brought_J);
        f.away += s.report.hand[0].state != PALP_STATE_RUN ? 1 : 0;
        f.off_rad = fmaxf(f.off_rad, fabsf(value - palp_scene_setpoint(s.scene, 0)->value));
        f.fastest_rad_s = fmaxf(f.fastest_rad_s, fabsf(value - last) / DT_S);
        last = value;
    }
    f.largest_N = s.largest_N[0];
    f.step_N = s.step_N[0];
    const palp_counters *c = palp_scene_counters(s.scene, 0);
    printf("# %s: up to %g N, steps of %g N, %llu ticks braked\n", what, (double)f.largest_N,
           (double)f.step_N, (unsigned long long)c->braked);
    CHECK(c->accepted - accepted > 3u * ticks && c->rejected < ticks / 4,
          "%s: frames for joints are accepted, %llu rejected", what,
          (unsigned long long)c->rejected);
    CHECK(f.away == 0 && !s.out && c->overruns == 0, "%s: in RUN, within limits, in time", what);
    AT_MOST(f.off_rad, 1e-6, "%s: the joint off its set-point, rad", what);
    AT_MOST(f.fastest_rad_s, 1.01, "%s: the joint's fastest, rad/s", what);
    stop(&s);
    return f;
}

static void test_felt(void) {
    const felt steady = feel("steady", send_steady, 6000), wild = feel("wild", send_wild, 20000);
    CHECK(steady.largest_N > 0.05f && wild.largest_N > 0.05f,
          "the hand feels the arm: up to %.3f N, and %.3f N", (double)steady.largest_N,
          (double)wild.largest_N);
    AT_MOST(steady.given_J, 1e-6, "steady: energy given beyond what joints brought, J");
    AT_MOST((double)wild.given_J / wild.passed_J, 0.005,
            "wild: the same, over the %.3g J that went through the joint", wild.passed_J);
    AT_MOST(wild.step_N, 5 * (double)steady.step_N + 0.05, "wild: largest step of the force, N");
}

int main(void) {
    progress_quiet(1);
    const mesh box = model_box(0.06, 8);
    arm = model_zones(&box,
                      "young 3e4\npoisson 0.4\nzone a\nfix-below x 1e-6\nzone b\n"
                      "fix-above x 0.0599\ncut a b 0.03 0 0 1 0 0\njoint j revolute a b\n"
                      "axis 0 1 0\norigin 0.03 0 0\nlimits -1 1\n",
                      0.05);
    test_frames();
    test_course();
    test_bad_drives();
    test_felt();
    return tap_done();
}
