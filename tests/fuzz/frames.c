/* SPDX-License-Identifier: MIT */
/*
 * libFuzzer on the tick: the input is a protocol, then ticks made of frames, events and missed
 * periods. Whatever it is, the force is finite and within the device's limits, and so are all
 * torques.
 *
 *   byte 0: which device; then per tick a head byte:
 *     bits 0-1 frames from the fuzzer, bit 2 keep the simulated drives' frames away, bit 3 an events
 *     byte follows, bit 4 skipped periods follow; per frame: id u16 (or a choice of ours), length,
 *     data
 */
#include "core/palp.h"
#include "sim/bus.h"
#include "port/host/placement.h"
#include "port/host/blobfile.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static const char *const names[] = {"arm3",      "arm3-cia402",  "arm3-moteus", "arm3-mit",
                                    "arm3-palp", "arm3-palp-fd", "pantograph",  "delta3"};
#define DEVICES 8
static palp_blob blob;
static device_file files[DEVICES];
static touch_frame touches[DEVICES];
static void *memory;
static size_t bytes;

static uint64_t clock_ns(void *context) {
    uint64_t *now = context;
    return *now += 300;
}

static void set_up(void) {
    program_name = "fuzz";
    const char *path = getenv("PALP_FUZZ_BLOB");
    if (path == NULL) die(EXIT_USAGE, "PALP_FUZZ_BLOB names no blob");
    blob = load_blob(path);
    for (int i = 0; i < DEVICES; i++) {
        files[i] = device_load(names[i]);
        touches[i] = place_body(&blob, &files[i].device, UINT32_MAX, NULL, 0);
    }
    bytes = palp_servo_memsize(&blob, PALP_CONTACT_FINEST);
    memory = allocate_aligned(bytes, 1);
}

typedef struct {
    const uint8_t *at;
    size_t left;
} reader;

static uint8_t next(reader *r) {
    if (r->left == 0) return 0;
    r->left--;
    return *r->at++;
}

/* A frame with an id of our drives more often than not. */
static palp_can_frame make_frame(reader *r, const palp_device *d) {
    palp_can_frame f = {.id = 0};
    palp_can_filter filter[PALP_DRIVE_FILTERS];
    uint8_t how = next(r);
    uint32_t n = palp_drive_filters(&d->drives, d->node_id[how % 2], filter);
    f.id = filter[(how >> 1) % n].id | (d->drives.protocol == PALP_PROTOCOL_ODRIVE ? how >> 3 : 0u);
    f.flags = (uint8_t)(filter[0].flags | (d->drives.fd ? PALP_CAN_FD : 0));
    if (how > 0xf0) {
        f.id = next(r) | (uint32_t)next(r) << 8;
        f.flags = next(r) & 15u;
    }
    f.length = next(r) & 127u;
    if (f.length > 64) f.length = 8;
    for (uint32_t i = 0; i < f.length; i++) f.data[i] = next(r);
    return f;
}

static void check(const palp_report *r, const palp_device *d) {
    if (!palp_vec3_is_finite(r->force_N) || palp_norm(r->force_N) > d->force_max_N * 1.0001f)
        abort();
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        if (!(fabsf(r->motor_torque_Nm[i]) <= d->drives.torque_max_Nm * 1.0001f)) abort();
    }
    bool may = r->state == PALP_STATE_RUN || r->state == PALP_STATE_DAMPING;
    if (!may && palp_norm(r->force_N) > 0) abort();
}

/* A servo in RUN with the tool in the body, as it was after 400 undisturbed ticks. */
typedef struct {
    void *memory; /* copy of what the servo lies in */
    sim_bus bus;
    uint64_t now;
} snapshot;

static palp_servo *servo;
static sim_bus bus;
static uint64_t now;

static void send(const palp_can_frame *out, uint32_t n) {
    for (uint32_t i = 0; i < n; i++) (void)sim_bus_send(&bus, &out[i]);
}

static void warm_up(uint32_t which, bool resume) {
    static hand_key key[2] = {{0, {0, 0, 0.004}}, {0.2, {0.002, 0, -0.01}}};
    palp_servo_config config = {
        .device = files[which].device,
        .placement = touches[which].placement,
        .finest = PALP_CONTACT_FINEST,
        .cost = {.target = &palp_target_counted, .ns_per_instruction = 0.5f, .margin = 0.8f},
        .tool = palp_tool_sphere(touches[which].tool_radius_m),
        .port = {.now_ns = clock_ns, .context = &now},
        .resume = resume};
    palp_can_frame frames[64], out[PALP_SERVO_FRAMES_OUT];
    palp_report report = {.tick = 0};
    uint32_t events;
    now = 0;
    if (palp_servo_open(&servo, &blob, &config, memory, bytes, NULL) != PALP_OK) abort();
    sim_bus_init(&bus, &files[which],
                 (hand){.key = key, .count = 2, .stiffness_N_per_m = 400, .damping_Ns_per_m = 6},
                 (fault_list){.seed = 1});
    for (int tick = 0; tick < 400; tick++) {
        uint32_t n = sim_bus_pass(&bus, 0.001, frames, 64, &events);
        palp_tick_input input = {.frames = frames, .count = n};
        send(out, palp_servo_tick(servo, &input, out, &report));
    }
    if (report.state != PALP_STATE_RUN) abort();
}

static void begin(uint32_t which, bool resume) {
    static snapshot kept[DEVICES][2];
    snapshot *s = &kept[which][resume ? 1 : 0];
    if (s->memory == NULL) {
        warm_up(which, resume);
        s->memory = memcpy(allocate(bytes, 1), memory, bytes);
        s->bus = bus;
        s->now = now;
    }
    memcpy(memory, s->memory, bytes);
    servo = memory; /* what comes first in it */
    bus = s->bus;
    now = s->now;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (memory == NULL) set_up();
    reader in = {data, size};
    uint32_t which = next(&in) % DEVICES, events;
    const palp_device *d = &files[which].device;
    palp_can_frame frames[64], out[PALP_SERVO_FRAMES_OUT];
    palp_report report;
    begin(which, (next(&in) & 1u) != 0);
    while (in.left > 0) {
        uint8_t head = next(&in);
        uint32_t n = sim_bus_pass(&bus, 0.001, frames, 32, &events);
        if ((head & 4u) != 0) n = 0;
        for (uint32_t i = 0; i < (head & 3u); i++) frames[n++] = make_frame(&in, d);
        palp_tick_input input = {.frames = frames, .count = n};
        if ((head & 8u) != 0) input.events = (uint32_t)next(&in) | (uint32_t)(head & 16u) << 4;
        if ((head & 16u) != 0) input.skipped = (head & 32u) != 0 ? UINT32_MAX : next(&in);
        n = palp_servo_tick(servo, &input, out, &report);
        check(&report, d);
        send(out, n);
    }
    return 0;
}
