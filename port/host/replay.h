/* SPDX-License-Identifier: MIT */
/* A recorded session again: its frames, events and clock readings into the same scene, and whether the
 * same comes out. */
#ifndef PALP_HOST_REPLAY_H
#define PALP_HOST_REPLAY_H

#include "port/host/run_tick.h"

/* Why a replay has come to its end. */
typedef enum {
    REPLAY_RUNS,
    REPLAY_DONE,      /* the log ends as its run did */
    REPLAY_CUT,       /* the log ends before its run did */
    REPLAY_GAP,       /* ticks are missing from it: what follows cannot be repeated */
    REPLAY_EXCHANGED, /* bodies or tools are exchanged here */
    REPLAY_DIFFERS    /* see `why` */
} replay_end;

typedef struct {
    session_record session;
    scene_setup *setup;
    palp_scene *scene;
    tick_record *recorded, *again; /* the last tick, on record and as it came out now */
    uint64_t ticks, digest, lost;
    replay_end end;
    char why[160];
    /* internal */
    record_reader *reader;
    const char *log;
    uint32_t clock_next;
    uint64_t periods;
    bool short_of;
} replay;

/*
 * Opens a log with the files of its session: `body` is its blob, or the scene that names its blobs and
 * tools; `tool` (may be NULL) the tool of a session with one blob. Exits with what is wrong: 2 where files
 * are to be named, 1 where they are others than those of the session.
 */
replay *replay_open(const char *log, const char *body, const char *tool);

/* The next tick, in `recorded` and `again`; false when there is none that can be repeated: see `end`. A tick
 * that differs is the last. */
bool replay_next(replay *r);

void replay_close(replay *r);

#endif
