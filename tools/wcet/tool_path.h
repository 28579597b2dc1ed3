/* SPDX-License-Identifier: MIT */
/*
 * The search for the most expensive tick: a ball goes over a body in a way that a few numbers
 * describe, and the numbers of what was expensive are changed a little, again and again. Stands on
 * core alone, so that the same search runs on bare targets, where instructions are counted.
 */
#ifndef PALP_TOOLS_TOOL_PATH_H
#define PALP_TOOLS_TOOL_PATH_H

#include "core/palp.h"

/* A generator that is the same everywhere. */
typedef struct {
    uint64_t state;
} dice;
static inline uint32_t dice_roll(dice *d) {
    d->state = d->state * 6364136223846793005ull + 1442695040888963407ull;
    return (uint32_t)(d->state >> 33);
}
static inline uint32_t dice_below(dice *d, uint32_t n) { return dice_roll(d) % n; }
/* -1..1 */
static inline float dice_float(dice *d) { return (float)dice_below(d, 20001) / 10000.0f - 1.0f; }

/* A ball of `radius` mean edges on a spring of a share of the body's stiffness dwells at a node for
 * some ticks, sunk by a share of its radius that changes by `swing`, trembles by a share of an
 * edge, and goes to another node, anywhere or next to it. */
typedef struct {
    uint32_t dwell;
    float radius, stiffness, sunk, swing, tremble, far;
    uint64_t seed;
} tool_path;

tool_path path_random(dice *d);
tool_path path_mutated(tool_path path, dice *d);

/* What was done in a tick. */
typedef struct {
    uint32_t level;
    palp_lattice_counts filled;
    uint32_t points, active, iterations;
    uint64_t cost; /* by the clock of the search */
} path_tick;

/* The bound of that: the sum of its steps. */
float path_bound(const palp_contact_cost *cost, const path_tick *tick);

typedef struct {
    const palp_blob *blob;
    uint32_t level; /* of contact */
    bool friction;
    palp_port port; /* its clock prices ticks; it gives no tick too little time */
    void *memory;   /* palp_answer_memsize of one tool */
    size_t bytes;
    void (*told)(void *context, const path_tick *tick); /* of every tick */
    void *context;
    void (*chill)(void); /* before every tick; may be NULL */
    palp_answer answer;
    palp_tool tool;
} search;

/* Ticks along one path. False if the answer cannot be opened. */
bool path_run(search *h, const tool_path *path, uint32_t ticks);

#endif
