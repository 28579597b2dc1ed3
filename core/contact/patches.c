/* SPDX-License-Identifier: MIT */
/* What meets what: the tools and zones that lie near each other, and where each is seen from the
 * body that it presses. */
#include "core/contact/contact_internal.h"
#include "core/base/apart.h"
#include "core/contact/facing.h"

#define BENT 0.1f /* of a zone's diagonal: how far it may be bent */

palp_vec3 palp_contact_outward(const palp_contact *contact, uint32_t body, palp_vec3 v) {
    const palp_assembly *a = contact->assembly;
    return a != NULL ? palp_rotate(a->world[body].r, v) : v;
}

palp_vec3 palp_contact_inward(const palp_contact *contact, uint32_t body, palp_vec3 v) {
    const palp_assembly *a = contact->assembly;
    return a != NULL ? palp_rotate_back(a->world[body].r, v) : v;
}

/* ---- seams ---- */

/* The node of zone `other` that a node of `zone` is bonded to; PALP_NONE. */
static uint32_t twin_of(const palp_assembly *a, uint32_t zone, uint32_t node, uint32_t *other) {
    const palp_zones *z = a->zones;
    const uint32_t at = a->node[zone][node].on_seam;
    if (at == PALP_NONE) return PALP_NONE;
    const uint32_t s = z->part[zone].seam[at >> 24u], i = at & 0xffffffu;
    const uint32_t side = palp_zone_is_second(z, s, zone) ? 1u : 0u;
    *other = z->seam[s].zone[1u - side];
    return z->seam_node[s][2u * i + 1u - side];
}

/* The outer triangle of a zone that has the edge from p to q; PALP_NONE. */
static uint32_t triangle_at(const palp_surface *s, uint32_t p, uint32_t q) {
    const palp_blob *b = s->blob;
    for (uint32_t t = 0; t < b->meta->triangles; t++) {
        const uint32_t *v = b->triangle + 3u * (size_t)t;
        for (uint32_t k = 0; k < 3u; k++) {
            if (v[k] == p && v[(k + 1u) % 3u] == q && !palp_surface_is_inner(s, t)) return t;
        }
    }
    return PALP_NONE;
}

/* What lies beyond the edge of an outer triangle that faces corner k, where that is a seam. */
static uint32_t beyond_edge(const palp_contact *c, uint32_t body, uint32_t t, uint32_t k) {
    const palp_zones *z = c->assembly->zones;
    const uint32_t *v = z->blob[body].triangle + 3u * (size_t)t;
    uint32_t other = 0, same = 0;
    const uint32_t p = twin_of(c->assembly, body, v[(k + 1u) % 3u], &other);
    const uint32_t q = twin_of(c->assembly, body, v[(k + 2u) % 3u], &same);
    if (p == PALP_NONE || q == PALP_NONE || other != same) return PALP_NONE;
    const uint32_t found = triangle_at(&c->surface[other], q, p);
    return found == PALP_NONE ? PALP_NONE : other << 24u | found;
}

void palp_contact_open_patches(palp_contact *c) {
    for (uint32_t k = 0; c->pairs && k < c->bodies * (c->bodies - 1u) / 2u; k++)
        c->closest[k][0] = c->closest[k][1] = 0;
    for (uint32_t b = 0; b < c->bodies; b++) {
        const palp_surface *s = &c->surface[b];
        for (uint32_t t = 0; t < s->blob->meta->triangles; t++) {
            const uint32_t *across = s->blob->regular.across + 3u * (size_t)t;
            const bool inner = palp_surface_is_inner(s, t);
            for (uint32_t k = 0; k < 3u; k++)
                c->beyond[b][3u * (size_t)t + k] =
                    across[k] == t && !inner ? beyond_edge(c, b, t, k) : PALP_NONE;
        }
    }
}

/* ---- patches ---- */

bool palp_contact_near(const palp_contact *contact) {
    bool any = contact->approached;
    for (uint32_t k = 0; k < contact->patches; k++) {
        const palp_contact_patch *p = &contact->patch[k];
        any = any || (p->used && (p->lattice.placed || p->normal_N > 0.0f));
    }
    return any;
}

uint32_t palp_contact_next(palp_contact *c) {
    uint32_t next = c->patches;
    for (uint32_t k = c->patches; k-- > 0u;) {
        const palp_contact_patch *p = &c->patch[k];
        if (!p->used || p->filled) continue;
        const bool presses = p->normal_N > 0.0f || c->assembly == NULL;
        if (next == c->patches || presses || !(c->patch[next].normal_N > 0.0f)) next = k;
    }
    if (next < c->patches) c->patch[next].filled = true;
    return next;
}

/* Whether a place is within the box of a zone, or as far from it as that may be bent. */
static bool is_near(const palp_blob *b, palp_vec3 x) {
    const palp_vec3 low = palp_vec3_at(b->meta->box_min_m), high = palp_vec3_at(b->meta->box_max_m);
    return palp_surface_is_within(b, x, BENT * palp_norm(palp_sub(high, low)));
}

static palp_contact_patch *find(palp_contact *c, uint32_t body, uint32_t other) {
    for (uint32_t k = c->tool_count; k < c->patches; k++) {
        palp_contact_patch *p = &c->patch[k];
        if (p->used && p->body == body && p->other == other) return p;
    }
    return NULL;
}

/* The points that a patch had when it was another pair's. */
static void forget_points(palp_contact *c, uint32_t patch) {
    for (uint32_t i = 0; i < c->count_before; i++) {
        palp_contact_point *p = &c->before[i];
        if (p->patch != patch) continue;
        p->active = false;
        p->force_N = 0.0f;
    }
}

/* A patch that is not in use, as new; NULL if there is none. */
static palp_contact_patch *take(palp_contact *c, uint32_t body, uint32_t other) {
    for (uint32_t k = c->tool_count; k < c->patches; k++) {
        palp_contact_patch *p = &c->patch[k];
        if (p->used) continue;
        palp_lattice_table *table = p->table, *before = p->table_before;
        *p = (palp_contact_patch){.used = true,
                                  .body = body,
                                  .tool = PALP_CONTACT_TOOLS,
                                  .other = other,
                                  .table = table,
                                  .table_before = before};
        palp_lattice_clear(table);
        palp_lattice_clear(before);
        forget_points(c, k);
        return p;
    }
    c->flags |= PALP_CONTACT_FULL;
    return NULL;
}

/* ---- zones before zones ---- */

#define OPPOSED                                                                                    \
    0.3f             /* cosine of nodes' normals that face each other; at corners they lie aside   \
                      */
#define BEFORE 0.3f  /* edges before two zones meet, from which a lattice is ready */
#define DEEPEST 3.0f /* edges: what lies deeper is not in contact but on the far side */

/* The node of `b` nearest to x among the cells around it; PALP_NONE if there is none. */
static uint32_t nearest_node(palp_contact *c, const palp_blob *b, palp_vec3 x) {
    const palp_meta *m = b->meta;
    const float at[3] = {x.x, x.y, x.z};
    uint32_t low[3], high[3], nearest = PALP_NONE;
    float least = 1e30f;
    for (uint32_t k = 0; k < 3u; k++) {
        const float cell = (at[k] - m->cell_origin_m[k]) / m->cell_size_m;
        const float last = (float)(m->cells[k] - 1u);
        low[k] = (uint32_t)palp_clamp(cell - 1.0f, 0.0f, last);
        high[k] = (uint32_t)palp_clamp(cell + 1.0f, 0.0f, last);
    }
    for (uint32_t z = low[2]; z <= high[2]; z++) {
        for (uint32_t y = low[1]; y <= high[1]; y++) {
            const uint32_t row = (z * m->cells[1] + y) * m->cells[0];
            const uint32_t end = b->cell_offset[row + high[0] + 1u];
            for (uint32_t k = b->cell_offset[row + low[0]]; k < end; k++) {
                palp_vec3 d = palp_sub(palp_vec3_at(b->rest_m + 3u * (size_t)b->cell_node[k]), x);
                c->filled.around++;
                if (palp_dot(d, d) >= least) continue;
                least = palp_dot(d, d);
                nearest = b->cell_node[k];
            }
        }
    }
    return nearest;
}

static palp_vec3 node_at(const palp_contact *c, uint32_t body, uint32_t node) {
    return palp_carry(&c->frame[body],
                      palp_vec3_at(c->surface[body].blob->rest_m + 3u * (size_t)node));
}

/* A place on one zone and the zone that may lie before it. */
typedef struct {
    uint32_t body, node, other, before; /* the node of the other one that is nearest */
    palp_vec3 bent_m;                   /* of the one against the other */
    palp_vec3 axis;                     /* out of the other one, between both normals */
} encounter;

/* Whether a node lies in another zone, just below its surface, or is about to. */
static bool lies_in(palp_contact *c, encounter *e) {
    const palp_surface *s = &c->surface[e->body], *other = &c->surface[e->other];
    const palp_frame *here = &c->frame[e->body], *there = &c->frame[e->other];
    const palp_vec3 n = palp_rotate(here->r, palp_vec3_at(s->blob->normal + 3u * (size_t)e->node));
    const palp_vec3 bent = palp_rotate(here->r, palp_surface_bent(s, e->node));
    const palp_vec3 x = node_at(c, e->body, e->node);
    const palp_vec3 in_other = palp_carry_back(there, palp_add(x, bent));
    if (!is_near(other->blob, in_other)) return false;
    const uint32_t nearest = nearest_node(c, other->blob, in_other);
    if (nearest == PALP_NONE || palp_node_is_fixed(other->blob, nearest)) return false;
    const palp_vec3 m =
        palp_rotate(there->r, palp_vec3_at(other->blob->normal + 3u * (size_t)nearest));
    if (palp_dot(n, m) > OPPOSED) return false;
    e->bent_m = palp_sub(bent, palp_rotate(there->r, palp_surface_bent(other, nearest)));
    uint32_t crossings = PALP_SURFACE_CROSSINGS;
    const uint32_t triangle = other->blob->regular.triangle[nearest];
    uint32_t hint[2] = {triangle, triangle};
    e->before = nearest;
    const palp_vec3 apart = palp_sub(m, n);
    e->axis = palp_scale(1.0f / palp_norm(apart), apart);
    palp_gap gap = palp_facing_gap(&(palp_facing_body){other, there}, palp_add(x, e->bent_m),
                                   e->axis, &crossings, hint);
    c->filled.shots++;
    c->filled.crossings += PALP_SURFACE_CROSSINGS - crossings;
    c->filled.bent += 2u;
    const float edge = s->blob->meta->mean_edge_m;
    return gap.gap_m < BEFORE * edge && gap.gap_m > -DEEPEST * edge;
}

/* Begins a patch there, or shows the place to the one that there is. */
static void begin_pair(palp_contact *c, const encounter *e) {
    const palp_surface *s = &c->surface[e->body];
    const palp_frame *here = &c->frame[e->body];
    const palp_surface_point at = palp_lattice_at_node(s, e->body, e->node);
    palp_contact_patch *p = find(c, e->body, e->other);
    if (p == NULL && find(c, e->other, e->body) != NULL) return;
    if (p != NULL) {
        if (p->lattice.seeds < PALP_LATTICE_SEEDS) p->lattice.seed[p->lattice.seeds++] = at;
        return;
    }
    p = take(c, e->body, e->other);
    if (p == NULL) return;
    const float edge = s->blob->meta->mean_edge_m;
    p->met_m = at.y;
    p->at = palp_frame_at(palp_carry(here, at.y));
    p->bent = (palp_far_field){.at_m = p->at.t, .mean_m = e->bent_m, .fade = 0.01f / (edge * edge)};
    p->before = e->before;
    palp_lattice_aim(&p->lattice, e->axis, e->bent_m);
}

/* The node, or a neighbour of it, that is nearest to x; bones and seams are passed over. */
static uint32_t step_towards(palp_contact *c, uint32_t body, uint32_t node, palp_vec3 x) {
    const palp_blob *b = c->surface[body].blob;
    uint32_t best = node;
    palp_vec3 d = palp_sub(node_at(c, body, node), x);
    float least = palp_node_is_fixed(b, node) ? 1e30f : palp_dot(d, d);
    for (uint32_t k = b->ring_offset[node]; k < b->ring_offset[node + 1u]; k++) {
        d = palp_sub(node_at(c, body, b->ring[k]), x);
        c->filled.around += 2u;
        if (palp_dot(d, d) >= least || palp_node_is_fixed(b, b->ring[k])) continue;
        least = palp_dot(d, d);
        best = b->ring[k];
    }
    return best;
}

/* A node's k-th neighbour, the 0th being itself; PALP_NONE for bones and seams, which do not meet
 * anything. */
static uint32_t neighbour(const palp_blob *b, uint32_t node, uint32_t k) {
    const uint32_t n = k == 0u ? node : b->ring[b->ring_offset[node] + k - 1u];
    return palp_node_is_fixed(b, n) ? PALP_NONE : n;
}

static uint32_t neighbours(const palp_blob *b, uint32_t node) {
    return 1u + b->ring_offset[node + 1u] - b->ring_offset[node];
}

/* The nearest two of both nodes and their neighbours. Both move at once: of two sides that run
 * towards each other, the next node of one alone would be farther away. */
static void draw_near(palp_contact *c, uint32_t first, uint32_t second, uint32_t node[2]) {
    const palp_blob *a = c->surface[first].blob, *b = c->surface[second].blob;
    const uint32_t old[2] = {node[0], node[1]};
    const uint32_t others = neighbours(b, old[1]);
    float least = 1e30f;
    for (uint32_t i = 0; i < neighbours(a, old[0]); i++) {
        const uint32_t p = neighbour(a, old[0], i);
        c->filled.around += others;
        if (p == PALP_NONE) continue;
        const palp_vec3 x = palp_carry_back(&c->frame[second], node_at(c, first, p));
        for (uint32_t j = 0; j < others; j++) {
            const uint32_t q = neighbour(b, old[1], j);
            if (q == PALP_NONE) continue;
            const palp_vec3 d = palp_sub(palp_vec3_at(b->rest_m + 3u * (size_t)q), x);
            if (palp_dot(d, d) >= least) continue;
            least = palp_dot(d, d);
            node[0] = p;
            node[1] = q;
        }
    }
}

/* Follows the nearest nodes of the next pairs of zones in turn. */
static void track_closest(palp_contact *c) {
    const uint32_t pairs = c->bodies * (c->bodies - 1u) / 2u;
    uint32_t n = PALP_CONTACT_TRACKED < pairs ? PALP_CONTACT_TRACKED : pairs;
    for (; n > 0u; n--) {
        c->pair_scan = c->pair_scan + 1u < pairs ? c->pair_scan + 1u : 0u;
        uint32_t a = 1, first = 0;
        while (first + a <= c->pair_scan) first += a++; /* at most zones */
        const uint32_t b = c->pair_scan - first;
        uint32_t *node = c->closest[c->pair_scan];
        draw_near(c, a, b, node);
        for (uint32_t k = 0; k < 2u; k++) {
            encounter e = {.body = k == 0u ? a : b, .node = node[k], .other = k == 0u ? b : a};
            if (lies_in(c, &e)) {
                begin_pair(c, &e);
                break;
            }
        }
    }
}

/* Compares the next nodes in turn with the other zones. */
PALP_APART static void meet_zones(palp_contact *c) {
    const palp_zones *z = c->assembly->zones;
    for (uint32_t k = c->tool_count; k < c->patches; k++) {
        palp_contact_patch *p = &c->patch[k];
        p->used = p->used && (p->lattice.placed || p->normal_N > 0.0f);
        if (!p->used) continue;
        p->at.t = palp_carry(&c->frame[p->body], p->met_m);
        const palp_vec3 there = palp_add(p->at.t, p->lattice.at.origin_m);
        p->before = step_towards(c, p->other, p->before, there);
    }
    track_closest(c);
    uint32_t body = 0;
    for (uint32_t k = 0; k < PALP_CONTACT_SCAN; k++) {
        c->scan = c->scan + 1u < z->nodes ? c->scan + 1u : 0u;
        while (body > 0u && c->scan < z->part[body].first_node) body--; /* at most zones */
        /* at most zones */
        while (body + 1u < c->bodies && c->scan >= z->part[body + 1u].first_node) body++;
        const uint32_t node = c->scan - z->part[body].first_node;
        if (palp_node_is_fixed(c->surface[body].blob, node)) continue;
        for (uint32_t other = 0; other < c->bodies; other++) {
            encounter e = {.body = body, .node = node, .other = other};
            if (other != body && lies_in(c, &e)) begin_pair(c, &e);
        }
    }
}

/* ---- a tick ---- */

void palp_contact_choose_patches(palp_contact *c) {
    for (uint32_t k = 0; k < c->patches; k++) c->patch[k].filled = false;
    for (uint32_t t = 0; t < c->tool_count; t++) {
        palp_contact_patch *p = &c->patch[t];
        p->used = true;
        p->tool = t;
    }
    if (c->pairs) meet_zones(c);
}

palp_vec3 palp_contact_carried(const palp_contact *c, uint32_t tool) {
    const palp_contact_point *point = c->solved ? c->point : c->before;
    const uint32_t points = c->solved ? c->count : c->count_before;
    palp_vec3 sum = {0};
    if (c->frame == NULL || !(c->normal_N[tool] > 0.0f)) return sum;
    for (uint32_t i = 0; i < points; i++) {
        const palp_contact_point *p = &point[i];
        if (p->patch != tool || !(p->force_N > 0.0f)) continue;
        palp_vec3 local = palp_carry_back(&c->frame_before[p->at.body], c->rest[tool].t);
        palp_vec3 now = palp_carry(&c->frame[p->at.body], local);
        sum = palp_madd(sum, p->force_N / c->normal_N[tool], palp_sub(now, c->rest[tool].t));
    }
    return sum;
}
