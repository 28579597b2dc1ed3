/* SPDX-License-Identifier: MIT */
/*
 * Contact that changes its constraint level without being felt (MR 8.2).
 *
 * The rungs are the levels whose compliances contact can use, those with a table and the blob's
 * constraint level, and between two levels with tables the mixed set of both: fine under the tool,
 * coarse around it, the zone as wide as half of max_active allows. A change of rung carries the
 * contact forces over:
 *
 *   down   F_k = sum_i P_ik lambda_i       each force goes to the hats above it
 *   up     lambda_i = (R_l^T F)_i          each hat's force is spread over the nodes below it
 *
 * Both keep the sum. The forces are then scaled node by node, lambda_i (1 + p_i . m), with the m in
 * R^3 that makes the force on the tool exactly what it was, and lowered if they would store more
 * energy than before (and than the tank holds). Each candidate is relieved of, or credited with,
 * the depth by which the new level would answer differently there. So force and tool stand still,
 * no energy is made, and the difference between levels enters with later motion:
 *
 *   credit (a force too large for the new level) fades in RELAX_S, and its energy fills the tank;
 *   relief (a force too small) fades too, as far as the tank pays for the work that it does.
 *
 * Climbing takes several ticks: the finer contact is prepared aside, a few candidates at a time,
 * before it takes over.
 */
#ifndef PALP_TOUCH_LADDER_H
#define PALP_TOUCH_LADDER_H

#include "core/touch/contact.h"

#define PALP_RELAX_S 0.1f /* time in which credits and reliefs fade */

typedef struct {
    uint32_t level, outer; /* equal unless the set is mixed */
} palp_rung;

typedef struct {
    palp_node_contact contact[2]; /* on a multizone model, which has one rung, the first alone */
    uint32_t now;            /* which of them is felt */
    palp_rung at[2u * PALP_MAX_LEVELS]; /* coarse to fine */
    uint32_t rungs, rung;
    bool preparing;            /* the other one is being made ready for rung + 1 */
    uint32_t waited;           /* ticks of preparation, or since the last change */
    uint32_t dropped, climbed; /* changes so far */
    float tank_J;
} palp_ladder;

size_t palp_ladder_memsize(const palp_blob *blob, palp_node_contact_limits limits);

/* As palp_node_contact_init; starts on the finest rung. Errors: those of palp_node_contact_init. */
palp_status palp_ladder_init(palp_ladder *ladder, const palp_blob *blob, const float *position_m,
                             const palp_tool *tools, uint32_t tool_count,
                             palp_node_contact_limits limits, void *memory, size_t bytes);

/* The same on a multizone model, as palp_node_contact_init_zones and in as much memory. */
palp_status palp_ladder_init_zones(palp_ladder *ladder, palp_assembly *assembly, bool pairs,
                                   const palp_tool *tools, uint32_t tool_count,
                                   palp_node_contact_limits limits, void *memory, size_t bytes);

/* Forgets all contacts and the tank, and goes back to the finest rung. */
void palp_ladder_clear(palp_ladder *ladder);
/* The same, to another rung. */
void palp_ladder_clear_to(palp_ladder *ladder, uint32_t rung);

static inline palp_node_contact *palp_ladder_contact(palp_ladder *ladder) {
    return &ladder->contact[ladder->now];
}

/* How many basis functions of `rung` the present forces would load. Cost: 8 operations per level
 * and active candidate, and the marks of the levels. */
uint32_t palp_ladder_load(palp_ladder *ladder, uint32_t rung);

/* Goes to the next coarser rung now, tools being at tool_m; false on the coarsest. Cost: with h
 * = palp_ladder_load of that rung, h^2 / 2 look-ups and h^3 / 6. */
bool palp_ladder_drop(palp_ladder *ladder, const palp_vec3 *tool_m);

/*
 * Prepares the next finer rung: lists candidates for palp_ladder_prepare_admit. Returns how many; 0
 * when it is ready for palp_ladder_climb. Does nothing on the finest rung.
 */
uint32_t palp_ladder_prepare(palp_ladder *ladder, const palp_vec3 *tool_m, palp_fresh *fresh);
static inline palp_node_contact *palp_ladder_other(palp_ladder *ladder) {
    return &ladder->contact[1u - ladder->now];
}

/* Takes the prepared rung over. False, and the preparation is forgotten, if it cannot carry the
 * forces. */
bool palp_ladder_climb(palp_ladder *ladder, const palp_vec3 *tool_m);
void palp_ladder_forget(palp_ladder *ladder);

/* Lets credits and reliefs fade for one tick. Cost: active. */
void palp_ladder_relax(palp_ladder *ladder, float dt_s);

#endif
