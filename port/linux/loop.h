/* SPDX-License-Identifier: MIT */
/*
 * The real-time loop: wake, receive, tick, send, spare, publish. It allocates nothing, writes no
 * file, takes no lock, and makes only the system calls of clock, sleep, receive and send. Everybody
 * else sees the run through a ring of tick records.
 */
#ifndef PALP_PORT_LOOP_H
#define PALP_PORT_LOOP_H

#include "port/host/ring.h"
#include "port/linux/socketcan.h"
#include "port/host/record.h"

/*
 * Lock step, for comparisons in which timing does not enter: after each tick's frames both ends
 * send this frame (tick u32, frames before it u32) and wait for the other's. The controller begins
 * with LOCKSTEP_HELLO.
 */
#define LOCKSTEP_ID 0x7ffu
#define LOCKSTEP_HELLO 0xffffffffu
palp_can_frame lockstep_mark(uint32_t tick, uint32_t frames);

/* Receives until the other end's mark; false after `timeout_ms`. *lost counts frames that the mark
 * knows of and that did not come, or a mark out of turn. */
typedef struct {
    uint32_t tick, frames;
} lockstep_turn;
bool lockstep_receive(can_port *port, int timeout_ms, palp_can_frame *frames, uint32_t capacity,
                      lockstep_turn *turn, uint64_t *lost);

/* Sends and, as timing does not enter, waits while the interface is busy. */
bool lockstep_send(can_port *port, const palp_can_frame *frame);

/* A bus in this process in place of the port: what comes in a period, and whether a frame was
 * taken; periods that the controller misses now. */
typedef struct {
    void *context;
    uint32_t (*pass)(void *context, double dt_s, palp_can_frame *frames, uint32_t room,
                     uint32_t *events);
    bool (*send)(void *context, const palp_can_frame *frame);
    uint32_t (*overrun)(void *context, double dt_s);
} memory_bus;

/* The way to a device. */
typedef struct {
    memory_bus memory; /* where the loop is simulated */
    can_port port;     /* else */
} loop_line;

/* A scene, opened. */
typedef struct {
    scene_setup *setup;
    palp_scene *scene;
} loop_scene;

typedef struct {
    scene_setup *setup;
    palp_scene *scene;
    _Atomic(loop_scene *)
        next;                  /* to be exchanged for the present one: set by anybody, with the same
                                   devices, while it is NULL; then the loop's until it is NULL again, */
    _Atomic(loop_scene *) old; /* and the one before is here, for whoever set `next` */
    loop_line line[PALP_SCENE_HANDS];
    double rate_hz;
    uint64_t ticks;    /* 0: until stopped */
    bool simulated;    /* devices in this process */
    bool paced;        /* wait for the clock; else as fast as it goes, dropping nothing */
    bool lockstep;     /* no clock at all */
    _Atomic bool hold; /* stay in READY until the operator's next reset */
    bool home;         /* mechanisms stand at their home poses at the start */
    ring ring;         /* of tick_record, record_bytes each */
    _Atomic uint32_t operator_events; /* RESET and ESTOP, set by anybody, used once */
    _Atomic bool stop, finished;
    /* Written by the loop, to be read when it has finished. */
    uint64_t done, minor_faults, lockstep_lost;
    bool leaving;         /* the scene is about to be exchanged */
    uint64_t periods;     /* since the start, those that were missed as well */
    tick_record *current; /* where the clock's readings go */
    uint64_t begins_ns;   /* until when the tick is to have begun; 0: no clock paces it */
    uint64_t first_ns;    /* first reading of the tick */
    tick_record *scratch; /* for ticks that find the ring full */
} servo_loop;

/* What a device's bus has to let through for a scene: its drives' answers, set-points of joints,
 * the marks of lock step. Returns how many patterns. */
#define LOOP_FILTERS (PALP_AXES * PALP_DRIVE_FILTERS + PALP_SCENE_DRIVES + 1u)
uint32_t loop_filters(const scene_setup *setup, uint32_t device, bool lockstep,
                      palp_can_filter filter[LOOP_FILTERS]);

/* The port's clock for a scene in this loop: context is the servo_loop. A tick that begins within a
 * tenth of the period, which is there for waking up and receiving, counts from its beginning; one
 * that begins later counts from there on, so less is left of it. A simulated device waits with the
 * loop, so nothing is late for it. */
uint64_t loop_clock(void *context);

/* The body of the thread; context is the servo_loop. */
void *loop_run(void *context);

#endif
