/* SPDX-License-Identifier: MIT */
/*
 * What a tick of contact costs at most, in the unit of the prices given (budget/price.h); names of
 * prices in capitals. Everything follows from the level and from how many points there are.
 *
 *   EVALUATION   balls BALL, PAD or CYLINDER, of the most expensive tool
 *   N            most nodes within a tool's reach, wherever it is: NODE; all nodes of the search
 *                grid's cells around it are AROUND. Of a field those within reach are AROUND twice,
 *                and PALP_LATTICE_TESTS of them tested
 *   shots, crossings, rings, feet: the most of one filling (lattice.h)
 */
#ifndef PALP_CONTACT_COST_H
#define PALP_CONTACT_COST_H

#include "core/budget/price.h"
#include "core/contact/contact.h"

/* Of one thing that presses, wherever it is: nodes within its reach at most, nodes of the cells
 * around it, and all visits of nodes and rows of cells on the way. */
typedef struct {
    float evaluation, nodes, passed, visits;
    float ways; /* evaluations of one palp_tool_gap_along, the most; deep: what they cost */
    float deep;
} palp_contact_presser;

typedef struct {
    palp_prices price;
    palp_contact_presser presser[PALP_CONTACT_TOOLS + 1u]; /* the tools; last: another zone */
    float samples; /* heights of all pads, and extremes of all fields */
    float tools, evaluation, ways, deep, nodes, visits, ring; /* the most of them */
    uint32_t modes, finest; /* finest: the level that points of the last tick may be from */
    float rings[PALP_CONTACT_LEVELS]; /* all neighbours of the PALP_LATTICE_RINGS most connected */
    bool friction;
    float patches;      /* tools, and pairs of zones */
    float zones, pairs; /* of a multizone model, else 0; 1 if zones touch each other */
    float bent;         /* to say how a node of a zone is bent: POSITION + M POSITION_MODE */
    /* of the level of the seams in use: unknowns, palp_seams_cost_solve, palp_seams_cost_forward */
    float unknowns, solve, forward;
    float cells; /* most nodes in 27 cells of a zone */
} palp_contact_cost;

/* EVALUATION of a tool. */
float palp_contact_cost_evaluation(const palp_tool *tool, const palp_prices *price);

/* Cost of this: for each tool, boxes of half its reach in the grid, times the nodes around it; for each
 * level the nodes, as often as one has neighbours. It is for when a simulation is opened. */
palp_contact_cost palp_contact_cost_of(const palp_blob *blob, const palp_tool *tools,
                                       uint32_t tool_count, const palp_prices *price);

/* The cost of one body at other prices: nothing is counted anew. */
palp_contact_cost palp_contact_cost_at(const palp_contact_cost *cost, const palp_tool *tools,
                                       const palp_prices *price);

/* The same of a multizone model, the worst of its zones in each count; seams on the finest level.
 */
palp_contact_cost palp_contact_cost_of_zones(const palp_assembly *assembly, bool pairs,
                                             const palp_tool *tools, uint32_t tool_count,
                                             const palp_prices *price);

/* A level of the body, or of the zones. */
palp_contact_level palp_contact_cost_level(const palp_contact_cost *cost, uint32_t level);

/* palp_contact_begin on a multizone model: zones tools SOUGHT, and where zones touch each other
 * (PALP_CONTACT_SCAN (zones - 1) + 2 pairs tracked) (2 BENT + SHOT + PALP_SURFACE_CROSSINGS
 * CROSSING + cells AROUND) + pairs tracked (ring + 1)^2 AROUND + 2 pairs in contact (ring AROUND +
 * FILLING). */
float palp_contact_cost_patches(const palp_contact_cost *cost);

/* What a filling did: fillings FILLING + around AROUND + nodes NODE + evaluations (EVALUATION +
 * FAR_FIELD) + feet FOOT + shots SHOT + crossings CROSSING + kept KEPT + followed FOLLOWED +
 * fillings WATCHED (CORNER + FAR_MODES CORNER_MODE) of lattice.h + bent BENT; between zones an
 * evaluation is a shot as well. */
float palp_contact_cost_filled(const palp_contact_cost *cost, palp_lattice_counts done);

/* The most that one palp_contact_fill does: 1 filling; around: nodes and rows of the cells,
 * and feet max_ring; evaluations: N + ways shots + rings + 5 feet + 4 + PALP_TOOL_EXIT; shots:
 * PALP_LATTICE_SHOTS; crossings; kept: the points of the finest level; followed: of this one. To
 * begin a lattice takes less. */
palp_lattice_counts palp_contact_most_filled(const palp_contact_cost *cost,
                                             palp_contact_level level);
float palp_contact_cost_fill(const palp_contact_cost *cost, palp_contact_level level);
/* The same of the lattice of one tool, or of two zones: PALP_CONTACT_TOOLS. */
float palp_contact_cost_fill_by(const palp_contact_cost *cost, palp_contact_level level,
                                uint32_t tool);

/*
 * Of a multizone model, BENT is POSITION + M POSITION_MODE with M modes of a zone's seams; FELT the
 * same of the level of the seams in use, or BENT where that is less. Where zones touch each other,
 * up to half of the points of the level have two sides. On top of what follows:
 *
 *   fill       zones SOUGHT, and a TURN for each place that is turned from one frame to another
 *   points     a side 3 (BENT + FELT) + 2 unknowns SEAM_TURN + 2 forward, and 60 forward once to
 *              begin rows; one between zones 2 SHOT + PALP_SURFACE_CROSSINGS CROSSING besides
 *   assemble   a pair of sides COMPLIANCE and 2 unknowns MODE_PAIR more; a row one side more, with
 *              pairs of zones 1.5
 *   finish     zones (solve + 4 unknowns SEAM_MODE); 6 FELT for a side in contact, 3 FELT for any;
 *              up to 7 sides in contact more for each body but the first: they fill whole lanes
 */

/* palp_contact_points: count (POINT + ways EVALUATION + 2 FAR_FIELD + modes MODE_AT + 3 CORNER) */
float palp_contact_cost_points(const palp_contact_cost *cost, palp_contact_level level,
                               uint32_t count);

/* palp_contact_assemble, all of it: count (count + 1) / 2 (COMPLIANCE + modes MODE_PAIR) + (1 +
 * count + count / PALP_CONTACT_ROWS) (ROW_BEGUN + modes ROW_MODE) */
float palp_contact_cost_assemble(const palp_contact_cost *cost, palp_contact_level level,
                                 uint32_t count);

/* What of it is left at most when rows below `from` are there. */
float palp_contact_cost_rows(const palp_contact_cost *cost, palp_contact_level level, uint32_t from,
                             uint32_t count);

/* palp_contact_iterate, so many times of one solve. With a points in contact, b = min(a, count / 2)
 * and r = min(iterations (count - a), count) that are left out of the factor for good: iterations
 * (ITERATION + QUANTUM + (count + a) PRESSED + 2 a SUBSTITUTE + a^2 (AXPY + SUBSTITUTE) / 2 + (b +
 * 1) (count - b) DOT) + (iterations a^2 / 2 + r a) (GATHER + SUBSTITUTE) + (iterations a^3 / 6 + r
 * a^2 / 2) AXPY */
float palp_contact_cost_iterate(const palp_contact_cost *cost, uint32_t count, uint32_t active,
                                uint32_t iterations);

/* palp_contact_finish, with l = a + 7 sides in whole lanes and 3 count (CORNER + modes CORNER_MODE)
 * for all corners: tools FINISH + idle (max_ring + 1 + PALP_LATTICE_WATCHED) (CORNER + modes
 * CORNER_MODE + TURN) + corners + count (DERIVATIVE + EVALUATION + l DISPLACE) + a (tools ITERATION
 * + l PULL) + 2 l modes CORNER_MODE; with friction + tools (FRICTION + 2 corners + l (RUB + 2 modes
 * CORNER_MODE)) + 4 a l DISPLACE + 2 a (RUB + modes MODE_AT). Idle: tools that do not press, one
 * fewer than all where nothing but tools presses. */
float palp_contact_cost_finish(const palp_contact_cost *cost, palp_contact_level level,
                               uint32_t count, uint32_t active);

#endif
