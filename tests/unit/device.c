/* SPDX-License-Identifier: MIT */
/* Codecs, protection, mechanisms, velocity and bus load, each against figures from elsewhere or a
 * second way to compute them. */
#include "core/base/real.h"
#include "core/palp.h"
#include "sim/device.h"
#include "tests/tap.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static bool hex_is(const palp_can_frame *f, const char *hex) {
    char text[2 * PALP_CAN_MAX_DATA + 1] = "";
    for (uint32_t i = 0; i < f->length; i++) sprintf(text + 2 * i, "%02x", f->data[i]);
    return strcmp(text, hex) == 0;
}

static void test_odrive(void) {
    /* The protocol's example: node 1, 0.25 Nm = 02E#0000803E, sent with four bytes. */
    palp_odrive_message m = {
        .node = 1, .command = PALP_ODRIVE_SET_INPUT_TORQUE, .torque_Nm = 0.25f};
    palp_can_frame f = palp_odrive_encode(&m);
    CHECK(f.id == 0x02e && hex_is(&f, "0000803e"), "ODrive: the specification's torque frame");
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
    f = palp_odrive_encode(&(palp_odrive_message){.node = 1, .command = PALP_ODRIVE_CLEAR_ERRORS});
    CHECK(f.length == 1 && f.id == 0x038, "clear errors has one byte");
    palp_drive drive;
    palp_drive_config config = device_load("arm3").device.drives;
    palp_drive_init(&drive, 1);
    palp_can_frame iq = {.id = 0x034, .length = 8}, fault = {.id = 0x023, .length = 8, .data = {4}};
    CHECK(palp_drive_receive(&drive, &config, &iq) == PALP_RX_STATUS && drive.error == 0 &&
              palp_drive_receive(&drive, &config, &fault) == PALP_RX_STATUS && drive.error == 4,
          "currents pass unread, an error report counts");
    palp_can_frame parts = {.id = 0x021, .length = 8, .data = {0, 0, 0, 0, 8, 1, 1, 0x81}};
    CHECK(palp_drive_receive(&drive, &config, &parts) == PALP_RX_STATUS &&
              drive.error == (PALP_DRIVE_ERROR_PARTS | 7u),
          "a heartbeat of firmware 0.5 with errors of motor, encoder and controller");
    palp_can_frame done = {.id = 0x021, .length = 8, .data = {0, 0, 0, 0, 8, 0, 0, 0x80}},
                   newer = {.id = 0x021, .length = 8, .data = {0, 0, 0, 0, 8, 1, 1, 0}};
    CHECK(palp_drive_receive(&drive, &config, &done) == PALP_RX_STATUS && drive.error == 0 &&
              palp_drive_receive(&drive, &config, &newer) == PALP_RX_STATUS && drive.error == 0,
          "one without, and one of firmware 0.6, which has other things there");
    f = palp_odrive_encode(&m);
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

static void test_moteus(void) {
    /* The documented torque command's leading subframes, ours with the watchdog register besides.
     */
    palp_moteus_command c = {.mode = PALP_MOTEUS_POSITION,
                             .torque_Nm = 0.25f,
                             .torque_max_Nm = 1.0f,
                             .timeout_s = 0.05f},
                        d;
    palp_can_frame f = palp_moteus_encode_command(3, &c);
    CHECK(f.id == 0x8003 && f.flags == (PALP_CAN_FD | PALP_CAN_EXTENDED) &&
              hex_is(&f, "01000a0c08200000c07f000000000000803e00000000000000000000803f"
                         "0000c07fcdcc4c3d11001f01130d50505050"),
          "moteus: register writes and queries as documented, 48 bytes");
    CHECK(palp_moteus_decode_command(&f, 3, &d) && memcmp(&c, &d, sizeof c) == 0, "and back again");
    /* An answer in 16-bit integers, which drives may be set to: 0.5 rev, -1 rev/s, 0.25 Nm. */
    palp_can_frame a = {.id = 0x300,
                        .flags = PALP_CAN_FD,
                        .length = 12,
                        .data = {0x24, 4, 0, 10, 0, 0x88, 0x13, 0x60, 0xf0, 25, 0, 0x50}};
    palp_moteus_answer r;
    CHECK(palp_moteus_decode_answer(&a, 3, &r) && r.mode == 10 &&
              fabsf(r.position_rev - 0.5f) < 1e-6f && fabsf(r.velocity_rev_s + 1.0f) < 1e-6f &&
              fabsf(r.torque_Nm - 0.25f) < 1e-6f,
          "integers are scaled by register");
    a.length = 10;
    CHECK(!palp_moteus_decode_answer(&a, 3, &r), "a subframe cut short is refused");
    a.length = 200;
    CHECK(!palp_moteus_decode_answer(&a, 3, &r), "and a frame that says it is 200 bytes long");
}

static void test_mit(void) {
    const palp_mit_range range = {12.5f, 30, 10};
    palp_mit_command out;
    palp_can_frame f =
        palp_mit_encode_command(1, 0, &range, (palp_mit_command){.kind = PALP_MIT_ENTER});
    CHECK(hex_is(&f, "fffffffffffffffc"), "MIT: enter is seven FF and FC");
    f = palp_mit_encode_command(1, 0, &range, (palp_mit_command){.torque_Nm = 0});
    CHECK(hex_is(&f, "8000800000000800") && palp_mit_decode_command(&f, 1, 0, &range, &out) &&
              fabsf(out.torque_Nm) < 10.01f / 4095,
          "zero torque is half a step from zero: %.4f Nm", (double)out.torque_Nm);
    double worst = 0;
    for (int i = -100; i <= 100; i++) {
        palp_mit_command in = {.torque_Nm = 0.1f * (float)i};
        f = palp_mit_encode_command(1, 0, &range, in);
        (void)palp_mit_decode_command(&f, 1, 0, &range, &out);
        worst = fmax(worst, fabs((double)(out.torque_Nm - in.torque_Nm)));
    }
    AT_MOST(worst, 10.0 / 4095 * 1.001, "torques are kept to half a step, Nm");
    f = palp_mit_encode_command(1, 0, &range, (palp_mit_command){.torque_Nm = 1e9f});
    (void)palp_mit_decode_command(&f, 1, 0, &range, &out);
    CHECK(fabsf(out.torque_Nm - 10) < 1e-5f, "and saturate");
    palp_mit_answer a = {.node = 5,
                         .state = 1,
                         .is_long = true,
                         .position_rad = 1.25f,
                         .velocity_rad_s = -3,
                         .torque_Nm = 0.5f},
                    b;
    f = palp_mit_encode_answer(0, 0, &range, &a);
    CHECK(palp_mit_decode_answer(&f, 0, 0, &range, &b) && b.node == 5 && b.state == 1 &&
              fabsf(b.position_rad - 1.25f) < 2e-4f && fabsf(b.velocity_rad_s + 3) < 8e-3f,
          "answers with the state beside the number");
}

/* A drive that is told to enable for 20 ticks and answers each with `answer`. */
static palp_drive mit_answers(palp_mit_form form, uint8_t node, const char *answer) {
    const palp_drive_config c = {.protocol = PALP_PROTOCOL_MIT,
                                 .form = form,
                                 .range = {12.5f, 30, 10},
                                 .counts_per_rev = 65536,
                                 .torque_max_Nm = 1,
                                 .watchdog_s = 0.02f,
                                 .rate_hz = 1000};
    palp_drive d;
    palp_can_frame out[PALP_DRIVE_FRAMES], f = {.length = (uint8_t)(strlen(answer) / 2)};
    palp_drive_init(&d, node);
    for (size_t i = 0; i < f.length; i++) {
        const char byte[3] = {answer[2 * i], answer[2 * i + 1], 0};
        f.data[i] = (uint8_t)strtoul(byte, NULL, 16);
    }
    for (int tick = 0; tick < 20; tick++) {
        (void)palp_drive_send(&d, &c, PALP_REQUEST_ENABLE, 0, out);
        (void)palp_drive_receive(&d, &c, &f);
    }
    return d;
}

static void test_mit_forms(void) {
    const struct {
        palp_mit_form form;
        uint8_t node;
        const char *answer;
        bool enabled;
        uint32_t error;
        const char *name;
    } table[] = {
        {PALP_MIT_FORM_AUTO, 1, "0180008008001e00", true, 0, "AK series, healthy, found"},
        {PALP_MIT_FORM_AUTO, 1, "0180008008005a02", true, 2, "AK series, over-current, found"},
        {PALP_MIT_FORM_AUTO, 1, "018000800800", true, 0, "6 bytes"},
        {PALP_MIT_FORM_AUTO, 3, "1380008008001e1c", true, 0, "Damiao, on, found"},
        {PALP_MIT_FORM_AUTO, 3, "0380008008001e1c", false, 0, "Damiao, will not go on"},
        {PALP_MIT_FORM_AUTO, 3, "a380008008001e1c", false, 10, "Damiao, fault"},
        {PALP_MIT_FORM_ERROR, 3, "0380008008001e1c", true, 28, "AK series, described"},
        {PALP_MIT_FORM_STATE, 3, "0380008008001e00", false, 0, "Damiao, described"}};
    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        palp_drive d = mit_answers(table[i].form, table[i].node, table[i].answer);
        CHECK(d.heard && d.enabled == table[i].enabled && d.error == table[i].error,
              "MIT: %s: enabled %d, error %u", table[i].name, d.enabled, d.error);
    }
}

static void test_cia402(void) {
    const struct {
        uint32_t word;
        palp_cia402_state state;
    } table[] = {{0x0000, PALP_CIA402_NOT_READY}, {0x0250, PALP_CIA402_DISABLED},
                 {0x0231, PALP_CIA402_READY},     {0x0233, PALP_CIA402_SWITCHED_ON},
                 {0x1237, PALP_CIA402_ENABLED},   {0x0217, PALP_CIA402_QUICK_STOP},
                 {0x021f, PALP_CIA402_FAULT},     {0x0218, PALP_CIA402_FAULT},
                 {0x0270, PALP_CIA402_DISABLED},  {0x0238, PALP_CIA402_FAULT}};
    bool right = true;
    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++)
        right = right && palp_cia402_state_of(table[i].word) == table[i].state;
    CHECK(right, "CiA 402: statuswords of drives in the field mean the right states");
    palp_can_frame f =
        palp_sdo_encode(0x605, (palp_sdo){PALP_SDO_WRITE(1), 0x6060, 0, PALP_CIA402_CST});
    CHECK(f.id == 0x605 && hex_is(&f, "2f6060000a000000"), "SDO: write mode 10 to node 5");
    f = palp_sdo_encode(0x605, (palp_sdo){PALP_SDO_WRITE(2), 0x1017, 0, 50});
    CHECK(hex_is(&f, "2b17100032000000"), "SDO: two bytes");
    f = palp_sdo_encode(0x605, (palp_sdo){PALP_SDO_WRITE(4), 0x1600, 1, 0x60400010});
    CHECK(hex_is(&f, "2300160110004060"), "SDO: four bytes");
    f = palp_rpdo_encode(5, 0x0f, -100);
    CHECK(f.id == 0x205 && hex_is(&f, "0f009cff"), "RPDO: controlword and target torque");
}

static void test_protection(void) {
    CHECK(palp_crc8(0, (const uint8_t *)"123456789", 9) == 0x4b,
          "CRC-8 SAE J1850 of 123456789 is 4B");
    palp_e2e out = {0}, in = {0};
    palp_can_frame f = {.id = 0x181, .length = 8};
    palp_e2e_verdict v[6];
    for (int i = 0; i < 40; i++) {
        palp_e2e_protect(&out, &f);
        v[0] = palp_e2e_check(&in, &f);
    }
    CHECK(v[0] == PALP_E2E_OK, "40 frames in order are OK");
    palp_can_frame longer = f;
    longer.length = 200;
    v[0] = palp_e2e_check(&in, &longer);
    longer.length = 0;
    CHECK(v[0] == PALP_E2E_WRONG_CRC && palp_e2e_check(&in, &longer) == PALP_E2E_WRONG_CRC,
          "one of 200 bytes and an empty one are not");
    v[0] = palp_e2e_check(&in, &f);
    for (int i = 0; i < 3; i++) palp_e2e_protect(&out, &f);
    v[1] = palp_e2e_check(&in, &f);
    for (int i = 0; i < 7; i++) palp_e2e_protect(&out, &f);
    v[2] = palp_e2e_check(&in, &f);
    v[5] = palp_e2e_check(&in, NULL);
    palp_e2e_protect(&out, &f);
    palp_can_frame other = f;
    other.id = 0x182;
    v[4] = palp_e2e_check(&in, &other);
    v[3] = palp_e2e_check(&in, &f);
    CHECK(v[0] == PALP_E2E_REPEATED && v[1] == PALP_E2E_SOME_LOST &&
              v[2] == PALP_E2E_WRONG_SEQUENCE && v[3] == PALP_E2E_OK &&
              v[4] == PALP_E2E_WRONG_CRC && v[5] == PALP_E2E_NO_NEW_DATA,
          "repeated, some lost, wrong sequence, another id, nothing: each has its verdict");
    int missed = 0, tried = 0;
    for (int bit = 0; bit < 64; bit++) {
        for (int second = bit; second < 64; second++, tried++) {
            palp_can_frame bad = f;
            palp_e2e state = in;
            bad.data[bit / 8] ^= (uint8_t)(1 << bit % 8);
            if (second != bit) bad.data[second / 8] ^= (uint8_t)(1 << second % 8);
            missed += palp_e2e_check(&state, &bad) != PALP_E2E_WRONG_CRC ? 1 : 0;
        }
    }
    CHECK(missed == 0, "all %d errors of one or two bits are found", tried);
}

/* ---- mechanisms ---- */

/* The constraint equations of kinematics.h in double: 0 when the tip belongs to the joints. */
static double mismatch(const palp_kinematics *k, const double q[3], const double p[3]) {
    double a = (double)k->upper_m, b = (double)k->fore_m, e = (double)k->base_m, worst = 0;
    if (k->mechanism == PALP_ARM3) {
        double rho = a * cos(q[1]) + b * sin(q[2]);
        worst = fmax(fabs(rho * cos(q[0]) - a - p[0]), fabs(rho * sin(q[0]) - p[1]));
        return fmax(worst, fabs(a * sin(q[1]) - b * cos(q[2]) + b - p[2]));
    }
    uint32_t n = palp_axes(k);
    double home = sqrt(b * b - (e + a) * (e + a));
    for (uint32_t i = 0; i < n; i++) {
        double phi = n == 2 ? i * M_PI : i * 2 * M_PI / 3;
        double r = e + a * cos(q[i]);
        double d[3] = {p[0] - r * cos(phi), p[1] - r * sin(phi), p[2] + home - a * sin(q[i])};
        worst = fmax(worst, fabs(sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) - b));
    }
    return worst;
}

/* Wrists: the turn that joints make, its axes by differences, its inverse, and what motors transmit. */
static void test_wrist(const char *name) {
    const palp_kinematics k = device_load(name).device.kinematics;
    const uint32_t first = palp_wrist_axis(&k), gripper = palp_gripper_axis(&k);
    uint64_t seed = 9;
    double axes = 0, back = 0, power = 0, passive = 0, opens = 0, columns = 0;
    for (int i = 0; i < 2000; i++) {
        float q[PALP_AXES], dq[PALP_AXES] = {0}, there[PALP_AXES], tau[PALP_AXES];
        for (uint32_t j = 0; j < palp_axes(&k); j++) q[j] = 0.9f * (float)tap_random(&seed);
        const palp_pose pose = palp_forward(&k, q);
        for (uint32_t j = 0; j < palp_axes(&k); j++) {
            float up[PALP_AXES], down[PALP_AXES];
            memcpy(up, q, sizeof q);
            memcpy(down, q, sizeof q);
            up[j] += 1e-2f;
            down[j] -= 1e-2f;
            const palp_pose a = palp_forward(&k, up), b = palp_forward(&k, down);
            const palp_vec3 turn = palp_scale(50.0f, palp_turn_between(b.r, a.r)),
                            move = palp_scale(50.0f, palp_sub(a.tip_m, b.tip_m));
            axes = fmax(axes, (double)palp_norm(palp_sub(turn, pose.turn[j])));
            columns = fmax(columns, (double)palp_norm(palp_sub(move, pose.column_m[j])));
        }
        memcpy(there, q, sizeof q);
        for (uint32_t j = 0; j < 3; j++) there[first + j] = 0;
        palp_inverse_wrist(&k, pose.r, there);
        for (uint32_t j = 0; j < 3; j++)
            back = fmax(back, fabs((double)(there[first + j] - q[first + j])));
        const palp_vec3 f = {(float)tap_random(&seed), (float)tap_random(&seed), 0.5f},
                        m = {(float)tap_random(&seed), 0.3f, (float)tap_random(&seed)};
        palp_pose_torques(&pose, f, m, tau);
        double work = 0;
        for (uint32_t j = 0; j < PALP_AXES; j++) {
            dq[j] = j < palp_axes(&k) ? (float)tap_random(&seed) : 0;
            work += (double)(tau[j] * dq[j]);
        }
        work -= (double)(palp_dot(f, palp_pose_velocity(&pose, dq)) +
                         palp_dot(m, palp_pose_turning(&pose, dq)));
        power = fmax(power, fabs(work));
        const palp_vec3 some = palp_pose_transmits(&pose, &k, 1u << first | 4u << first, m);
        passive = fmax(passive, fabs((double)palp_dot(some, pose.turn[first + 1])));
        for (uint32_t j = 0; j < 3; j += 2)
            passive =
                fmax(passive, fabs((double)palp_dot(palp_sub(some, m), pose.turn[first + j])));
        const palp_vec3 all = palp_pose_transmits(&pose, &k, 7u << first, m);
        passive = fmax(passive, (double)palp_norm(palp_sub(all, m)));
        passive = fmax(passive, (double)palp_norm(palp_pose_transmits(&pose, &k, 7u, m)));
        if (gripper < palp_axes(&k))
            opens = fmax(opens, fabs((double)(pose.opening_m - k.gripper_m_per_rad * q[gripper])));
    }
    AT_MOST(axes, 2e-4, "%s: axes that joints turn the tool about, against differences", name);
    AT_MOST(columns, 1e-4, "%s: and how they move the tip, m/rad", name);
    AT_MOST(back, 1e-5, "%s: joints of the wrist from the tool's turn, rad", name);
    AT_MOST(power, 1e-6, "%s: torques do the work of force and moment", name);
    AT_MOST(passive, 2e-5, "%s: what motors transmit has nothing along axes without, Nm", name);
    AT_MOST(opens, 1e-9, "%s: the gripper opens", name);
}

static void test_mechanism(const char *name) {
    device_file file = device_load(name);
    const palp_kinematics *k = &file.device.kinematics;
    double forward = 0, inverse = 0, jacobian = 0, home = 0;
    uint64_t seed = 8;
    const float zero[PALP_AXES] = {0};
    home = (double)palp_norm(palp_forward(k, zero).tip_m);
    for (int i = 0; i < 2000; i++) {
        double R = (double)file.device.workspace_radius_m;
        palp_vec3 tip = {(float)(R * 0.6 * tap_random(&seed)), (float)(R * 0.6 * tap_random(&seed)),
                         (float)(R * 0.6 * tap_random(&seed))};
        if (palp_axes(k) == 2) tip.y = 0;
        float q[PALP_AXES] = {0}, there[2][PALP_AXES] = {{0}};
        if (!palp_inverse(k, tip, q)) inverse = 1;
        palp_pose pose = palp_forward(k, q);
        inverse = fmax(inverse, (double)palp_norm(palp_sub(pose.tip_m, tip)));
        double qd[3] = {(double)q[0], (double)q[1], (double)q[2]};
        double p[3] = {(double)pose.tip_m.x, (double)pose.tip_m.y, (double)pose.tip_m.z};
        forward = fmax(forward, mismatch(k, qd, p));
        /* d(inverse)/d(tip) times J is the identity: differences of an independent formula */
        for (uint32_t axis = 0; axis < palp_axes(k); axis++) {
            const float h = 2e-3f;
            palp_vec3 step = palp_scale(h, pose.column_m[axis]);
            if (!palp_inverse(k, palp_add(tip, step), there[0]) ||
                !palp_inverse(k, palp_sub(tip, step), there[1]))
                continue;
            for (uint32_t r = 0; r < palp_axes(k); r++)
                jacobian = fmax(jacobian, fabs((double)((there[0][r] - there[1][r]) / (2 * h)) -
                                               (r == axis ? 1 : 0)));
        }
    }
    AT_MOST(home, 1e-7, "%s: at home the tip is at the origin, m", name);
    AT_MOST(forward, 1e-7, "%s: forward kinematics satisfies its equations in double, m", name);
    AT_MOST(inverse, 3e-7, "%s: forward undoes inverse, m", name);
    AT_MOST(jacobian, 2e-3, "%s: the Jacobian is the inverse of the inverse's differences", name);
}

static void test_singular(void) {
    device_file file = device_load("arm3");
    float stretched[PALP_AXES] = {0, 0, 1.5707f}; /* upper arm and forearm in line */
    AT_MOST((double)palp_forward(&file.device.kinematics, stretched).conditioning, 1e-3,
            "arm3: a stretched arm is singular");
    float home[PALP_AXES] = {0}, q[PALP_AXES] = {0};
    CHECK(palp_forward(&file.device.kinematics, home).conditioning > 0.9f, "and home is not");
    CHECK(!palp_inverse(&file.device.kinematics, (palp_vec3){0.3f, 0, 0}, q),
          "a place out of reach is refused");
    const palp_kinematics flat = {
        .mechanism = PALP_DELTA, .upper_m = 0.06f, .fore_m = 0.0901f, .base_m = 0.03f};
    AT_MOST((double)palp_forward(&flat, home).conditioning, 0.05,
            "a delta whose distal links nearly lie in a plane is nearly singular");
}

static void test_atan2(void) {
    double worst = 0;
    for (int i = 0; i < 100000; i++) {
        float angle = -3.14159f + 6.28318f * (float)i / 1e5f, s, c;
        palp_sincos(angle, &s, &c);
        float r = i % 3 == 0 ? 1e-3f : i % 3 == 1 ? 1.0f : 1e4f;
        worst = fmax(worst, fabs((double)palp_atan2(r * s, r * c) -
                                 atan2((double)(r * s), (double)(r * c))));
    }
    AT_MOST(worst, 3e-7, "atan2 against libm in double");
}

/* A slow and a fast sine, read by an encoder of 4,000 counts: windowed against plain differences.
 */
static void test_velocity(void) {
    const double step = 2 * M_PI / 40000, dt = 0.001;
    const palp_joint_limits limits = {-10, 10, 100, (float)step, 0};
    double square[2] = {0, 0}, still = 0;
    palp_joint j = {.age = 0};
    double last = 0;
    for (int i = 0; i < 4000; i++) {
        double t = i * dt, q = 0.3 * sin(2 * t), v = 0.6 * cos(2 * t);
        double read = floor(q / step) * step;
        palp_joint_age(&j, 1, (float)dt);
        (void)palp_joint_take(&j, &limits, (float)read, (float)dt);
        palp_joint_velocity(&j, &limits, (float)dt);
        if (i > 20) {
            square[0] += pow((double)j.dq_rad_s - v, 2);
            square[1] += pow((read - last) / dt - v, 2);
        }
        last = read;
    }
    CHECK(square[0] < 0.05 * square[1], "velocity: error %.4f rad/s, of plain differences %.4f",
          sqrt(square[0] / 4000), sqrt(square[1] / 4000));
    for (int i = 0; i < 200; i++) { /* flickers between two counts */
        palp_joint_age(&j, 1, (float)dt);
        (void)palp_joint_take(&j, &limits, (float)(last + (i % 2) * step), (float)dt);
        palp_joint_velocity(&j, &limits, (float)dt);
        if (i > 40) still = fmax(still, fabs((double)j.dq_rad_s));
    }
    AT_MOST(still, step / dt / 10, "flicker between two counts is nearly rest, rad/s");
}

static void test_joint(void) {
    const palp_joint_limits limits = {-1, 1, 20, 1e-4f, 0};
    palp_joint j = {.age = 0};
    const float good[] = {0.5f, 0.501f}, bad[] = {NAN, INFINITY, 1.2f, 0.7f, 0.0f};
    bool refused = true;
    for (int i = 0; i < 2; i++) {
        palp_joint_age(&j, 1, 0.001f);
        (void)palp_joint_take(&j, &limits, good[i], 0.001f);
        palp_joint_velocity(&j, &limits, 0.001f);
    }
    for (int i = 0; i < 5; i++) {
        palp_joint before = j;
        palp_joint_age(&before, 1, 0.001f);
        refused = refused &&
                  palp_joint_take(&before, &limits, bad[i], 0.001f) == PALP_READING_BAD &&
                  before.q_rad >= 0.501f && before.q_rad <= 0.501f && before.age == 1;
    }
    CHECK(refused, "NaN, infinity, out of limits, a jump, and a jump to exactly 0 are refused");
    palp_joint_age(&j, 20, 0.001f);
    CHECK(palp_joint_take(&j, &limits, 0.7f, 0.001f) == PALP_READING_TAKEN,
          "after 20 ms it may have gone that far");
}

/* A joint that turns evenly, read every millisecond by an encoder, while readings are lost, come
 * again, or come late behind the next one: the largest step of its place over an even one. */
typedef enum { LOST, AGAIN, SWAPPED } disturbance;

static double largest_step(disturbance what, int ticks, double rad_s, double *velocity) {
    const double step = 1e-5, dt = 0.001;
    const palp_joint_limits limits = {-10, 10, 100, (float)step, 0};
    palp_joint j = {.age = 0};
    double most = 0, before = 0, wrong = 0;
    for (int i = 0; i < 120; i++) {
        const bool struck = i >= 50 && i < 50 + ticks;
        const double now = floor(rad_s * i * dt / step) * step;
        const double old = floor(rad_s * (i - 1) * dt / step) * step;
        palp_joint_age(&j, 1, (float)dt);
        if (struck && what == AGAIN)
            (void)palp_joint_take(&j, &limits, j.q_rad, (float)dt);
        else if (!struck)
            (void)palp_joint_take(&j, &limits, (float)now, (float)dt);
        if (i == 50 + ticks && what == SWAPPED)
            (void)palp_joint_take(&j, &limits, (float)old, (float)dt);
        if (j.age == 0) palp_joint_velocity(&j, &limits, (float)dt);
        palp_joint_update_belief(&j, &limits);
        if (i > 20) {
            most = fmax(most, fabs((double)j.believed_rad - before));
            wrong = fmax(wrong, fabs((double)j.dq_rad_s / rad_s - 1));
        }
        before = (double)j.believed_rad;
    }
    *velocity = wrong;
    return most / (rad_s * dt);
}

static void test_missed(void) {
    static const char *const names[] = {"lost", "sent again", "out of order"};
    static const int most[] = {5, 3, 3};
    for (int k = 0; k < 3; k++) {
        double worst = 0, velocity = 0;
        for (int ticks = 1; ticks <= most[k]; ticks++) {
            for (double rad_s = 0.1; rad_s < 4; rad_s *= 1.7) {
                double v;
                worst = fmax(worst, largest_step((disturbance)k, ticks, rad_s, &v));
                velocity = fmax(velocity, v);
            }
        }
        CHECK(worst <= 1.25 && velocity < 0.12,
              "1 to %d readings %s: largest step of the place %.2f of an even one, velocity off by "
              "%.3f",
              most[k], names[k], worst, velocity);
    }
    /* A joint that is stopped short is believed in the end. */
    const palp_joint_limits limits = {-10, 10, 100, 1e-5f, 0};
    palp_joint j = {.age = 0};
    for (int i = 0; i < 60; i++) {
        palp_joint_age(&j, 1, 0.001f);
        (void)palp_joint_take(&j, &limits, 1e-3f * (float)(i < 50 ? i : 50), 0.001f);
        if (j.age == 0) palp_joint_velocity(&j, &limits, 0.001f);
        palp_joint_update_belief(&j, &limits);
    }
    CHECK(fabsf(j.believed_rad - 0.05f) < 1e-6f && !(fabsf(j.certain_rad_s) > 0),
          "stopped short, it is where it was read: off by %.2g rad",
          fabs((double)j.believed_rad - 0.05));
}

/* Silences so long that the count of ticks comes round: no velocity is known after them. */
/* Every codec looks at the length: answers of all lengths, cut short or far too long. */
static void test_lengths(void) {
    static const char *const names[] = {"arm3",     "arm3-cia402", "arm3-moteus",
                                        "arm3-mit", "arm3-palp",   "arm3-palp-fd"};
    uint32_t taken = 0;
    for (int k = 0; k < 6; k++) {
        const palp_device d = device_load(names[k]).device;
        palp_can_filter filter[PALP_DRIVE_FILTERS];
        const uint32_t filters = palp_drive_filters(&d.drives, d.node_id[0], filter);
        for (uint32_t i = 0; i < filters; i++) {
            for (uint32_t length = 65; length < 256; length++) {
                palp_drive drive;
                palp_drive_init(&drive, d.node_id[0]);
                palp_can_frame *f = allocate(1, sizeof *f); /* reads beyond it are seen */
                *f = (palp_can_frame){
                    .id = filter[i].id,
                    .flags = (uint8_t)(filter[i].flags | (d.drives.fd ? PALP_CAN_FD : 0)),
                    .length = (uint8_t)length};
                memset(f->data, 0x50, sizeof f->data);
                const palp_rx_event event = palp_drive_receive(&drive, &d.drives, f);
                taken += event != PALP_RX_NONE && event != PALP_RX_BAD;
                free(f);
            }
        }
    }
    CHECK(taken == 0, "no codec takes a frame of more than 64 bytes (%u)", taken);
    palp_device d = device_load("arm3").device;
    d.joint_max_rad[1] = 1e30f;
    CHECK(!palp_device_is_sound(&d), "a joint limit of 1e30 is refused");
    d.joint_max_rad[1] = NAN;
    CHECK(!palp_device_is_sound(&d), "and one that is no number");
}

static void test_silence(void) {
    const palp_joint_limits limits = {-10, 10, 100, 1e-5f, 0};
    palp_joint j = {.age = 0};
    bool finite = true;
    for (int i = 0; i < 40; i++) {
        palp_joint_age(&j, i % 5 == 4 ? 4 : UINT32_MAX, 0.001f);
        (void)palp_joint_take(&j, &limits, 0.1f, 0.001f);
        palp_joint_velocity(&j, &limits, 0.001f);
        palp_joint_update_belief(&j, &limits);
        finite = finite && isfinite(j.dq_rad_s) && isfinite(j.believed_rad);
    }
    CHECK(finite, "after silences of 2^30 periods each, velocity and place are finite");
}

/* Figures computed elsewhere for 1 Mbit/s and 5 or 8 Mbit/s. */
static void test_load(void) {
    const struct {
        uint32_t bytes;
        float data;
        double us;
    } known[] = {{8, 0, 135},     {6, 0, 115},    {4, 0, 95},     {0, 0, 55},    {64, 5e6f, 169},
                 {64, 8e6f, 118}, {24, 5e6f, 89}, {24, 8e6f, 68}, {8, 5e6f, 56}, {8, 8e6f, 47}};
    double worst = 0;
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++)
        worst =
            fmax(worst,
                 fabs(1e6 * (double)palp_frame_time_s(known[i].bytes, false, 1e6f, known[i].data) -
                      known[i].us));
    AT_MOST(worst, 0.6, "worst times of ten kinds of frames, us off");
    palp_device d = device_load("arm3-cia402").device;
    d.drives.rate_hz = 1342;
    AT_MOST(fabs((double)palp_bus_load_of(&d).load - 1), 0.07,
            "CANopen with three axes fills the bus at 1342 Hz (heartbeats besides)");
    d = device_load("arm3-moteus").device;
    float low = palp_bus_load_of(&d).load;
    d.node_id[2] = 9;
    CHECK(palp_bus_load_of(&d).load > 1.05f * low, "moteus answers from node 8 on take longer");
}

int main(void) {
    test_odrive();
    test_moteus();
    test_mit();
    test_mit_forms();
    test_cia402();
    test_protection();
    test_atan2();
    test_mechanism("arm3");
    test_mechanism("pantograph");
    test_mechanism("delta3");
    test_wrist("arm6-palp-fd");
    test_wrist("arm7-palp-fd");
    test_singular();
    test_velocity();
    test_joint();
    test_missed();
    test_silence();
    test_lengths();
    test_load();
    return tap_done();
}
