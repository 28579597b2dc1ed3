/* SPDX-License-Identifier: MIT */
/* Codec, kinematics, output chain and the tick: what goes out is finite and limited whatever comes
 * in. */
#include "sim/device.h"
#include "sim/hand.h"
#include "sim/placement.h"
#include "tests/models.h"
#include "tests/tap.h"
#include "tools/parallel.h"
#include "tools/util.h"
#include <stdlib.h>
#include <string.h>

static baked body;
static device_file file;
static uint64_t virtual_ns;

/* A clock that costs: every look at it takes `step` ns. */
static uint64_t virtual_clock(void *context) { return virtual_ns += *(uint64_t *)context; }

static void test_codec(void) {
    /* The protocol's example: node 1, 0.25 Nm = 02E#0000803E, sent with four bytes. */
    palp_odrive_message m = {
        .node = 1, .command = PALP_ODRIVE_SET_INPUT_TORQUE, .torque_Nm = 0.25f};
    palp_can_frame f = palp_odrive_encode(&m);
    const uint8_t wanted[4] = {0x00, 0x00, 0x80, 0x3e};
    CHECK(f.id == 0x02e && memcmp(f.data, wanted, 4) == 0,
          "torque frame of the specification's example");
    bool same = true;
    uint64_t seed = 6;
    for (uint32_t command = 0; command < 32; command++) {
        palp_odrive_message in = {.node = (uint8_t)(command * 2 % 64),
                                  .command = (palp_odrive_command)command,
                                  .error = 77,
                                  .state = 8,
                                  .position_rev = (float)tap_random(&seed),
                                  .velocity_rev_s = (float)tap_random(&seed),
                                  .torque_Nm = (float)tap_random(&seed),
                                  .control_mode = 1,
                                  .input_mode = 1},
                            out;
        palp_can_frame frame = palp_odrive_encode(&in);
        if (frame.length > 8) continue;
        same = same && palp_odrive_decode(&frame, &out) && out.node == in.node &&
               out.command == in.command;
        palp_can_frame again = palp_odrive_encode(&out);
        same = same && memcmp(&again, &frame, sizeof frame) == 0;
    }
    CHECK(same, "every command survives encoding and decoding");
    palp_can_frame bad = f;
    bad.length = 3;
    CHECK(!palp_odrive_decode(&bad, &m), "a wrong length is refused");
    bad = f;
    bad.flags = PALP_CAN_REMOTE;
    CHECK(!palp_odrive_decode(&bad, &m), "a remote frame is refused");
    bad = f;
    bad.id = 0x7ff + 1;
    CHECK(!palp_odrive_decode(&bad, &m), "an id out of range is refused");
}

static void test_kinematics(void) {
    const palp_arm *arm = &file.device.arm;
    double inverse = 0, jacobian = 0;
    uint64_t seed = 8;
    for (int i = 0; i < 2000; i++) {
        float q[3] = {0.6f * (float)tap_random(&seed), 0.5f * (float)tap_random(&seed),
                      0.5f * (float)tap_random(&seed)};
        palp_arm_pose pose = palp_arm_forward(arm, q);
        const double x[3] = {(double)pose.tip_m.x, (double)pose.tip_m.y, (double)pose.tip_m.z};
        double back[3];
        if (!arm_inverse(arm, x, back)) inverse = 1;
        for (int k = 0; k < 3; k++) inverse = fmax(inverse, fabs(back[k] - (double)q[k]));
        for (int k = 0; k < 3; k++) {
            /* central difference of the formula in the header, in double */
            double tip[2][3];
            for (int s = 0; s < 2; s++) {
                double p[3] = {(double)q[0], (double)q[1], (double)q[2]};
                p[k] += s == 0 ? 1e-5 : -1e-5;
                double a = (double)arm->upper_m, b = (double)arm->fore_m,
                       rho = a * cos(p[1]) + b * sin(p[2]);
                tip[s][0] = rho * cos(p[0]) - a;
                tip[s][1] = rho * sin(p[0]);
                tip[s][2] = a * sin(p[1]) - b * cos(p[2]) + b;
            }
            for (int r = 0; r < 3; r++)
                jacobian = fmax(jacobian, fabs((tip[0][r] - tip[1][r]) / 2e-5 -
                                               (double)pose.jacobian[3 * r + k]));
        }
    }
    AT_MOST(inverse, 2e-5, "forward kinematics undoes the inverse");
    AT_MOST(jacobian, 1e-6, "Jacobian against differences in double");
}

static void test_output(void) {
    palp_output out = {0};
    float q[3] = {0.1f, 0.2f, 0.1f};
    palp_arm_pose pose = palp_arm_forward(&file.device.arm, q);
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
        palp_output_result r = palp_output_apply(&out, &file.device, &pose, wanted, 0.001f);
        sound = sound && palp_vec3_is_finite(r.force_N) &&
                palp_norm(r.force_N) <= file.device.force_max_N * 1.0001f;
        for (int k = 0; k < 3; k++)
            sound =
                sound && fabsf(r.motor_torque_Nm[k]) <= file.device.motor_torque_max_Nm * 1.0001f;
        if (!r.bad) jump = fmax(jump, (double)palp_norm(palp_sub(r.force_N, last)));
        last = r.force_N;
    }
    CHECK(sound, "20,000 wild forces: finite, within force and torque limits");
    AT_MOST(jump, 1.001 * (double)file.device.slew_max_N_per_s * 0.001,
            "and within the slew limit");
}

typedef struct {
    palp_servo *servo;
    sim_device device;
    hand script;
    palp_report report;
    uint64_t clock_step;
    double largest_N;
    bool silent, corrupt;
} rig;

static palp_servo_config config_of(rig *r) {
    touch_frame t = place_body(&body.blob, &file.device, UINT32_MAX);
    return (palp_servo_config){.device = file.device,
                               .placement = t.placement,
                               .limits = PALP_CONTACT_DEFAULTS,
                               .cost = {.ns_per_operation = 0.5f, .margin = 0.8f},
                               .rate_hz = 1000,
                               .tool = palp_tool_sphere(t.tool_radius_m),
                               .port = {.now_ns = virtual_clock, .context = &r->clock_step}};
}

static void start(rig *r) {
    double x[3];
    *r = (rig){.clock_step = 100, .script = hand_load("touch")};
    palp_servo_config config = config_of(r);
    size_t bytes = palp_servo_memsize(&body.blob, config.limits);
    if (palp_servo_open(&r->servo, &body.blob, &config, allocate_aligned(bytes, 1), bytes, NULL) !=
        PALP_OK)
        die(1, "servo");
    hand_target(&r->script, 0, x);
    sim_device_init(&r->device, &file, x);
}

static void tick(rig *r) {
    palp_can_frame in[SIM_FRAMES_OUT], out[PALP_SERVO_FRAMES_OUT];
    double target[3];
    hand_target(&r->script, r->device.time_s, target);
    sim_device_move(&r->device, 0.001, target, r->script.stiffness_N_per_m,
                    r->script.damping_Ns_per_m);
    uint32_t n = sim_device_transmit(&r->device, in);
    for (uint32_t i = 0; i < n && r->corrupt; i++) {
        if (in[i].length == 8 && (in[i].id & 31u) == 9u) memset(in[i].data, 0xff, 4);
    }
    n = palp_servo_tick(r->servo, in, r->silent ? 0 : n, out, &r->report);
    for (uint32_t i = 0; i < n; i++) sim_device_receive(&r->device, &out[i]);
    palp_servo_spare(r->servo);
    r->largest_N = fmax(r->largest_N, (double)palp_norm(r->report.force_N));
}

static void test_run(void) {
    rig r;
    start(&r);
    uint32_t most = 0;
    float margin = 0;
    bool run_late = false;
    for (int i = 0; i < 10000; i++) {
        tick(&r);
        if (i == 10) run_late = r.report.state != PALP_STATE_RUN;
        most = r.report.active > most ? r.report.active : most;
        margin = fminf(margin, r.report.absorbed_J);
    }
    CHECK(run_late, "no RUN before the drives have answered the enable sequence");
    CHECK(r.report.state == PALP_STATE_RUN && r.report.faults == 0,
          "10 s of touching end in RUN without fault");
    CHECK(most >= 3 && r.largest_N > 0.3, "%u nodes touched, %.2f N felt", most, r.largest_N);
    AT_MOST(-(double)margin, 2e-6, "energy given to the hand, J");
    const palp_counters *c = palp_servo_counters(r.servo);
    CHECK(c->rejected == 0 && c->implausible == 0 && c->late == 0 && c->overruns == 0,
          "nothing rejected, implausible, late or overrun");
}

static void test_silence(void) {
    rig r;
    start(&r);
    for (int i = 0; i < 1600; i++) tick(&r);
    double before = (double)palp_norm(r.report.force_N);
    r.silent = true;
    int zero = -1, fault = -1;
    for (int i = 0; i < 60; i++) {
        tick(&r);
        if (zero < 0 && !(palp_norm(r.report.force_N) > 1e-3f)) zero = i;
        if (fault < 0 && r.report.faults != 0) fault = i;
    }
    CHECK(before > 0.1, "%.2f N before the frames stop", before);
    CHECK(zero >= 0 && zero <= 20, "force is zero %d ms after the last frame", zero);
    CHECK(fault > 0 && fault <= 30 && (r.report.faults & PALP_FAULT_LOST) != 0,
          "the fault latches after %d ms", fault);
    r.silent = false;
    for (int i = 0; i < 500; i++) tick(&r);
    CHECK(r.report.state == PALP_STATE_FAULT && !(palp_norm(r.report.force_N) > 0),
          "and stays when the frames come back");
}

static void test_faults(void) {
    rig r;
    start(&r);
    for (int i = 0; i < 1600; i++) tick(&r);
    r.corrupt = true;
    for (int i = 0; i < 5; i++) tick(&r);
    CHECK((r.report.faults & PALP_FAULT_INPUT) != 0 &&
              palp_servo_counters(r.servo)->implausible > 0,
          "NaN positions latch a fault");
    start(&r);
    for (int i = 0; i < 1600; i++) tick(&r);
    r.device.drive[1].state = PALP_ODRIVE_IDLE;
    for (int i = 0; i < 150; i++) tick(&r);
    CHECK((r.report.faults & PALP_FAULT_DRIVE) != 0,
          "a drive that leaves its loop latches a fault");
    CHECK(r.device.drive[0].state == PALP_ODRIVE_IDLE &&
              r.device.drive[2].state == PALP_ODRIVE_IDLE,
          "and all drives go idle together");
    start(&r);
    for (int i = 0; i < 1600; i++) tick(&r);
    palp_servo_skip(r.servo, 30);
    tick(&r);
    CHECK((r.report.faults & PALP_FAULT_LOST) != 0 && palp_servo_counters(r.servo)->skipped == 30,
          "30 skipped periods are 30 ms without encoders");
    start(&r);
    for (int i = 0; i < 1600; i++) tick(&r);
    palp_servo_bus_failed(r.servo);
    tick(&r);
    CHECK(r.report.state == PALP_STATE_FAULT && !(palp_norm(r.report.force_N) > 0),
          "a failed bus is a fault in the same tick");
}

static void test_budget(void) {
    rig r = {.clock_step = 100};
    palp_servo_config config = config_of(&r);
    size_t bytes = palp_servo_memsize(&body.blob, config.limits);
    void *memory = allocate_aligned(bytes, 1);
    float bound_ns = 0;
    config.cost.ns_per_operation = 50;
    CHECK(palp_servo_open(&r.servo, &body.blob, &config, memory, bytes, &bound_ns) ==
              PALP_ERR_BUDGET,
          "a machine 100 times slower is refused at open");
    CHECK(bound_ns > 0.8e6f, "and told that it would take %.0f us", (double)bound_ns * 1e-3);
    config.cost.ns_per_operation = 0.5f;
    CHECK(palp_servo_open(&r.servo, &body.blob, &config, memory, bytes - 1, NULL) ==
              PALP_ERR_MEMORY,
          "one byte too few is refused");
    config.rate_hz = 0;
    CHECK(palp_servo_open(&r.servo, &body.blob, &config, memory, bytes, NULL) == PALP_ERR_ARGUMENT,
          "a rate of zero is refused");
    /* A clock that eats the period: the tick sheds work and still answers, without losing
     * passivity. */
    start(&r);
    r.clock_step = 780000;
    float margin = 0;
    for (int i = 0; i < 10000; i++) {
        tick(&r);
        margin = fminf(margin, r.report.absorbed_J);
    }
    CHECK(r.report.faults == 0 && palp_servo_counters(r.servo)->shortened > 5,
          "a slow clock shortens %llu ticks, none faults",
          (unsigned long long)palp_servo_counters(r.servo)->shortened);
    CHECK(r.largest_N > 0.1, "and the body is still felt: %.2f N", r.largest_N);
    AT_MOST(-(double)margin, 5e-5, "energy given to the hand, J");
}

int main(void) {
    progress_quiet(1);
    mesh control = mesh_load("blobs/rabbit.obj");
    mesh once = subdivide_loop(&control), twice = subdivide_loop(&once);
    body = model_bake(twice, 0.004, 0.05, false, false);
    file = device_load("arm3");
    test_codec();
    test_kinematics();
    test_output();
    test_run();
    test_silence();
    test_faults();
    test_budget();
    return tap_done();
}
