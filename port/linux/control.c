/* SPDX-License-Identifier: MIT */
#include "port/linux/control.h"
#include "port/host/util.h"
#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

void control_open(control *c, const char *path) {
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    *c = (control){.path = path};
    for (int i = 0; i < CONTROL_CLIENTS; i++) c->client[i].fd = -1;
    if (strlen(path) >= sizeof at.sun_path)
        die(EXIT_USAGE, "--control: '%s' is longer than the %zu letters that a socket may have",
            path, sizeof at.sun_path - 1);
    snprintf(at.sun_path, sizeof at.sun_path, "%s", path);
    c->fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (c->fd < 0) die(EXIT_WORK, "--control: no socket: %s", strerror(errno));
    if (connect(c->fd, (struct sockaddr *)&at, sizeof at) == 0)
        die(EXIT_USAGE, "--control: another program listens at %s", path);
    if (errno == ECONNREFUSED) (void)unlink(path); /* left behind */
    const mode_t before = umask(0117);
    const int bound = bind(c->fd, (struct sockaddr *)&at, sizeof at);
    umask(before);
    if (bound != 0 || listen(c->fd, CONTROL_CLIENTS) != 0)
        die(EXIT_USAGE, "--control: cannot listen at %s: %s", path, strerror(errno));
}

static void hang_up(control_client *p) {
    close(p->fd);
    p->fd = -1;
    p->used = 0;
}

static void take_clients(control *c) {
    for (int i = 0; i < CONTROL_CLIENTS; i++) {
        if (c->client[i].fd >= 0) continue;
        c->client[i].fd = accept4(c->fd, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
        if (c->client[i].fd < 0) return;
        c->client[i].used = 0;
    }
}

static void answer_line(control_client *p, char *line, control_handler *handle, void *context) {
    char answer[CONTROL_LINE];
    snprintf(answer, sizeof answer, "ok");
    line[strcspn(line, "\r")] = '\0';
    handle(context, line, answer, sizeof answer - 1);
    const size_t n = strlen(answer);
    answer[n] = '\n';
    if (send(p->fd, answer, n + 1, MSG_NOSIGNAL) < 0) hang_up(p);
}

static void serve(control_client *p, control_handler *handle, void *context) {
    const ssize_t n = recv(p->fd, p->line + p->used, sizeof p->line - 1 - p->used, 0);
    if (n < 0 && (errno == EAGAIN || errno == EINTR)) return;
    if (n <= 0) {
        hang_up(p);
        return;
    }
    p->used += (size_t)n;
    p->line[p->used] = '\0';
    for (char *end; p->fd >= 0 && (end = strchr(p->line, '\n')) != NULL;) {
        *end = '\0';
        answer_line(p, p->line, handle, context);
        p->used -= (size_t)(end + 1 - p->line);
        memmove(p->line, end + 1, p->used + 1);
    }
    if (p->fd >= 0 && p->used == sizeof p->line - 1) {
        static const char why[] = "error a line of more than 510 letters\n";
        (void)!send(p->fd, why, sizeof why - 1, MSG_NOSIGNAL);
        hang_up(p);
    }
}

void control_poll(control *c, control_handler *handle, void *context) {
    take_clients(c);
    for (int i = 0; i < CONTROL_CLIENTS; i++) {
        if (c->client[i].fd >= 0) serve(&c->client[i], handle, context);
    }
}

void control_close(control *c) {
    for (int i = 0; i < CONTROL_CLIENTS; i++) {
        if (c->client[i].fd >= 0) hang_up(&c->client[i]);
    }
    close(c->fd);
    (void)unlink(c->path);
}
