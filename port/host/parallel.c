/* SPDX-License-Identifier: MIT */
#include "port/host/parallel.h"
#include "port/host/util.h"
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <unistd.h>

#define MAX_THREADS 64u

static uint32_t threads_wanted;

void set_threads(uint32_t count) { threads_wanted = count; }

uint32_t thread_count(void) {
    long n = threads_wanted > 0 ? (long)threads_wanted : sysconf(_SC_NPROCESSORS_ONLN);
    if (n < 1) n = 1;
    return n > (long)MAX_THREADS ? MAX_THREADS : (uint32_t)n;
}

typedef struct {
    work_item work;
    void *context;
    size_t items;
    atomic_size_t next;
} job;

static void *run_job(void *argument) {
    job *j = argument;
    for (;;) {
        size_t item = atomic_fetch_add(&j->next, 1);
        if (item >= j->items) return NULL;
        j->work(j->context, item);
    }
}

void parallel_for(size_t items, work_item work, void *context) {
    pthread_t thread[MAX_THREADS];
    job j = {.work = work, .context = context, .items = items};
    uint32_t wanted = thread_count();
    uint32_t helpers = 0;
    while (helpers + 1 < wanted && helpers + 1 < items) {
        if (pthread_create(&thread[helpers], NULL, run_job, &j) != 0) break;
        helpers++;
    }
    run_job(&j);
    for (uint32_t i = 0; i < helpers; i++) pthread_join(thread[i], NULL);
}

static struct {
    pthread_mutex_t lock;
    const char *stage;
    double total, done, start, shown, next_mark;
    int quiet;
} progress = {.lock = PTHREAD_MUTEX_INITIALIZER};

void progress_quiet(int quiet) { progress.quiet = quiet; }

void progress_begin(const char *stage, double total) {
    pthread_mutex_lock(&progress.lock);
    progress.stage = stage;
    progress.total = total;
    progress.done = 0;
    progress.start = progress.shown = now_s();
    progress.next_mark = 0.1;
    pthread_mutex_unlock(&progress.lock);
}

void progress_add(double amount) {
    pthread_mutex_lock(&progress.lock);
    if (progress.stage == NULL || !(progress.total > 0)) { /* no stage, or one of unknown length */
        pthread_mutex_unlock(&progress.lock);
        return;
    }
    progress.done += amount;
    double fraction = fmin(progress.done / progress.total, 1);
    double t = now_s();
    double left = fraction < 1 ? (t - progress.start) * (1 / fraction - 1) : 0;
    if (!progress.quiet && isatty(2)) {
        if (t - progress.shown > 0.1) {
            fprintf(stderr, "\r%-28s %3.0f %%  %.0f s left  ", progress.stage, 100 * fraction,
                    left);
            progress.shown = t;
        }
    } else if (!progress.quiet && fraction >= progress.next_mark && t - progress.start > 5) {
        fprintf(stderr, "%s: %.0f %%, %.0f s left\n", progress.stage, 100 * fraction, left);
        progress.next_mark = 0.1 * (floor(10 * fraction) + 1);
    }
    pthread_mutex_unlock(&progress.lock);
}

void progress_end(void) {
    pthread_mutex_lock(&progress.lock);
    double seconds = now_s() - progress.start;
    if (!progress.quiet && seconds >= 0.1) {
        fprintf(stderr, "%s%-28s %.1f s\n", isatty(2) ? "\r" : "", progress.stage, seconds);
    }
    progress.stage = NULL;
    pthread_mutex_unlock(&progress.lock);
}
