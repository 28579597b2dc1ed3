/* SPDX-License-Identifier: MIT */
#include "port/linux/loop.h"
#include "port/linux/realtime.h"
#include "port/host/subnormals.h"
#include <string.h>
#include <time.h>

#define STALE_PERIODS 2u /* missed periods after which what has queued up is too old to use */
#define LOCKSTEP_PATIENCE_MS 5000
#define CLOSING_TICKS 3
#define MOST_REFILLS 64

/* ---- lock step ---- */

palp_can_frame lockstep_mark(uint32_t tick, uint32_t frames) {
    palp_can_frame f = {.id = LOCKSTEP_ID, .length = 8};
    palp_put_u32(f.data, tick);
    palp_put_u32(f.data + 4, frames);
    return f;
}

bool lockstep_receive(can_port *port, int timeout_ms, palp_can_frame *frames, uint32_t capacity,
                      lockstep_turn *turn, uint64_t *lost) {
    uint32_t n = 0;
    while (can_wait(port, timeout_ms)) {
        palp_can_frame f;
        if (can_receive(port, &f, NULL, 1) == 0) {
            if ((port->events & (PALP_EVENT_BUS_DOWN | PALP_EVENT_BUS_OFF)) != 0) return false;
            continue;
        }
        if (!palp_can_is(&f, LOCKSTEP_ID, 0, 8)) {
            if (n < capacity) frames[n++] = f;
            continue;
        }
        uint32_t wanted = palp_get_u32(f.data + 4);
        *turn = (lockstep_turn){.tick = palp_get_u32(f.data), .frames = n};
        *lost += wanted > n ? wanted - n : n - wanted;
        return true;
    }
    return false;
}

bool lockstep_send(can_port *port, const palp_can_frame *frame) {
    const struct timespec moment = {.tv_nsec = 200000};
    for (int tries = 0; tries < 20000; tries++) {
        if (can_send(port, frame)) return true;
        if ((port->events & PALP_EVENT_BUS_FULL) == 0) return false;
        port->events &= ~PALP_EVENT_BUS_FULL;
        port->lost--;
        port->sent--;
        nanosleep(&moment, NULL);
    }
    return false;
}

/* ---- clock ---- */

uint64_t loop_clock(void *context) {
    servo_loop *l = context;
    uint64_t now = l->lockstep ? 0 : monotonic_ns(NULL);
    tick_record *t = l->current;
    if (t == NULL) return now;
    if (t->clock_count == 0 && !t->clock_full) l->first_ns = now;
    if (t->clock_count < RECORD_CLOCKS)
        t->clock_ns[t->clock_count++] = (uint32_t)(now - l->first_ns);
    else
        t->clock_full = true;
    return now - l->first_ns;
}

/* ---- one tick ---- */

static void receive(servo_loop *l, uint32_t tick, tick_record *t) {
    if (l->memory != NULL) {
        t->in_count =
            l->memory->pass(l->memory->context, 1 / l->rate_hz, t->in, RECORD_FRAMES, &t->events);
    } else if (l->lockstep) {
        lockstep_turn turn = {.tick = LOCKSTEP_HELLO};
        if (!lockstep_receive(&l->port, LOCKSTEP_PATIENCE_MS, t->in, RECORD_FRAMES, &turn,
                              &l->lockstep_lost))
            l->port.events |= PALP_EVENT_BUS_DOWN;
        else if (turn.tick != tick)
            l->lockstep_lost++;
        t->in_count = turn.frames;
    } else {
        t->in_count = can_receive(&l->port, t->in, t->in_time_s, RECORD_FRAMES);
        /* More than any tick should bring: the old ones go, so that none waits to be believed. */
        for (int i = 0; i < MOST_REFILLS && t->in_count == RECORD_FRAMES; i++) {
            l->port.events |= PALP_EVENT_OVERFLOW;
            t->in_count = can_receive(&l->port, t->in, t->in_time_s, RECORD_FRAMES);
        }
    }
    uint32_t pressed = atomic_exchange(&l->operator_events, 0);
    if ((pressed & PALP_EVENT_RESET) != 0) l->hold = false;
    t->events |= l->port.events | pressed | (l->hold ? PALP_EVENT_HOLD : 0) |
                 (l->home ? PALP_EVENT_HOME : 0);
    l->port.events = 0;
}

static void send(servo_loop *l, uint32_t tick, const palp_can_frame *frames, uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        if (l->memory != NULL) {
            if (!l->memory->send(l->memory->context, &frames[i]))
                l->port.events |= PALP_EVENT_BUS_FULL;
        } else if (l->lockstep) {
            (void)lockstep_send(&l->port, &frames[i]);
        } else if (!can_send(&l->port, &frames[i])) {
            break; /* what is queued will act late: fault, never send again */
        }
    }
    if (l->lockstep && l->memory == NULL) {
        palp_can_frame mark = lockstep_mark(tick, count);
        (void)lockstep_send(&l->port, &mark);
    }
}

static double wall_s(void) {
    struct timespec t;
    clock_gettime(CLOCK_REALTIME, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static tick_record *next_record(servo_loop *l) {
    tick_record *t = ring_begin(&l->ring);
    const struct timespec moment = {.tv_nsec = 100000};
    while (t == NULL && !l->paced) { /* nobody's hand is waiting */
        nanosleep(&moment, NULL);
        t = ring_begin(&l->ring);
    }
    if (t == NULL) t = &l->scratch;
    t->in_count = t->out_count = t->clock_count = t->load_count = 0;
    t->skipped = t->events = 0;
    t->clock_full = false;
    return t;
}

static void one_tick(servo_loop *l, uint64_t tick, uint32_t skipped, float late_us,
                     uint64_t *digest) {
    tick_record *t = next_record(l);
    double period_us = 1e6 / l->rate_hz;
    t->late_us = late_us;
    t->skipped = skipped;
    bool wall = l->paced && l->memory == NULL;
    t->time_s = wall ? wall_s() : (double)tick / l->rate_hz;
    receive(l, (uint32_t)tick, t);
    for (uint32_t i = 0; i < t->in_count && !wall; i++) t->in_time_s[i] = t->time_s;
    /* A simulated device waits with us: for it nobody is late. */
    if (l->memory == NULL && (double)late_us > 0.5 * period_us) t->events |= PALP_EVENT_LATE;
    palp_tick_input in = {
        .frames = t->in, .count = t->in_count, .skipped = t->skipped, .events = t->events};
    l->current = t;
    t->out_count = palp_servo_tick(l->servo, &in, t->out, &t->report);
    send(l, (uint32_t)tick, t->out, t->out_count);
    l->current = NULL;
    *digest = record_digest(*digest, t->out, t->out_count, &t->report);
    t->digest = *digest;
    t->counters = *palp_servo_counters(l->servo);
    t->load_count = palp_servo_loads(l->servo, t->load);
    for (uint32_t i = 0; i < PALP_AXES && t->report.state != PALP_STATE_RUN; i++)
        t->trouble[i] = palp_servo_trouble(l->servo, i);
    if (t != &l->scratch) ring_end(&l->ring);
}

/* Torques to zero and drives to idle, whatever the state was. */
static void close_down(servo_loop *l) {
    tick_record *t = &l->scratch;
    if (l->lockstep && l->memory == NULL) return; /* the other end has gone by now */
    for (int i = 0; i < CLOSING_TICKS; i++) {
        palp_tick_input in = {.events = PALP_EVENT_ESTOP};
        uint32_t n = palp_servo_tick(l->servo, &in, t->out, &t->report);
        send(l, 0, t->out, n);
    }
}

/* Waits for tick `next`; returns how many periods were missed, and how late it is for the one after
 * them. Whole periods are skipped, never made up for in a burst. */
static uint32_t wait(uint64_t period_ns, uint64_t *next, float *late_us) {
    *next += period_ns;
    uint64_t late = sleep_until(*next);
    uint64_t skipped = late / period_ns;
    *next += skipped * period_ns;
    *late_us = (float)late * 1e-3f;
    return (uint32_t)skipped;
}

/* Says hello until the other end has something to say. */
static void meet(servo_loop *l) {
    palp_can_frame hello = lockstep_mark(LOCKSTEP_HELLO, 0);
    for (int i = 0; i < 100 && !l->stop; i++) {
        (void)lockstep_send(&l->port, &hello);
        if (can_wait(&l->port, 100)) return;
    }
}

void *loop_run(void *context) {
    servo_loop *l = context;
    uint64_t period_ns = (uint64_t)(1e9 / l->rate_hz), digest = 0;
    subnormals_off();
    if (l->memory == NULL && can_listen(&l->port) && l->lockstep) meet(l);
    uint64_t next = monotonic_ns(NULL), faults = 0;
    for (uint64_t tick = 0; (l->ticks == 0 || tick < l->ticks) && !l->stop; tick++) {
        uint32_t skipped =
            l->memory != NULL ? l->memory->overrun(l->memory->context, 1 / l->rate_hz) : 0;
        for (uint32_t i = 0; i < skipped; i++) { /* the device goes on without us */
            uint32_t events;
            (void)l->memory->pass(l->memory->context, 1 / l->rate_hz, l->scratch.in, RECORD_FRAMES,
                                  &events);
        }
        float late_us = 0;
        if (l->paced) {
            uint32_t missed = wait(period_ns, &next, &late_us);
            if (l->memory == NULL) skipped = missed;
        }
        tick += skipped;
        if (l->memory == NULL && skipped > STALE_PERIODS) can_drain(&l->port);
        one_tick(l, tick, skipped, late_us, &digest);
        if (l->done++ == 10) faults = minor_faults(); /* by then everything has been touched */
    }
    l->minor_faults = l->done > 10 ? minor_faults() - faults : 0;
    close_down(l);
    l->finished = true;
    return NULL;
}
