/* SPDX-License-Identifier: MIT */
/* What the files of the solver share. */
#ifndef PALP_GREEN_CMA_INTERNAL_H
#define PALP_GREEN_CMA_INTERNAL_H

#include "core/green/cma.h"

/* Unknown k of those that are solved for. */
static inline palp_switched_unknown *palp_cma_unknown(const palp_cma *cma, uint32_t k) {
    return &cma->switches[cma->chosen[k]];
}

static inline uint32_t palp_cma_domain(const palp_blob *b, uint32_t node) {
    return palp_node_is_fixed(b, node) ? PALP_FIXED : PALP_FREE;
}

static inline bool palp_cma_is_split(const palp_cma *cma) {
    return palp_blob_has(cma->blob, PALP_META_SPLIT);
}

/* Whether a switch stands for a basis function below the finest level. */
static inline bool palp_cma_is_coarse(const palp_cma *c, const palp_switched_unknown *s) {
    return !palp_node_is_fixed(c->blob, s->node) && s->level + 1u < c->blob->meta->levels;
}

/* ---- cma_levels.c ---- */

/* Which basis function stands for each displaced free node (MR 68), and which of them are unknowns.
 * Error: ABSENT; then nothing has changed. */
palp_status palp_cma_choose(palp_cma *cma);

/* A force on slot m of a level above the stored ones is taken by its parents: carried = P^T given.
 */
void palp_cma_restrict(palp_cma *cma);

/* Adds the solved forces, level by level, to what is given. */
void palp_cma_carry(palp_cma *cma);

/* Nodal forces of the free domain, from those of the constraint level. */
void palp_cma_nodal_forces(palp_cma *cma);

/* ---- cma_field.c ---- */

/* g~_1 of MR 42 and 45: the RBVP's answer to what is given so far, as details; of a split blob as
 * nodal values. */
void palp_cma_sum_columns(palp_cma *cma);

/* MR 46 and 47: one inverse transform per domain; nodes take their values, switched ones exactly.
 */
void palp_cma_write(palp_cma *cma, float *u_m, float *f_N);

/* ---- cma_capacitance.c ---- */

/* Assembles C g = t - E^T v0 and solves it. Errors: NOT_SPD, SINGULAR. */
palp_status palp_cma_solve_unknowns(palp_cma *cma);

/* ---- cma_held.c ---- */

/* Whether what is prescribed leaves the body no rigid motion. */
bool palp_cma_is_held(const palp_cma *cma);

#endif
