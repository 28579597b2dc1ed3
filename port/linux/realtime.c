/* SPDX-License-Identifier: MIT */
#include "realtime.h"
#include "tools/util.h"
#include <errno.h>
#include <sched.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/utsname.h>
#include <time.h>
#if defined(__SSE2__)
#include <immintrin.h>
#endif

#define NS_PER_S 1000000000ull

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

static void complain(bool strict, const char *what, const char *mend) {
    if (strict) die(EXIT_WORK, "%s: %s", what, mend);
    warn("not real-time: %s: %s", what, mend);
}

void realtime_setup(int cpu, int priority, bool strict) {
    struct utsname name;
    bool wanted = strict || priority > 0;
#if defined(__SSE2__)
    _mm_setcsr(_mm_getcsr() | 0x8040u); /* flush to zero, denormals are zero */
#endif
    if (cpu >= 0) {
        cpu_set_t set;
        CPU_ZERO(&set);
        CPU_SET((unsigned)cpu, &set);
        if (sched_setaffinity(0, sizeof set, &set) != 0)
            die(EXIT_USAGE, "--cpu: processor %d is not there", cpu);
    }
    if (!wanted) return;
    if (uname(&name) == 0 && strstr(name.version, "PREEMPT_RT") == NULL) {
        complain(strict, "the kernel is not PREEMPT_RT", "install linux-image-rt-amd64 or -arm64");
    }
    if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
        complain(strict, "memory cannot be locked",
                 "raise the memlock limit (ulimit -l unlimited)");
    }
    struct sched_param p = {.sched_priority = priority > 0 ? priority : 40};
    if (sched_setscheduler(0, SCHED_FIFO, &p) != 0) {
        complain(strict, "SCHED_FIFO was refused",
                 "raise the rtprio limit or run with CAP_SYS_NICE");
    }
}
