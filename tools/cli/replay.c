/* SPDX-License-Identifier: MIT */
/* palp replay: a recorded session again, with the recorded frames, events and clock. */
#include "core/base/crc32c.h"
#include "port/host/record.h"
#include "port/host/report.h"
#include "port/host/subnormals.h"
#include "port/host/toolfile.h"
#include "port/host/args.h"
#include "tools/cli/commands.h"
#include "port/host/blobfile.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

static const char help[] =
    "usage: palp replay LOG BLOB [--tool FILE] [-o OUT.csv]\n"
    "\n"
    "Re-runs a session that 'palpd --log LOG' has recorded, with the same frames, events and clock "
    "readings,\n"
    "and compares every result. Exit 1 at the first differing bit.\n"
    "\n"
    "  --tool FILE the tool of the session, if it had one of its own\n"
    "  -o OUT.csv  one line per tick: time_s, state, faults, level, active, tip, force, energy\n";

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
    bool short_of; /* asked for more than was recorded: the runs have parted */
} recorded_clock;

static uint64_t read_clock(void *context) {
    recorded_clock *c = context;
    if (c->tick == NULL) return 0;
    if (c->next < c->tick->clock_count) return c->tick->clock_ns[c->next++];
    c->short_of = true;
    return c->tick->clock_count > 0 ? c->tick->clock_ns[c->tick->clock_count - 1] : 0;
}

static bool same_frames(const tick_record *t, const palp_can_frame *out, uint32_t count, char *why,
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

static void write_line(FILE *f, const tick_record *t, const palp_report *r) {
    fprintf(f, "%.6f,%s,%" PRIu32 ",%" PRIu32 ",%" PRIu32, t->time_s, report_state(r->state),
            r->faults, r->level, r->active);
    const float v[] = {r->tip_m.x,   r->tip_m.y,   r->tip_m.z,  r->force_N.x,
                       r->force_N.y, r->force_N.z, r->stored_J, r->absorbed_J};
    for (int i = 0; i < 8; i++) fprintf(f, ",%.9g", (double)v[i]);
    fputc('\n', f);
}

static palp_servo *open_servo(const palp_blob *blob, const palp_servo_config *config) {
    palp_servo *servo;
    size_t bytes = palp_servo_memsize(blob, config->finest);
    if (bytes == 0)
        die(EXIT_WORK, "the log's level of contact is none, or the blob cannot be touched");
    palp_status status =
        palp_servo_open(&servo, blob, config, allocate_aligned(bytes, 1), bytes, NULL);
    if (status != PALP_OK) die(EXIT_WORK, "cannot open the servo: %s", palp_status_text(status));
    return servo;
}

/* The tool of the session, which the log knows by its bytes alone. */
static void take_tool(const replay_spec *s, session_record *session) {
    if (s->tool == NULL)
        die(EXIT_USAGE, "%s was recorded with a tool of its own: add --tool FILE", s->log);
    const tool_file t = tool_load(s->tool);
    if (t.bytes != session->tool_bytes || t.crc != session->tool_crc)
        die(EXIT_WORK,
            "%s is not the tool of this session (it had %" PRIu32 " bytes, CRC %08" PRIX32 ")",
            s->tool, session->tool_bytes, session->tool_crc);
    const float friction = session->config.tool.friction, sliding = session->config.tool.sliding;
    session->config.tool = t.tool;
    session->config.tool.friction = friction;
    session->config.tool.sliding = sliding;
}

int command_replay(int argc, char **argv) {
    replay_spec s = {.csv = NULL};
    args_parse(argc, argv, options, help, set_option, &s);
    if (s.log == NULL || s.blob == NULL) die(EXIT_USAGE, "need a log and its blob (--help)");
    session_record session;
    record_reader *reader = record_open(s.log, &session);
    size_t bytes;
    char *data = read_file(s.blob, &bytes);
    if (bytes != session.blob_bytes || palp_crc32c(0, data, bytes) != session.blob_crc)
        die(EXIT_WORK,
            "%s is not the blob of this session (it had %" PRIu32 " bytes, CRC %08" PRIX32 ")",
            s.blob, session.blob_bytes, session.blob_crc);
    free(data);
    if (session.tool_bytes > 0) take_tool(&s, &session);
    palp_blob blob = load_blob(s.blob);
    recorded_clock clock = {.tick = NULL};
    subnormals_off(); /* as in the loop */
    session.config.port = (palp_port){.now_ns = read_clock, .context = &clock};
    palp_servo *servo = open_servo(&blob, &session.config);
    output csv = {0};
    if (s.csv != NULL) {
        csv = open_output(s.csv);
        fputs("time_s,state,faults,level,active,x,y,z,fx,fy,fz,stored_J,absorbed_J\n", csv.file);
    }
    tick_record *t = allocate(1, sizeof *t);
    uint64_t ticks = 0, digest = 0, lost;
    char why[160] = "";
    while (why[0] == '\0' && record_next(reader, t, &lost)) {
        if (lost > 0 || t->clock_full) {
            warn("%s: %" PRIu64 " ticks are missing from the log before tick %" PRIu64
                 ": what follows cannot be replayed",
                 s.log, lost, t->report.tick);
            return EXIT_WORK;
        }
        palp_can_frame out[PALP_SERVO_FRAMES_OUT];
        palp_report report;
        clock = (recorded_clock){.tick = t};
        palp_tick_input in = {
            .frames = t->in, .count = t->in_count, .skipped = t->skipped, .events = t->events};
        uint32_t n = palp_servo_tick(servo, &in, out, &report);
        digest = record_digest(digest, out, n, &report);
        if (csv.file != NULL) write_line(csv.file, t, &report);
        if (same_frames(t, out, n, why, sizeof why)) {
            if (digest != t->digest || !same_result(&t->report, &report))
                snprintf(why, sizeof why, "force, state or level differ");
            else if (clock.short_of || clock.next != t->clock_count)
                snprintf(why, sizeof why,
                         "the clock was read %" PRIu32 " times, %" PRIu32 " on record", clock.next,
                         t->clock_count);
        }
        ticks++;
    }
    run_totals totals;
    const bool ended = record_totals(reader, &totals);
    record_close(reader);
    if (csv.file != NULL && why[0] == '\0') commit_output(&csv);
    if (ticks == 0) die(EXIT_WORK, "%s: no tick on record", s.log);
    if (why[0] != '\0')
        die(EXIT_WORK, "%s: tick %" PRIu64 " at %.6f s: %s", s.log, t->report.tick, t->time_s, why);
    if (!ended) warn("%s: the log ends before its run did", s.log);
    printf("%s: %" PRIu64 " ticks repeated bit for bit, digest %016" PRIx64 "\n", s.log, ticks,
           digest);
    return EXIT_SUCCESS;
}
