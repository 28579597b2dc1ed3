/* SPDX-License-Identifier: MIT */
#include "port/host/replay.h"
#include "port/host/subnormals.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

/* ---- the files of a session ---- */

/* The log knows their bytes alone: their names come from the command line, or from a scene. */
static void name_files(const replay *r, const char *body, const char *tool) {
    scene_file *of = r->session.scene;
    if (scene_is_here(body)) {
        scene_file *named = scene_read(body);
        if (named->bodies != of->bodies || named->tools != of->tools)
            die(EXIT_WORK,
                "%s is not the scene of this session, which had %" PRIu32 " bodies and %" PRIu32
                " tools",
                body, of->bodies, of->tools);
        for (uint32_t b = 0; b < of->bodies; b++)
            memcpy(of->body[b].path, named->body[b].path, sizeof of->body[b].path);
        for (uint32_t t = 0; t < of->tools; t++)
            memcpy(of->tool[t].path, named->tool[t].path, sizeof of->tool[t].path);
        scene_free(named);
        return;
    }
    if (of->bodies > 1)
        die(EXIT_USAGE, "%s was recorded with %" PRIu32 " bodies: name its scene", r->log,
            of->bodies);
    if (r->session.tool_bytes[0] > 0 && tool == NULL)
        die(EXIT_USAGE, "%s was recorded with a tool of its own: add --tool FILE", r->log);
    snprintf(of->body[0].path, sizeof of->body[0].path, "%s", body);
    if (r->session.tool_bytes[0] > 0)
        snprintf(of->tool[0].path, sizeof of->tool[0].path, "%s", tool);
}

/* That they are those of the session. */
static void check_files(const replay *r) {
    const scene_file *f = r->setup->file;
    const session_record *s = &r->session;
    for (uint32_t b = 0; b < f->bodies; b++) {
        if (r->setup->part[b].bytes == s->blob_bytes[b] && r->setup->part[b].crc == s->blob_crc[b])
            continue;
        die(EXIT_WORK,
            "%s is not the blob of this session (it had %" PRIu32 " bytes, CRC %08" PRIX32 ")",
            f->body[b].path, s->blob_bytes[b], s->blob_crc[b]);
    }
    for (uint32_t t = 0; t < f->tools; t++) {
        if (r->setup->tool_bytes[t] == s->tool_bytes[t] && r->setup->tool_crc[t] == s->tool_crc[t])
            continue;
        die(EXIT_WORK,
            "%s is not the tool of this session (it had %" PRIu32 " bytes, CRC %08" PRIX32 ")",
            f->tool[t].path, s->tool_bytes[t], s->tool_crc[t]);
    }
}

/* ---- the clock ---- */

/* The recorded readings, in order; past their end the last: then the runs have parted. */
static uint64_t read_clock(void *context) {
    replay *r = context;
    const tick_record *t = r->recorded;
    if (r->ticks == 0) return 0;
    if (r->clock_next < t->clock_count) return t->clock_ns[r->clock_next++];
    r->short_of = true;
    return t->clock_count > 0 ? t->clock_ns[t->clock_count - 1] : 0;
}

replay *replay_open(const char *log, const char *body, const char *tool) {
    replay *r = allocate(1, sizeof *r);
    r->log = log;
    r->reader = record_open(log, &r->session);
    name_files(r, body, tool);
    r->setup = scene_set_up(r->session.scene);
    check_files(r);
    subnormals_off(); /* as in the loop */
    r->setup->config.cost = r->session.cost;
    r->setup->config.port = (palp_port){.now_ns = read_clock, .context = r};
    for (uint32_t h = 0; h < r->setup->config.hands; h++)
        r->setup->hand[h].resume = r->session.resume;
    const size_t bytes = record_bytes(r->setup->config.hands);
    r->recorded = allocate(1, bytes);
    r->again = allocate(1, bytes);
    r->scene = scene_open(r->setup);
    return r;
}

void replay_close(replay *r) {
    record_close(r->reader);
    scene_tear_down(r->setup, r->scene);
    free(r->recorded);
    free(r->again);
    free(r);
}

/* ---- a tick again ---- */

static bool same_frames(const tick_hand *is, const tick_hand *was, char *why, size_t room) {
    if (is->out_count != was->out_count) {
        snprintf(why, room, "%" PRIu32 " frames were sent, %" PRIu32 " on record", is->out_count,
                 was->out_count);
        return false;
    }
    for (uint32_t i = 0; i < is->out_count; i++) {
        const palp_can_frame *a = &is->out[i], *b = &was->out[i];
        if (a->id == b->id && a->length == b->length && memcmp(a->data, b->data, a->length) == 0)
            continue;
        snprintf(why, room,
                 "frame %" PRIu32 " of the tick differs (id %03" PRIX32 ", on record "
                 "%03" PRIX32 ")",
                 i, a->id, b->id);
        return false;
    }
    return true;
}

/* What stands in the log besides the digest, so that whoever reads it there reads the truth. */
static bool same_result(const palp_report *a, const palp_report *b) {
    return a->state == b->state && a->faults == b->faults && a->level == b->level &&
           a->points == b->points && a->held == b->held && a->active == b->active &&
           memcmp(&a->force_N, &b->force_N, sizeof a->force_N) == 0 &&
           memcmp(&a->tip_m, &b->tip_m, sizeof a->tip_m) == 0 &&
           memcmp(&a->stored_J, &b->stored_J, sizeof a->stored_J) == 0 &&
           memcmp(&a->absorbed_J, &b->absorbed_J, sizeof a->absorbed_J) == 0 &&
           memcmp(&a->elapsed_ns, &b->elapsed_ns, sizeof a->elapsed_ns) == 0;
}

static void compare(replay *r) {
    const tick_record *was = r->recorded, *is = r->again;
    const size_t room = sizeof r->why;
    for (uint32_t h = 0; h < was->hands && r->why[0] == '\0'; h++) {
        if (same_frames(&is->hand[h], &was->hand[h], r->why, room) &&
            !same_result(&is->hand[h].report, &was->hand[h].report))
            snprintf(r->why, room, "force, state or level differ");
    }
    if (r->why[0] == '\0' && r->digest != was->digest)
        snprintf(r->why, room, "force, state or level differ");
    if (r->why[0] == '\0' && (r->short_of || r->clock_next != was->clock_count))
        snprintf(r->why, room, "the clock was read %" PRIu32 " times, %" PRIu32 " on record",
                 r->clock_next, was->clock_count);
    if (r->why[0] != '\0') r->end = REPLAY_DIFFERS;
}

static void stop(replay *r) {
    run_totals totals[PALP_SCENE_HANDS];
    r->end = record_totals(r->reader, totals) ? REPLAY_DONE : REPLAY_CUT;
}

bool replay_next(replay *r) {
    if (r->end != REPLAY_RUNS) return false;
    tick_record *t = r->recorded, *again = r->again;
    if (!record_next(r->reader, t, &r->lost)) {
        stop(r);
        return false;
    }
    if (r->lost > 0 || t->clock_full) r->end = REPLAY_GAP;
    if (t->exchanged && r->end == REPLAY_RUNS) r->end = REPLAY_EXCHANGED;
    if (r->end != REPLAY_RUNS) return false;
    run_begin(r->setup, again);
    again->time_s = t->time_s;
    again->skipped = t->skipped;
    for (uint32_t h = 0; h < t->hands; h++) {
        tick_hand *to = &again->hand[h];
        const tick_hand *from = &t->hand[h];
        to->in_count = from->in_count;
        to->events = from->events;
        memcpy(to->in, from->in, from->in_count * sizeof from->in[0]);
    }
    r->clock_next = 0;
    r->short_of = false;
    r->ticks++;
    r->periods += t->skipped;
    run_tick(r->setup, r->scene, (double)r->periods++ / r->setup->file->rate_hz, again, &r->digest);
    palp_scene_spare(r->scene);
    compare(r);
    return true;
}
