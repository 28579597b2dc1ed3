/* SPDX-License-Identifier: MIT */
/* What the files of core/contact share about the points of a tick. */
#ifndef PALP_CONTACT_INTERNAL_H
#define PALP_CONTACT_INTERNAL_H

#include "core/contact/contact.h"

#define LANES 8u /* sums run in so many lanes, in one order on every target */

/* palp_contact.column: all points side by side. */
enum { COL_Y = 0, COL_N = 3, COL_M = 6, COL_CELL = 9, COL_TOOL = 10 };

/* palp_contact.pressed: the points in contact side by side, padded to whole lanes by points far
 * away without force. */
enum { IN_Y = 0, IN_N = 3, IN_F = 6, IN_CELL = 9, IN_TOOL = 10 };

/* Two points are never taken to be nearer than half a cell; points of different tools as if each
 * were spread over its cell. Both as the square of a distance, over cell_i cell_j. */
#define NEAREST2 0.25f
#define SPREAD2 0.056330f /* 1 / PALP_LATTICE_SELF^2 */

/* row[j], j < count: m_i . C_ij m_j of point i. */
void palp_contact_compliance_row(palp_contact *contact, uint32_t i, uint32_t count, float *row);

/* The forces in `pressed`, and the load of the modes, from those of the active points. */
void palp_contact_gather(palp_contact *contact);

/* Displacement of a point by the gathered forces. */
palp_vec3 palp_contact_displacement(palp_contact *contact, uint32_t i);

/* entry[11, 12, 22]: t_a . C t_b of the tangential forces lambda / normal_N of one tool. Destroys
 * what was gathered. */
void palp_contact_tangential(palp_contact *contact, uint32_t tool, const palp_vec3 tangent[2],
                             float normal_N, float entry[3]);

/* d/dc (f . y + f C f / 2) of the gathered forces for each tool: what the force on it has beyond
 * - sum lambda m. Zero for tools without contact. */
void palp_contact_exact(palp_contact *contact, palp_vec3 beyond_N[PALP_CONTACT_TOOLS]);

#endif
