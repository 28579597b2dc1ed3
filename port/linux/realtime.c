/* SPDX-License-Identifier: MIT */
#include "port/linux/realtime.h"
#include "port/host/util.h"
#include <errno.h>
#include <fcntl.h>
#include <sched.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#define NS_PER_S 1000000000ull
#define STACK_BYTES (512u * 1024u)
#define TOUCHED_BYTES (256u * 1024u)
#define STRICT_PRIORITY 40 /* where none is asked for */

uint64_t monotonic_ns(void *context) {
    struct timespec t;
    (void)context;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (uint64_t)t.tv_sec * NS_PER_S + (uint64_t)t.tv_nsec;
}

uint64_t sleep_until(uint64_t deadline_ns) {
    struct timespec t = {.tv_sec = (time_t)(deadline_ns / NS_PER_S),
                         .tv_nsec = (long)(deadline_ns % NS_PER_S)};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL) == EINTR) continue;
    uint64_t now = monotonic_ns(NULL);
    return now > deadline_ns ? now - deadline_ns : 0;
}

static int priority_of(const realtime_spec *s) {
    return s->priority > 0 ? s->priority : s->strict ? STRICT_PRIORITY : 0;
}

static void complain(bool strict, const char *what, const char *mend) {
    if (strict) die(EXIT_WORK, "not real-time: %s: %s", what, mend);
    warn("not real-time: %s: %s", what, mend);
}

/* What a process needs the right to. */
static void check_rights(const realtime_spec *s) {
    struct rlimit r;
    const bool root = geteuid() == 0;
    if (!root && getrlimit(RLIMIT_RTPRIO, &r) == 0 && r.rlim_cur < (rlim_t)s->priority)
        complain(s->strict, "the rtprio limit is below --priority",
                 "add 'USER - rtprio 90' to /etc/security/limits.conf, or use the systemd unit");
    if (!root && getrlimit(RLIMIT_MEMLOCK, &r) == 0 && r.rlim_cur != RLIM_INFINITY)
        complain(s->strict, "locked memory is limited",
                 "add 'USER - memlock unlimited' to /etc/security/limits.conf");
    /* The file must stay open: the request ends with it. */
    int latency = open("/dev/cpu_dma_latency", O_WRONLY | O_CLOEXEC);
    const int32_t none = 0;
    if (latency < 0 || write(latency, &none, sizeof none) != (ssize_t)sizeof none)
        complain(s->strict, "deep processor sleep cannot be switched off",
                 "give access to /dev/cpu_dma_latency, or boot with intel_idle.max_cstate=1 (x86)");
    if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0)
        complain(s->strict, "memory cannot be locked",
                 "raise the memlock limit (ulimit -l unlimited)");
}

static void say_missing(void *context, const char *what, const char *mend) {
    (void)context;
    warn("not real-time: %s: %s", what, mend);
}

void realtime_prepare(const realtime_spec *spec) {
    if (!spec->strict && spec->priority == 0) {
        if (spec->buses > 0)
            warn("without --priority N the loop is an ordinary task, and nothing about its timing "
                 "is guaranteed: --priority 45 --cpu N on a controller (CONTROLLER.md)");
        return;
    }
    startup_spec place = {
        .root = "", .cpu = spec->cpu, .priority = priority_of(spec), .buses = spec->buses};
    for (uint32_t b = 0; b < spec->buses; b++) {
        place.bus[b] = spec->bus[b];
        place.frames[b] = spec->frames[b];
    }
    const uint32_t missing = startup_check(&place, say_missing, NULL);
    if (spec->strict && missing > 0)
        die(EXIT_WORK, "--strict-rt: %u of what real time needs is missing", missing);
    check_rights(spec);
}

typedef struct {
    const char *name;
    void *(*body)(void *);
    void *context;
} started;

/* Touches the stack that the loop will use, so that it never faults. */
static __attribute__((noinline)) void touch_stack(void) {
    volatile char page[TOUCHED_BYTES];
    for (size_t i = 0; i < sizeof page; i += 1024) page[i] = 0;
    (void)page[0];
}

static void *enter(void *context) {
    started *s = context;
    pthread_setname_np(pthread_self(), s->name);
    touch_stack();
    return s->body(s->context);
}

pthread_t realtime_start(const realtime_spec *spec, const char *name, void *(*body)(void *),
                         void *context) {
    pthread_t thread;
    pthread_attr_t a;
    int priority = priority_of(spec);
    started *s = allocate(1, sizeof *s); /* lives as long as the thread */
    *s = (started){name, body, context};
    pthread_attr_init(&a);
    pthread_attr_setstacksize(&a, STACK_BYTES);
    if (spec->cpu >= 0) {
        cpu_set_t set;
        CPU_ZERO(&set);
        CPU_SET((unsigned)spec->cpu, &set);
        if (spec->cpu >= sysconf(_SC_NPROCESSORS_CONF) ||
            pthread_attr_setaffinity_np(&a, sizeof set, &set) != 0)
            die(EXIT_USAGE, "--cpu: processor %d is not there", spec->cpu);
    }
    if (priority > 0) {
        struct sched_param p = {.sched_priority = priority};
        pthread_attr_setinheritsched(&a, PTHREAD_EXPLICIT_SCHED);
        pthread_attr_setschedpolicy(&a, SCHED_FIFO);
        pthread_attr_setschedparam(&a, &p);
    }
    int error = pthread_create(&thread, &a, enter, s);
    if (error == EPERM && priority > 0) {
        complain(spec->strict, "SCHED_FIFO was refused",
                 "raise the rtprio limit or run with CAP_SYS_NICE");
        pthread_attr_setinheritsched(&a, PTHREAD_INHERIT_SCHED);
        error = pthread_create(&thread, &a, enter, s);
    }
    if (error == EINVAL && spec->cpu >= 0)
        die(EXIT_USAGE, "--cpu: processor %d is not there", spec->cpu);
    if (error != 0) die(EXIT_WORK, "cannot start the real-time thread: %s", strerror(error));
    pthread_attr_destroy(&a);
    return thread;
}

uint64_t minor_faults(void) {
    struct rusage r;
    return getrusage(RUSAGE_THREAD, &r) == 0 ? (uint64_t)r.ru_minflt : 0;
}
