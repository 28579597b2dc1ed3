/* SPDX-License-Identifier: MIT */
/*
 * What a tick of contact costs at most, in the unit of the prices given (base/price.h); names of
 * prices in capitals. Everything follows from the level and from how many points there are.
 *
 *   EVALUATION   balls BALL, PAD or CYLINDER, of the most expensive tool
 *   N            most nodes of the search grid's cells around a tool, wherever it is
 *   looks, crossings, rings, feet: the most of one filling (lattice.h)
 */
#ifndef PALP_CONTACT_COST_H
#define PALP_CONTACT_COST_H

#include "core/base/price.h"
#include "core/contact/contact.h"

typedef struct {
    palp_prices price;
    float tools, evaluation, nodes, rows, ring;
    uint32_t modes;
    bool friction;
} palp_contact_cost;

/* Cost of this: the cells of the grid, times those around a tool. */
palp_contact_cost palp_contact_cost_of(const palp_blob *blob, const palp_tool *tools,
                                       uint32_t tool_count, const palp_prices *price);

/* What a filling did: fillings FILLING + around AROUND + evaluations (EVALUATION + GIVEN) + shots
 * SHOT + crossings CROSSING + fillings WATCHED (CORNER + FAR_MODES CORNER_MODE) of lattice.h. */
float palp_contact_cost_filled(const palp_contact_cost *cost, palp_lattice_counts done);

/* The most that one palp_contact_fill does: 1 filling; around: N, the rows of cells and feet
 * max_ring; evaluations: N + looks + wanted + rings max_ring + 10 feet + 1; shots: looks + 4 feet;
 * crossings. To begin a lattice takes less. */
palp_lattice_counts palp_contact_most_filled(const palp_contact_cost *cost,
                                             palp_contact_level level);
float palp_contact_cost_fill(const palp_contact_cost *cost, palp_contact_level level);

/* palp_contact_points: count (POINT + EVALUATION + modes MODE_AT + 3 CORNER) */
float palp_contact_cost_points(const palp_contact_cost *cost, palp_contact_level level,
                               uint32_t count);

/* palp_contact_assemble, all of it: count (count + 1) / 2 (COMPLIANCE + modes MODE_PAIR) + count
 * (GATHER + POINT / 2 + modes MODE_AT / 4) */
float palp_contact_cost_assemble(const palp_contact_cost *cost, palp_contact_level level,
                                 uint32_t count);

/* palp_contact_iterate with a points in contact: ITERATION + (count + a) PRESSED + a (a + 1) / 2
 * (GATHER + SUBSTITUTE + DOT) + a^3 / 6 AXPY + a (2 SUBSTITUTE) + a^2 (AXPY + DOT) / 2 + (count -
 * a) a DOT + QUANTUM */
float palp_contact_cost_iterate(const palp_contact_cost *cost, uint32_t count, uint32_t active);

/* palp_contact_finish: tools FINISH + count (POINT + a DISPLACE) + 5/4 a^2 DISPLACE + count (FOLLOW
 * + EVALUATION)
 * + 3 count (CORNER + modes CORNER_MODE) + a modes MODE_AT; with friction + 2 (a (POINT + modes
 * MODE_AT) + a^2 DISPLACE + 3 count (CORNER + modes CORNER_MODE)) */
float palp_contact_cost_finish(const palp_contact_cost *cost, palp_contact_level level,
                               uint32_t count, uint32_t active);

#endif
