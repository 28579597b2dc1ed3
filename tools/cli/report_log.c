/* SPDX-License-Identifier: MIT */
/* palp report: the page of a run, from its log. */
#include "port/host/record.h"
#include "port/host/report.h"
#include "port/host/args.h"
#include "tools/cli/commands.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

static const char help[] = "usage: palp report LOG -o OUT.html\n"
                           "\n"
                           "Draws a session that 'palpd --log LOG' has recorded: force, latency, "
                           "energy and levels over time.\n"
                           "How well contacts were settled and the picture of the body are not in "
                           "a log: palpd --report has them.\n";

static const option options[] = {{"-o", 1}, {NULL, 0}};

typedef struct {
    const char *log, *page;
} report_spec;

static void set_option(void *context, const argument *a) {
    report_spec *s = context;
    if (a->option != NULL)
        s->page = a->value[0];
    else if (s->log == NULL)
        s->log = a->value[0];
    else
        die(EXIT_USAGE, "one log, not also '%s'", a->value[0]);
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
    size_t capacity[PALP_SCENE_HANDS] = {0}, late_capacity = 0;
    tick_record *t = allocate(1, record_bytes(r.hands));
    for (uint64_t lost; record_next(reader, t, &lost); r.count++) {
        r.late_us = grow(r.late_us, &late_capacity, r.count + 1, sizeof *r.late_us);
        r.late_us[r.count] = t->late_us;
        for (uint32_t h = 0; h < r.hands; h++) {
            run_hand *of = &r.hand[h];
            of->tick = grow(of->tick, &capacity[h], r.count + 1, sizeof *of->tick);
            of->tick[r.count] = t->hand[h].report;
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
    output page = open_output(s.page);
    report_html(page.file, &r);
    commit_output(&page);
    return EXIT_SUCCESS;
}
