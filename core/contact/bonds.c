/* SPDX-License-Identifier: MIT */
/*
 * What bonded bodies do to each other: the seams' part of the compliance between points
 * (zone/assembly.h). A point pushes its triangle's corners by their weights, free nodes and those
 * on seams alike.
 */
#include "core/contact/contact_internal.h"

static void clear(float *x, size_t n) {
    for (size_t i = 0; i < n; i++) x[i] = 0.0f;
}

/* What the seams of a zone feel of a force at a place of its surface. */
static void feel(palp_contact *c, uint32_t level, uint32_t zone, const palp_surface_point *at,
                 palp_vec3 force) {
    const palp_blob *b = &c->assembly->zones->blob[zone];
    const uint32_t *corner = b->triangle + 3u * (size_t)at->triangle;
    for (uint32_t k = 0; k < 3u; k++)
        palp_assembly_modal_load(c->assembly, level, zone, corner[k],
                                 palp_scale(at->weight[k], force), c->felt);
    c->work_done += 27u * (uint32_t)palp_assembly_modes(c->assembly, zone);
}

void palp_contact_bond(palp_contact *c) {
    palp_assembly *a = c->assembly;
    palp_seams *q = &a->seams;
    const palp_seam_factor *f = palp_seams_factor(q);
    const size_t n = 3u * (size_t)q->modes, stride = c->side_room;
    float *rest = c->seam + n * stride;
    const uint32_t lanes = (c->sides + LANES - 1u) / LANES * LANES; /* at most side_room */
    uint64_t touched = 0, own = 0;
    for (uint32_t s = 0; s < q->zones->meta->seams; s++) {
        const size_t first = 3u * (size_t)q->first_mode[s];
        for (size_t i = first; i < first + 3u * palp_seam_modes(q, s, f->level); i++) {
            clear(c->seam + i * stride, lanes);
            clear(rest + i * stride, lanes);
        }
    }
    for (uint32_t s = 0; s < c->sides; s++) {
        const uint32_t zone = palp_contact_body(c, s);
        const palp_zone_part *part = &a->zones->part[zone];
        clear(c->felt, 3u * a->zones->zone[zone].modes);
        feel(c, f->level, zone, palp_contact_side(c, s), palp_contact_column(c, COL_M, s));
        palp_seams_load_among(q, a->configuration, zone, c->felt, c->seam + s, stride);
        palp_seams_load_among(q, NULL, zone, c->felt, rest + s, stride);
        for (uint32_t k = 0; k < part->seams; k++) touched |= 1ull << part->seam[k];
        c->work_done += 30u * (uint32_t)palp_assembly_modes(a, zone);
    }
    own = touched;
    palp_seams_forward_many(q, f, c->seam, stride, lanes, &touched);
    palp_seams_forward_many(q, palp_seams_at_rest(q), rest, stride, lanes, &own);
    c->seam_touched = touched;
}

/* row[j] += sign y_side . y_j over the unknowns of the seams that are touched. */
static void add_products(const palp_contact *c, const float *y, uint32_t side, uint32_t first,
                         uint32_t end, float sign, float *restrict row) {
    const palp_seams *q = &c->assembly->seams;
    const uint32_t level = palp_seams_factor(q)->level;
    const size_t stride = c->side_room;
    for (uint32_t s = 0; s < q->zones->meta->seams; s++) {
        if ((c->seam_touched >> s & 1u) == 0u) continue;
        const uint32_t n = 3u * palp_seam_modes(q, s, level);
        const float *from = y + 3u * (size_t)q->first_mode[s] * stride;
        for (uint32_t i = 0; i < n; i++, from += stride) {
            const float w = sign * from[side];
            for (uint32_t j = first; j < end; j++) row[j] += w * from[j];
        }
    }
}

void palp_contact_bond_row(palp_contact *c, uint32_t side, uint32_t first, uint32_t end,
                           float *row) {
    const size_t n = 3u * (size_t)c->assembly->seams.modes;
    add_products(c, c->seam, side, first, end, 1.0f, row);
    add_products(c, c->seam + n * c->side_room, side, first, end, -1.0f, row);
    c->work_done += 2u * (uint64_t)n * (end - first);
}

/* What the seams of a zone feel of all forces that press it; false if there are none. */
static bool feel_all(palp_contact *c, uint32_t zone) {
    const palp_contact_run *in = &c->pressed_of[zone];
    const uint32_t level = palp_seams_factor(&c->assembly->seams)->level;
    clear(c->felt, 3u * c->assembly->zones->zone[zone].modes);
    for (uint32_t k = in->first; k < in->end; k++) {
        const palp_vec3 f = {c->pressed[IN_F][k], c->pressed[IN_F + 1][k], c->pressed[IN_F + 2][k]};
        if (palp_dot(f, f) > 0.0f)
            feel(c, level, zone, palp_contact_side(c, c->pressed_side[k]), f);
    }
    return in->end > in->first;
}

void palp_contact_bond_corners(palp_contact *c) {
    palp_assembly *a = c->assembly;
    const uint32_t n = 3u * a->seams.modes, level = palp_seams_factor(&a->seams)->level;
    clear(c->answer, 2u * n);
    for (uint32_t b = 0; b < c->bodies; b++) {
        if (feel_all(c, b)) palp_assembly_add_modal_load(a, b, c->felt, c->answer);
    }
    palp_assembly_answer(a, c->answer);
    for (uint32_t b = 0; b < c->bodies; b++) {
        bool any = false;
        for (uint32_t k = 0; k < c->nodes; k++) any = any || c->node_body[k] == b;
        if (!any) continue;
        palp_assembly_answer_of(a, b, c->answer, c->felt);
        for (uint32_t k = 0; k < c->nodes; k++) {
            if (c->node_body[k] != b) continue;
            palp_vec3 u = palp_assembly_modal_displacement(a, level, b, c->node[k], c->felt);
            c->node_u_m[k] = palp_add(c->node_u_m[k], u);
            c->work_done += 9u * (uint32_t)palp_assembly_modes(a, b);
        }
    }
}

void palp_contact_load_seams(palp_contact *c) {
    const palp_contact_point *point = c->solved ? c->point : c->before;
    const palp_contact_facing *facing = c->solved ? c->facing : c->facing_before;
    const uint32_t points = c->solved ? c->count : c->count_before;
    if (c->assembly == NULL) return;
    const uint32_t finest = c->assembly->seams.finest;
    palp_assembly_unload(c->assembly);
    for (uint32_t b = 0; b < c->bodies; b++) {
        bool any = false;
        clear(c->felt, 3u * c->assembly->zones->zone[b].modes);
        for (uint32_t i = 0; i < points; i++) {
            const palp_contact_point *p = &point[i];
            const palp_contact_patch *patch = &c->patch[p->patch];
            const bool here = p->at.body == b;
            const bool there = patch->tool == PALP_CONTACT_TOOLS && patch->other == b;
            if (!(p->force_N > 0.0f) || !(here || there)) continue;
            const palp_surface_point *at = here ? &p->at : &facing[i].at;
            feel(c, finest, b, at, palp_scale(p->force_N, here ? p->m : facing[i].m));
            any = true;
        }
        if (any) palp_assembly_load(c->assembly, b, c->felt);
    }
}
