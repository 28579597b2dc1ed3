/* SPDX-License-Identifier: MIT */
/* palp replay: a recorded session again, with the recorded frames, events and clock. */
#include "port/host/record.h"
#include "port/host/report.h"
#include "port/host/subnormals.h"
#include "port/host/args.h"
#include "tools/cli/commands.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

static const char help[] =
    "usage: palp replay LOG BLOB|SCENE [--tool FILE] [-o OUT.csv]\n"
    "\n"
    "Re-runs a session that 'palpd --log LOG' has recorded, with the same frames, events and clock "
    "readings,\n"
    "and compares every result. Exit 1 at the first differing bit.\n"
    "\n"
    "  SCENE       the scene of the session, which names its blobs and tools\n"
    "  --tool FILE the tool of a session with one blob, if it had one of its own\n"
    "  -o OUT.csv  one line per tick and device: time_s, state, faults, level, active, tip, force, "
    "energy,\n"
    "              and where there are several devices which it is\n";

static const option options[] = {{"-o", 1}, {"--tool", 1}, {NULL, 0}};

typedef struct {
    const char *log, *blob, *csv, *tool;
} replay_spec;

static void set_option(void *context, const argument *a) {
    replay_spec *s = context;
    if (a->option != NULL && strcmp(a->option, "--tool") == 0)
        s->tool = a->value[0];
    else if (a->option != NULL)
        s->csv = a->value[0];
    else if (s->log == NULL)
        s->log = a->value[0];
    else if (s->blob == NULL)
        s->blob = a->value[0];
    else
        die(EXIT_USAGE, "one log and one blob, not also '%s'", a->value[0]);
}

/* Gives the recorded readings, in order; past their end the last. */
typedef struct {
    const tick_record *tick;
    uint32_t next;
    uint64_t periods; /* since the start, those that were skipped as well */
    bool short_of;    /* asked for more than was recorded: the runs have parted */
} recorded_clock;

static uint64_t read_clock(void *context) {
    recorded_clock *c = context;
    if (c->tick == NULL) return 0;
    if (c->next < c->tick->clock_count) return c->tick->clock_ns[c->next++];
    c->short_of = true;
    return c->tick->clock_count > 0 ? c->tick->clock_ns[c->tick->clock_count - 1] : 0;
}

static bool same_frames(const tick_hand *t, const palp_can_frame *out, uint32_t count, char *why,
                        size_t size) {
    if (count != t->out_count) {
        snprintf(why, size, "%" PRIu32 " frames were sent, %" PRIu32 " on record", count,
                 t->out_count);
        return false;
    }
    for (uint32_t i = 0; i < count; i++) {
        const palp_can_frame *a = &out[i], *b = &t->out[i];
        if (a->id == b->id && a->length == b->length && memcmp(a->data, b->data, a->length) == 0)
            continue;
        snprintf(why, size,
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

static void write_line(FILE *f, const tick_record *t, const palp_report *r, uint32_t hand) {
    fprintf(f, "%.6f,%s,%" PRIu32 ",%" PRIu32 ",%" PRIu32, t->time_s, report_state(r->state),
            r->faults, r->level, r->active);
    const float v[] = {r->tip_m.x,   r->tip_m.y,   r->tip_m.z,  r->force_N.x,
                       r->force_N.y, r->force_N.z, r->stored_J, r->absorbed_J};
    for (int i = 0; i < 8; i++) fprintf(f, ",%.9g", (double)v[i]);
    if (t->hands > 1) fprintf(f, ",%" PRIu32, hand);
    fputc('\n', f);
}

/* The files of the session, of which the log knows the bytes alone: from the command line, or a scene
 * that names them. */
static void name_files(const replay_spec *s, session_record *session) {
    scene_file *of = session->scene;
    if (scene_is_here(s->blob)) {
        scene_file *named = scene_read(s->blob);
        if (named->bodies != of->bodies || named->tools != of->tools)
            die(EXIT_WORK,
                "%s is not the scene of this session, which had %" PRIu32 " bodies and %" PRIu32
                " tools",
                s->blob, of->bodies, of->tools);
        for (uint32_t b = 0; b < of->bodies; b++)
            memcpy(of->body[b].path, named->body[b].path, sizeof of->body[b].path);
        for (uint32_t t = 0; t < of->tools; t++)
            memcpy(of->tool[t].path, named->tool[t].path, sizeof of->tool[t].path);
        return;
    }
    if (of->bodies > 1)
        die(EXIT_USAGE, "%s was recorded with %" PRIu32 " bodies: name its scene", s->log,
            of->bodies);
    if (session->tool_bytes[0] > 0 && s->tool == NULL)
        die(EXIT_USAGE, "%s was recorded with a tool of its own: add --tool FILE", s->log);
    snprintf(of->body[0].path, sizeof of->body[0].path, "%s", s->blob);
    if (session->tool_bytes[0] > 0)
        snprintf(of->tool[0].path, sizeof of->tool[0].path, "%s", s->tool);
}

/* That they are those of the session. */
static void check_files(const session_record *session, const scene_setup *setup) {
    const scene_file *f = setup->file;
    for (uint32_t b = 0; b < f->bodies; b++) {
        if (setup->part[b].bytes == session->blob_bytes[b] &&
            setup->part[b].crc == session->blob_crc[b])
            continue;
        die(EXIT_WORK,
            "%s is not the blob of this session (it had %" PRIu32 " bytes, CRC %08" PRIX32 ")",
            f->body[b].path, session->blob_bytes[b], session->blob_crc[b]);
    }
    for (uint32_t t = 0; t < f->tools; t++) {
        if (setup->tool_bytes[t] == session->tool_bytes[t] &&
            setup->tool_crc[t] == session->tool_crc[t])
            continue;
        die(EXIT_WORK,
            "%s is not the tool of this session (it had %" PRIu32 " bytes, CRC %08" PRIX32 ")",
            f->tool[t].path, session->tool_bytes[t], session->tool_crc[t]);
    }
}

/* One tick again; what differs, if anything does, in `why`. */
static void repeat(const scene_setup *setup, palp_scene *scene, recorded_clock *clock,
                   const tick_record *t, FILE *csv, uint64_t *digest, char *why, size_t room) {
    palp_can_frame out[PALP_SCENE_HANDS][PALP_SERVO_FRAMES_OUT];
    palp_tick_input in[PALP_SCENE_HANDS];
    palp_scene_report report;
    uint32_t sent[PALP_SCENE_HANDS];
    *clock = (recorded_clock){.tick = t, .periods = clock->periods};
    for (uint32_t h = 0; h < t->hands; h++)
        in[h] = (palp_tick_input){.frames = t->hand[h].in,
                                  .count = t->hand[h].in_count,
                                  .skipped = t->skipped,
                                  .events = t->hand[h].events};
    clock->periods += t->skipped;
    scene_move(setup, scene, (double)clock->periods++ / setup->file->rate_hz);
    palp_scene_tick(scene, in, out, sent, &report);
    for (uint32_t h = 0; h < t->hands; h++) {
        palp_report view;
        palp_scene_view(scene, &report, h, &view);
        *digest = record_digest(*digest, out[h], sent[h], &view);
        if (csv != NULL) write_line(csv, t, &view, h);
        if (why[0] == '\0' && same_frames(&t->hand[h], out[h], sent[h], why, room) &&
            !same_result(&t->hand[h].report, &view))
            snprintf(why, room, "force, state or level differ");
    }
    palp_scene_spare(scene);
    if (why[0] == '\0' && *digest != t->digest) snprintf(why, room, "force, state or level differ");
    if (why[0] == '\0' && (clock->short_of || clock->next != t->clock_count))
        snprintf(why, room, "the clock was read %" PRIu32 " times, %" PRIu32 " on record",
                 clock->next, t->clock_count);
}

int command_replay(int argc, char **argv) {
    replay_spec s = {.csv = NULL};
    args_parse(argc, argv, options, help, set_option, &s);
    if (s.log == NULL || s.blob == NULL) die(EXIT_USAGE, "need a log and its blob (--help)");
    session_record session;
    record_reader *reader = record_open(s.log, &session);
    name_files(&s, &session);
    scene_setup *setup = scene_set_up(session.scene);
    check_files(&session, setup);
    recorded_clock clock = {.tick = NULL};
    subnormals_off(); /* as in the loop */
    setup->config.cost = session.cost;
    setup->config.port = (palp_port){.now_ns = read_clock, .context = &clock};
    for (uint32_t h = 0; h < setup->config.hands; h++) setup->hand[h].resume = session.resume;
    palp_scene *scene = scene_open(setup);
    output csv = {0};
    if (s.csv != NULL) {
        csv = open_output(s.csv);
        fprintf(csv.file, "time_s,state,faults,level,active,x,y,z,fx,fy,fz,stored_J,absorbed_J%s\n",
                setup->config.hands > 1 ? ",device" : "");
    }
    tick_record *t = allocate(1, record_bytes(setup->config.hands));
    uint64_t ticks = 0, digest = 0, lost;
    char why[160] = "";
    while (why[0] == '\0' && record_next(reader, t, &lost)) {
        if (lost > 0 || t->clock_full) {
            warn("%s: %" PRIu64 " ticks are missing from the log before tick %" PRIu64
                 ": what follows cannot be replayed",
                 s.log, lost, t->hand[0].report.tick);
            return EXIT_WORK;
        }
        if (t->exchanged) {
            warn("%s: bodies or tools are exchanged at tick %" PRIu64 ", where replay ends", s.log,
                 t->hand[0].report.tick);
            break;
        }
        repeat(setup, scene, &clock, t, csv.file, &digest, why, sizeof why);
        ticks++;
    }
    run_totals totals[PALP_SCENE_HANDS];
    const bool ended = t->exchanged || record_totals(reader, totals);
    record_close(reader);
    if (csv.file != NULL && why[0] == '\0') commit_output(&csv);
    if (ticks == 0) die(EXIT_WORK, "%s: no tick on record", s.log);
    if (why[0] != '\0')
        die(EXIT_WORK, "%s: tick %" PRIu64 " at %.6f s: %s", s.log, t->hand[0].report.tick,
            t->time_s, why);
    if (!ended) warn("%s: the log ends before its run did", s.log);
    printf("%s: %" PRIu64 " ticks repeated bit for bit, digest %016" PRIx64 "\n", s.log, ticks,
           digest);
    return EXIT_SUCCESS;
}
