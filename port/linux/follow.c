/* SPDX-License-Identifier: MIT */
#include "port/linux/follow.h"
#include "port/host/trouble.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define POLL_NS 2000000 /* between looks at the ring */
#define DDS_HZ 100.0

/* ---- what is said at once ---- */

/* Which drive it was, and what of it. */
void follow_trouble(const follower *f, uint32_t hand, const palp_drive_trouble *trouble) {
    const palp_device *d = &f->loop->setup->device[hand].device;
    for (uint32_t i = 0; i < palp_axes(&d->kinematics); i++) {
        char text[320];
        trouble_text(&trouble[i], d->drives.protocol, text, sizeof text);
        if (text[0] != '\0') warn("%s", text);
    }
}

/* Says when the state changes, so that nobody waits for a device that is not there. */
static void announce(follower *f, const tick_hand *t, uint32_t hand) {
    const palp_report *r = &t->report;
    const scene_file *scene = f->loop->setup->file;
    if (f->state_shown[hand] && r->state == f->last_state[hand]) return;
    f->state_shown[hand] = true;
    f->last_state[hand] = r->state;
    char faults[128], which[64] = "";
    report_faults(r->faults, faults, sizeof faults);
    if (scene->devices > 1)
        snprintf(which, sizeof which, "device %" PRIu32 " on %s: ", hand, scene->device[hand].bus);
    const bool quiet = f->loop->simulated || f->loop->lockstep;
    if (r->state == PALP_STATE_HOMING && !f->home) {
        warn(
            "%sHOMING: hold the mechanism at its home pose ('joint-home' of the device), then send "
            "SIGUSR1",
            which);
        return;
    }
    if (quiet && !palp_state_is_stopped(r->state)) return;
    if (r->state == PALP_STATE_INIT) {
        const uint8_t *node = f->loop->setup->device[hand].device.node_id;
        warn("%swaiting for heartbeats of nodes %d %d %d on %s", which, node[0], node[1], node[2],
             scene->device[hand].bus);
    } else {
        warn("%s%s%s%s", which, report_state(r->state), r->faults != 0 ? ": " : "", faults);
    }
    if ((r->faults & (PALP_FAULT_CONFIG | PALP_FAULT_ENABLE | PALP_FAULT_DRIVE)) != 0)
        follow_trouble(f, hand, t->trouble);
}

/* ---- what is kept ---- */

static void consume_tick(follower *f, const tick_record *t) {
    run_record *r = &f->record;
    const uint64_t tick = t->hand[0].report.tick;
    const uint64_t lost = f->taken > 0 ? tick - f->last_tick - 1 : tick;
    if (f->log != NULL) {
        if (lost > 0) record_write_gap(f->log, t->time_s, lost);
        record_write_tick(f->log, f->loop->setup->file, t);
    }
    f->last_tick = tick;
    f->digest = t->digest;
    f->exchanged = f->exchanged || t->exchanged;
    if (!f->exchanged && f->picture != NULL) picture_take(f->picture, (double)tick / r->rate_hz, t);
    const size_t at = (size_t)(f->taken++ % f->capacity); /* a longer run keeps its last ticks */
    if (r->late_us != NULL) r->late_us[at] = t->late_us;
    if (r->count < f->capacity) r->count++;
    const uint64_t every = (uint64_t)(r->rate_hz / DDS_HZ + 0.5);
    for (uint32_t h = 0; h < t->hands; h++) {
        r->hand[h].tick[at] = t->hand[h].report;
        r->hand[h].events[at] = t->hand[h].events;
        memcpy(f->trouble[h], t->hand[h].trouble, sizeof f->trouble[h]);
        f->counters[h] = t->hand[h].counters;
        if (f->telemetry[h] != NULL && tick % (every > 0 ? every : 1) == 0)
            telemetry_publish(f->telemetry[h], &t->hand[h].report);
        announce(f, &t->hand[h], h);
    }
    f->joints = t->joint_count;
    memcpy(f->joint, t->joint, t->joint_count * sizeof t->joint[0]);
    for (uint32_t j = 0; j < t->joint_count && j < r->joints && !f->exchanged; j++)
        r->joint[j].at = t->joint[j];
    for (uint32_t b = 0; b < r->bodies && !f->exchanged; b++)
        run_body_add(&r->body[b], &t->body[b]);
}

void follow_run(follower *f, const volatile sig_atomic_t *interrupted) {
    const struct timespec moment = {.tv_nsec = POLL_NS};
    for (;;) {
        bool last = f->loop->finished;
        for (tick_record *t; (t = ring_peek(&f->loop->ring)) != NULL;) {
            consume_tick(f, t);
            ring_release(&f->loop->ring);
        }
        if (last) return;
        if (*interrupted != 0) f->loop->stop = true;
        if (f->serve != NULL) f->serve(f->context);
        nanosleep(&moment, NULL);
    }
}

void follow_begin(follower *f, size_t capacity) {
    const scene_setup *s = f->loop->setup;
    run_record *r = &f->record;
    f->capacity = capacity;
    r->rate_hz = s->file->rate_hz;
    r->hands = s->config.hands;
    if (f->loop->paced) r->late_us = allocate(capacity, sizeof *r->late_us);
    for (uint32_t h = 0; h < r->hands; h++) {
        r->hand[h].tick = allocate(capacity, sizeof *r->hand[h].tick);
        r->hand[h].events = allocate(capacity, sizeof *r->hand[h].events);
        r->hand[h].device_name = copy_string(s->device[h].name); /* scenes come and go */
        r->hand[h].bus_name = copy_string(s->file->device[h].bus);
    }
    run_joints_of(r, s);
    const bool plain = s->config.bodies == 1 && s->part[0].kind == PALP_BODY_ELASTIC;
    r->bodies = plain ? 0 : s->config.bodies;
    for (uint32_t b = 0; b < r->bodies; b++)
        r->body[b] =
            (run_body){.name = copy_string(s->file->body[b].name), .kind = s->part[b].kind};
}

/* An array in a ring in the order of time. */
static void *unrolled(void *array, size_t size, size_t count, size_t start) {
    char *from = array, *to = allocate(count, size);
    memcpy(to, from + start * size, (count - start) * size);
    memcpy(to + (count - start) * size, from, start * size);
    free(array);
    return to;
}

void follow_end(follower *f) {
    const servo_loop *l = f->loop;
    run_record *r = &f->record;
    const size_t start = f->taken > f->capacity ? (size_t)(f->taken % f->capacity) : 0;
    if (start > 0 && r->late_us != NULL)
        r->late_us = unrolled(r->late_us, sizeof *r->late_us, r->count, start);
    for (uint32_t h = 0; h < r->hands; h++) {
        run_hand *of = &r->hand[h];
        if (start > 0) {
            of->tick = unrolled(of->tick, sizeof *of->tick, r->count, start);
            of->events = unrolled(of->events, sizeof *of->events, r->count, start);
        }
        of->totals = (run_totals){.counters = f->counters[h],
                                  .frames_sent = l->line[h].port.sent,
                                  .frames_lost = l->line[h].port.lost,
                                  .frames_dropped = l->line[h].port.dropped,
                                  .unrecorded = l->paced ? atomic_load(&l->ring.dropped) : 0,
                                  .minor_faults = l->minor_faults};
    }
    r->totalled = true;
    r->first_s = (double)r->hand[0].tick[0].tick / r->rate_hz;
}
