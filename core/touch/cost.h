/* SPDX-License-Identifier: MIT */
/*
 * What the operations of this folder cost at most, in the unit of the prices given: sums of named
 * counts times prices (base/price.h), written here with the names of the prices in capitals.
 *
 *   k, n        candidates, and those of them in contact, before the step
 *   T, C        tools; C = 3 T axes of their springs
 *   EVALUATION  balls BALL, PAD or CYLINDER, of the most expensive tool; on zones + PLACE + modes
 *               PLACE_MODE, and nearest nodes are sought on every zone
 *   LOOK_UP     PAIR, with friction + PAIR_BLOCK; without a
 *               table 2 EXTRACTION
 *
 * Loops in the code and factors in the sums belong together one by one.
 */
#ifndef PALP_TOUCH_COST_H
#define PALP_TOUCH_COST_H

#include "core/green/cost.h"
#include "core/touch/coupling.h"
#include "core/touch/contact.h"

/* What the sums are made of; fixed when a simulation is opened. */
typedef struct {
    palp_prices price;
    palp_node_contact_limits limits;
    float tools, evaluation; /* how many; the most expensive */
    float cells, ring,
        children; /* most nodes in 27 cells, neighbours of a node, children of a slot */
    float near[PALP_MAX_LEVELS];  /* most neighbours of a slot of each level */
    float nodes[PALP_MAX_LEVELS]; /* of each level: no more candidates than that */
    float slots;                  /* of the free domain */
    uint32_t tables;              /* bit per level that has one */
    float row, extraction;        /* one row of W^-1, one block of G from a compressed column */
    float zones, modes;           /* of a multizone model: bodies, modes of the one that has most */
    float place, pairs;           /* where a node is; 2 if zones touch each other, else 1 */
    float nearest;                /* a nearest node sought on one zone */
    float seam_row, unknowns;     /* of the seams' level in use: one candidate's row, its length */
    float seam_width;             /* length of a row on the finest of them */
} palp_touch_cost;

palp_touch_cost palp_touch_cost_of(const palp_blob *blob, palp_node_contact_limits limits,
                                   const palp_tool *tools, uint32_t tool_count,
                                   const palp_prices *price);

/* The same of a multizone model with seams up to level `finest`: the worst of its zones in each
 * count. */
palp_touch_cost palp_touch_cost_of_zones(const palp_zones *zones, uint32_t finest, bool pairs,
                                         palp_node_contact_limits limits, const palp_tool *tools,
                                         uint32_t tool_count, const palp_prices *price);

/*
 * palp_node_contact_search: SEARCH + k (CANDIDATE + EVALUATION) + (k - n) n IDLE + T n FORCE
 *   + min(max_new, k - n) (DROP + k MOVE, with friction + k MOVE_BLOCK)
 *   + tools that touch nothing (NEAREST + (cells + 32 ring) CELL)
 *   + min(PALP_NODE_CONTACT_WALK, k) (children CHILD + near NEIGHBOUR) + PALP_NODE_CONTACT_SCAN
 * NEIGHBOUR
 *   + looks (CLOSE + EVALUATION + max_new SIFT), looks being PALP_NODE_CONTACT_SCAN +
 * PALP_NODE_CONTACT_LOOKS, or what the neighbours of k and the nearest nodes ask for
 */
float palp_cost_search(const palp_touch_cost *cost, uint32_t level, uint32_t count,
                       uint32_t active);

/*
 * palp_node_contact_admit: ADMIT + EVALUATION + n IDLE + (k + 1) LOOK_UP, with all
 * candidates in use
 *   + k ROOM + DROP + k MOVE; without a table + ROW
 */
float palp_cost_admit(const palp_touch_cost *cost, uint32_t level, uint32_t count, uint32_t active);

/* palp_node_contact_begin: BEGIN + k (TARGET + EVALUATION); every 64 changes + palp_cost_refactor.
 */
float palp_cost_begin(const palp_touch_cost *cost, uint32_t count);

/* The factor made afresh: n (n + 1) / 2 (GATHER + SUBSTITUTE + DOT) + n^3 / 6 AXPY + n APPEND. */
float palp_cost_refactor(const palp_touch_cost *cost, uint32_t active);

/*
 * palp_node_contact_step: the solve, PIVOT + n ACTIVE + (1 + C) (n SUBSTITUTE + n^2 / 2 AXPY)
 *   + n SUBSTITUTE + n^2 / 2 DOT + C (SPRING + n (ACTIVE + AXPY)) + (C^2 + C) n DOT,
 * and the dearer of what may follow:
 *   one is let out:  n ROTATION + n^2 / 2 ROTATE
 *   one is let in:   k CHOICE + (k - n) n IDLE + T n FORCE + APPEND
 *                    + n (GATHER + SUBSTITUTE + DOT) + n^2 / 2 AXPY; without room for it
 *                    palp_cost_relieve, (k - n) (CHOICE + n IDLE), instead, and the solve ends
 */
float palp_cost_pivot(const palp_touch_cost *cost, uint32_t count, uint32_t active);
/* Its parts. */
float palp_cost_pivot_solve(const palp_touch_cost *cost, uint32_t active);
float palp_cost_pivot_out(const palp_touch_cost *cost, uint32_t active);
float palp_cost_pivot_in(const palp_touch_cost *cost, uint32_t count, uint32_t active);
float palp_cost_relieve(const palp_touch_cost *cost, uint32_t count, uint32_t active);

/* What palp_node_coupling_step does around a solve: T (COUPLE + n FORCE), with friction + T
 * FRICTION + T n FORCE. */
float palp_cost_couple(const palp_touch_cost *cost, uint32_t active);

/* palp_node_coupling_centers, begin and end: T (LEAVE + 4 n FORCE) + n^2 IDLE
 * + 3 n ACTIVE, with friction + T FRICTION + n^2 FRICTION_PAIR. */
float palp_cost_leave(const palp_touch_cost *cost, uint32_t active);

/*
 * palp_node_contact_load and palp_node_contact_follow on a level of the seams with `unknowns`
 * (palp_seams_cost_solve being `solve`), with p = 2 if zones touch each other, else 1:
 * (k + n) p (PLACE + 3 modes PLACE_MODE) + k (solve / 2 + unknowns SEAM_MODE + width SEAM_DOT)
 * + k (k + 1) / 2 (unknowns SEAM_DOT + MOVE), and with p = 2 max_new (a nearest node and a row + 4
 * PLACE + 4 modes PLACE_MODE + 4 k (PAIR + 2 EXTRACTION)).
 */
float palp_cost_follow(const palp_touch_cost *cost, uint32_t count, uint32_t active, float unknowns,
                       float solve);

#endif
