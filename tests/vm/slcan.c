/* SPDX-License-Identifier: MIT */
/*
 * slcan INTERFACE: a serial-line CAN adapter, played on a pseudo terminal. The kernel's slcan
 * driver sits on the terminal's other end, and what it sends goes to INTERFACE and back. SIGUSR1
 * makes the adapter report error-passive, SIGUSR2 bus-off (nothing passes from then), SIGHUP
 * error-active.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <linux/tty.h>
#include <net/if.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

static volatile sig_atomic_t pending;
static void on_signal(int number) { pending = number; }

static int die(const char *what) {
    perror(what);
    exit(1);
}

static int open_can(const char *name) {
    struct sockaddr_can a = {.can_family = AF_CAN, .can_ifindex = (int)if_nametoindex(name)};
    int fd = socket(PF_CAN, SOCK_RAW, CAN_RAW);
    if (fd < 0 || bind(fd, (struct sockaddr *)&a, sizeof a) < 0) die(name);
    return fd;
}

/* "tIIILDD.." or "TIIIIIIIILDD.." */
static int parse(const char *line, struct can_frame *f) {
    int wide = line[0] == 'T', digits = wide ? 8 : 3;
    char text[9] = "";
    if (line[0] != 't' && line[0] != 'T') return 0;
    if ((int)strlen(line) < 2 + digits) return 0;
    memcpy(text, line + 1, (size_t)digits);
    *f = (struct can_frame){.can_id = (canid_t)strtoul(text, NULL, 16) | (wide ? CAN_EFF_FLAG : 0),
                            .len = (__u8)(line[1 + digits] - '0')};
    if (f->len > 8 || (int)strlen(line) < 2 + digits + 2 * f->len) return 0;
    for (int i = 0; i < f->len; i++) {
        char byte[3] = {line[2 + digits + 2 * i], line[3 + digits + 2 * i], 0};
        f->data[i] = (__u8)strtoul(byte, NULL, 16);
    }
    return 1;
}

static void print(int terminal, const struct can_frame *f) {
    char line[64];
    int wide = (f->can_id & CAN_EFF_FLAG) != 0;
    int n = sprintf(line, wide ? "T%08X%u" : "t%03X%u", f->can_id & CAN_EFF_MASK, f->len);
    for (int i = 0; i < f->len; i++) n += sprintf(line + n, "%02X", f->data[i]);
    line[n++] = '\r';
    if (write(terminal, line, (size_t)n) != n) perror("terminal");
}

int main(int argc, char **argv) {
    char name[IFNAMSIZ] = "", line[256];
    size_t used = 0;
    int off = 0, discipline = N_SLCAN;
    struct termios t;
    if (argc != 2) return 2;
    int terminal = open("/dev/ptmx", O_RDWR | O_NOCTTY);
    if (terminal < 0 || grantpt(terminal) != 0 || unlockpt(terminal) != 0) die("ptmx");
    int slave = open(ptsname(terminal), O_RDWR | O_NOCTTY);
    if (slave < 0) die("pts");
    tcgetattr(slave, &t);
    cfmakeraw(&t);
    tcsetattr(slave, TCSANOW, &t);
    if (ioctl(slave, TIOCSETD, &discipline) != 0) die("slcan line discipline");
    if (ioctl(slave, SIOCGIFNAME, name) != 0) die("interface");
    printf("%s\n", name);
    fflush(stdout);
    int can = open_can(argv[1]);
    signal(SIGUSR1, on_signal);
    signal(SIGUSR2, on_signal);
    signal(SIGHUP, on_signal);
    for (;;) {
        struct pollfd p[2] = {{.fd = terminal, .events = POLLIN}, {.fd = can, .events = POLLIN}};
        int ready = poll(p, 2, 100);
        if (pending != 0) {
            const char *text = pending == SIGUSR1   ? "sp128130\r"
                               : pending == SIGUSR2 ? "sb000255\r"
                                                    : "sa000000\r";
            off = pending == SIGUSR2 || (off && pending == SIGUSR1);
            pending = 0;
            if (write(terminal, text, strlen(text)) < 0) perror("terminal");
        }
        if (ready <= 0) continue;
        if ((p[1].revents & POLLIN) != 0) {
            struct can_frame f;
            if (read(can, &f, sizeof f) == sizeof f && !off) print(terminal, &f);
        }
        if ((p[0].revents & POLLIN) == 0) continue;
        ssize_t n = read(terminal, line + used, sizeof line - 1 - used);
        if (n > 0) used += (size_t)n;
        line[used] = '\0';
        for (char *end; (end = strchr(line, '\r')) != NULL;) {
            struct can_frame f;
            *end = '\0';
            if (!off && parse(line, &f) && write(can, &f, sizeof f) < 0) perror(argv[1]);
            used -= (size_t)(end + 1 - line);
            memmove(line, end + 1, used + 1);
        }
        if (used == sizeof line - 1) used = 0;
    }
}
