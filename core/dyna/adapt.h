/* SPDX-License-Identifier: MIT */
/*
 * Where the mesh is refined and where it is merged (AD 2.2, 3.3).
 *
 * A node's measure gamma = |f| / (mu h) (AD 9, m) is how far its displacements are from linear. A
 * family whose parents are active splits when one of them exceeds refine_m; it merges when all of
 * its children have been below merge_m for a while. Families under a tool split, and stay.
 *
 * Neighbours differ by one level at most: a family waits to split until the elements of its parents
 * are all there on their level, and asks for what is missing first.
 *
 * The rate is guaranteed by a cap on the work of a tick: no family splits when the tick is
 * expected to exceed it then (AD 3.3), and when it is exceeded all the same, or the cap came down,
 * families merge with the smallest gamma first. (The tick itself never is beyond its bound: it
 * takes larger steps meanwhile, servo/dynamic.h.)
 */
#ifndef PALP_DYNA_ADAPT_H
#define PALP_DYNA_ADAPT_H

#include "core/dyna/dyna.h"

typedef struct {
    float refine_m, merge_m;    /* gamma_max, gamma_min */
    uint32_t dwell_ticks;       /* between the split of a family and its merging */
    uint32_t max_changes;       /* families per tick */
    uint32_t max_element_tests; /* elements around families that are tested for it; at least those
                                of the largest family */
} palp_adapt_config;

/* gamma_max = 0.8 % of the diagonal, a tenth of it to merge (a child's gamma is about a quarter of
 * its parent's), 50 ticks, 8 changes, 2,000 element tests. */
palp_adapt_config palp_adapt_defaults(const palp_tets *tets);

typedef struct {
    palp_dyna *dyna;
    palp_adapt_config config;
    float *gamma_m; /* [families] largest of the parents if they may split, of the children if
                       those may merge, else -1 */
    uint8_t *held;  /* [families] a tool is near */
    uint32_t *age;  /* [families] ticks since it split */
    uint32_t element_tests; /* left in this tick */
    uint32_t most_nodes;    /* children, or parents, of a family; */
    uint32_t most_parents;
    uint32_t most_terms; /* what they follow together, when it splits or merges */
} palp_adapt;

typedef struct {
    uint32_t splits, merges;
    uint32_t refused; /* families that wanted to split and would have exceeded the cap */
    uint32_t forced;  /* of the merges: to come below the cap, or to make room under a tool */
} palp_adapt_report;

size_t palp_adapt_memsize(const palp_tets *tets);

/* Errors: ARGUMENT (thresholds not positive, merge_m not below refine_m, max_changes 0 or beyond
 * 64), ALIGNMENT, MEMORY. */
palp_status palp_adapt_init(palp_adapt *adapt, palp_dyna *dyna, const palp_adapt_config *config,
                            void *memory, size_t bytes);

void palp_adapt_reset(palp_adapt *adapt);

/* A tool is near this skin vertex: until the next palp_adapt_tick its families want to split. */
void palp_adapt_hold(palp_adapt *adapt, uint32_t skin);

/* What there is to spend on a tick beyond what it costs as it stands, in operations (below 0: it
 * costs too much), and what each evaluation and each step of a tick would cost more. */
typedef struct {
    float spare, per_evaluation, per_step;
} palp_adapt_room;

/*
 * Measures, then merges, or splits within the room there is.
 * Cost: 12 per node, 8 per family, 8 per family and change, 24 per element test, and
 * palp_dyna_relist if anything changed.
 */
palp_adapt_report palp_adapt_tick(palp_adapt *adapt, palp_adapt_room room);

#endif
