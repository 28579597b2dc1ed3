/* SPDX-License-Identifier: MIT */
/* What the files of core/contact share about the points of a tick. */
#ifndef PALP_CONTACT_INTERNAL_H
#define PALP_CONTACT_INTERNAL_H

#include "core/contact/regions.h"

#define LANES 8u /* sums run in so many lanes, in one order on every target */

/* palp_contact.column: all sides of the points, one beside the other. */
enum { COL_Y = 0, COL_N = 3, COL_M = 6, COL_CELL = 9, COL_PATCH = 10 };

/* palp_contact.pressed: the sides in contact, body by body, each body's padded to whole lanes by
 * places far away without force. */
enum { IN_Y = 0, IN_N = 3, IN_F = 6, IN_CELL = 9, IN_PATCH = 10 };

/* Two points are never taken to be nearer than half a cell; points of different patches as if each
 * were spread over its cell. Both as the square of a distance, over cell_i cell_j. */
#define NEAREST2 0.25f
#define SPREAD2 0.056330f /* 1 / PALP_LATTICE_SELF^2 */

/* Spacing of a tool's lattice where its points lie, about. */
static inline float palp_contact_cell(const palp_contact *contact, uint32_t tool) {
    const float spacing = contact->patch[tool].lattice.used.spacing;
    const palp_tool *t = &contact->tools[tool];
    return palp_tool_is_ball(t) ? spacing * palp_tool_size(t) : spacing;
}

/* ---- open.c ---- */

/* A level of this contact's body or zones. */
palp_contact_level palp_contact_level_at(const palp_contact *contact, uint32_t level);

/* ---- contact.c ---- */

/* Where a tool comes to rest under the force and the moment on it. */
void palp_contact_rest(palp_contact *contact, uint32_t tool);

/* ---- points.c ---- */

/* Empties the list of corners. */
void palp_contact_forget_nodes(palp_contact *contact);

/* Finds the far field before a tool that does not press, as others have moved the body, once the loads of a
 * tick are known. Cost: a node, its neighbours and those that are watched, with all modes each. */
void palp_contact_idle(palp_contact *contact, palp_contact_patch *patch);

/* A triangle of a pair's second zone near where the two meet. */
uint32_t palp_contact_other_triangle(const palp_contact *contact, const palp_contact_patch *patch);

/* ---- patches.c ---- */

/* A direction from a body's frame to the world, and back. */
palp_vec3 palp_contact_outward(const palp_contact *contact, uint32_t body, palp_vec3 v);
palp_vec3 palp_contact_inward(const palp_contact *contact, uint32_t body, palp_vec3 v);

/* Opens what patches need, once there is memory: which triangles meet across seams. */
void palp_contact_open_patches(palp_contact *contact);

/* The next patch to be filled; palp_contact.patches when all have been. */
uint32_t palp_contact_next(palp_contact *contact);

/* Which patches this tick has, and where they see what presses. */
void palp_contact_choose_patches(palp_contact *contact);

/* ---- compliance.c ---- */

/* Three columns of a side as a vector. */
static inline palp_vec3 palp_contact_column(const palp_contact *contact, uint32_t first,
                                            uint32_t side) {
    const palp_vec3 out = {contact->column[first][side], contact->column[first + 1u][side],
                           contact->column[first + 2u][side]};
    return out;
}

/* A side's point of the surface, and the body that it lies on. */
static inline const palp_surface_point *palp_contact_side(const palp_contact *contact,
                                                          uint32_t side) {
    return side < contact->count ? &contact->point[side].at
                                 : &contact->facing[contact->side_point[side]].at;
}
static inline uint32_t palp_contact_body(const palp_contact *contact, uint32_t side) {
    return palp_contact_side(contact, side)->body;
}

/* The half-space between two bodies: of zones that differ, the mean of both. */
typedef struct {
    float factor, poisson; /* (1 + nu) / (pi E) */
} palp_half_space;
palp_half_space palp_contact_half_space(const palp_contact *contact, uint32_t body, uint32_t other);

/* row[j], j <= i: d_i . C_ij d_j of point i, all sides together. */
void palp_contact_compliance_row(palp_contact *contact, uint32_t i, float *row);

/* The forces in `pressed`, and the loads of the modes, from those of the points. */
void palp_contact_gather(palp_contact *contact);

/* What modes and seams displace all corners by, under the gathered forces. */
void palp_contact_displace_corners(palp_contact *contact);

/* Displacement of a side by the gathered forces. */
palp_vec3 palp_contact_displacement(palp_contact *contact, uint32_t side);

/*
 * Compliance of a tool's contact along its surface, under forces as lambda: of each region by
 * itself, along its own tangents, as if the body were a half-space; and what all of them together
 * have beyond that, along two tangents of the tool, each region going along with what of them lies
 * in its plane (of a single region: its own tangents). Destroys what was gathered.
 */
void palp_contact_tangential(palp_contact *contact, uint32_t tool, const palp_vec3 tangent[2],
                             const palp_contact_region *region, uint32_t regions,
                             palp_symmetric2 *near, palp_symmetric2 *far);

/* ---- bonds.c ---- */

/* What the seams feel of a unit push at each side. */
void palp_contact_bond(palp_contact *contact);

/* Adds the seams' part of d_s . C d_j to row[j] for the sides first..end - 1. */
void palp_contact_bond_row(palp_contact *contact, uint32_t side, uint32_t first, uint32_t end,
                           float *row);

/* Adds the seams' answer to the gathered forces, tangential ones too, to the corners. */
void palp_contact_bond_corners(palp_contact *contact);

/* ---- gradient.c ---- */

/* d/dc (f . y + f C f / 2) of the gathered forces for each patch of a tool, to its beyond_N, and of a
 * turn about c to its beyond_Nm: what force and moment on the tool have beyond - sum lambda m. */
void palp_contact_exact(palp_contact *contact);

#endif
