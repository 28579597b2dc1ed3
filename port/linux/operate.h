/* SPDX-License-Identifier: MIT */
/*
 * What an operator tells a running palpd through its control socket (control.h): a command a line.
 *
 *     state          tick, scene, loading, record, and of each device state, faults and force
 *     reset | stop   as SIGUSR1 and SIGUSR2
 *     hold           no force until the next reset
 *     load FILE      a scene with the same devices; or where there is one body and one device another
 *                    blob, or FILE.tool: it is read and checked beside the loop, the force fades, and the
 *                    devices go on with it; `state` says how far that is
 *     record FILE    from now on a log to FILE; record off: ends it
 *     end            ends the run
 */
#ifndef PALP_PORT_OPERATE_H
#define PALP_PORT_OPERATE_H

#include "port/host/util.h"
#include "port/linux/control.h"
#include "port/linux/follow.h"
#include <pthread.h>

typedef enum { LOAD_NONE, LOAD_READING, LOAD_READ, LOAD_FADING, LOAD_REFUSED } load_stage;

typedef struct {
    follower *follower;
    control control;
    output record; /* without a file: none, or that of the command line */
    bool recording;
    _Atomic load_stage stage;
    pthread_t reader;
    char file[256], scene[256], said[256]; /* to be loaded; in use; why it was refused */
    loop_scene next;
} operation;

/* Opens the socket; `scene` is what is in use. */
void operate_begin(operation *o, follower *f, const char *path, const char *scene);
/* Serves it, from the thread that follows the loop; context is the operation. */
void operate_poll(void *context);
/* Ends a record, and waits for what is being read. */
void operate_end(operation *o);

#endif
