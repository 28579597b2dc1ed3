/* SPDX-License-Identifier: MIT */
/* palp replay: a recorded session again, with the recorded frames, events and clock. */
#include "port/host/args.h"
#include "port/host/replay.h"
#include "port/host/report.h"
#include "port/host/util.h"
#include "tools/cli/commands.h"
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

static void write_line(FILE *f, const tick_record *t, const palp_report *r, uint32_t hand) {
    fprintf(f, "%.6f,%s,%" PRIu32 ",%" PRIu32 ",%" PRIu32, t->time_s, report_state(r->state),
            r->faults, r->level, r->active);
    const float v[] = {r->tip_m.x,   r->tip_m.y,   r->tip_m.z,  r->force_N.x,
                       r->force_N.y, r->force_N.z, r->stored_J, r->absorbed_J};
    for (int i = 0; i < 8; i++) fprintf(f, ",%.9g", (double)v[i]);
    if (t->hands > 1) fprintf(f, ",%" PRIu32, hand);
    fputc('\n', f);
}

int command_replay(int argc, char **argv) {
    replay_spec s = {.csv = NULL};
    args_parse(argc, argv, options, help, set_option, &s);
    if (s.log == NULL || s.blob == NULL) die(EXIT_USAGE, "need a log and its blob (--help)");
    replay *r = replay_open(s.log, s.blob, s.tool);
    output csv = {0};
    if (s.csv != NULL) {
        csv = open_output(s.csv);
        fprintf(csv.file, "time_s,state,faults,level,active,x,y,z,fx,fy,fz,stored_J,absorbed_J%s\n",
                r->setup->config.hands > 1 ? ",device" : "");
    }
    while (replay_next(r)) {
        for (uint32_t h = 0; h < r->again->hands && csv.file != NULL; h++)
            write_line(csv.file, r->again, &r->again->hand[h].report, h);
    }
    const tick_record *t = r->recorded;
    if (r->end == REPLAY_GAP) {
        warn("%s: %" PRIu64 " ticks are missing from the log before tick %" PRIu64
             ": what follows cannot be replayed",
             s.log, r->lost, t->hand[0].report.tick);
        return EXIT_WORK;
    }
    if (r->end == REPLAY_EXCHANGED)
        warn("%s: bodies or tools are exchanged at tick %" PRIu64 ", where replay ends", s.log,
             t->hand[0].report.tick);
    if (csv.file != NULL && r->end != REPLAY_DIFFERS) commit_output(&csv);
    if (r->ticks == 0) die(EXIT_WORK, "%s: no tick on record", s.log);
    if (r->end == REPLAY_DIFFERS)
        die(EXIT_WORK, "%s: tick %" PRIu64 " at %.6f s: %s", s.log, t->hand[0].report.tick,
            t->time_s, r->why);
    if (r->end == REPLAY_CUT) warn("%s: the log ends before its run did", s.log);
    printf("%s: %" PRIu64 " ticks repeated bit for bit, digest %016" PRIx64 "\n", s.log, r->ticks,
           r->digest);
    replay_close(r);
    return EXIT_SUCCESS;
}
