/* SPDX-License-Identifier: MIT */
/* What palpd says at its start of a system that is not ready: on made-up trees of /proc and /sys. */
#include "port/linux/startup.h"
#include "tests/tap.h"
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

static char root[] = "/tmp/palp-startup-XXXXXX";
static char said[8192];

static void put(const char *path, const char *text) {
    char whole[512];
    snprintf(whole, sizeof whole, "%s%s", root, path);
    for (char *p = whole + strlen(root) + 1; (p = strchr(p, '/')) != NULL; p++) {
        *p = '\0';
        if (mkdir(whole, 0755) != 0 && errno != EEXIST) abort();
        *p = '/';
    }
    FILE *f = fopen(whole, "w");
    if (f == NULL) abort();
    fprintf(f, "%s\n", text);
    fclose(f);
}

static void note(void *context, const char *what, const char *mend) {
    const size_t used = strlen(said);
    (void)context;
    snprintf(said + used, sizeof said - used, "%s%s: %s", used > 0 ? "; " : "", what, mend);
}

static uint32_t look(const startup_spec *s) {
    said[0] = '\0';
    return startup_check(s, note, NULL);
}

static void good_system(void) {
    put("/sys/kernel/realtime", "1");
    put("/sys/kernel/mm/transparent_hugepage/enabled", "always [madvise] never");
    put("/proc/sys/kernel/sched_rt_runtime_us", "950000");
    put("/proc/self/cgroup", "0::/system.slice/palpd.service");
    put("/sys/devices/system/cpu/isolated", "2-3");
    put("/sys/devices/system/cpu/cpu3/topology/thread_siblings_list", "3");
    put("/sys/devices/system/cpu/cpu3/cpufreq/scaling_governor", "performance");
    put("/sys/devices/system/cpu/cpu3/cpufreq/cpuinfo_max_freq", "1500000");
    put("/sys/devices/system/cpu/cpu3/cpufreq/scaling_max_freq", "1500000");
    put("/sys/devices/system/clocksource/clocksource0/current_clocksource", "arch_sys_counter");
    put("/proc/interrupts",
        "           CPU0       CPU3\n 41:  12  900  GICv2  spi0  can0\n"
        " 42:  12  7  GICv2  eth0\n 43:  12  0  GICv2  eth1\nIPI0:  1  2  Rescheduling");
    put("/proc/irq/41/effective_affinity_list", "3");
    put("/proc/irq/42/effective_affinity_list", "0-1");
    put("/proc/irq/43/effective_affinity_list", "3"); /* which never came */
    put("/proc/77/comm", "irq/41-can0");
    put("/proc/77/stat",
        "77 (irq/41-can0) S 2 0 0 0 -1 2129984 0 0 0 0 0 0 0 0 -86 0 1 0 80 0 0 0 0 0 0 "
        "0 0 0 0 0 0 0 0 0 0 3 85 1 0 0 0");
    put("/sys/class/net/can0/device/uevent", "DRIVER=mcp251xfd");
    put("/sys/class/net/can0/tx_queue_len", "32");
    put("/sys/class/net/can0/threaded", "1");
}

static const startup_spec controller = {
    .root = root, .cpu = 3, .priority = 45, .bus = {"can0"}, .buses = 1, .frames = {11}};

/* One thing is wrong: it alone is said, with a remedy. */
static void expect(const char *path, const char *text, const char *what, const char *mend) {
    put(path, text);
    const uint32_t n = look(&controller);
    CHECK(n == 1 && strstr(said, what) != NULL && strstr(said, mend) != NULL, "%s: %u said: %s",
          path, n, said);
    good_system();
}

int main(void) {
    if (mkdtemp(root) == NULL) return 1;
    good_system();
    CHECK(look(&controller) == 0, "nothing is said of a system that is ready%s", said);
    expect("/sys/kernel/realtime", "0", "PREEMPT_RT", "linux-image-rt");
    expect("/sys/kernel/mm/transparent_hugepage/enabled", "[always] madvise never", "huge pages",
           "madvise");
    expect("/proc/sys/kernel/sched_rt_runtime_us", "100000", "100000 us", "sysctl");
    expect("/sys/devices/system/cpu/isolated", "1", "processor 3", "isolcpus");
    expect("/sys/devices/system/cpu/cpu3/topology/thread_siblings_list", "1,3", "processor 1",
           "nosmt");
    expect("/sys/devices/system/cpu/cpu3/cpufreq/scaling_governor", "ondemand", "ondemand",
           "cpupower");
    expect("/sys/devices/system/clocksource/clocksource0/current_clocksource", "hpet", "hpet",
           "tsc=reliable");
    expect("/proc/irq/42/effective_affinity_list", "0-3", "42, eth0", "irqaffinity");
    expect("/sys/class/net/can0/tx_queue_len", "10", "queues 10 frames", "txqueuelen 32");
    expect("/sys/class/net/can0/tx_queue_len", "1000", "too old", "txqueuelen 32");
    put("/sys/kernel/realtime", "0"); /* else receiving runs in the interrupt's own thread */
    put("/sys/class/net/can0/threaded", "0");
    CHECK(look(&controller) == 2 && strstr(said, "soft interrupt") != NULL,
          "receiving without a thread: %s", said);
    good_system();
    put("/proc/interrupts", "           CPU0       CPU3\n 41:  12  900  GICv2  can01\n");
    CHECK(look(&controller) == 1 && strstr(said, "41, can01") != NULL,
          "another interface whose name begins alike: %s", said);
    good_system();
    expect("/proc/77/stat",
           "77 (irq/41-can0) S 2 0 0 0 -1 2129984 0 0 0 0 0 0 0 0 -41 0 1 0 80 0 0 0 0 0 0 "
           "0 0 0 0 0 0 0 0 0 0 3 40 1 0 0 0",
           "has priority 40, the loop 45", "chrt");
    put("/sys/devices/system/cpu/cpu3/cpufreq/scaling_max_freq", "1200000");
    CHECK(look(&controller) == 1 && strstr(said, "1.2 of 1.5 GHz") != NULL, "a limited clock: %s",
          said);
    good_system();
    put("/proc/self/cgroup", "4:cpu,cpuacct:/hands\n0::/");
    put("/sys/fs/cgroup/cpu/hands/cpu.rt_runtime_us", "0");
    CHECK(look(&controller) == 1 && strstr(said, "'/hands' has no time") != NULL,
          "a control group without real time: %s", said);
    good_system();

    startup_spec any = controller;
    any.cpu = -1;
    put("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance");
    CHECK(look(&any) == 1 && strstr(said, "--cpu N") != NULL, "no processor chosen: %s", said);

    const startup_spec nowhere = {
        .root = "/nonexistent", .cpu = 0, .priority = 45, .bus = {"can0"}, .buses = 1};
    CHECK(look(&nowhere) <= 1, "what cannot be read is not complained of: %s", said);
    CHECK(startup_list_has("0,2-3", 3) && startup_list_has("7", 7) &&
              !startup_list_has("0,2-3", 1) && !startup_list_has("", 0) &&
              !startup_list_has("x", 0),
          "lists of processors");
    char remove_all[64];
    snprintf(remove_all, sizeof remove_all, "rm -rf %s", root);
    return system(remove_all) == 0 ? tap_done() : 1;
}
