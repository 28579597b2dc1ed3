/* SPDX-License-Identifier: MIT */
/* port/host/parallel.h where there is one thread: a browser. Results are the same; progress goes to stderr, a
 * line every hundredth, for the page to show. */
#include "port/host/parallel.h"
#include "port/host/util.h"

static struct {
    const char *stage;
    double total, done;
    int shown, quiet;
} progress;

void set_threads(uint32_t count) { (void)count; }

uint32_t thread_count(void) { return 1; }

void parallel_for(size_t items, work_item work, void *context) {
    for (size_t i = 0; i < items; i++) work(context, i);
}

void progress_quiet(int quiet) { progress.quiet = quiet; }

static void show(int percent) {
    if (progress.quiet || percent == progress.shown) return;
    progress.shown = percent;
    fprintf(stderr, "%s %d %%\n", progress.stage, percent);
}

void progress_begin(const char *stage, double total) {
    progress.stage = stage;
    progress.total = total;
    progress.done = 0;
    progress.shown = -1;
    show(0);
}

void progress_add(double amount) {
    progress.done += amount;
    if (progress.total > 0 && progress.done <= progress.total)
        show((int)(100 * progress.done / progress.total));
}

void progress_end(void) { show(100); }
