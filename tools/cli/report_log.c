/* SPDX-License-Identifier: MIT */
/* palp report: the page of a run, from its log. */
#include "port/host/replay.h"
#include "port/host/report.h"
#include "port/host/shape.h"
#include "port/host/args.h"
#include "tools/cli/commands.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

static const char help[] =
    "usage: palp report LOG [BLOB|SCENE] [--tool FILE] -o OUT.html\n"
    "\n"
    "Draws a session that 'palpd --log LOG' has recorded: one page with force, place, level, "
    "latency, "
    "energy and what\n"
    "happened on the bus, over time, with one cursor. With the blob or scene of the session it is "
    "run "
    "again, and the page\n"
    "shows the bodies at the cursor as well. How well contacts were settled is not in a log: palpd "
    "--report has it.\n"
    "\n"
    "  --tool FILE the tool of a session with one blob, if it had one of its own\n";

static const option options[] = {{"-o", 1}, {"--tool", 1}, {NULL, 0}};

typedef struct {
    const char *log, *body, *tool, *page;
} report_spec;

static void set_option(void *context, const argument *a) {
    report_spec *s = context;
    if (a->option != NULL && strcmp(a->option, "--tool") == 0)
        s->tool = a->value[0];
    else if (a->option != NULL)
        s->page = a->value[0];
    else if (s->log == NULL)
        s->log = a->value[0];
    else if (s->body == NULL)
        s->body = a->value[0];
    else
        die(EXIT_USAGE, "one log and one blob or scene, not also '%s'", a->value[0]);
}

/* The session again, for what the bodies looked like. */
static void look_again(const report_spec *s, motion *m) {
    replay *r = replay_open(s->log, s->body, s->tool);
    shape *look = shape_open(r->setup, r->scene);
    shape_to_motion(look, m, MOTION_PAGE_BYTES);
    while (replay_next(r)) {
        const double t_s = (double)r->again->hand[0].report.tick / r->setup->file->rate_hz;
        if (motion_wants(m, t_s)) shape_add_frame(look, m, t_s, r->again->tool);
    }
    if (r->end == REPLAY_DIFFERS)
        warn("%s: tick %" PRIu64 ": %s: the bodies are shown up to there", s->log,
             r->recorded->hand[0].report.tick, r->why);
}

int command_report(int argc, char **argv) {
    report_spec s = {.log = NULL};
    args_parse(argc, argv, options, help, set_option, &s);
    if (s.log == NULL || s.page == NULL) die(EXIT_USAGE, "need a log and -o OUT.html (--help)");
    session_record session;
    record_reader *reader = record_open(s.log, &session);
    const scene_file *scene = session.scene;
    run_record r = {
        .hands = scene->devices, .rate_hz = scene->rate_hz, .title = s.log, .from_log = true};
    for (uint32_t h = 0; h < r.hands; h++)
        r.hand[h] = (run_hand){.device_name =
                                   h == 0 && r.hands == 1 ? "as recorded" : scene->device[h].name,
                               .bus_name = scene->device[h].bus,
                               .bus_load = "not in a log"};
    size_t capacity[PALP_SCENE_HANDS] = {0}, events_capacity[PALP_SCENE_HANDS] = {0},
           late_capacity = 0;
    tick_record *t = allocate(1, record_bytes(r.hands));
    for (uint64_t lost; record_next(reader, t, &lost); r.count++) {
        r.late_us = grow(r.late_us, &late_capacity, r.count + 1, sizeof *r.late_us);
        r.late_us[r.count] = t->late_us;
        if (r.count == 0) r.first_s = (double)t->hand[0].report.tick / r.rate_hz;
        for (uint32_t h = 0; h < r.hands; h++) {
            run_hand *of = &r.hand[h];
            of->tick = grow(of->tick, &capacity[h], r.count + 1, sizeof *of->tick);
            of->tick[r.count] = t->hand[h].report;
            of->events = grow(of->events, &events_capacity[h], r.count + 1, sizeof *of->events);
            of->events[r.count] = t->hand[h].events;
        }
        r.bodies = t->bodies;
        for (uint32_t b = 0; b < t->bodies; b++) {
            r.body[b].kind = t->kind[b];
            r.body[b].name = b < scene->bodies ? scene->body[b].name : "";
            run_body_add(&r.body[b], &t->body[b]);
        }
    }
    run_totals totals[PALP_SCENE_HANDS];
    r.totalled = record_totals(reader, totals);
    for (uint32_t h = 0; h < r.hands && r.totalled; h++) r.hand[h].totals = totals[h];
    record_close(reader);
    if (r.count == 0) die(EXIT_WORK, "%s: no tick on record", s.log);
    motion m = {.parts = 0};
    if (s.body != NULL) {
        look_again(&s, &m);
        r.motion = &m;
    }
    output page = open_output(s.page);
    report_html(page.file, &r);
    commit_output(&page);
    return EXIT_SUCCESS;
}
