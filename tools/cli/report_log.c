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
    run_record r = {.rate_hz = (double)session.config.device.drives.rate_hz,
                    .blob_name = s.log,
                    .device_name = "as recorded",
                    .bus_name = session.bus,
                    .bus_load = "not in a log",
                    .from_log = true};
    size_t capacity = 0, late_capacity = 0;
    tick_record *t = allocate(1, sizeof *t);
    for (uint64_t lost; record_next(reader, t, &lost); r.count++) {
        r.tick = grow(r.tick, &capacity, r.count + 1, sizeof *r.tick);
        r.late_us = grow(r.late_us, &late_capacity, r.count + 1, sizeof *r.late_us);
        r.tick[r.count] = t->report;
        r.late_us[r.count] = t->late_us;
    }
    r.totalled = record_totals(reader, &r.totals);
    record_close(reader);
    if (r.count == 0) die(EXIT_WORK, "%s: no tick on record", s.log);
    output page = open_output(s.page);
    report_html(page.file, &r);
    commit_output(&page);
    return EXIT_SUCCESS;
}
