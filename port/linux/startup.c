/* SPDX-License-Identifier: MIT */
#include "port/linux/startup.h"
#include <ctype.h>
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
    size_t used = (size_t)snprintf(whole, sizeof whole, "%s", c->spec->root);
    used = used < sizeof whole ? used : sizeof whole - 1u;
    va_start(values, path);
    vsnprintf(whole + used, sizeof whole - used, path, values);
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

static bool is_realtime(const checks *c) {
    struct utsname name;
    char text[LINE];
    if (read_line(c, text, "/sys/kernel/realtime")) return text[0] == '1';
    return uname(&name) == 0 && strstr(name.version, "PREEMPT_RT") != NULL;
}

static void check_kernel(checks *c) {
    char text[LINE];
    if (!is_realtime(c))
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
            "real-time tasks are throttled after %ld us of a period of real-time scheduling",
            atol(text));
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
    char text[LINE], most[LINE];
    if (read_line(c, text, "/sys/devices/system/cpu/cpu%u/cpufreq/scaling_governor", cpu) &&
        strcmp(text, "performance") != 0)
        say(c, "cpupower frequency-set -g performance",
            "the clock of processor %u follows its load (governor '%s')", cpu, text);
    if (read_line(c, text, "/sys/devices/system/cpu/cpu%u/cpufreq/cpuinfo_max_freq", cpu) &&
        read_line(c, most, "/sys/devices/system/cpu/cpu%u/cpufreq/scaling_max_freq", cpu) &&
        atol(most) < atol(text))
        say(c, "cpupower frequency-set -u MAX, or find what set the limit",
            "processor %u is held at %.3g of %.3g GHz", cpu, 1e-6 * atof(most), 1e-6 * atof(text));
    if (read_line(c, text, "/sys/devices/system/clocksource/clocksource0/current_clocksource") &&
        (strcmp(text, "acpi_pm") == 0 || strcmp(text, "hpet") == 0 || strcmp(text, "jiffies") == 0))
        say(c, "boot with tsc=reliable", "the clock source '%s' is slow to read", text);
}

/* ---- interrupts ---- */

/* Whether a text has a name in it as a whole word. */
static bool has_name(const char *text, const char *name) {
    const size_t length = strlen(name);
    for (const char *p = text; length > 0 && (p = strstr(p, name)) != NULL; p++) {
        const bool before = p == text || !isalnum((unsigned char)p[-1]);
        if (before && !isalnum((unsigned char)p[length])) return true;
    }
    return false;
}

/* Whether a line of /proc/interrupts, or a thread's name, is of one of the buses: by the
 * interface's name, or by that of its device (an SPI controller's interrupt is 'spi0.0'). */
static bool is_of_bus(const checks *c, const char *line) {
    for (uint32_t b = 0; b < c->spec->buses; b++) {
        char path[LINE], device[LINE];
        if (has_name(line, c->spec->bus[b])) return true;
        snprintf(path, sizeof path, "%s/sys/class/net/%s/device", c->spec->root, c->spec->bus[b]);
        const ssize_t n = readlink(path, device, sizeof device - 1u);
        if (n <= 0) continue;
        device[n] = '\0';
        const char *last = strrchr(device, '/');
        if (has_name(line, last != NULL ? last + 1 : device)) return true;
    }
    return false;
}

/* Which column of /proc/interrupts is a processor's; -1: none. */
static int column_of(const char *head, int cpu) {
    char name[16];
    int column = 0;
    snprintf(name, sizeof name, "CPU%d", cpu);
    for (const char *p = head; *p != '\0'; column++) {
        p += strspn(p, " \n");
        const size_t length = strcspn(p, " \n");
        if (length == strlen(name) && strncmp(p, name, length) == 0) return column;
        p += length;
    }
    return -1;
}

/* How often an interrupt came to the processor of a column. */
static unsigned long came(const char *counts, int column) {
    char *end = (char *)(uintptr_t)counts;
    unsigned long n = 0;
    for (int k = 0; k <= column; k++) n = strtoul(end, &end, 10);
    return n;
}

/* Interrupts other than the buses' that have come to the loop's processor, and still would. */
static void check_interrupts(checks *c) {
    char path[LINE], text[LINE], first[64] = "";
    uint32_t others = 0;
    if (c->spec->cpu < 0) return;
    snprintf(path, sizeof path, "%s/proc/interrupts", c->spec->root);
    FILE *f = fopen(path, "r");
    char *line = NULL;
    size_t room = 0;
    const bool head = f != NULL && getline(&line, &room, f) > 0;
    const int column = head ? column_of(line, c->spec->cpu) : -1;
    while (column >= 0 && getline(&line, &room, f) > 0) {
        char *end;
        const unsigned long number = strtoul(line, &end, 10);
        if (*end != ':' || came(end + 1, column) == 0 || is_of_bus(c, line)) continue;
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
            "boot with irqaffinity= of the other processors and isolcpus=managed_irq,domain,N, or "
            "write these to /proc/irq/N/smp_affinity_list",
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

static void check_bus(checks *c, const char *bus, uint32_t frames) {
    char text[LINE];
    if (!read_line(c, text, "/sys/class/net/%s/device/uevent", bus))
        return; /* one without hardware keeps nothing waiting */
    if (read_line(c, text, "/sys/class/net/%s/tx_queue_len", bus)) {
        const long room = atol(text);
        if (room < (long)frames)
            say(c, "ip link set CAN txqueuelen 32, or more",
                "%s queues %ld frames, and a tick may send %u", bus, room, frames);
        if (room > LONG_QUEUE)
            say(c, "ip link set CAN txqueuelen 32",
                "%s queues %ld frames: behind so many, torques are too old when they are sent", bus,
                room);
    }
    if (c->spec->root[0] == '\0' && discipline_of(bus, text) && strncmp(text, "pfifo", 5) != 0 &&
        strcmp(text, "noqueue") != 0)
        say(c, "tc qdisc replace dev CAN root pfifo_fast",
            "%s sends by '%s', which may delay or drop frames", bus, text);
    if (c->spec->priority > 0 && !is_realtime(c) &&
        read_line(c, text, "/sys/class/net/%s/threaded", bus) && text[0] == '0')
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
    for (uint32_t b = 0; b < spec->buses; b++) check_bus(&c, spec->bus[b], spec->frames[b]);
    return c.count;
}
