/* SPDX-License-Identifier: MIT */
/*
 * The control socket: a Unix stream socket on which each line is a command and each answer a line that
 * begins with `ok` or `error`. Up to CONTROL_CLIENTS at a time; nobody is waited for.
 */
#ifndef PALP_PORT_CONTROL_H
#define PALP_PORT_CONTROL_H

#include <stdbool.h>
#include <stddef.h>

#define CONTROL_CLIENTS 8
#define CONTROL_LINE 512u

typedef struct {
    int fd;
    size_t used;
    char line[CONTROL_LINE];
} control_client;

typedef struct {
    int fd; /* that listens; -1: none */
    const char *path;
    control_client client[CONTROL_CLIENTS];
} control;

/* Answers one command with one line, without its end. */
typedef void control_handler(void *context, char *command, char *answer, size_t room);

/* Listens at `path`, for its owner and group; a socket that nobody listens on any more is replaced. Exits 2
 * where that cannot be. */
void control_open(control *c, const char *path);
/* Takes what has come in; returns at once. */
void control_poll(control *c, control_handler *handle, void *context);
void control_close(control *c);

#endif
