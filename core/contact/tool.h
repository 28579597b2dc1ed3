/* SPDX-License-Identifier: MIT */
/*
 * Rigid tools: where they are, and what a place or a node of a surface sees of one.
 *
 * A tool has a reference point and axes of its own, in which its shape is given; a frame says where
 * they are. Shapes:
 *
 *     balls      up to PALP_TOOL_BALLS spheres, merged smoothly where they meet
 *     cylinder   with rounded rims; with rims of its own radius a capsule
 *     pad        a rectangle with rounded edges, flat or with a height field, facing along its
 *                third axis
 *     field      any closed mesh, as a signed distance field (contact/tool_field.h)
 *
 * Contact on surfaces asks for the gap at a place. Imposed motion on dynamic bodies asks for the
 * depth of a node x with outward normal n: how far the node must go along -n to clear the tool at
 * c. It is a smooth function of c (continuous gradient everywhere), and the push is minus its
 * gradient: the force on the tool for a unit normal force at the node. A sphere's depth goes over
 * into a cone beyond PALP_TOOL_BETA of its radius, so that it stays defined for every node. The flat
 * ends of a cylinder do not drive nodes; those of a capsule do.
 */
#ifndef PALP_CONTACT_TOOL_H
#define PALP_CONTACT_TOOL_H

#include "core/base/frame.h"
#include "core/contact/tool_field.h"
#include <stddef.h>

#define PALP_TOOL_BALLS 8u
#define PALP_TOOL_BETA 0.8f
#define PALP_TOOL_REACH 1.6f /* radii off the axis at which a node stops being of interest */

typedef enum {
    PALP_TOOL_OF_BALLS,
    PALP_TOOL_CYLINDER,
    PALP_TOOL_PAD,
    PALP_TOOL_FIELD
} palp_tool_shape;

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
    palp_tool_shape shape;
    uint32_t balls; /* 1 to PALP_TOOL_BALLS of a tool of balls */
    palp_ball ball[PALP_TOOL_BALLS];
    palp_cylinder cylinder;
    palp_pad pad;
    palp_tool_field field;
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

/* A sphere about the reference point; and all places within radius_m of the segment from -half_m to
 * half_m along a unit axis. */
palp_tool palp_tool_sphere(float radius_m);
palp_tool palp_tool_capsule(palp_vec3 axis, float half_m, float radius_m);

/* Where a tool is that is to touch nothing. */
static inline palp_frame palp_tool_away(void) {
    const palp_vec3 away = {1e3f, 1e3f, 1e3f};
    return palp_frame_at(away);
}

/* Whether radii and extents are positive and finite, axes orthonormal, friction in 0..10 and not
 * below sliding, a field open. */
bool palp_tool_is_sound(const palp_tool *tool);

/* Coulomb's mu while the tool slides. */
static inline float palp_tool_sliding(const palp_tool *tool) {
    return tool->sliding > 0.0f ? tool->sliding : tool->friction;
}

/* The scale of its search margins (m): the smallest radius, of balls, cylinder or edges; of a field
 * that of its largest ball inside. */
float palp_tool_size(const palp_tool *tool);

/* What the node at x with unit normal n sees of the tool. Cost: a frame, and about 60 operations per
 * ball, 120 for a cylinder, 160 for a pad, 200 for a field. */
palp_touch palp_tool_at(const palp_tool *tool, const palp_frame *at, palp_vec3 x, palp_vec3 n);

/* The gap at x: a distance for balls and cylinders; for a pad the height over the face, for a field
 * its value, divided by its slope. Whatever lies behind a pad's face is inside. Costs as
 * palp_tool_at. */
palp_gap palp_tool_gap(const palp_tool *tool, const palp_frame *at, palp_vec3 x);

/* How a tool is pressed: along which axis, unit, out of the tool into the body; how far, to 1, what it
 * touches is one region, which it can come over; and how far it has sunk in there. */
typedef struct {
    palp_vec3 axis;
    float whole, sunk;
    palp_ball tip; /* of a field: its part that is pressed, in its own axes; radius 0: not known */
} palp_tool_press;

/*
 * The gap as a contact along the axis of a press sees it. Of a tool pressed
 * deeper than a part of it is thick, as a ball deeper than its radius, the nearest side is not the one
 * that presses. So a place inside, or behind a ball or cylinder that has sunk in, looks for where the axis
 * leaves the tool, at e with the normal n, and is n . (x - e) from it: the more, the more the nearest
 * side faces back. In a field that has not sunk in it holds as long as it is less than PALP_TOOL_STEEP
 * times the distance of the nearest side. Else, and for pads, as palp_tool_gap. Cost: at most
 * palp_tool_out evaluations more.
 */
palp_gap palp_tool_gap_along(const palp_tool *tool, const palp_frame *at, palp_vec3 x,
                             const palp_tool_press *press);
#define PALP_TOOL_STEEP 3.0f
#define PALP_TOOL_EXIT 4u
#define PALP_TOOL_AHEAD 0.4f /* of the axis to the nearest side: from there on that alone counts */

/* What the way out takes, with flared sides: evaluations more than palp_tool_gap alone. */
static inline uint32_t palp_tool_out(const palp_tool *tool) {
    return tool->shape == PALP_TOOL_FIELD      ? PALP_TOOL_EXIT
           : tool->shape == PALP_TOOL_CYLINDER ? 2u
           : tool->shape == PALP_TOOL_PAD      ? 0u
                                               : 1u;
}

/* The part of a field that is pressed, as a ball that touches its surface from inside at e, where its normal
 * is n; all in its own axes. Cost: an evaluation. */
palp_ball palp_tool_tip(const palp_tool_field *field, palp_vec3 e, palp_vec3 n);

/* Whether that differs from palp_tool_gap, for balls and cylinders. */
static inline bool palp_tool_faces_back(const palp_tool *tool, palp_gap gap,
                                        const palp_tool_press *press) {
    const float facing = palp_dot(gap.normal, press->axis);
    return tool->shape != PALP_TOOL_PAD && facing < PALP_TOOL_AHEAD && press->whole > 0.0f &&
           (gap.gap_m < 0.0f || (press->sunk > 0.0f && facing < 0.0f));
}

/*
 * What the sides of one ball, a cylinder or a field are to a place that it has come over, with its `gap`: a cone that
 * touches them where their normal has PALP_TOOL_FLARE of the axis, by this share. Points of a
 * soft surface that has been pressed deep would else go aside, and let the tool through. Cost: as an
 * evaluation.
 */
palp_gap palp_tool_gap_flared(const palp_tool *tool, const palp_frame *at, palp_vec3 x,
                              const palp_tool_press *press, palp_gap gap, float share);
#define PALP_TOOL_FLARE 0.8f
static inline bool palp_tool_flares(const palp_tool *tool) {
    return tool->shape == PALP_TOOL_OF_BALLS ? tool->balls == 1u : tool->shape != PALP_TOOL_PAD;
}

/* The place inside a cylinder that lies farthest along `down`, at its end or on its rim, before the rounding;
 * of one that lies across it, at most a few degrees off, the place next to x. In its own axes. */
palp_vec3 palp_tool_core(const palp_cylinder *cylinder, palp_vec3 down, palp_vec3 x);

/* Radius about the reference point within which the surface that touches lies (m). */
float palp_tool_extent(const palp_tool *tool);

/* Whether a place in the tool's own axes may be within reach_m of it: false only where it is not. A
 * box, which takes less than a gap. */
bool palp_tool_may_reach(const palp_tool *tool, palp_vec3 own, float reach_m);

/* How far it extends from the reference point along a unit direction of its own axes (m); at most
 * by a box for pads, and for fields without extremes. */
float palp_tool_support(const palp_tool *tool, palp_vec3 own_direction);

/* What of a turn changes how the tool lies: nothing of a ball's, nothing about a cylinder's axis. */
palp_vec3 palp_tool_turned(const palp_tool *tool, const palp_frame *at, palp_vec3 turn_rad);

/* One ball, which looks the same from all sides of its centre. */
static inline bool palp_tool_is_ball(const palp_tool *tool) {
    return tool->shape == PALP_TOOL_OF_BALLS && tool->balls == 1u;
}

#endif
