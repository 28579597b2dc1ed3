/* SPDX-License-Identifier: MIT */
/*
 * Rigid tools, and what a surface node sees of one.
 *
 * For a node at x with outward normal n and a tool at c, the depth is how far the node must go
 * along -n to clear the tool. It is a smooth function of c (continuous gradient everywhere), and
 * the push is minus its gradient: the force on the tool for a unit normal force at the node. So
 * contact energy is a function of the tool's place alone, and its force the gradient.
 *
 * A tool is a set of up to PALP_TOOL_BALLS spheres, merged smoothly where they meet, a cylinder
 * with rounded rims, or a pad: a rectangle with rounded edges, flat or with a height field, facing
 * along its third axis. A sphere's depth goes over into a cone beyond PALP_TOOL_BETA of its radius,
 * so that it stays defined for every node.
 */
#ifndef PALP_CONTACT_TOOL_H
#define PALP_CONTACT_TOOL_H

#include "core/base/real.h"
#include <stddef.h>

#define PALP_TOOL_BALLS 8u
#define PALP_TOOL_BETA 0.8f
#define PALP_TOOL_REACH 1.6f /* radii off the axis at which a node stops being of interest */

typedef struct {
    palp_vec3 center_m; /* from the tool's reference point */
    float radius_m;
} palp_ball;

typedef struct {
    palp_vec3 axis[3];      /* orthonormal; the face looks along axis[2] */
    float half_m[2];        /* half extents along axis[0] and axis[1] */
    float edge_m;           /* radius of the rounded edges */
    uint32_t columns, rows; /* of the height field; 0: flat */
    const float *height_m;  /* [rows][columns] above the face, smoothed by quadratic B-splines */
} palp_pad;

typedef struct {
    palp_vec3 axis; /* unit, through the reference point */
    float radius_m, half_m;
    float rim_m; /* radius of the rounded rims, beyond half_m */
} palp_cylinder;

typedef struct {
    uint32_t balls; /* 0: a cylinder if its radius is not 0, else a pad */
    palp_ball ball[PALP_TOOL_BALLS];
    palp_cylinder cylinder;
    palp_pad pad;
    float friction; /* Coulomb's mu, static; 0: none */
    float sliding;  /* mu while it slides, at most `friction`; 0: the same */
} palp_tool;

typedef struct {
    float depth_m;
    float reach;    /* 1 at the distance off the axis where nodes stop being of interest */
    float facing;   /* cosine between the node's normal and the direction to the tool */
    palp_vec3 push; /* minus the gradient of the depth with respect to the tool's position */
} palp_touch;

/* How far a place is from the tool's surface (below 0: inside), and the direction in which that
 * grows fastest: unit, out of the tool. */
typedef struct {
    float gap_m;
    palp_vec3 normal;
} palp_gap;

/* A sphere about the reference point. */
palp_tool palp_tool_sphere(float radius_m);

/* Whether radii and extents are positive and finite, axes orthonormal, friction in 0..10 and not
 * below sliding. */
bool palp_tool_is_sound(const palp_tool *tool);

/* Coulomb's mu while the tool slides. */
static inline float palp_tool_sliding(const palp_tool *tool) {
    return tool->sliding > 0.0f ? tool->sliding : tool->friction;
}

/* The smallest radius, of balls, cylinder or edges: the scale of its search margins (m). */
float palp_tool_size(const palp_tool *tool);

/* What the node at x with unit normal n sees of the tool at c. Cost: about 60 operations per ball,
 * 120 for a cylinder, 160 for a pad. */
palp_touch palp_tool_at(const palp_tool *tool, palp_vec3 c, palp_vec3 x, palp_vec3 n);

/* The gap at x of the tool at c: a distance for balls and cylinders; for a pad the height over the
 * face divided by its slope, whatever lies behind the face being inside. Costs as palp_tool_at. */
palp_gap palp_tool_gap(const palp_tool *tool, palp_vec3 c, palp_vec3 x);

/* Radius about the reference point within which the surface that touches lies (m). */
float palp_tool_extent(const palp_tool *tool);

#endif
