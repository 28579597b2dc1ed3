/* SPDX-License-Identifier: MIT */
#include "port/linux/loop.h"
#include "port/linux/realtime.h"
#include "port/host/run_tick.h"
#include "port/host/subnormals.h"
#include <string.h>
#include <time.h>

#define WAKING 0.1       /* of a period, in which a tick is to begin: to wake up and to receive */
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
    if (t->clock_count == 0 && !t->clock_full) {
        if (l->begins_ns > 0 && now > l->begins_ns) now = l->begins_ns;
        l->first_ns = now;
    }
    if (t->clock_count < RECORD_CLOCKS)
        t->clock_ns[t->clock_count++] = (uint32_t)(now - l->first_ns);
    else
        t->clock_full = true;
    return now - l->first_ns;
}

uint32_t loop_filters(const scene_setup *setup, uint32_t number, bool lockstep,
                      palp_can_filter filter[LOOP_FILTERS]) {
    const palp_device *device = &setup->device[number].device;
    uint32_t n = 0;
    for (uint32_t i = 0; i < palp_axes(&device->kinematics); i++)
        n += palp_drive_filters(&device->drives, device->node_id[i], filter + n);
    for (uint32_t d = 0; d < setup->config.drives; d++) {
        const palp_scene_drive *of = &setup->drive[d];
        if (of->by != PALP_DRIVEN_BY_FRAMES || of->hand != number) continue;
        const uint8_t flags = palp_can_id_flags(of->id);
        filter[n++] =
            (palp_can_filter){.id = of->id, .mask = flags ? 0x1fffffffu : 0x7ffu, .flags = flags};
    }
    if (lockstep) filter[n++] = (palp_can_filter){.id = LOCKSTEP_ID, .mask = 0x7ff};
    return n;
}

/* ---- one tick ---- */

static void receive_lockstep(servo_loop *l, can_port *port, uint32_t tick, tick_hand *hand) {
    lockstep_turn turn = {.tick = LOCKSTEP_HELLO};
    bool here;
    do { /* hellos said again are nothing */
        here = lockstep_receive(port, LOCKSTEP_PATIENCE_MS, hand->in, RECORD_FRAMES, &turn,
                                &l->lockstep_lost);
    } while (here && turn.tick == LOCKSTEP_HELLO && !l->stop);
    if (!here)
        port->events |= PALP_EVENT_BUS_DOWN;
    else if (turn.tick != tick)
        l->lockstep_lost++;
    hand->in_count = turn.frames;
}

static void receive_port(can_port *port, tick_hand *hand) {
    hand->in_count = can_receive(port, hand->in, hand->in_time_s, RECORD_FRAMES);
    /* More than any tick should bring: the old ones go, so that none waits to be believed. */
    for (int i = 0; i < MOST_REFILLS && hand->in_count == RECORD_FRAMES; i++) {
        port->events |= PALP_EVENT_OVERFLOW;
        hand->in_count = can_receive(port, hand->in, hand->in_time_s, RECORD_FRAMES);
    }
}

static void receive(servo_loop *l, uint32_t tick, tick_record *t) {
    const uint32_t pressed = atomic_exchange(&l->operator_events, 0);
    if ((pressed & PALP_EVENT_RESET) != 0) l->hold = false;
    for (uint32_t h = 0; h < t->hands; h++) {
        loop_line *line = &l->line[h];
        tick_hand *hand = &t->hand[h];
        if (l->simulated)
            hand->in_count = line->memory.pass(line->memory.context, 1 / l->rate_hz, hand->in,
                                               RECORD_FRAMES, &hand->events);
        else if (l->lockstep)
            receive_lockstep(l, &line->port, tick, hand);
        else
            receive_port(&line->port, hand);
        hand->events |= line->port.events | pressed | (l->hold ? PALP_EVENT_HOLD : 0) |
                        (l->home ? PALP_EVENT_HOME : 0);
        line->port.events = 0;
    }
}

static void send(servo_loop *l, loop_line *line, uint32_t tick, const palp_can_frame *frames,
                 uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        if (l->simulated) {
            if (!line->memory.send(line->memory.context, &frames[i]))
                line->port.events |= PALP_EVENT_BUS_FULL;
        } else if (l->lockstep) {
            (void)lockstep_send(&line->port, &frames[i]);
        } else if (!can_send(&line->port, &frames[i])) {
            break; /* what is queued will act late: fault, never send again */
        }
    }
    if (l->lockstep && !l->simulated) {
        palp_can_frame mark = lockstep_mark(tick, count);
        (void)lockstep_send(&line->port, &mark);
    }
}

/* Lets the present scene fade when another waits, and then goes on with that. */
static void exchange(servo_loop *l, tick_record *t) {
    loop_scene *next = atomic_load(&l->next);
    if (next == NULL) return;
    if (!l->leaving) {
        palp_scene_leave(l->scene);
        l->leaving = t->exchanged = true;
    }
    if (!palp_scene_has_left(l->scene) || palp_scene_take_over(next->scene, l->scene) != PALP_OK)
        return;
    const loop_scene old = {l->setup, l->scene};
    l->setup = next->setup;
    l->scene = next->scene;
    *next = old;
    l->leaving = false;
    l->periods = 0; /* tracks begin anew */
    t->bodies = l->setup->config.bodies;
    for (uint32_t b = 0; b < t->bodies; b++) t->kind[b] = l->setup->part[b].kind;
    atomic_store(&l->old, next);
    atomic_store(&l->next, NULL);
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
    if (t == NULL) t = l->scratch;
    run_begin(l->setup, t);
    return t;
}

static void one_tick(servo_loop *l, uint64_t tick, uint32_t skipped, float late_us,
                     uint64_t *digest) {
    tick_record *t = next_record(l);
    double period_us = 1e6 / l->rate_hz;
    t->late_us = late_us;
    t->skipped = skipped;
    bool wall = l->paced && !l->simulated;
    t->time_s = wall ? wall_s() : (double)tick / l->rate_hz;
    receive(l, (uint32_t)tick, t);
    for (uint32_t h = 0; h < t->hands; h++) {
        tick_hand *hand = &t->hand[h];
        for (uint32_t i = 0; i < hand->in_count && !wall; i++) hand->in_time_s[i] = t->time_s;
        /* A simulated device waits with us: for it nobody is late. */
        if (!l->simulated && (double)late_us > 0.5 * period_us) hand->events |= PALP_EVENT_LATE;
    }
    l->periods += skipped;
    exchange(l, t);
    l->current = t;
    run_tick(l->setup, l->scene, (double)l->periods / l->rate_hz, t, digest);
    l->periods++;
    for (uint32_t h = 0; h < t->hands; h++)
        send(l, &l->line[h], (uint32_t)tick, t->hand[h].out, t->hand[h].out_count);
    palp_scene_spare(l->scene);
    l->current = NULL;
    t->load_count = palp_scene_loads(l->scene, 0, t->load);
    if (t != l->scratch) ring_end(&l->ring);
}

/* Torques to zero and drives to idle, whatever the state was. */
static void close_down(servo_loop *l) {
    uint64_t digest = 0;
    if (l->lockstep && !l->simulated) return; /* the other end has gone by now */
    for (int i = 0; i < CLOSING_TICKS; i++) {
        tick_record *t = l->scratch;
        for (uint32_t h = 0; h < t->hands; h++) {
            t->hand[h].in_count = 0;
            t->hand[h].events = PALP_EVENT_ESTOP;
        }
        run_tick(l->setup, l->scene, (double)l->periods / l->rate_hz, t, &digest);
        for (uint32_t h = 0; h < t->hands; h++)
            send(l, &l->line[h], 0, t->hand[h].out, t->hand[h].out_count);
    }
}

/* Waits for tick `next`; returns how many periods were missed, and how late it is for the period that
 * it waited for. Whole periods are skipped, never made up for in a burst: then *next is when the one
 * that is under way began. */
static uint32_t wait(uint64_t period_ns, uint64_t *next, float *late_us) {
    *next += period_ns;
    uint64_t late = sleep_until(*next);
    uint64_t skipped = late / period_ns;
    *next += skipped * period_ns;
    *late_us = (float)late * 1e-3f;
    return (uint32_t)skipped;
}

/* Says hello until the other end has something to say. */
static void meet(servo_loop *l, can_port *port) {
    palp_can_frame hello = lockstep_mark(LOCKSTEP_HELLO, 0);
    for (int i = 0; i < 100 && !l->stop; i++) {
        (void)lockstep_send(port, &hello);
        if (can_wait(port, 100)) return;
    }
}

/* Periods that faults make the controller miss now: simulated devices go on without it. */
static uint32_t miss(servo_loop *l) {
    const double dt_s = 1 / l->rate_hz;
    uint32_t skipped = 0, events;
    for (uint32_t h = 0; h < l->setup->config.hands; h++) {
        const memory_bus *m = &l->line[h].memory;
        const uint32_t missed = m->overrun(m->context, dt_s);
        skipped = missed > skipped ? missed : skipped;
    }
    for (uint32_t h = 0; h < l->setup->config.hands; h++) {
        const memory_bus *m = &l->line[h].memory;
        for (uint32_t i = 0; i < skipped; i++)
            (void)m->pass(m->context, dt_s, l->scratch->hand[h].in, RECORD_FRAMES, &events);
    }
    return skipped;
}

static void listen_all(servo_loop *l) {
    for (uint32_t h = 0; h < l->setup->config.hands; h++) {
        can_port *port = &l->line[h].port;
        if (can_listen(port) && l->lockstep) meet(l, port);
    }
}

void *loop_run(void *context) {
    servo_loop *l = context;
    const uint32_t hands = l->setup->config.hands;
    uint64_t period_ns = (uint64_t)(1e9 / l->rate_hz), digest = 0;
    subnormals_off();
    l->scratch->hands = hands;
    l->scratch->bodies = l->setup->config.bodies;
    if (!l->simulated) listen_all(l);
    uint64_t next = monotonic_ns(NULL), faults = 0;
    for (uint64_t tick = 0; (l->ticks == 0 || tick < l->ticks) && !l->stop; tick++) {
        uint32_t skipped = l->simulated ? miss(l) : 0;
        float late_us = 0;
        if (l->paced) {
            uint32_t missed = wait(period_ns, &next, &late_us);
            if (!l->simulated) {
                skipped = missed;
                l->begins_ns = next + (uint64_t)(WAKING * (double)period_ns);
            }
        }
        tick += skipped;
        for (uint32_t h = 0; h < hands && !l->simulated && skipped > STALE_PERIODS; h++)
            can_drain(&l->line[h].port);
        one_tick(l, tick, skipped, late_us, &digest);
        if (l->done++ == 10) faults = minor_faults(); /* by then everything has been touched */
    }
    l->minor_faults = l->done > 10 ? minor_faults() - faults : 0;
    close_down(l);
    l->finished = true;
    return NULL;
}
