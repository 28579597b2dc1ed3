/* SPDX-License-Identifier: MIT */
#include "core/contact/lattice_internal.h"

#define ELSEWHERE 1.2f /* most motion elsewhere over that at the contact */
#define UNSURE 0.05f   /* of what it moves at the contact: how far off that may be */

bool palp_lattice_is_central(const palp_tool *tool) { return palp_tool_is_ball(tool); }

bool palp_lattice_is_flat(const palp_tool *tool) { return tool->shape == PALP_TOOL_PAD; }

/* Between two bodies each shot crosses the triangles of both. */
static uint32_t crossings_of(const palp_lattice_room *r) {
    const uint32_t crossings = PALP_LATTICE_CROSSINGS(r->most);
    return r->other.surface != NULL ? PALP_LATTICE_BETWEEN * crossings : crossings;
}

/* The longest mean edge. */
static float edge_of(const palp_lattice_room *r) {
    float edge = 0.0f;
    for (uint32_t b = 0; b < r->bodies; b++)
        edge = palp_max(edge, r->surface[b].blob->meta->mean_edge_m);
    return edge;
}

static void start_filling(palp_lattice_filling *f, palp_lattice *l, const palp_lattice_room *r,
                          uint32_t first) {
    palp_frame moved = r->at;
    moved.t = palp_sub(moved.t, r->far_field.mean_m);
    l->at.far_field = r->far_field;
    l->used = l->at;
    *f = (palp_lattice_filling){.l = l,
                                .r = r,
                                .moved = moved,
                                .central = palp_lattice_central(r),
                                .first = first,
                                .shots_left = PALP_LATTICE_SHOTS(r->most),
                                .crossings = crossings_of(r),
                                .rings = PALP_LATTICE_RINGS(r->most),
                                .feet = PALP_LATTICE_FEET(r->most),
                                .tests = PALP_LATTICE_TESTS,
                                .unsure_m = UNSURE * palp_norm(r->far_field.mean_m),
                                .far_m = ELSEWHERE * palp_norm(r->far_field.mean_m) +
                                         PALP_LATTICE_MARGIN * edge_of(r)};
    *r->count = first;
    palp_lattice_move_watched(l, r);
}

static bool begin(palp_lattice *l, const palp_lattice_room *r) {
    palp_lattice_filling a;
    l->placed = false;
    l->watched = 0;
    l->first_axis = (palp_vec3){0};
    l->at.back_m = l->at.whole = l->at.sunk = l->at.tip.radius_m = 0.0f;
    l->went = (palp_vec3){0};
    l->grew = 0.0f;
    start_filling(&a, l, r, *r->count);
    const uint32_t crossings = r->other.surface != NULL ? crossings_of(r) : PALP_LATTICE_MEASURE;
    a.crossings = crossings;
    palp_lattice_visit(&a, PALP_LATTICE_TO_MEASURE);
    r->done->fillings++;
    r->done->crossings += crossings - a.crossings;
    if (!(a.gap_m < 0.0f)) return false;
    float size = r->size_m, depth = -a.gap_m;
    palp_vec3 c = palp_add(a.moved.t, palp_lattice_center(r));
    const palp_vec3 deepest = palp_lattice_world(r, &a.deepest);
    palp_gap gap = palp_lattice_gap(&a, deepest);
    if (palp_lattice_central(r)) {
        palp_lattice_set_axis(l, palp_sub(deepest, c));
        palp_lattice_set_origin(l, r);
    } else {
        /* the nearest side of a thin tool may be another than the one that presses */
        const bool field = r->other.surface == NULL && r->tool->shape == PALP_TOOL_FIELD;
        const palp_vec3 into = palp_scale(-1.0f, palp_lattice_normal(r, &a.deepest));
        palp_lattice_set_axis(l, palp_lattice_flat(r) ? palp_lattice_face(r)
                                 : field              ? into
                                                      : gap.normal);
        l->at.origin_m = palp_sub(deepest, a.moved.t);
        l->at.origin_m =
            palp_madd(l->at.origin_m, -palp_dot(l->at.origin_m, l->at.axis), l->at.axis);
    }
    float area_m2 = palp_max(2.0f * PALP_PI_F * size * palp_min(depth, size), a.area_m2);
    float cell = palp_sqrt(palp_lattice_cell2(r, 0.5f * area_m2));
    l->at.spacing = cell;
    if (palp_lattice_central(r)) {
        float distance = palp_norm(palp_sub(deepest, palp_add(a.moved.t, l->at.origin_m)));
        l->at.spacing = palp_min(cell / palp_max(distance, 0.1f * size), 0.8f);
    }
    l->seeds = 1;
    l->seed[0] = a.deepest;
    l->placed = l->fresh = true;
    return true;
}

void palp_lattice_aim(palp_lattice *l, palp_vec3 axis, palp_vec3 aim_m) {
    *l = (palp_lattice){.carried = true};
    palp_lattice_set_axis(l, axis);
    l->at.origin_m = aim_m;
}

/* All regions, first those that were there before. */
static void fill(palp_lattice_filling *f, palp_lattice *l, const palp_lattice_room *r,
                 uint32_t first) {
    const uint32_t seeds = l->seeds;
    r->done->kept += r->count_before;
    if (palp_lattice_flat(r)) palp_lattice_set_axis(l, palp_lattice_face(r));
    start_filling(f, l, r, first);
    r->done->fillings++;
    l->seeds = 0;
    palp_lattice_want_pressed(f);
    for (uint32_t k = 0; k < seeds;
         k++) { /* which puts a seed in place of this or an earlier one */
        const palp_surface_point seed = l->seed[k];
        (void)palp_lattice_fill_region(f, &seed);
    }
    for (uint32_t k = 0; k < r->count_before; k++) { /* what has come apart since the last tick */
        const palp_contact_point *p = &r->before[k];
        if (p->patch == r->number && p->active) palp_lattice_fill_unknown(f, &p->at);
    }
    palp_lattice_visit(f, PALP_LATTICE_TO_SEEK);
    r->done->crossings += crossings_of(r) - f->crossings;
}

uint32_t palp_lattice_fill(palp_lattice *l, const palp_lattice_room *room, uint32_t first) {
    palp_lattice_filling f;
    *room->count = first;
    palp_lattice_clear(room->table);
    if (!l->placed) return begin(l, room) ? PALP_LATTICE_BEGUN : 0u;
    fill(&f, l, room, first);
    l->placed = *room->count > first;
    room->done->followed += *room->count - first;
    if (!l->placed) return PALP_LATTICE_MOVED; /* gone, or overtaken */
    bool moved = palp_lattice_track(l, room, &f);
    const bool lost = f.crossings == 0u || f.tests == 0u;
    return (f.full ? PALP_LATTICE_FULL : 0u) | (lost ? PALP_LATTICE_LOST : 0u) |
           (moved || f.full ? PALP_LATTICE_MOVED : 0u);
}
