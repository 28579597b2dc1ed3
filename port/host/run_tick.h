/* SPDX-License-Identifier: MIT */
/* One tick of an open scene, with its input and its result in a record. */
#ifndef PALP_HOST_RUN_TICK_H
#define PALP_HOST_RUN_TICK_H

#include "port/host/record.h"

/* A record for the next tick: counts and kinds of the scene, nothing received yet. */
void run_begin(const scene_setup *setup, tick_record *tick);

/*
 * The tick at time t_s: frames, events and skipped periods of `tick` in; frames out, reports, counters and
 * the digest into it. *digest goes on from the tick before (0 at first). Comes behind run_begin; the caller
 * then sends the frames, and calls palp_scene_spare. Allocates nothing.
 */
void run_tick(const scene_setup *setup, palp_scene *scene, double t_s, tick_record *tick,
              uint64_t *digest);

#endif
