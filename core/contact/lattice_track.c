/* SPDX-License-Identifier: MIT */
/* How a lattice follows the overlap: its axis, origin and spacing. */
#include "core/contact/lattice_internal.h"

#define FARTHEST -0.7f  /* cosine with the first axis at which one begins anew */
#define SHALLOW 0.4f    /* overlap over the size, from which a sphere's shots come from behind it */
#define OFF 0.1f        /* of the size: how far off the surface a tip may be found */
#define WHOLE 0.1f      /* change of that in a filling */
#define SUNK 0.8f       /* and from which it has sunk in, */
#define SUNK_ALL 1.2f   /* up to here */
#define FAR_BEHIND 2.0f /* over the size: where shots of one that has sunk in come from, besides */
#define DAMPED 0.4f     /* share of a change that turns back on the last one */
#define LARGE 0.1f      /* weight over the largest region's, at which a region counts half */
#define APART 0.6f      /* length of the mean direction up to which an axis hardly follows */
#define GATHERED 0.8f   /* and from which it follows at once */
#define SLOWEST 0.03f   /* share of a change that it takes up in a filling at least */
#define SLOWER 0.3f     /* the same of the spacing, over several regions */
#define COVERS 0.4f  /* share of a pad's face from which a lattice begins to keep to its middle */
#define COVERED 0.8f /* and keeps to it */
#define FLOOR 0.015f /* radius that the smallest contact is taken to have, over the tool's size */
#define CELL_CHANGE 0.06f /* relative change of the cells that calls for another filling */

/* The tangent for an axis: that of the first one, turned along the shortest way. So it depends on
 * the axis alone, and not on the way that it has come. */
static palp_vec3 tangent_for(const palp_lattice *l, palp_vec3 axis) {
    const float facing = 1.0f + palp_dot(l->first_axis, axis);
    const palp_vec3 t = l->first_tangent;
    return palp_madd(t, -palp_dot(t, axis) / facing, palp_add(l->first_axis, axis));
}

void palp_lattice_set_axis(palp_lattice *l, palp_vec3 axis) {
    float length = palp_norm(axis);
    if (!(length > 1e-20f)) return;
    l->at.axis = palp_scale(1.0f / length, axis);
    const bool begun = !l->carried && palp_dot(l->first_axis, l->first_axis) > 0.0f;
    if (!begun || palp_dot(l->first_axis, l->at.axis) < FARTHEST) {
        const palp_vec3 x = {1.0f, 0.0f, 0.0f}, y = {0.0f, 1.0f, 0.0f};
        palp_vec3 t =
            palp_madd(l->at.tangent[0], -palp_dot(l->at.tangent[0], l->at.axis), l->at.axis);
        if (palp_norm(t) < 0.3f) {
            t = palp_abs(l->at.axis.x) < 0.7f ? x : y;
            t = palp_madd(t, -palp_dot(t, l->at.axis), l->at.axis);
        }
        l->first_axis = l->at.axis;
        l->first_tangent = palp_scale(1.0f / palp_norm(t), t);
    }
    l->at.tangent[0] = tangent_for(l, l->at.axis);
    l->at.tangent[0] = palp_scale(1.0f / palp_norm(l->at.tangent[0]), l->at.tangent[0]);
    l->at.tangent[1] = palp_cross(l->at.axis, l->at.tangent[0]);
}

void palp_lattice_set_origin(palp_lattice *l, const palp_lattice_room *r) {
    if (palp_lattice_central(r))
        l->at.origin_m = palp_madd(palp_lattice_center(r), -l->at.back_m, l->at.axis);
}

float palp_lattice_cell2(const palp_lattice_room *r, float area_m2) {
    float floor = FLOOR * r->size_m;
    return (area_m2 + PALP_PI_F * floor * floor) / (PALP_LATTICE_CELL * r->cells);
}

static float face_m2(const palp_tool *tool) {
    return 4.0f * tool->pad.half_m[0] * tool->pad.half_m[1];
}

/* How far the lattice keeps to the middle and the size of a pad. Where a face lies on the body as a
 * whole, what overlaps ends with the face: its mean place jumps as points come in at one side and
 * go out at the other, with the spacing after them, and a lattice that followed would go to and
 * fro. */
static float covered(const palp_lattice_room *r, float area_m2) {
    if (!palp_lattice_flat(r)) return 0.0f;
    return palp_clamp((area_m2 / face_m2(r->tool) - COVERS) / (COVERED - COVERS), 0.0f, 1.0f);
}

/* A change that turns back on the last one is damped, so that a lattice does not go to and fro
 * between two places of which each points to the other. */
static float damping(float along) { return along < 0.0f ? DAMPED : 1.0f; }

/*
 * Where a sphere's axis is to point: to the mean of its regions' directions, each by its weight but
 * a large one not by more than a small one, so that all of them lie in the map. Shorter than 1 by
 * how far the overlap is apart. Of one that has sunk in, the shots come from far behind, and would turn
 * it the more the more it has turned: then, by the share `sunk`, the surface says what is ahead.
 */
static palp_vec3 axis_toward(const palp_lattice_room *r, const palp_lattice_filling *f,
                             float sunk) {
    palp_vec3 toward[PALP_LATTICE_SEEDS], mean = {.x = 0.0f};
    float weight[PALP_LATTICE_SEEDS], most = 0.0f, all = 0.0f;
    uint32_t k = f->first;
    for (uint32_t n = 0; n < f->regions; n++) {
        toward[n] = (palp_vec3){.x = 0.0f};
        weight[n] = 0.0f;
        for (; k < f->end[n]; k++) {
            const palp_contact_point *p = &r->point[k];
            float w = p->cell_m * p->cell_m * p->overlap_m;
            toward[n] = palp_madd(toward[n], w * (1.0f - sunk), p->direction);
            toward[n] = palp_madd(toward[n], -w * sunk, p->n);
            weight[n] += w;
        }
        most = palp_max(most, weight[n]);
    }
    for (uint32_t n = 0; n < f->regions; n++) {
        if (!(weight[n] > 0.0f)) continue;
        float share = weight[n] / (weight[n] + LARGE * most);
        mean = palp_madd(mean, share / weight[n], toward[n]);
        all += share;
    }
    return palp_scale(1.0f / palp_max(all, 1e-30f), mean);
}

/* How far the axis follows in one filling. Between regions on opposite sides the mean direction
 * swings with each point that comes or goes, and would take all points with it. */
static float following(float length) {
    return palp_clamp((length - APART) / (GATHERED - APART), SLOWEST, 1.0f);
}

/* How far a tool that flares is pressed deeper than it is thick. */
static float sunk(const palp_lattice_room *r, float deepest_m) {
    if (r->other.surface != NULL || !palp_tool_flares(r->tool)) return 0.0f;
    const bool cylinder = r->tool->shape == PALP_TOOL_CYLINDER;
    const float half = cylinder ? r->tool->cylinder.radius_m : r->size_m;
    return palp_clamp((deepest_m / half - SUNK) / (SUNK_ALL - SUNK), 0.0f, 1.0f);
}

/* The part of a field that is pressed: where the axis leaves it below the deepest point, while that
 * can be told. */
static void find_tip(palp_lattice *l, const palp_lattice_room *r, const palp_lattice_filling *f,
                     const palp_contact_point *deepest) {
    const palp_tool_press press = palp_lattice_press(&l->used, deepest->n);
    float gone;
    if (r->other.surface != NULL || r->tool->shape != PALP_TOOL_FIELD || l->at.sunk > 0.0f) return;
    const palp_vec3 y = palp_add(deepest->y, palp_lattice_beside(f, deepest->y, &gone));
    const palp_gap gap = palp_tool_gap_along(r->tool, &f->moved, y, &press);
    const float facing = palp_dot(gap.normal, press.axis);
    r->done->evaluations += 3u + PALP_TOOL_EXIT;
    if (!(gap.gap_m < 0.0f) || facing < 0.5f) return;
    const palp_vec3 e = palp_madd(y, -gap.gap_m / facing, press.axis);
    if (palp_abs(palp_tool_gap(r->tool, &f->moved, e).gap_m) > OFF * r->size_m) return;
    l->at.tip = palp_tool_tip(&r->tool->field, palp_carry_back(&f->moved, e),
                              palp_rotate_back(f->moved.r, gap.normal));
}

bool palp_lattice_track(palp_lattice *l, const palp_lattice_room *r,
                        const palp_lattice_filling *f) {
    float weight = 0.0f, square = 0.0f, cells = 0.0f, deepest = 0.0f;
    palp_vec3 aside = {0}, out = {0};
    const palp_contact_point *lowest = &r->point[f->first];
    for (uint32_t k = f->first; k < *r->count; k++) {
        const palp_contact_point *p = &r->point[k];
        float area = PALP_LATTICE_CELL * p->cell_m * p->cell_m, w = area * p->overlap_m;
        palp_vec3 off = palp_sub(p->q, palp_add(f->moved.t, l->at.origin_m));
        weight += w;
        square += w * p->overlap_m;
        cells += w * area;
        if (p->overlap_m > deepest) lowest = p;
        deepest = palp_max(deepest, p->overlap_m);
        aside = palp_madd(aside, w, off);
        if (!f->central) out = palp_madd(out, -w, p->n);
    }
    if (!(weight > 0.0f) || !(square > 0.0f)) return false;
    float area_m2 = 4.0f / 3.0f * weight * weight / square;
    l->at.fixed = covered(r, area_m2);
    float cell2 = palp_lattice_cell2(r, 0.5f * area_m2);
    if (l->at.fixed > 0.0f) /* all of it in contact */
        cell2 += l->at.fixed * (face_m2(r->tool) / (PALP_LATTICE_CELL * r->cells) - cell2);
    float change2 = cell2 * PALP_LATTICE_CELL * weight / cells;
    if (f->full) change2 = palp_max(change2, l->fresh && r->other.surface == NULL ? 2.25f : 1.3f);
    l->fresh = l->fresh && f->full;
    float change = palp_sqrt(palp_clamp(change2, 0.25f, 4.0f));
    const float slow = f->regions > 1u ? SLOWER : 1.0f;
    change = 1.0f + slow * damping((change - 1.0f) * l->grew) * (change - 1.0f);
    l->grew = change - 1.0f;
    palp_vec3 went;
    l->at.whole = palp_clamp(l->at.whole + (f->regions > 1u ? -WHOLE : WHOLE), 0.0f, 1.0f);
    find_tip(l, r, f, lowest);
    l->at.sunk = l->at.whole * sunk(r, deepest);
    if (f->central) {
        const palp_vec3 before = l->at.axis, toward = axis_toward(r, f, l->at.sunk);
        const float follows = following(palp_norm(toward));
        l->apart = follows < 1.0f;
        palp_lattice_set_axis(l, toward);
        went = palp_scale(1.0f / l->at.spacing, palp_sub(l->at.axis, before));
        float share = damping(palp_dot(went, l->went)) * follows;
        palp_lattice_set_axis(l, palp_madd(before, share, palp_sub(l->at.axis, before)));
        went = palp_scale(share, went);
        l->at.spacing = palp_min(l->at.spacing * change, 0.8f);
    } else {
        palp_vec3 shift = palp_scale(1.0f / weight, aside);
        shift = palp_madd(palp_scale(1.0f - l->at.fixed, shift), -l->at.fixed, l->at.origin_m);
        if (!palp_lattice_flat(r)) palp_lattice_set_axis(l, out);
        shift = palp_madd(shift, -palp_dot(shift, l->at.axis), l->at.axis);
        went = palp_scale(1.0f / l->at.spacing, shift);
        float share = damping(palp_dot(went, l->went));
        l->at.origin_m = palp_madd(l->at.origin_m, share, shift);
        l->at.origin_m =
            palp_madd(l->at.origin_m, -palp_dot(l->at.origin_m, l->at.axis), l->at.axis);
        went = palp_scale(share, went);
        l->at.spacing *= change;
    }
    l->went = went;
    const float size = r->size_m;
    const float behind = deepest - SHALLOW * size + FAR_BEHIND * l->at.sunk * size;
    const float back = f->central ? palp_max(behind, 0.0f) : 0.0f;
    const float moved = palp_norm(went) + palp_abs(back - l->at.back_m) / size;
    l->at.back_m = back;
    palp_lattice_set_origin(l, r);
    return palp_abs(change - 1.0f) > CELL_CHANGE || moved > 0.25f;
}
