/* SPDX-License-Identifier: MIT */
/* What the files of a lattice share. */
#ifndef PALP_CONTACT_LATTICE_INTERNAL_H
#define PALP_CONTACT_LATTICE_INTERNAL_H

#include "core/base/apart.h"
#include "core/contact/lattice.h"

#define PALP_LATTICE_MARKED                                                                        \
    0xfffeu /* in the table: a site not shot at yet whose point is to be kept */
#define PALP_LATTICE_MARGIN 0.6f /* edges beyond the tool within which nodes lead to regions */

/* One filling under way. */
typedef struct {
    palp_lattice *l;
    const palp_lattice_room *r;
    palp_frame moved; /* the tool, seen from the surface that the body as a whole has moved */
    bool central;
    uint32_t first;                              /* points of this tool begin here */
    uint32_t shots_left, crossings, rings, feet; /* left in this filling */
    uint32_t tests;                              /* of nodes near a field, left */
    bool full;                                   /* sites were left out */
    bool crowded;                                /* and nodes that say how zones are bent */
    uint32_t regions, end[PALP_LATTICE_SEEDS];   /* points of each region end here */
    float far_m;                                 /* gap up to which displacements far away matter */
    float unsure_m;       /* gap up to which points there are kept: they may carry force */
    float gap_m, area_m2; /* of measure_node */
    palp_surface_point deepest;
} palp_lattice_filling;

/* ---- where bodies are ---- */

/* Of two bodies the lattice is that of a tool that is neither. */
static inline bool palp_lattice_central(const palp_lattice_room *r) {
    return r->other.surface == NULL && palp_lattice_is_central(r->tool);
}

static inline bool palp_lattice_flat(const palp_lattice_room *r) {
    return r->other.surface == NULL && palp_lattice_is_flat(r->tool);
}

static inline const palp_surface *palp_lattice_surface(const palp_lattice_room *r, uint32_t body) {
    return &r->surface[body - r->first_body];
}

static inline const palp_frame *palp_lattice_frame(const palp_lattice_room *r, uint32_t body) {
    return &r->frame[body - r->first_body];
}

/* From a body's frame to the world, and back: places (out, into) and directions (turned). */
static inline palp_vec3 palp_lattice_out(const palp_lattice_room *r, uint32_t body, palp_vec3 x) {
    return r->frame != NULL ? palp_carry(palp_lattice_frame(r, body), x) : x;
}

static inline palp_vec3 palp_lattice_turned_out(const palp_lattice_room *r, uint32_t body,
                                                palp_vec3 v) {
    return r->frame != NULL ? palp_rotate(palp_lattice_frame(r, body)->r, v) : v;
}

static inline palp_vec3 palp_lattice_into(const palp_lattice_room *r, uint32_t body, palp_vec3 x) {
    return r->frame != NULL ? palp_carry_back(palp_lattice_frame(r, body), x) : x;
}

static inline palp_vec3 palp_lattice_turned_in(const palp_lattice_room *r, uint32_t body,
                                               palp_vec3 v) {
    return r->frame != NULL ? palp_rotate_back(palp_lattice_frame(r, body)->r, v) : v;
}

static inline palp_vec3 palp_lattice_world(const palp_lattice_room *r,
                                           const palp_surface_point *at) {
    return palp_lattice_out(r, at->body, at->y);
}

static inline palp_vec3 palp_lattice_normal(const palp_lattice_room *r,
                                            const palp_surface_point *at) {
    return palp_lattice_turned_out(r, at->body, at->n);
}

static inline palp_vec3 palp_lattice_node(const palp_lattice_room *r, uint32_t body,
                                          uint32_t node) {
    return palp_lattice_out(
        r, body, palp_vec3_at(palp_lattice_surface(r, body)->blob->rest_m + 3u * (size_t)node));
}

static inline palp_vec3 palp_lattice_center(const palp_lattice_room *r) {
    return palp_lattice_central(r) ? palp_rotate(r->at.r, r->tool->ball[0].center_m)
                                   : (palp_vec3){0};
}

/* Where a pad's face looks. */
static inline palp_vec3 palp_lattice_face(const palp_lattice_room *r) {
    return palp_rotate(r->at.r, r->tool->pad.axis[2]);
}

/* ---- lattice_table.c ---- */

/* The slot of a key: where it is, or where it would go; or, when PALP_LATTICE_PROBES slots in a row
 * have others, one of theirs: then there is no room for it. Sites that are shot at or marked are
 * fewer than half of the table, so that hardly ever happens. */
uint32_t palp_lattice_slot(const palp_lattice_table *table, uint32_t key);

static inline uint32_t palp_lattice_key(int32_t i, int32_t j) {
    return 0x80000000u | ((uint32_t)(i + 16384) & 0x7fffu) << 15u |
           ((uint32_t)(j + 16384) & 0x7fffu);
}

/* ---- lattice_shots.c ---- */

/* What the body as a whole has moved a place of the surface by, beyond the mean; *gone: how far it
 * is beyond the reach of the contact. */
palp_vec3 palp_lattice_beside(const palp_lattice_filling *f, palp_vec3 y, float *gone);

/* The gap at a place of the surface, as the body as a whole has moved it. */
palp_gap palp_lattice_gap(palp_lattice_filling *f, palp_vec3 y);

/* Where a line enters the surface, beginning on at->triangle of at->body and going on beyond seams.
 */
bool palp_lattice_enter(palp_lattice_filling *f, palp_vec3 from, palp_vec3 direction,
                        palp_surface_point *at);

/* Marks the sites next to the points that carried force in the last tick. They are kept whatever is
 * foreseen, so that only a solved contact lets them go. */
void palp_lattice_want_pressed(const palp_lattice_filling *f);

/* Fills the region around a point of the surface and keeps its deepest point for the next filling;
 * false if the lattice finds nothing there. */
bool palp_lattice_fill_region(palp_lattice_filling *f, const palp_surface_point *from);

/* The same, unless the lattice has shot at the site next to the point, or cannot. Each region that
 * it fills takes a shot. */
void palp_lattice_fill_unknown(palp_lattice_filling *f, const palp_surface_point *from);

/* ---- lattice_regions.c ---- */

/* Before there is a lattice: what overlaps, how much and where deepest; later: regions that no site
 * has shown. */
typedef enum { PALP_LATTICE_TO_MEASURE, PALP_LATTICE_TO_SEEK } palp_lattice_purpose;

/* Visits each node near the tool that faces it, and chooses those to be watched. */
void palp_lattice_visit(palp_lattice_filling *f, palp_lattice_purpose of);

/* Where the watched nodes are now. */
void palp_lattice_move_watched(palp_lattice *l, const palp_lattice_room *r);

/* ---- lattice_track.c ---- */

void palp_lattice_set_axis(palp_lattice *l, palp_vec3 axis);
void palp_lattice_set_origin(palp_lattice *l, const palp_lattice_room *r);

/* Spacing of the cells that are wanted in an area, squared. */
float palp_lattice_cell2(const palp_lattice_room *r, float area_m2);

/* Moves the lattice to what its points say of the overlap; true when another filling is worth it.
 */
bool palp_lattice_track(palp_lattice *l, const palp_lattice_room *r, const palp_lattice_filling *f);

#endif
