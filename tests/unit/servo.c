/* SPDX-License-Identifier: MIT */
/* Output chain, passivity controller and the tick: what goes out is finite and limited whatever
 * comes in, and the states follow each other as safety.h says. */
#include "tests/models.h"
#include "sim/virtual_time.h"
#include "tests/tap.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

static baked body;
static device_file file;

static void test_output(void) {
    palp_output out = {0};
    float q[PALP_AXES] = {0.1f, 0.2f, 0.1f};
    palp_pose pose = palp_forward(&file.device.kinematics, q);
    uint64_t seed = 10;
    bool sound = true;
    double jump = 0;
    palp_vec3 last = {0};
    for (int i = 0; i < 20000; i++) {
        float size = i % 7 == 0 ? 1e30f : 20.0f;
        palp_vec3 wanted = {size * (float)tap_random(&seed), size * (float)tap_random(&seed),
                            size * (float)tap_random(&seed)};
        if (i % 501 == 0) wanted.y = NAN;
        if (i % 703 == 0) wanted.x = INFINITY;
        palp_output_request request = {.force_N = wanted};
        palp_output_result r = palp_output_apply(&out, &file.device, NULL, &pose, &request, 0.001f);
        sound = sound && palp_vec3_is_finite(r.force_N) &&
                palp_norm(r.force_N) <= file.device.force_max_N * 1.0001f;
        for (int k = 0; k < 3; k++)
            sound =
                sound && fabsf(r.motor_torque_Nm[k]) <= file.device.drives.torque_max_Nm * 1.0001f;
        if (!r.bad) jump = fmax(jump, (double)palp_norm(palp_sub(r.force_N, last)));
        last = r.force_N;
    }
    CHECK(sound, "20,000 wild forces: finite, within force and torque limits");
    AT_MOST(jump, 1.001 * (double)file.device.slew_max_N_per_s * 0.001,
            "and within the slew limit");
}

/* Feed-forward that jumps, on top of a force that wanders: the sum keeps to the limits. */
static void test_feed_forward(void) {
    palp_output out = {0};
    const palp_device *d = &file.device;
    const float q[PALP_AXES] = {0.1f, 0.2f, 0.1f}, limit = d->drives.torque_max_Nm;
    const float step = d->slew_max_N_per_s * 0.001f;
    const palp_pose pose = palp_forward(&d->kinematics, q);
    const palp_vec3 along[3] = {{step, 0, 0}, {0, step, 0}, {0, 0, step}};
    double most[3] = {0}, worst = 0, force_step = 0, arrived = 0;
    float before[3] = {0};
    palp_vec3 last = {0};
    bool within = true, told = false;
    for (int k = 0; k < 3; k++) {
        float torque[PALP_AXES];
        palp_pose_torques(&pose, along[k], (palp_vec3){0}, torque);
        for (int i = 0; i < 3; i++) most[i] += pow((double)(torque[i] / d->gear[i]), 2);
    }
    for (int t = 0; t < 4000; t++) {
        palp_output_request request = {.force_N = {2.0f * sinf(0.01f * (float)t), 1, 3},
                                       .gravity_share = 1,
                                       .friction_share = 0};
        const float wanted = t / 500 % 2 == 1 ? 10.0f * limit : 0.3f * limit;
        for (int i = 0; i < 3; i++) request.feedforward_Nm[i] = (i == 1 ? -1.0f : 1.0f) * wanted;
        const palp_output_result r = palp_output_apply(&out, d, NULL, &pose, &request, 0.001f);
        for (int i = 0; i < 3; i++) {
            within = within && fabsf(r.motor_torque_Nm[i]) <= 1.0001f * limit;
            if (t > 0)
                worst =
                    fmax(worst, fabs((double)(r.motor_torque_Nm[i] - before[i])) / sqrt(most[i]));
            before[i] = r.motor_torque_Nm[i];
        }
        if (t > 0) force_step = fmax(force_step, (double)palp_norm(palp_sub(r.force_N, last)));
        last = r.force_N;
        told = told || (t == 500 && r.slewed);
        if (t == 999) arrived = fabs((double)r.motor_torque_Nm[0]) / (double)limit;
    }
    CHECK(within, "feed-forward ten times what the motors make: torques within their limit");
    AT_MOST(worst, 1.001, "change of a motor's torque over what the slew limit allows");
    AT_MOST(force_step, 1.001 * (double)step, "change of the force at the tip, N");
    CHECK(told, "it is told that the slew limit was met");
    CHECK(arrived > 0.99, "and what was wanted comes in the end: %.3f of the motor's limit",
          arrived);
}

/* Drives that read 0 where they were switched on, held at the home pose until they are homed. */
static bool home_at(rig *r, const hand_key *keys, uint32_t count) {
    *r = (rig){.file = device_load("arm3")};
    r->file.device.drives.rate_hz = 1000;
    r->file.device.homes = true;
    const palp_vec3 home = {(float)keys[0].x_m[0], (float)keys[0].x_m[1], (float)keys[0].x_m[2]};
    if (!palp_inverse(&r->file.device.kinematics, home, r->file.device.joint_home_rad))
        return false;
    const palp_servo_config config = rig_config(r, &body.blob);
    rig_open(r, &body.blob, &config, "touch", NULL, 1);
    rig_lead(r, keys, count, 800, 10);
    r->bus.script.tremor_m = 2e-5;
    hand_pose begin = {.turn = {.gripper_rad = 0}};
    memcpy(begin.x_m, keys[0].x_m, sizeof begin.x_m);
    sim_device_init(&r->bus.device, &r->file, &begin);
    rig_run(r, 0.5);
    return r->report.state == PALP_STATE_HOMING;
}

static void test_homing(void) {
    static const hand_key keys[] = {{0, {0.01, -0.01, 0.02}},
                                    {1, {0.01, -0.01, 0.02}},
                                    {2, {0, 0, -0.006}},
                                    {4, {0, 0, -0.006}}};
    rig r, plain;
    CHECK(home_at(&r, keys, 4), "drives without a zero: it waits in HOMING");
    CHECK(r.largest_N <= 0 && palp_servo_counters(r.servo)->implausible == 0,
          "without force, and no reading is out of limits");
    r.more_events = PALP_EVENT_HOME;
    rig_run(&r, 3);
    rig_start(&plain, &body.blob, "arm3", 1000, "touch", NULL, 1);
    rig_lead(&plain, keys, 4, 800, 10);
    plain.bus.script.tremor_m = 2e-5;
    hand_pose begin = {.turn = {.gripper_rad = 0}};
    memcpy(begin.x_m, keys[0].x_m, sizeof begin.x_m);
    sim_device_init(&plain.bus.device, &plain.file, &begin);
    rig_run(&plain, 3.5);
    CHECK(r.report.state == PALP_STATE_RUN && palp_norm(plain.report.force_N) > 0.1f,
          "held at home, the operator says so: RUN, and %.3f N",
          (double)palp_norm(r.report.force_N));
    AT_MOST(palp_norm(palp_sub(r.report.force_N, plain.report.force_N)) /
                palp_norm(plain.report.force_N),
            0.02, "as with drives that know their zero: force off by");
    r.more_events = PALP_EVENT_ESTOP;
    rig_run(&r, 0.01);
    r.more_events = PALP_EVENT_RESET;
    rig_run(&r, 0.5);
    CHECK(r.report.state == PALP_STATE_RUN, "the operator's stop does not lose the zero");
    r.silent = true;
    rig_run(&r, 0.1);
    r.silent = false;
    r.more_events = PALP_EVENT_RESET;
    rig_run(&r, 0.5);
    CHECK(r.report.state == PALP_STATE_HOMING, "drives that were silent are homed again");
    rig_stop(&r);
    rig_stop(&plain);
}

static void test_run(void) {
    rig r;
    rig_start(&r, &body.blob, "arm3", 1000, "touch", NULL, 1);
    uint32_t most = 0;
    float margin = 0;
    bool run_early = false;
    palp_state seen[8] = {PALP_STATE_INIT};
    int states = 0;
    for (int i = 0; i < 10000; i++) {
        rig_tick(&r);
        if (i == 40) run_early = r.report.state >= PALP_STATE_RUN;
        if (seen[states] != r.report.state && states < 7) seen[++states] = r.report.state;
        most = r.report.active > most ? r.report.active : most;
        margin = fminf(margin, r.report.absorbed_J);
    }
    CHECK(!run_early, "no RUN before the drives have answered the enable sequence");
    CHECK(states == 4 && seen[1] == PALP_STATE_CONFIG_CHECK && seen[2] == PALP_STATE_READY &&
              seen[3] == PALP_STATE_ENABLING && seen[4] == PALP_STATE_RUN && r.report.faults == 0,
          "INIT, CONFIG_CHECK, READY, ENABLING, RUN; 10 s of touching end there without fault");
    CHECK(most >= 3 && r.largest_N > 0.3, "%u points in contact, %.2f N felt", most, r.largest_N);
    AT_MOST(-(double)margin, 2e-6, "energy given to the hand, J");
    const palp_counters *c = palp_servo_counters(r.servo);
    CHECK(c->rejected == 0 && c->implausible == 0 && c->late == 0 && c->overruns == 0 &&
              c->frozen == 0 && c->braked == 0,
          "nothing rejected %llu, implausible %llu, late %llu, overrun %llu, frozen %llu or braked "
          "%llu",
          (unsigned long long)c->rejected, (unsigned long long)c->implausible,
          (unsigned long long)c->late, (unsigned long long)c->overruns,
          (unsigned long long)c->frozen, (unsigned long long)c->braked);
    rig_stop(&r);
}

static void test_damping(void) {
    rig r;
    rig_start(&r, &body.blob, "arm3", 1000, "touch", NULL, 1);
    rig_run(&r, 1.6);
    double before = (double)palp_norm(r.report.force_N);
    r.silent = true;
    int zero = -1, damping = -1, latched = -1;
    for (int i = 1; i < 60; i++) {
        rig_tick(&r);
        if (damping < 0 && r.report.state == PALP_STATE_DAMPING) damping = i;
        if (zero < 0 && !(palp_norm(r.report.force_N) > 1e-3f)) zero = i;
        if (latched < 0 && r.report.faults != 0) latched = i;
    }
    CHECK(before > 0.1, "%.2f N before the frames stop", before);
    CHECK(damping == 6, "DAMPING %d ms after the last frame", damping);
    CHECK(zero >= 0 && zero <= 20, "force is zero after %d ms", zero);
    CHECK(latched > 20 && latched <= 30 && (r.report.faults & PALP_FAULT_LOST) != 0,
          "the fault latches after %d ms", latched);
    r.silent = false;
    rig_run(&r, 0.5);
    CHECK(r.report.state == PALP_STATE_FAULT && !(palp_norm(r.report.force_N) > 0),
          "and stays when the frames come back");
    r.more_events = PALP_EVENT_RESET;
    rig_run(&r, 0.5);
    CHECK(r.report.state == PALP_STATE_RUN && r.report.faults == 0,
          "until the operator's reset: then all states again to RUN");
    /* 8 ms of silence: force fades, and comes back only by a reset. */
    r.silent = true;
    rig_run(&r, 0.008);
    r.silent = false;
    rig_run(&r, 1);
    CHECK(r.report.state == PALP_STATE_DAMPING && r.report.faults == 0,
          "8 ms of silence end in DAMPING, without a fault, and stay there");
    rig_stop(&r);
    rig_start(&r, &body.blob, "arm3", 1000, "touch", NULL, 1);
    palp_servo_config config = rig_config(&r, &body.blob);
    config.resume = true;
    rig_stop(&r);
    rig_open(&r, &body.blob, &config, "touch", NULL, 1);
    rig_run(&r, 1.4);
    r.silent = true;
    rig_run(&r, 0.008);
    r.silent = false;
    rig_run(&r, 0.055);
    CHECK(r.report.state == PALP_STATE_RUN && palp_norm(r.report.force_N) < 0.02f,
          "with resume it goes back to RUN when all is well, without force");
    rig_run(&r, 1.3);
    CHECK(palp_norm(r.report.force_N) > 0.1f, "and the next touch is felt: %.2f N",
          (double)palp_norm(r.report.force_N));
    rig_stop(&r);
}

static void test_operator(void) {
    rig r;
    rig_start(&r, &body.blob, "arm3", 1000, "touch", NULL, 1);
    rig_run(&r, 1.5);
    r.more_events = PALP_EVENT_ESTOP;
    rig_tick(&r);
    CHECK(r.report.state == PALP_STATE_ESTOP && !(palp_norm(r.report.force_N) > 0),
          "the operator's stop takes the force in the same tick");
    rig_run(&r, 0.2);
    CHECK(r.bus.device.drive[0].axis_state == PALP_ODRIVE_IDLE &&
              r.report.state == PALP_STATE_ESTOP,
          "drives idle, and it stays when the button is let go");
    r.more_events = PALP_EVENT_RESET | PALP_EVENT_ESTOP;
    rig_tick(&r);
    CHECK(r.report.state == PALP_STATE_ESTOP, "a reset under the pressed button does nothing");
    for (int i = 0; i < 500; i++) {
        r.more_events = i == 0 ? PALP_EVENT_RESET | PALP_EVENT_HOLD : PALP_EVENT_HOLD;
        rig_tick(&r);
    }
    CHECK(r.report.state == PALP_STATE_READY, "under HOLD it waits in READY");
    rig_run(&r, 0.5);
    CHECK(r.report.state == PALP_STATE_RUN && palp_servo_counters(r.servo)->resets == 1,
          "and goes on when HOLD is let go");
    for (int i = 0; i < 3; i++) {
        r.more_events = PALP_EVENT_LATE;
        rig_tick(&r);
    }
    CHECK(r.report.state == PALP_STATE_DAMPING && palp_servo_counters(r.servo)->tardy == 3,
          "three late ticks in a row end in DAMPING");
    rig_stop(&r);
}

static void test_feedforward(void) {
    rig r;
    rig_start(&r, &body.blob, "arm3", 1000, "touch", NULL, 1);
    rig_run(&r, 0.6);
    palp_can_frame out[PALP_SERVO_FRAMES_OUT];
    double largest = 0;
    for (int i = 0; i < 10; i++) {
        palp_tick_input in = {.feedforward_Nm = {0.05f, i == 5 ? NAN : 100.0f, -100.0f}};
        (void)palp_servo_tick(r.servo, &in, out, &r.report);
        for (int k = 0; k < 3; k++)
            largest = fmax(largest, fabs((double)r.report.motor_torque_Nm[k]));
        if (i == 0)
            CHECK(fabsf(r.report.motor_torque_Nm[0] - 0.05f) < 1e-6f,
                  "the integrator's torque comes through: %.3f Nm",
                  (double)r.report.motor_torque_Nm[0]);
    }
    AT_MOST(largest, 1.0001 * (double)r.file.device.drives.torque_max_Nm,
            "and stays within the motors' limit, Nm");
    CHECK((r.report.faults & PALP_FAULT_OUTPUT) != 0, "one that is not a number is a fault");
    rig_stop(&r);
}

static void test_compensation(void) {
    double drop[2];
    for (int with = 0; with < 2; with++) {
        rig r;
        rig_start(&r, &body.blob, "arm3", 1000, "touch", NULL, 1);
        r.file.weight_N = 0.8;
        if (with == 1) r.file.device.compensation.gravity_compensation_N.z = 0.8f;
        palp_servo_config config = rig_config(&r, &body.blob);
        rig_stop(&r);
        rig_open(&r, &body.blob, &config, "touch", NULL, 1);
        r.bus.script.stiffness_N_per_m = 100;
        r.bus.script.count = 1; /* holds still above the body */
        rig_run(&r, 0.6);
        hand_pose target;
        hand_target(&r.bus.script, r.bus.time_s, &target);
        drop[with] = target.x_m[2] - r.bus.device.x_m[2];
        if (with == 1) {
            rig_run(&r, 1.5);
            CHECK(r.report.state == PALP_STATE_RUN, "and rests there without a fault");
            r.silent = true;
            rig_run(&r, 0.02);
            double left = 0;
            for (int k = 0; k < 3; k++)
                left = fmax(left, fabs((double)r.report.motor_torque_Nm[k]));
            AT_MOST(left, 1e-6, "compensation fades with the force when frames stay away, Nm");
        }
        rig_stop(&r);
    }
    CHECK(drop[0] > 0.006, "a weight of 0.8 N pulls the hand down %.1f mm", 1e3 * drop[0]);
    AT_MOST(fabs(drop[1]), 0.0005, "with compensation it floats, m");
}

/* What is wrong in a config is refused when it is opened. */
static bool opens_with(const palp_servo_config *config) { return rig_opens(&body.blob, config); }

static void test_configs(void) {
    rig r = {.clock_step_ns = 100, .file = file};
    const palp_servo_config good = rig_config(&r, &body.blob);
    palp_servo_config c = good;
    CHECK(opens_with(&c), "the config itself is taken");
    c.placement.rotation[4] = NAN;
    bool any = opens_with(&c);
    c = good;
    for (int k = 0; k < 3; k++) c.placement.rotation[k] = -c.placement.rotation[k];
    any = any || opens_with(&c);
    CHECK(!any, "a placement that is no number, or a reflection, is refused");
    c = good;
    c.placement.origin_m.y = INFINITY;
    any = opens_with(&c);
    c = good;
    c.placement.scale = INFINITY;
    any = any || opens_with(&c);
    CHECK(!any, "an infinite origin or scale is refused");
    c = good;
    c.coupling_N_per_m = 300;
    c.coupling_Ns_per_m = -1;
    any = opens_with(&c);
    c.coupling_Ns_per_m = NAN;
    any = any || opens_with(&c);
    CHECK(!any, "negative damping of the coupling, and one that is no number, are refused");
}

/* More frames in a tick than it has time for: the newest count. */
static void test_flood(void) {
    static palp_can_frame many[500];
    palp_can_frame out[PALP_SERVO_FRAMES_OUT];
    palp_report report;
    rig r;
    rig_start(&r, &body.blob, "arm3", 1000, "touch", NULL, 1);
    rig_run(&r, 0.5);
    const palp_counters before = *palp_servo_counters(r.servo);
    for (int i = 0; i < 500; i++) many[i] = (palp_can_frame){.id = 0x7ff, .length = 8};
    const palp_tick_input in = {.frames = many, .count = 500};
    (void)palp_servo_tick(r.servo, &in, out, &report);
    const palp_counters *after = palp_servo_counters(r.servo);
    CHECK(after->rejected - before.rejected == PALP_SERVO_FRAMES_IN &&
              after->overflows - before.overflows == 500 - PALP_SERVO_FRAMES_IN,
          "of 500 frames in a tick 64 are looked at, and the rest is counted");
    rig_stop(&r);
}

/* In FAULT nothing is counted that only matters under force. */
static void test_frozen_in_fault(void) {
    rig r;
    rig_start(&r, &body.blob, "arm3", 1000, "touch", "stuck@5+5", 1);
    rig_run(&r, 7);
    const uint64_t counted = palp_servo_counters(r.servo)->frozen;
    rig_run(&r, 1);
    CHECK(r.report.state == PALP_STATE_FAULT && counted > 0 &&
              palp_servo_counters(r.servo)->frozen == counted,
          "an encoder that froze is not counted on in FAULT: %llu",
          (unsigned long long)palp_servo_counters(r.servo)->frozen);
    rig_stop(&r);
}

static void test_budget(void) {
    rig r = {.clock_step_ns = 100, .file = file};
    palp_servo_config config = rig_config(&r, &body.blob);
    size_t bytes = palp_servo_memsize(&body.blob, config.finest);
    void *memory = allocate_aligned(bytes, 1);
    float bound_ns = 0;
    config.cost.ns_per_instruction = 50;
    CHECK(palp_servo_open(&r.servo, &body.blob, &config, memory, bytes, &bound_ns) ==
              PALP_ERR_BUDGET,
          "a machine 100 times slower is refused at open");
    CHECK(bound_ns > 0.8e6f, "and told that it would take %.0f us", (double)bound_ns * 1e-3);
    config.cost.ns_per_instruction = 0.5f;
    CHECK(palp_servo_open(&r.servo, &body.blob, &config, memory, bytes - 1, NULL) ==
              PALP_ERR_MEMORY,
          "one byte too few is refused");
    config.device.drives.rate_hz = 0;
    CHECK(palp_servo_open(&r.servo, &body.blob, &config, memory, bytes, NULL) == PALP_ERR_ARGUMENT,
          "a rate of zero is refused");
    /* A clock that eats the period: the tick sheds work and still answers, without losing
     * passivity. */
    rig_start(&r, &body.blob, "arm3", 1000, "touch", NULL, 1);
    r.clock_step_ns = 100000;
    float margin = 0;
    for (int i = 0; i < 10000; i++) {
        rig_tick(&r);
        margin = fminf(margin, r.report.absorbed_J);
    }
    const palp_counters *c = palp_servo_counters(r.servo);
    CHECK(r.report.faults == 0 && c->shortened + c->held > 5,
          "a slow clock shortens %llu ticks, holds %llu, none faults",
          (unsigned long long)c->shortened, (unsigned long long)c->held);
    CHECK(r.largest_N > 0.1, "and the body is still felt: %.2f N", r.largest_N);
    AT_MOST(-(double)margin, 5e-5, "energy given to the hand, J");
    rig_stop(&r);
    free(memory);
}

int main(void) {
    progress_quiet(1);
    mesh control = mesh_load("blobs/rabbit.obj");
    mesh once = subdivide_loop(&control), twice = subdivide_loop(&once);
    body = model_bake(twice, 0.004, 0.05, false, false);
    file = device_load("arm3");
    test_output();
    test_feed_forward();
    test_run();
    test_homing();
    test_damping();
    test_operator();
    test_feedforward();
    test_compensation();
    test_configs();
    test_flood();
    test_frozen_in_fault();
    test_budget();
    return tap_done();
}
