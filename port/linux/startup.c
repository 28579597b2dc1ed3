/* SPDX-License-Identifier: MIT */
#include "port/linux/startup.h"
#include <dirent.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/utsname.h>
#include <unistd.h>

#define LONG_QUEUE 256 /* frames: what waits behind so many is too old to act on */
#define LINE 256

typedef struct {
    const startup_spec *spec;
    startup_say *say;
    void *context;
    uint32_t count;
} checks;

__attribute__((format(printf, 3, 4))) static void say(checks *c, const char *mend, const char *what,
                                                      ...) {
    char text[LINE];
    va_list values;
    va_start(values, what);
    vsnprintf(text, sizeof text, what, values);
    va_end(values);
    c->say(c->context, text, mend);
    c->count++;
}

/* First line of a file under the root; false where there is none. */
__attribute__((format(printf, 3, 4))) static bool read_line(const checks *c, char text[LINE],
                                                            const char *path, ...) {
    char whole[LINE];
    va_list values;
    int used = snprintf(whole, sizeof whole, "%s", c->spec->root);
    va_start(values, path);
    vsnprintf(whole + used, sizeof whole - (size_t)used, path, values);
    va_end(values);
    FILE *f = fopen(whole, "r");
    const bool good = f != NULL && fgets(text, LINE, f) != NULL;
    if (f != NULL) fclose(f);
    if (good) text[strcspn(text, "\n")] = '\0';
    return good;
}

int startup_list_has(const char *list, uint32_t number) {
    for (const char *p = list; *p >= '0' && *p <= '9';) {
        char *end;
        const unsigned long first = strtoul(p, &end, 10);
        unsigned long last = first;
        if (*end == '-') last = strtoul(end + 1, &end, 10);
        if (number >= first && number <= last) return 1;
        p = *end == ',' ? end + 1 : end;
    }
    return 0;
}

/* ---- the system ---- */

static void check_kernel(checks *c) {
    struct utsname name;
    char text[LINE];
    const bool flag = read_line(c, text, "/sys/kernel/realtime") && text[0] == '1';
    const bool named = uname(&name) == 0 && strstr(name.version, "PREEMPT_RT") != NULL;
    if (!flag && !named)
        say(c, "install linux-image-rt-amd64 or -rt-arm64", "the kernel is not PREEMPT_RT");
    if (read_line(c, text, "/sys/kernel/mm/transparent_hugepage/enabled") &&
        strstr(text, "[always]") != NULL)
        say(c, "echo madvise > /sys/kernel/mm/transparent_hugepage/enabled",
            "huge pages are collected behind every task's back (THP always)");
}

/* The control group of this process in the hierarchy of an older kernel; "" for its root. */
static bool group_of(const checks *c, char path[LINE]) {
    char whole[LINE], line[LINE];
    snprintf(whole, sizeof whole, "%s/proc/self/cgroup", c->spec->root);
    FILE *f = fopen(whole, "r");
    bool found = false;
    while (f != NULL && !found && fgets(line, sizeof line, f) != NULL) {
        char *by = strchr(line, ':'), *at = by != NULL ? strchr(by + 1, ':') : NULL;
        if (at == NULL) continue;
        *at = '\0';
        line[LINE - 1] = '\0';
        at[1 + strcspn(at + 1, "\n")] = '\0';
        for (char *one = strtok(by + 1, ","); one != NULL; one = strtok(NULL, ","))
            found = found || strcmp(one, "cpu") == 0;
        if (found) snprintf(path, LINE, "%s", strcmp(at + 1, "/") == 0 ? "" : at + 1);
    }
    if (f != NULL) fclose(f);
    return found;
}

static void check_scheduling(checks *c) {
    char text[LINE], group[LINE];
    if (read_line(c, text, "/proc/sys/kernel/sched_rt_runtime_us") && atol(text) >= 0 &&
        atol(text) < 950000)
        say(c, "sysctl kernel.sched_rt_runtime_us=950000, or -1",
            "real-time tasks are throttled after %ld us of every second", atol(text));
    if (group_of(c, group) && read_line(c, text, "/sys/fs/cgroup/cpu%s/cpu.rt_runtime_us", group) &&
        atol(text) == 0)
        say(c, "give the control group cpu.rt_runtime_us, or a kernel without RT_GROUP_SCHED",
            "the control group '%s' has no time for real-time tasks", group);
}

/* ---- the processor ---- */

static void check_isolation(checks *c) {
    char text[LINE];
    if (c->spec->cpu < 0) {
        say(c, "--cpu N, of a processor that the kernel keeps free (isolcpus=N)",
            "the loop may be moved from one processor to another");
        return;
    }
    const uint32_t cpu = (uint32_t)c->spec->cpu;
    if (read_line(c, text, "/sys/devices/system/cpu/isolated") && !startup_list_has(text, cpu))
        say(c, "boot with isolcpus=N nohz_full=N rcu_nocbs=N",
            "other tasks may run on processor %u", cpu);
    if (read_line(c, text, "/sys/devices/system/cpu/cpu%u/topology/thread_siblings_list", cpu)) {
        for (uint32_t other = 0; other < 1024u; other++) {
            if (other == cpu || !startup_list_has(text, other)) continue;
            say(c, "boot with nosmt, or echo 0 > /sys/devices/system/cpu/cpuN/online",
                "processor %u shares its core with processor %u", cpu, other);
        }
    }
}

static void check_frequency(checks *c) {
    const uint32_t cpu = c->spec->cpu > 0 ? (uint32_t)c->spec->cpu : 0u;
    char text[LINE], least[LINE], most[LINE];
    if (read_line(c, text, "/sys/devices/system/cpu/cpu%u/cpufreq/scaling_governor", cpu) &&
        strcmp(text, "performance") != 0)
        say(c, "cpupower frequency-set -g performance",
            "the clock governor of processor %u is '%s'", cpu, text);
    if (read_line(c, text, "/sys/devices/system/cpu/cpu%u/cpufreq/cpuinfo_max_freq", cpu) &&
        read_line(c, most, "/sys/devices/system/cpu/cpu%u/cpufreq/scaling_max_freq", cpu) &&
        read_line(c, least, "/sys/devices/system/cpu/cpu%u/cpufreq/scaling_min_freq", cpu)) {
        if (atol(most) < atol(text))
            say(c, "cpupower frequency-set -u MAX, or find what set the limit",
                "processor %u is held at %.3g of %.3g GHz", cpu, 1e-6 * atof(most),
                1e-6 * atof(text));
        if (atol(least) < atol(most))
            say(c, "cpupower frequency-set -d MAX",
                "the clock of processor %u may fall from %.3g to %.3g GHz", cpu, 1e-6 * atof(most),
                1e-6 * atof(least));
    }
    if (read_line(c, text, "/sys/devices/system/clocksource/clocksource0/current_clocksource") &&
        (strcmp(text, "acpi_pm") == 0 || strcmp(text, "hpet") == 0 || strcmp(text, "jiffies") == 0))
        say(c, "boot with tsc=reliable", "the clock source '%s' is slow to read", text);
}

/* ---- interrupts ---- */

/* Whether the interrupt's line of /proc/interrupts names one of the buses. */
static bool is_of_bus(const checks *c, const char *line) {
    for (uint32_t b = 0; b < c->spec->buses; b++) {
        if (strstr(line, c->spec->bus[b]) != NULL) return true;
    }
    return false;
}

/* Interrupts other than the buses' that come to the loop's processor. */
static void check_interrupts(checks *c) {
    char path[LINE], text[LINE], first[64] = "";
    uint32_t others = 0;
    if (c->spec->cpu < 0) return;
    snprintf(path, sizeof path, "%s/proc/interrupts", c->spec->root);
    FILE *f = fopen(path, "r");
    char *line = NULL;
    size_t room = 0;
    while (f != NULL && getline(&line, &room, f) > 0) {
        char *end;
        const unsigned long number = strtoul(line, &end, 10);
        if (*end != ':' || is_of_bus(c, line)) continue;
        if (!read_line(c, text, "/proc/irq/%lu/effective_affinity_list", number) ||
            !startup_list_has(text, (uint32_t)c->spec->cpu))
            continue;
        if (others++ > 0) continue;
        char *name = end + strlen(end);
        while (name > end && (name[-1] == '\n' || name[-1] == ' ')) *--name = '\0';
        while (name > end && name[-1] != ' ') name--;
        snprintf(first, sizeof first, "%lu, %.40s", number, name);
    }
    free(line);
    if (f != NULL) fclose(f);
    if (others > 0)
        say(c,
            "boot with irqaffinity= of the other processors, or write these to "
            "/proc/irq/N/smp_affinity_list",
            "%u interrupts come to processor %d (the first: %s)", others, c->spec->cpu, first);
}

/* Threads that carry a bus's interrupts and frames, irq/N-can0 and napi/can0-N: those that the loop
 * would keep waiting. */
static void check_threads(checks *c) {
    char path[LINE], text[LINE], name[LINE];
    snprintf(path, sizeof path, "%s/proc", c->spec->root);
    DIR *all = c->spec->priority > 0 ? opendir(path) : NULL;
    const struct dirent *one;
    while (all != NULL && (one = readdir(all)) != NULL) {
        const unsigned long pid = strtoul(one->d_name, NULL, 10);
        if (pid == 0 || !read_line(c, name, "/proc/%lu/comm", pid) ||
            (strncmp(name, "irq/", 4) != 0 && strncmp(name, "napi/", 5) != 0) ||
            !is_of_bus(c, name) || !read_line(c, text, "/proc/%lu/stat", pid))
            continue;
        /* rt_priority: the 38th field after the name in parentheses */
        const char *p = strrchr(text, ')');
        for (int k = 0; p != NULL && k < 38; k++) p = strchr(p + 1, ' ');
        const long priority = p != NULL ? atol(p) : 0;
        if (priority > c->spec->priority) continue;
        say(c, "chrt -f -p 85 PID, or a lower --priority",
            "frames wait for the loop: %s (PID %lu) has priority %ld, the loop %d", name, pid,
            priority, c->spec->priority);
    }
    if (all != NULL) closedir(all);
}

/* ---- interfaces ---- */

/* The queueing discipline of an interface, by rtnetlink; false where the kernel does not tell. */
static bool discipline_of(const char *bus, char name[LINE]) {
    struct {
        struct nlmsghdr head;
        struct ifinfomsg link;
    } ask = {
        .head = {.nlmsg_len = sizeof ask, .nlmsg_type = RTM_GETLINK, .nlmsg_flags = NLM_F_REQUEST},
        .link = {.ifi_family = AF_UNSPEC, .ifi_index = (int)if_nametoindex(bus)}};
    _Alignas(struct nlmsghdr) char answer[16384];
    if (ask.link.ifi_index == 0) return false;
    const int fd = socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_ROUTE);
    if (fd < 0) return false;
    const struct timeval patience = {.tv_sec = 1};
    (void)setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    const bool asked = send(fd, &ask, sizeof ask, 0) == (ssize_t)sizeof ask;
    const ssize_t got = asked ? recv(fd, answer, sizeof answer, 0) : -1;
    close(fd);
    const struct nlmsghdr *head = (const struct nlmsghdr *)(const void *)answer;
    if (got < (ssize_t)NLMSG_LENGTH(sizeof(struct ifinfomsg)) || head->nlmsg_type != RTM_NEWLINK ||
        head->nlmsg_len > (size_t)got)
        return false;
    const char *at = (const char *)head + NLMSG_LENGTH(sizeof(struct ifinfomsg));
    const char *end = answer + head->nlmsg_len;
    struct rtattr a;
    while ((size_t)(end - at) >= sizeof a) {
        memcpy(&a, at, sizeof a);
        if (a.rta_len < sizeof a || a.rta_len > (size_t)(end - at)) return false;
        if (a.rta_type == IFLA_QDISC) {
            snprintf(name, LINE, "%.*s", (int)(a.rta_len - sizeof a), at + sizeof a);
            return true;
        }
        const size_t step = RTA_ALIGN((size_t)a.rta_len);
        at += step < (size_t)(end - at) ? step : (size_t)(end - at);
    }
    return false;
}

static void check_bus(checks *c, const char *bus) {
    char text[LINE];
    if (!read_line(c, text, "/sys/class/net/%s/device/uevent", bus))
        return; /* one without hardware keeps nothing waiting */
    if (read_line(c, text, "/sys/class/net/%s/tx_queue_len", bus)) {
        const long room = atol(text);
        if (room < (long)c->spec->frames)
            say(c, "ip link set CAN txqueuelen 32", "%s queues %ld frames, and a tick sends %u",
                bus, room, c->spec->frames);
        if (room > LONG_QUEUE)
            say(c, "ip link set CAN txqueuelen 32",
                "%s queues %ld frames: behind so many, torques are too old when they are sent", bus,
                room);
    }
    if (c->spec->root[0] == '\0' && discipline_of(bus, text) && strncmp(text, "pfifo", 5) != 0 &&
        strcmp(text, "noqueue") != 0)
        say(c, "tc qdisc replace dev CAN root pfifo_fast",
            "%s sends by '%s', which may delay or drop frames", bus, text);
    if (c->spec->priority > 0 && read_line(c, text, "/sys/class/net/%s/threaded", bus) &&
        text[0] == '0')
        say(c, "echo 1 > /sys/class/net/CAN/threaded; chrt -f -p 85 $(pgrep napi/CAN)",
            "frames of %s are received in a soft interrupt, behind ordinary tasks", bus);
}

uint32_t startup_check(const startup_spec *spec, startup_say *to, void *context) {
    checks c = {.spec = spec, .say = to, .context = context};
    check_kernel(&c);
    check_scheduling(&c);
    check_isolation(&c);
    check_frequency(&c);
    check_interrupts(&c);
    check_threads(&c);
    for (uint32_t b = 0; b < spec->buses; b++) check_bus(&c, spec->bus[b]);
    return c.count;
}
