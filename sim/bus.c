/* SPDX-License-Identifier: MIT */
#include "sim/bus.h"
#include "core/servo/safety.h"
#include <math.h>
#include <string.h>

#define DRIVE_ERROR 0x40u
#define GLITCH_TURNS 5.0

void sim_bus_init(sim_bus *b, const device_file *file, hand script, fault_list f) {
    hand_pose start;
    *b = (sim_bus){.script = script, .faults = f};
    hand_target(&b->script, 0, &start);
    sim_device_init(&b->device, file, &start);
}

static void put(sim_lane *lane, const palp_can_frame *frame, double due_s) {
    if (lane->count < SIM_BUS_QUEUE) lane->flight[lane->count++] = (sim_flight){*frame, due_s};
}

/* Puts a frame on its way, as far as the faults of the moment let it. */
static void launch(sim_bus *b, sim_lane *lane, palp_can_frame frame) {
    double now = b->time_s;
    if (fault_strikes(&b->faults, FAULT_LOSS, now)) return;
    if (fault_strikes(&b->faults, FAULT_CORRUPT, now) && frame.length > 0) {
        /* What a CRC of the bus would catch does not arrive; what arrives is wrong beyond it. */
        uint32_t byte = (uint32_t)(faults_random(&b->faults) * frame.length);
        frame.data[byte] ^= (uint8_t)(1u << (uint32_t)(faults_random(&b->faults) * 8));
    }
    const fault *delay = fault_now(&b->faults, FAULT_DELAY, now);
    put(lane, &frame, now + (delay != NULL ? delay->value : 0));
    if (fault_strikes(&b->faults, FAULT_DUPLICATE, now)) put(lane, &frame, now);
    if (lane->count > 1 && fault_strikes(&b->faults, FAULT_REORDER, now)) {
        sim_flight *f = &lane->flight[lane->count - 2];
        sim_flight swap = f[0];
        f[0] = f[1];
        f[1] = swap;
    }
}

/* The next frame that is due, taken out. */
static bool land(sim_lane *lane, double now, palp_can_frame *frame) {
    for (uint32_t i = 0; i < lane->count; i++) {
        if (lane->flight[i].due_s > now) continue;
        *frame = lane->flight[i].frame;
        lane->count--;
        memmove(&lane->flight[i], &lane->flight[i + 1], (lane->count - i) * sizeof lane->flight[0]);
        return true;
    }
    return false;
}

static bool cut(const sim_bus *b) {
    return fault_now(&b->faults, FAULT_BUS_OFF, b->time_s) != NULL ||
           fault_now(&b->faults, FAULT_DOWN, b->time_s) != NULL;
}

static uint16_t object_of(const fault *f) { return f != NULL ? (uint16_t)f->value : 0; }

static void strike_device(sim_bus *b) {
    const fault *jump = fault_now(&b->faults, FAULT_JUMP, b->time_s);
    bool drive = fault_now(&b->faults, FAULT_DRIVE, b->time_s) != NULL;
    b->device.stuck = fault_now(&b->faults, FAULT_STUCK, b->time_s) != NULL;
    b->device.offset_turns = jump != NULL ? jump->value : 0;
    if (fault_strikes(&b->faults, FAULT_GLITCH, b->time_s)) b->device.offset_turns = GLITCH_TURNS;
    if (fault_now(&b->faults, FAULT_NAN, b->time_s) != NULL) b->device.offset_turns = (double)NAN;
    b->device.drive[0].error = drive ? DRIVE_ERROR : 0;
    b->device.drive[0].refuses = object_of(fault_now(&b->faults, FAULT_REFUSE, b->time_s));
    b->device.drive[0].mutes = object_of(fault_now(&b->faults, FAULT_MUTE, b->time_s));
    b->device.drive[0].ignores = object_of(fault_now(&b->faults, FAULT_IGNORE, b->time_s));
}

static void answer(sim_bus *b) {
    palp_can_frame frames[SIM_FRAMES_OUT];
    uint32_t n = sim_device_transmit(&b->device, frames);
    for (uint32_t i = 0; i < n && !cut(b); i++) launch(b, &b->to_controller, frames[i]);
    palp_can_frame peer[PALP_SCENE_DRIVES];
    n = sim_peer_send(&b->peer, b->time_s, peer);
    for (uint32_t i = 0; i < n && !cut(b); i++) launch(b, &b->to_controller, peer[i]);
}

uint32_t sim_bus_pass(sim_bus *b, double dt_s, palp_can_frame *frames, uint32_t capacity,
                      uint32_t *events) {
    palp_can_frame frame;
    hand_pose target;
    while (land(&b->to_device, b->time_s, &frame)) sim_device_receive(&b->device, &frame);
    strike_device(b);
    hand_target(&b->script, b->time_s, &target);
    sim_device_move(&b->device, dt_s, &target, &b->script);
    answer(b);
    bool off = fault_now(&b->faults, FAULT_BUS_OFF, b->time_s) != NULL;
    *events = off && !b->was_off ? PALP_EVENT_BUS_OFF : 0;
    if (fault_now(&b->faults, FAULT_DOWN, b->time_s) != NULL) *events |= PALP_EVENT_BUS_DOWN;
    b->was_off = off;
    uint32_t n = 0;
    while (n < capacity && land(&b->to_controller, b->time_s, &frames[n])) n++;
    b->time_s += dt_s;
    return n;
}

bool sim_bus_send(sim_bus *b, const palp_can_frame *frame) {
    b->sent++;
    if (fault_now(&b->faults, FAULT_ENOBUFS, b->time_s) != NULL) {
        b->lost++;
        return false;
    }
    if (!cut(b)) launch(b, &b->to_device, *frame); /* bus-off: taken, and never sent */
    return true;
}

uint32_t sim_bus_overrun(const sim_bus *b, double dt_s) {
    const fault *f = fault_now(&b->faults, FAULT_OVERRUN, b->time_s);
    bool begins = f != NULL && b->time_s < f->from_s + dt_s;
    return begins ? (uint32_t)f->value : 0;
}
