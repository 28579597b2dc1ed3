/* SPDX-License-Identifier: MIT */
/* What is asked of the contact points of a tick, and what each side of them presses. */
#include "core/base/apart.h"
#include "core/contact/contact_internal.h"
#include "core/contact/facing.h"

#define COME_OVER 0.2f
#define OTHER_LATTICE 0.15f /* change of the spacing from which places are others */

/* ---- the last tick ---- */

static int16_t nearest(float x) {
    x = palp_clamp(x, -16000.0f, 16000.0f);
    return (int16_t)(x + (x >= 0.0f ? 0.5f : -0.5f));
}

/* The contact point of the last tick at the same place of the lattice, or next to it; NULL if
 * there is none. */
static const palp_contact_point *last_of(const palp_contact *c, const palp_contact_point *p,
                                         bool *same) {
    static const int16_t step[7][2] = {{0, 0}, {1, 0}, {0, 1}, {-1, 1}, {-1, 0}, {0, -1}, {1, -1}};
    const palp_contact_patch *patch = &c->patch[p->patch];
    const float before = patch->spacing_before;
    float scale = before > 0.0f ? patch->lattice.used.spacing / before : 1.0f;
    const bool changed = palp_abs(scale - 1.0f) > OTHER_LATTICE;
    if (!changed) scale = 1.0f;
    const int16_t i = nearest(scale * (float)p->i), j = nearest(scale * (float)p->j);
    for (uint32_t k = 0; k < 7u; k++) {
        uint32_t at = palp_lattice_find(patch->table_before, (int16_t)(i + step[k][0]),
                                        (int16_t)(j + step[k][1]));
        *same = k == 0u && !changed;
        if (at >= c->count_before) continue;
        const palp_contact_point *q = &c->before[at];
        /* the table of a patch that was left out is an older one */
        if (q->patch == p->patch && q->i == (int16_t)(i + step[k][0]) &&
            q->j == (int16_t)(j + step[k][1]))
            return q;
    }
    return NULL;
}

/* ---- corners ---- */

/* Puts a node at the end of the list; returns how many there are then. */
static uint32_t list_node(palp_contact *c, uint32_t body, uint32_t node) {
    c->node_bent_m[c->nodes] = palp_surface_bent(&c->surface[body], node);
    c->node_body[c->nodes] = body;
    c->node[c->nodes++] = node;
    return c->nodes;
}

/* Where a node is in the list. One whose PALP_CONTACT_NODE_PROBES slots all have others is listed
 * once for each corner, for which there is room. */
static uint32_t place_in_list(palp_contact *c, uint32_t body, uint32_t node) {
    uint32_t slot = ((node + 65536u * body) * 2654435761u) >> 22u;
    for (uint32_t k = 0; k < PALP_CONTACT_NODE_PROBES; k++, slot++) {
        slot &= PALP_CONTACT_NODE_SLOTS - 1u;
        const uint32_t n = c->node_slot[slot];
        if (n > 0u && c->node[n - 1u] == node && c->node_body[n - 1u] == body) return n - 1u;
        if (n > 0u) continue;
        c->node_slot[slot] = (uint16_t)list_node(c, body, node);
        return c->nodes - 1u;
    }
    return list_node(c, body, node) - 1u;
}

void palp_contact_forget_nodes(palp_contact *c) {
    for (uint32_t k = 0; k < PALP_CONTACT_NODE_SLOTS; k++) c->node_slot[k] = 0;
    c->nodes = 0;
}

/* Lists the corners of a side; returns how its place is bent. */
static palp_vec3 list_corners(palp_contact *c, uint32_t side, uint32_t body,
                              const palp_surface_point *at) {
    const palp_surface *surface = &c->surface[body];
    const uint32_t *v = surface->blob->triangle + 3u * (size_t)at->triangle;
    palp_vec3 bent = {0};
    for (uint32_t k = 0; k < 3u; k++) {
        c->corner[side][k] = (uint16_t)place_in_list(c, body, v[k]);
        if (surface->assembly != NULL)
            bent = palp_madd(bent, at->weight[k], c->node_bent_m[c->corner[side][k]]);
    }
    return bent;
}

/* ---- sides ---- */

/* The sides of one body that come one behind the other. */
static void add_to_run(palp_contact *c, uint32_t body, uint32_t side) {
    if (c->runs > 0u && side != c->count) { /* where those of points end */
        palp_contact_run *last = &c->run[c->runs - 1u];
        if (last->body == body && last->end == side) {
            last->end = side + 1u;
            return;
        }
    }
    c->run[c->runs++] = (palp_contact_run){body, side, side + 1u};
}

/* Puts one side of a point among the others, with the unit load along m on its body. */
static void add_side(palp_contact *c, uint32_t point, uint32_t side, uint32_t body,
                     const palp_surface_point *at, palp_vec3 m) {
    const palp_contact_point *p = &c->point[point];
    const float of[11] = {at->y.x, at->y.y, at->y.z, at->n.x,   at->n.y,        at->n.z,
                          m.x,     m.y,     m.z,     p->cell_m, (float)p->patch};
    const uint32_t modes = c->level.modes;
    for (uint32_t k = 0; k < 11u; k++) c->column[k][side] = of[k];
    c->side_point[side] = (uint16_t)point;
    add_to_run(c, body, side);
    palp_surface_modes(&c->surface[body], at, m, modes, c->mode + side, c->side_room);
    c->work_done += 120u + 9u * modes;
}

uint32_t palp_contact_other_triangle(const palp_contact *contact, const palp_contact_patch *patch) {
    return contact->surface[patch->other].blob->regular.triangle[patch->before];
}

/* The direction and the place that a point of one zone meets another one in, where both have gone
 * together. */
PALP_APART static void meet(palp_contact *c, uint32_t i) {
    palp_contact_point *p = &c->point[i];
    palp_contact_patch *patch = &c->patch[p->patch];
    palp_contact_facing *z = &c->facing[i];
    const palp_far_field *far_field = &patch->lattice.used.far_field;
    uint32_t crossings = PALP_SURFACE_CROSSINGS;
    uint32_t hint[2] = {patch->lattice.facing, palp_contact_other_triangle(c, patch)};
    float gone;
    palp_vec3 beside = palp_far_field_beside(far_field, p->y, &gone);
    palp_vec3 x = palp_add(p->y, palp_add(far_field->mean_m, beside));
    palp_vec3 m = palp_scale(-1.0f, p->n);
    z->at.body = patch->other;
    z->found =
        palp_facing_find(&(palp_facing_body){&c->surface[patch->other], &c->frame[patch->other]}, x,
                         patch->lattice.used.axis, &crossings, hint, &z->at);
    if (z->found) m = palp_add(m, palp_contact_outward(c, patch->other, z->at.n));
    p->out = palp_scale(1.0f / palp_max(palp_norm(m), 1e-6f), m);
    z->m = palp_scale(-1.0f, palp_contact_inward(c, patch->other, p->out));
    if (z->found) return;
    const palp_frame *there = &c->frame[patch->other];
    z->at.y = z->at.q = palp_carry_back(there, x);
    z->at.n = palp_scale(-1.0f, z->m);
    for (uint32_t k = 0; k < 3u; k++) z->at.weight[k] = 0.0f;
    p->left_out = true;
    p->active = false;
    c->flags |= PALP_CONTACT_LOST;
}

/* From where a tool is taken to be to where its spring would turn it without the contact. */
static palp_vec3 turn_to_held(const palp_contact *c, uint32_t t) {
    const palp_contact_spring *s = &c->spring[t];
    const palp_vec3 besides = palp_add(c->beyond_Nm[t], c->repaid_Nm[t]);
    if (!(s->stiffness_Nm_per_rad > 0.0f)) return (palp_vec3){0};
    return palp_madd(palp_turn_between(c->patch[t].at.r, s->held.r), 1.0f / s->stiffness_Nm_per_rad,
                     besides);
}

/* How far the tool has come over a point, which then may not go round its sides: to 1 where it has
 * by COME_OVER of its size, against a surface that looks along the lattice's axis. */
static float come_over(const palp_contact_point *p, const palp_tool_press *press, float size_m) {
    return press->whole * palp_clamp(p->overlap_m / (COME_OVER * size_m), 0.0f, 1.0f);
}

/* The tool as a point sees it, about its last displacement. */
static void face(palp_contact *c, uint32_t i, palp_vec3 y) {
    palp_contact_point *p = &c->point[i];
    const palp_contact_patch *patch = &c->patch[p->patch];
    const uint32_t t = patch->tool;
    const palp_contact_spring *s = &c->spring[t];
    const palp_tool *tool = &c->tools[t];
    const palp_tool_press press = palp_lattice_press(&patch->lattice.used, p->n);
    palp_gap gap = palp_tool_gap_along(tool, &patch->at, y, &press);
    gap = palp_tool_gap_flared(tool, &patch->at, y, &press, gap,
                               come_over(p, &press, palp_tool_size(tool)));
    palp_vec3 held = s->held.t;
    const palp_vec3 besides = palp_add(c->beyond_N[t], c->repaid_N[t]);
    if (s->stiffness_N_per_m > 0.0f) held = palp_madd(held, 1.0f / s->stiffness_N_per_m, besides);
    p->out = gap.normal;
    p->arm_m = palp_cross(palp_sub(y, patch->at.t), gap.normal);
    c->target[i] = -gap.gap_m + palp_dot(p->out, palp_sub(held, patch->at.t));
    if (s->stiffness_Nm_per_rad > 0.0f) c->target[i] += palp_dot(p->arm_m, c->turn_rad[t]);
}

static palp_vec3 field_at(const palp_far_field *f, palp_vec3 y) {
    float gone;
    return palp_add(f->mean_m, palp_far_field_beside(f, y, &gone));
}

/* What a new point is taken to have been displaced by, besides being bent: as its lattice has met
 * it. */
static palp_vec3 gone_with(const palp_contact *c, const palp_contact_point *p) {
    const palp_contact_patch *patch = &c->patch[p->patch];
    palp_vec3 u = field_at(&patch->lattice.used.far_field, p->y);
    if (c->assembly != NULL) u = palp_sub(u, field_at(&patch->bent_field_used, p->y));
    return palp_contact_inward(c, p->at.body, u);
}

/* What is asked of a point. */
static void linearise(palp_contact *c, uint32_t i) {
    palp_contact_point *p = &c->point[i];
    const palp_contact_patch *patch = &c->patch[p->patch];
    const uint32_t body = p->at.body;
    const bool pair = patch->tool == PALP_CONTACT_TOOLS;
    bool same;
    const palp_contact_point *last = last_of(c, p, &same);
    const bool here = last != NULL && last->at.body == body;
    p->u_m = (palp_vec3){0};
    if (here)
        p->u_m = last->u_m;
    else if (!pair)
        p->u_m = gone_with(c, p);
    p->active = last != NULL ? same && last->active : true;
    p->left_out = false;
    c->other_side[i] = 0;
    palp_vec3 moved = list_corners(c, i, body, &p->at);
    if (!pair) moved = palp_add(moved, p->u_m);
    const palp_vec3 y = palp_add(p->y, palp_contact_outward(c, body, moved));
    if (pair) {
        meet(c, i);
        c->target[i] = -palp_dot(p->out, y);
    } else {
        face(c, i, y);
    }
    p->m = palp_contact_inward(c, body, p->out);
    if (!pair) c->target[i] += palp_dot(p->m, p->u_m);
    add_side(c, i, i, body, &p->at, p->m);
}

/* The other side of a point between zones; it is asked that the two do not pass each other. */
PALP_APART static void add_other_side(palp_contact *c, uint32_t i) {
    const palp_contact_patch *patch = &c->patch[c->point[i].patch];
    const palp_contact_facing *z = &c->facing[i];
    const uint32_t side = c->sides++;
    c->other_side[i] = (uint16_t)side;
    palp_vec3 bent = list_corners(c, side, patch->other, &z->at);
    add_side(c, i, side, patch->other, &z->at, z->m);
    palp_vec3 there = palp_carry(&c->frame[patch->other], palp_add(z->at.y, bent));
    c->target[i] += palp_dot(c->point[i].out, there);
}

uint32_t palp_contact_points(palp_contact *c) {
    c->sides = c->count;
    for (uint32_t t = 0; t < c->tool_count; t++) c->turn_rad[t] = turn_to_held(c, t);
    for (uint32_t i = 0; i < c->count; i++) linearise(c, i);
    for (uint32_t i = 0; i < c->count && c->pairs; i++) {
        if (c->patch[c->point[i].patch].tool == PALP_CONTACT_TOOLS) add_other_side(c, i);
    }
    if (c->assembly != NULL) palp_contact_bond(c);
    return c->count;
}
