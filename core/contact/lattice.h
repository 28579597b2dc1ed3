/* SPDX-License-Identifier: MIT */
/*
 * Contact points that travel with a tool: one hexagonal lattice over all that it overlaps.
 *
 * Of a multizone model one lattice goes over all zones: a shot that comes to a seam goes on in the
 * zone beyond it.
 *
 * A sphere sends its shots from its centre, along the points of a lattice in Lambert's equal-area
 * map about the lattice's axis; every other tool sends them side by side, along the axis. Where a
 * shot enters the surface lies a contact point. Points come where the tool overlaps the surface,
 * and go where it does not and they carried no force. The lattice tracks the overlap
 *
 *     axis     sum a_i d_i direction_i, normalised (a sphere); origin sum a_i d_i x_i / sum a_i d_i
 *     spacing  mean cell = (A / 2 + pi (.015 R)^2) / cells,
 *              A = 4/3 (sum a_i d_i)^2 / sum a_i d_i^2
 *
 * (a_i: area of the cell, d_i: overlap), so that about `cells` of the points come to carry force,
 * whatever the size of the contact and however many regions it has. Of several regions the axis
 * takes the mean of their directions, and follows slowly where they lie on opposite sides.
 *
 * The overlap is that with the surface as the body as a whole has moved it in the last tick
 * (far_field.h; beyond its reach as the watched node nearest by), so d_i is what is left for the
 * contact's own neighbourhood. A sphere that is pressed deeper than 0.4 of its radius sends its
 * shots from behind its centre, so that they still meet the surface from above.
 *
 * A tool pressed deeper than it is thick has its surface partly behind its middle. On one region that looks
 * against the axis its overlap is told by where the axis leaves the tool (palp_tool_gap_along), and its
 * sides flare (palp_tool_gap_flared), so that what it has come over neither opens nor lets it through.
 */
#ifndef PALP_CONTACT_LATTICE_H
#define PALP_CONTACT_LATTICE_H

#include "core/contact/facing.h"
#include "core/contact/far_field.h"
#include "core/contact/tool.h"
#include "core/surface/surface.h"

#define PALP_LATTICE_SLOTS 1024u /* of the table of sites; a power of two */
#define PALP_LATTICE_PROBES 16u  /* of them that are looked at for a site */
#define PALP_LATTICE_CELL                                                                          \
    0.8660254f                   /* area of a cell over its spacing squared; height of a row       \
                                  */
#define PALP_LATTICE_SEEDS 8u    /* regions that are tracked */
#define PALP_LATTICE_FILLINGS 4u /* of a tick at most, its beginning among them */
/* What one filling does at most, with room for so many points. */
#define PALP_LATTICE_SHOTS(room) (3u * (room) / 2u + 36u) /* at sites, one each */
#define PALP_LATTICE_CROSSINGS(room) (5u * (room) + 180u) /* triangles crossed by all shots */
#define PALP_LATTICE_BETWEEN 3u                           /* times as many between two bodies */
#define PALP_LATTICE_MEASURE 96u                          /* and before there is a lattice */
#define PALP_LATTICE_RINGS(room) ((room) / 4u + 8u)  /* nodes compared with all their neighbours */
#define PALP_LATTICE_FEET(room) ((room) / 16u + 3u)  /* nearest points sought, four shots each */
#define PALP_LATTICE_WANTED(room) (3u * (room) / 5u) /* points kept because they carried force */
#define PALP_LATTICE_WATCHED 4u /* nodes beyond the reach of the contact that are kept in sight */
#define PALP_LATTICE_TESTS 256u /* nodes near a field that are tested in one filling */
#define PALP_LATTICE_BENT                                                                          \
    48u /* nodes of a zone asked how they are bent, before there is a lattice */
#define PALP_LATTICE_FAR_MODES 16u /* which say how the body has moved them */

/* One contact point. */
typedef struct {
    palp_surface_point at; /* in the frame of its body */
    palp_vec3 q, y, n;     /* the same where the body is */
    palp_vec3 direction;   /* of its shot */
    float shot_m;          /* length of the shot, to at.q */
    float facing;          /* - n . direction */
    float cell_m;          /* spacing of the regular lattice that it stands for */
    float overlap_m;       /* with the surface as the body as a whole has moved it; not below 0 */
    uint32_t patch;        /* whose lattice it belongs to */
    int16_t i, j;          /* site in it */
    palp_vec3 out;         /* out of the tool, into the body: direction of the force on the body */
    palp_vec3 arm_m;       /* from the tool's reference point, times out */
    palp_vec3 m, u_m; /* the same, and the displacement of the last solve, in the body's frame */
    float force_N;    /* along m, not negative */
    bool active;      /* in contact */
    bool left_out;    /* of this tick's active set: its pivot vanished */
    uint8_t region;   /* of those in contact, set by palp_contact_regions */
} palp_contact_point;

/* Which point lies at each site of a lattice. */
typedef struct {
    uint32_t key[PALP_LATTICE_SLOTS];   /* of a site, never 0; 0: empty */
    uint16_t point[PALP_LATTICE_SLOTS]; /* number, or PALP_LATTICE_MISS */
} palp_lattice_table;

#define PALP_LATTICE_MISS 0xffffu

/* How a lattice lies. */
typedef struct {
    palp_vec3 axis, tangent[2]; /* orthonormal */
    palp_vec3 origin_m;         /* of the shots, from the tool's reference point */
    float back_m;  /* from how far behind a sphere's centre its shots come, along -axis */
    float whole;   /* 0 to 1: how far what is touched is one region, */
    float sunk;    /* and pressed deeper than the tool is thick */
    palp_ball tip; /* of a field, from before it had */
    float spacing; /* rad for a sphere, else m */
    palp_far_field far_field; /* by the body as a whole */
    float fixed; /* 0 to 1: how far origin and spacing are those of a pad whose face is covered */
} palp_lattice_state;

/* As a place with the normal n at rest sees it: one that looks aside is not come over. */
static inline palp_tool_press palp_lattice_press(const palp_lattice_state *state, palp_vec3 n) {
    const float faces = palp_clamp(-2.0f * palp_dot(n, state->axis) - 1.0f, 0.0f, 1.0f);
    const palp_tool_press press = {state->axis, faces * state->whole, faces * state->sunk,
                                   state->tip};
    return press;
}

/* A node beyond the reach of the contact that the tool may come to touch, and what the largest
 * modes have moved it by. */
typedef struct {
    uint32_t body, node;
    palp_vec3 x_m, u_m;
    float gap_m;
} palp_lattice_watch;

typedef struct {
    palp_lattice_state at;               /* where the next filling will be */
    palp_lattice_state used;             /* of the points of this tick */
    palp_vec3 first_axis, first_tangent; /* of the touch, which the tangents follow */
    bool carried;                        /* they follow from tick to tick instead: between zones */
    palp_vec3 went; /* how axis or origin changed in the last filling, over the spacing */
    float grew;     /* and the spacing, less 1 */
    bool placed;
    bool fresh; /* begun, and wider than the room for points since */
    bool apart; /* its axis follows slowly, between regions */
    uint32_t watched;
    palp_lattice_watch watch[PALP_LATTICE_WATCHED];
    uint32_t seeds;
    palp_surface_point seed[PALP_LATTICE_SEEDS];
    palp_far_field bent; /* how nodes around the tool are bent, found while there is no lattice */
    float narrowed;      /* share of the tool's size that is left out of it: too many nodes */
    uint32_t facing;     /* triangle of the other body that was met last */
} palp_lattice;

/* What fillings did: tables begun, nodes and rows of cells visited, nodes within reach tested, gaps
 * of the tool evaluated, feet sought, shots and the triangles that they crossed, points of the last
 * tick looked for, points that the lattice follows, nodes asked how they are bent. */
typedef struct {
    uint32_t fillings, around, nodes, evaluations, feet, shots, crossings, kept, followed, bent;
} palp_lattice_counts;

/* What a lattice works on. */
typedef struct {
    const palp_surface *surface;   /* [bodies] */
    uint32_t bodies, first_body;   /* number of the first */
    const palp_frame *frame;       /* [bodies]; NULL: one that is where it is at rest */
    const uint32_t *const *beyond; /* [bodies][triangles][3] across seams: body << 24 | triangle;
                                      PALP_NONE elsewhere; NULL: none */
    const palp_tool *tool;
    palp_facing_body other;    /* what presses instead of a tool; without a surface: a tool */
    uint32_t facing;           /* a triangle of it near where the two meet */
    float size_m;              /* of what presses: palp_tool_size */
    float reach_m;             /* within which nodes are visited: palp_lattice_reach */
    uint32_t number;           /* of the patch */
    palp_frame at;             /* where it is; of two bodies only its place counts */
    float cells;               /* wanted in contact */
    palp_far_field far_field;  /* by the body as a whole, as foreseen, and as it is bent */
    const float *load;         /* [far_modes] of the modes, in the last tick */
    uint32_t far_modes;        /* PALP_LATTICE_FAR_MODES, or all that there are */
    float share;               /* of what they displace by, as foreseen */
    palp_contact_point *point; /* [most], the first *count in use by the tools before */
    uint32_t *count, most;
    const palp_contact_point *before; /* [count_before] of the last tick, of all tools */
    uint32_t count_before;
    palp_lattice_table *table; /* of this tool and tick */
    palp_lattice_counts *done; /* so far, in this tick */
} palp_lattice_room;

#define PALP_LATTICE_FULL 1u  /* more points or shots were wanted than there is room for */
#define PALP_LATTICE_MOVED 2u /* the overlap asks for another filling */
#define PALP_LATTICE_LOST                                                                          \
    8u                        /* shots ended before they met anything, or nodes near a field were
                                 not tested: too many */
#define PALP_LATTICE_BEGUN 4u /* laid where the tool overlaps, still without points: fill it */

/*
 * Lays the lattice for the tool where it is and puts its points behind the first `first` of the
 * room, in place of those that an earlier filling of this tick left there; where there is no
 * lattice yet it only begins one. Returns flags. Cost: one visit of every node around the tool, and
 * the counts above.
 */
uint32_t palp_lattice_fill(palp_lattice *lattice, const palp_lattice_room *room, uint32_t first);

/* The next filling searches where two bodies overlap, about the reference point displaced by
 * aim_m and along `axis`. */
void palp_lattice_aim(palp_lattice *lattice, palp_vec3 axis, palp_vec3 aim_m);

/* The point at a node of one of several bodies. */
palp_surface_point palp_lattice_at_node(const palp_surface *surface, uint32_t body, uint32_t node);

/* Radius about its reference point within which a tool's filling visits nodes (m). */
float palp_lattice_reach(const palp_tool *tool, const palp_blob *blob);

/* The point at a site of the lattice, or PALP_LATTICE_MISS. */
uint32_t palp_lattice_find(const palp_lattice_table *table, int16_t i, int16_t j);
void palp_lattice_clear(palp_lattice_table *table);

/* d cell_m / d facing */
float palp_lattice_cell_slope(const palp_contact_point *point);

/* One ball: shots from its centre. A pad: an axis of its own, which it keeps. */
bool palp_lattice_is_central(const palp_tool *tool);
bool palp_lattice_is_flat(const palp_tool *tool);

#endif
