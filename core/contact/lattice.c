/* SPDX-License-Identifier: MIT */
#include "core/contact/lattice.h"
#include "core/contact/facing.h"

#define SHALLOW 0.4f   /* overlap over the size, from which a sphere's shots come from behind it */
#define DAMPED 0.4f    /* share of a change that turns back on the last one */
#define LARGE 0.1f     /* weight over the largest region's, at which a region counts half */
#define APART 0.6f     /* length of the mean direction up to which an axis hardly follows */
#define GATHERED 0.8f  /* and from which it follows at once */
#define SLOWEST 0.03f  /* share of a change that it takes up in a filling at least */
#define SLOWER 0.3f    /* the same of the spacing, over several regions */
#define COVERS 0.4f    /* share of a pad's face from which a lattice begins to keep to its middle */
#define COVERED 0.8f   /* and keeps to it */
#define FLOOR 0.015f   /* radius that the smallest contact is taken to have, over the tool's size */
#define MARGIN 0.6f    /* edges beyond the tool within which nodes lead to regions */
#define ELSEWHERE 1.2f /* most motion elsewhere over that at the contact */
#define UNSURE 0.05f   /* of what it moves at the contact: how far off that may be */
#define KEPT 0.25f     /* gap over the size up to which points stay that carried force */
#define FACING 0.15f   /* cosine between shot and surface below which no point is taken */
#define FADE 0.15f     /* above FACING, in which cells grow to their full size */
#define HOPS 4u        /* zones that one shot goes through */
#define NARROWER 0.3f  /* share that is left out more when too many nodes say how zones are bent */
#define WIDER 0.01f    /* and less in a filling that has room for all */
#define FEET 4u        /* steps towards the nearest point of the surface */
#define WANTED 0xfffeu /* in the table: a place not looked at yet whose point is to be kept */
#define SITE_MOST 16000   /* largest place in a lattice */
#define CELL_CHANGE 0.06f /* relative change of the cells that calls for another filling */

bool palp_lattice_is_central(const palp_tool *tool) { return tool->balls == 1u; }

bool palp_lattice_is_flat(const palp_tool *tool) {
    return tool->balls == 0u && !(tool->cylinder.radius_m > 0.0f);
}

/* Of two bodies the lattice is that of a tool that is neither. */
static bool is_central(const palp_lattice_room *r) {
    return r->other == NULL && palp_lattice_is_central(r->tool);
}

static bool is_flat(const palp_lattice_room *r) {
    return r->other == NULL && palp_lattice_is_flat(r->tool);
}

/* ---- frames ---- */

static const palp_surface *surface_of(const palp_lattice_room *r, uint32_t body) {
    return &r->surface[body - r->first_body];
}

static const palp_frame *frame_of(const palp_lattice_room *r, uint32_t body) {
    return &r->frame[body - r->first_body];
}

/* From a body's frame to the world: places and directions; and back. */
static palp_vec3 out_of(const palp_lattice_room *r, uint32_t body, palp_vec3 x) {
    return r->frame != NULL ? palp_carry(frame_of(r, body), x) : x;
}

static palp_vec3 turned_out(const palp_lattice_room *r, uint32_t body, palp_vec3 v) {
    return r->frame != NULL ? palp_rotate(frame_of(r, body)->r, v) : v;
}

static palp_vec3 into(const palp_lattice_room *r, uint32_t body, palp_vec3 x) {
    return r->frame != NULL ? palp_carry_back(frame_of(r, body), x) : x;
}

static palp_vec3 turned_in(const palp_lattice_room *r, uint32_t body, palp_vec3 v) {
    return r->frame != NULL ? palp_rotate_back(frame_of(r, body)->r, v) : v;
}

static palp_vec3 world_of(const palp_lattice_room *r, const palp_surface_point *at) {
    return out_of(r, at->body, at->y);
}

static palp_vec3 normal_of(const palp_lattice_room *r, const palp_surface_point *at) {
    return turned_out(r, at->body, at->n);
}

static palp_vec3 node_at(const palp_lattice_room *r, uint32_t body, uint32_t node) {
    return out_of(r, body, palp_vec3_at(surface_of(r, body)->blob->rest_m + 3u * (size_t)node));
}

/* ---- table of places ---- */

void palp_lattice_clear(palp_lattice_table *table) {
    for (uint32_t k = 0; k < PALP_LATTICE_SLOTS; k++) table->key[k] = 0u;
}

/* Slot of a place: where it is, or where it would go. The table never fills up: places that are
 * looked at or wanted are fewer than half of it. */
static uint32_t slot_of(const palp_lattice_table *t, uint32_t key) {
    uint32_t slot = (key * 2654435761u) >> 22u;
    for (uint32_t k = 0; k < PALP_LATTICE_SLOTS; k++) {
        uint32_t at = (slot + k) & (PALP_LATTICE_SLOTS - 1u);
        if (t->key[at] == key || t->key[at] == 0u) return at;
    }
    return 0u;
}

static uint32_t key_of(int32_t i, int32_t j) {
    return 0x80000000u | ((uint32_t)(i + 16384) & 0x7fffu) << 15u |
           ((uint32_t)(j + 16384) & 0x7fffu);
}

uint32_t palp_lattice_find(const palp_lattice_table *table, int16_t i, int16_t j) {
    uint32_t key = key_of(i, j), slot = slot_of(table, key);
    const bool found = table->key[slot] == key && table->point[slot] != WANTED;
    return found ? table->point[slot] : PALP_LATTICE_MISS;
}

/* ---- shots ---- */

typedef struct {
    palp_lattice *l;
    const palp_lattice_room *r;
    palp_vec3 moved_m; /* the tool's reference point, seen from the moved surface */
    bool central;
    uint32_t first;                              /* points of this tool begin here */
    uint32_t shots_left, crossings, rings, feet; /* left in this filling */
    bool full;                                   /* places were left out */
    bool crowded;                                /* and nodes that say how zones are bent */
    uint32_t regions, end[PALP_LATTICE_SEEDS];   /* points of each region end here */
    float far_m;                                 /* gap up to which displacements far away matter */
    float unsure_m;       /* gap up to which points there are kept: they may carry force */
    float gap_m, area_m2; /* of measure_node */
    palp_surface_point deepest;
} filling;

/* What the body as a whole has moved a place of the surface by, beyond the mean; *gone: how far it
 * is beyond the reach of the contact. */
static palp_vec3 beside(const filling *f, palp_vec3 y, float *gone) {
    const palp_lattice *l = f->l;
    float least = 1e30f;
    palp_vec3 u = palp_far_field_beside(&l->at.given, y, gone), far = {0};
    if (!(*gone > 0.0f)) return u;
    for (uint32_t k = 0; k < l->watched; k++) {
        palp_vec3 d = palp_sub(y, l->watch[k].x_m);
        if (palp_dot(d, d) >= least) continue;
        least = palp_dot(d, d);
        far = l->watch[k].u_m;
    }
    return palp_madd(u, *gone, far);
}

/* The gap at a place that the body has been moved to, seen from what presses. */
static palp_gap gap_at(filling *f, palp_vec3 y) {
    const palp_lattice_room *r = f->r;
    f->r->done->evaluations++;
    if (r->other == NULL) return palp_tool_gap(r->tool, f->moved_m, y);
    const palp_vec3 x = palp_add(y, palp_sub(r->tool_m, f->moved_m));
    uint32_t hint[2] = {f->l->facing, r->facing};
    r->done->shots++;
    palp_gap gap = palp_facing_gap(r->other, r->other_frame, x, f->l->at.axis, &f->crossings, hint);
    f->l->facing = hint[0];
    return gap;
}

/* The gap at a place of the surface, as the body as a whole has moved it. */
static palp_gap gap_of(filling *f, palp_vec3 y) {
    float gone;
    return gap_at(f, palp_add(y, beside(f, y, &gone)));
}

static palp_vec3 direction_of(const filling *f, float a, float b) {
    const palp_lattice *l = f->l;
    if (!f->central) return l->at.axis;
    float rho2 = a * a + b * b, up = 1.0f - 0.5f * rho2,
          out = palp_sqrt(palp_max(1.0f - 0.25f * rho2, 0.0f));
    palp_vec3 d = palp_scale(up, l->at.axis);
    d = palp_madd(d, out * a, l->at.tangent[0]);
    return palp_madd(d, out * b, l->at.tangent[1]);
}

/* Where in the lattice's map a point of the surface lies; false at its back. */
static bool map(const filling *f, palp_vec3 y, float *a, float *b) {
    const palp_lattice *l = f->l;
    palp_vec3 r = palp_sub(y, palp_add(f->moved_m, l->at.origin_m));
    float scale = 1.0f;
    if (f->central) {
        float length = palp_norm(r), up = length > 0.0f ? palp_dot(r, l->at.axis) / length : -1.0f;
        if (up < -0.9f) return false;
        scale = palp_sqrt(2.0f / (1.0f + up)) / length;
    }
    *a = scale * palp_dot(r, l->at.tangent[0]);
    *b = scale * palp_dot(r, l->at.tangent[1]);
    return true;
}

float palp_lattice_cell_slope(const palp_contact_point *p) {
    float shown = p->facing - FACING;
    float fade = shown < FADE ? 1.0f / shown : 0.0f;
    return p->cell_m * (fade - 0.5f / p->facing);
}

/* Where a line enters the surface, beginning on at->triangle of at->body and going on beyond seams.
 */
static bool enter(filling *f, palp_vec3 from, palp_vec3 direction, palp_surface_point *at) {
    const palp_lattice_room *r = f->r;
    for (uint32_t hop = 0; hop < HOPS; hop++) {
        uint32_t edge = 0;
        palp_walk walk =
            palp_surface_walk(surface_of(r, at->body), into(r, at->body, from),
                              turned_in(r, at->body, direction), &f->crossings, at, &edge);
        if (walk != PALP_AT_SEAM) return walk == PALP_ENTERED;
        if (r->beyond == NULL) return false;
        const uint32_t beyond =
            r->beyond[at->body - r->first_body][3u * (size_t)at->triangle + edge];
        if (beyond == PALP_NONE) return false;
        at->body = beyond >> 24u;
        at->triangle = beyond & 0xffffffu;
    }
    return false;
}

/* What the shot at (a, b) of the map meets, beginning on p->at.triangle; false if there is nothing
 * to touch. `pressed`: it carried force in the last tick. */
static bool shoot(filling *f, float a, float b, bool pressed, palp_contact_point *p) {
    const palp_lattice *l = f->l;
    palp_vec3 from = palp_add(f->moved_m, l->at.origin_m);
    p->direction = direction_of(f, a, b);
    if (!f->central) {
        from = palp_madd(from, a, l->at.tangent[0]);
        from = palp_madd(from, b, l->at.tangent[1]);
    }
    f->r->done->shots++;
    if (!enter(f, from, p->direction, &p->at)) return false;
    p->q = out_of(f->r, p->at.body, p->at.q);
    p->y = world_of(f->r, &p->at);
    p->n = normal_of(f->r, &p->at);
    p->shot_m = palp_dot(palp_sub(p->q, from), p->direction);
    p->facing = -palp_dot(p->n, p->direction);
    float gone;
    palp_vec3 y = palp_add(p->y, beside(f, p->y, &gone));
    palp_gap gap = gap_at(f, y);
    p->overlap_m = palp_max(-gap.gap_m, 0.0f);
    if (gap.gap_m >= (pressed ? KEPT * f->r->size_m : gone * f->unsure_m)) return false;
    if (p->facing <= FACING || (f->central && p->shot_m <= 0.0f)) return false;
    if (palp_dot(gap.normal, p->n) >= 0.0f) return false;
    float cell = l->at.spacing / palp_sqrt(p->facing);
    if (f->central) cell *= p->shot_m;
    p->cell_m = cell * palp_min((p->facing - FACING) / FADE, 1.0f);
    return true;
}

/* Looks at a place of the lattice, unless it has been; beginning on the triangle of `near`. */
static void look(filling *f, int32_t i, int32_t j, const palp_surface_point *near) {
    const uint32_t body = near->body, triangle = near->triangle; /* which may be overwritten */
    const palp_lattice_room *r = f->r;
    if (i < -SITE_MOST || i > SITE_MOST || j < -SITE_MOST || j > SITE_MOST) return;
    uint32_t key = key_of(i, j), slot = slot_of(r->table, key);
    const bool known = r->table->key[slot] == key;
    const bool pressed = known && r->table->point[slot] == WANTED;
    if (known && !pressed) return;
    f->full = f->full || f->shots_left == 0u;
    if (f->shots_left == 0u) return;
    f->shots_left--;
    r->table->key[slot] = key;
    r->table->point[slot] = PALP_LATTICE_MISS;
    palp_contact_point *p = &r->point[*r->count];
    float a = f->l->at.spacing * ((float)i + 0.5f * (float)j),
          b = f->l->at.spacing * PALP_LATTICE_CELL * (float)j;
    p->at.body = body;
    p->at.triangle = triangle;
    if (f->central && a * a + b * b >= 3.9f) return;
    if (!shoot(f, a, b, pressed, p)) return;
    if (*r->count + 1u >= r->most) {
        f->full = true;
        return;
    }
    p->patch = r->number;
    p->i = (int16_t)i;
    p->j = (int16_t)j;
    p->active = false;
    p->force_N = 0.0f;
    r->table->point[slot] = (uint16_t)*r->count;
    (*r->count)++;
}

/* The place of the lattice next to a point of the surface; false if there is none. */
static bool nearest_site(const filling *f, palp_vec3 y, int32_t site[2]) {
    float a, b;
    if (!map(f, y, &a, &b)) return false;
    float row = b / (f->l->at.spacing * PALP_LATTICE_CELL);
    if (!(palp_abs(row) < (float)SITE_MOST)) return false; /* or not a number */
    site[1] = (int32_t)(row + (row >= 0.0f ? 0.5f : -0.5f));
    float column = a / f->l->at.spacing - 0.5f * (float)site[1];
    if (!(palp_abs(column) < (float)SITE_MOST)) return false;
    site[0] = (int32_t)(column + (column >= 0.0f ? 0.5f : -0.5f));
    return true;
}

/* Whether the lattice has looked at the place next to a point of the surface, or cannot. */
static bool is_known(const filling *f, palp_vec3 y) {
    int32_t site[2];
    if (!nearest_site(f, y, site)) return true;
    uint32_t key = key_of(site[0], site[1]), slot = slot_of(f->r->table, key);
    return f->r->table->key[slot] == key && f->r->table->point[slot] != WANTED;
}

/* Marks the places next to the points that carried force in the last tick. They are kept whatever
 * is foreseen, so that only a solved contact lets them go. */
static void want_pressed(const filling *f) {
    const palp_lattice_room *r = f->r;
    uint32_t left = PALP_LATTICE_WANTED(r->most);
    for (uint32_t k = 0; k < r->count_before && left > 0u; k++) {
        const palp_contact_point *p = &r->before[k];
        int32_t site[2];
        if (p->patch != r->number || !(p->force_N > 0.0f)) continue;
        left--;
        r->done->evaluations++; /* it costs less */
        if (!nearest_site(f, world_of(r, &p->at), site)) continue;
        uint32_t key = key_of(site[0], site[1]), slot = slot_of(r->table, key);
        r->table->key[slot] = key;
        r->table->point[slot] = WANTED;
    }
}

/* Fills the region around a point of the surface; false if the lattice finds nothing there. */
static bool flood(filling *f, const palp_surface_point *seed) {
    static const int32_t step[6][2] = {{1, 0}, {0, 1}, {-1, 1}, {-1, 0}, {0, -1}, {1, -1}};
    uint32_t before = *f->r->count;
    int32_t site[2];
    if (!nearest_site(f, world_of(f->r, seed), site)) return false;
    look(f, site[0], site[1], seed);
    /* at most the room */
    for (uint32_t k = before; k < *f->r->count; k++) {
        const int32_t at[2] = {f->r->point[k].i, f->r->point[k].j};
        const palp_surface_point near = f->r->point[k].at;
        for (uint32_t n = 0; n < 6u; n++) look(f, at[0] + step[n][0], at[1] + step[n][1], &near);
    }
    return *f->r->count > before;
}

/* Fills a region and keeps its deepest point for the next filling. */
static bool fill_region(filling *f, const palp_surface_point *from) {
    uint32_t before = *f->r->count, deepest = before;
    if (!flood(f, from)) return false;
    for (uint32_t k = before; k < *f->r->count; k++) {
        if (f->r->point[k].overlap_m > f->r->point[deepest].overlap_m) deepest = k;
    }
    if (f->l->seeds < PALP_LATTICE_SEEDS) f->l->seed[f->l->seeds++] = f->r->point[deepest].at;
    if (f->regions < PALP_LATTICE_SEEDS) f->regions++;
    f->end[f->regions - 1u] = *f->r->count;
    return true;
}

/* ---- regions ---- */

/* Direction from a ball's centre to the nearest point of the edges at a node: on a ridge the
 * deepest point may lie between nodes, where no normal leads to it. */
static palp_vec3 way_to_edges(const filling *f, uint32_t body, uint32_t node, palp_vec3 at) {
    const palp_blob *b = surface_of(f->r, body)->blob;
    const palp_vec3 x = palp_vec3_at(b->rest_m + 3u * (size_t)node);
    const palp_vec3 back = palp_sub(into(f->r, body, at), x);
    palp_vec3 way = palp_scale(-1.0f, back);
    for (uint32_t k = b->ring_offset[node]; k < b->ring_offset[node + 1u]; k++) {
        palp_vec3 e = palp_sub(palp_vec3_at(b->rest_m + 3u * (size_t)b->ring[k]), x);
        float share = palp_clamp(palp_dot(back, e) / palp_dot(e, e), 0.0f, 1.0f);
        palp_vec3 to = palp_sub(palp_scale(share, e), back);
        f->r->done->around++;
        if (palp_dot(to, to) < palp_dot(way, way)) way = to;
    }
    way = palp_scale(1.0f / palp_max(palp_norm(way), 1e-30f), way);
    return turned_out(f->r, body, way);
}

/* Where a tool looks for its foot from: a ball's centre, seen from the surface at rest; of any
 * other tool its nearest place. */
static palp_vec3 foot_from(const filling *f, palp_vec3 y, palp_gap gap) {
    float gone;
    if (!f->central) return palp_madd(y, -gap.gap_m, gap.normal);
    f->r->done->evaluations++; /* half of one */
    return palp_sub(palp_add(f->moved_m, f->r->tool->ball[0].center_m), beside(f, y, &gone));
}

/* From a node towards the point of the surface that lies deepest in the tool nearby. Each shot goes
 * against the normal where the last one met the surface, which finds the foot on smooth places;
 * where that leads away, as it does about an edge, it turns half back. */
static bool find_foot(filling *f, uint32_t node, palp_surface_point *p) {
    const palp_lattice_room *r = f->r;
    if (f->feet == 0u) return false;
    f->feet--;
    palp_gap least = gap_of(f, world_of(r, p));
    palp_vec3 best = least.normal, way = best;
    palp_surface_point trial = *p;
    if (f->central)
        way = best = way_to_edges(f, p->body, node, foot_from(f, world_of(r, p), least));
    bool met = false;
    for (uint32_t k = 0; k < FEET; k++) {
        palp_vec3 at = foot_from(f, world_of(r, p), least);
        r->done->shots++;
        if (!enter(f, at, way, &trial)) break;
        palp_gap gap = gap_of(f, world_of(r, &trial));
        if (gap.gap_m < least.gap_m || !met) {
            best = way;
            least = gap;
            *p = trial;
            met = true;
            way = palp_scale(-1.0f, normal_of(r, p));
        } else {
            way = palp_add(way, best);
            way = palp_scale(1.0f / palp_max(palp_norm(way), 1e-6f), way);
        }
    }
    return met && palp_dot(least.normal, normal_of(r, p)) < 0.0f;
}

palp_surface_point palp_lattice_at_node(const palp_surface *surface, uint32_t body, uint32_t node) {
    const palp_blob *b = surface->blob;
    palp_surface_point p = {.body = body, .triangle = b->regular.triangle[node]};
    p.q = p.y = palp_vec3_at(b->rest_m + 3u * (size_t)node);
    p.n = palp_vec3_at(b->normal + 3u * (size_t)node);
    return p;
}

/* Cells of the search grid around the tool. */
typedef struct {
    uint32_t low[3], high[3];
} cell_range;

static cell_range cells_around(const palp_blob *b, palp_vec3 c, float reach) {
    const palp_meta *m = b->meta;
    const float x[3] = {c.x, c.y, c.z};
    cell_range r;
    for (uint32_t k = 0; k < 3u; k++) {
        float last = (float)(m->cells[k] - 1u);
        float low = (x[k] - reach - m->cell_origin_m[k]) / m->cell_size_m;
        float high = (x[k] + reach - m->cell_origin_m[k]) / m->cell_size_m;
        r.low[k] = (uint32_t)palp_clamp(low, 0.0f, last);
        r.high[k] = (uint32_t)palp_clamp(high, 0.0f, last);
    }
    return r;
}

/* No neighbour lies deeper in the tool. */
static bool is_deepest(filling *f, uint32_t body, uint32_t node, float gap_m) {
    const palp_blob *b = surface_of(f->r, body)->blob;
    if (f->rings == 0u) return false;
    f->rings--;
    for (uint32_t k = b->ring_offset[node]; k < b->ring_offset[node + 1u]; k++) {
        if (gap_of(f, node_at(f->r, body, b->ring[k])).gap_m < gap_m) return false;
    }
    return true;
}

float palp_lattice_reach(const palp_tool *tool, const palp_blob *blob) {
    return palp_tool_extent(tool) + MARGIN * blob->meta->mean_edge_m;
}

/* Before there is a lattice: the deepest site, and the area that nodes see overlapped. */
static void measure_node(filling *f, uint32_t body, uint32_t node, float gap_m) {
    const palp_surface *surface = surface_of(f->r, body);
    if (gap_m < 0.0f) f->area_m2 += surface->blob->area_m2[node];
    if (gap_m >= f->gap_m && !is_deepest(f, body, node, gap_m)) return;
    palp_surface_point p = palp_lattice_at_node(surface, body, node), foot = p;
    float least = gap_m;
    if (find_foot(f, node, &foot)) {
        float gap = gap_of(f, world_of(f->r, &foot)).gap_m;
        if (gap < least) p = foot;
        least = palp_min(gap, least);
    }
    if (least >= f->gap_m) return;
    f->gap_m = least;
    f->deepest = p;
}

/* A region that no place of the lattice has shown yet. */
static void seek_region(filling *f, uint32_t body, uint32_t node, float gap_m) {
    palp_surface_point p = palp_lattice_at_node(surface_of(f->r, body), body, node);
    if (gap_m < 0.0f) {
        if (is_known(f, world_of(f->r, &p))) return;
        (void)fill_region(f, &p);
        return;
    }
    if (!is_deepest(f, body, node, gap_m)) return;
    if (!find_foot(f, node, &p) || is_known(f, world_of(f->r, &p))) return;
    if (gap_of(f, world_of(f->r, &p)).gap_m >= 0.0f) return;
    (void)fill_region(f, &p);
}

/* Where the watched nodes are now. */
static void place_watched(palp_lattice *l, const palp_lattice_room *r) {
    for (uint32_t k = 0; k < l->watched; k++) {
        palp_lattice_watch *w = &l->watch[k];
        const palp_surface *surface = surface_of(r, w->body);
        w->u_m = palp_surface_corner(surface, w->node, r->far_modes, r->load);
        w->u_m = palp_scale(r->share, w->u_m);
        w->u_m = palp_add(w->u_m, palp_surface_bent(surface, w->node));
        w->u_m = turned_out(r, w->body, w->u_m);
    }
}

/* Between two bodies each look crosses the triangles of both. */
static uint32_t crossings_of(const palp_lattice_room *r) {
    const uint32_t crossings = PALP_LATTICE_CROSSINGS(r->most);
    return r->other != NULL ? PALP_LATTICE_BETWEEN * crossings : crossings;
}

/* The longest mean edge. */
static float edge_of(const palp_lattice_room *r) {
    float edge = 0.0f;
    for (uint32_t b = 0; b < r->bodies; b++)
        edge = palp_max(edge, r->surface[b].blob->meta->mean_edge_m);
    return edge;
}

static void start_filling(filling *f, palp_lattice *l, const palp_lattice_room *r, uint32_t first) {
    const palp_vec3 moved = palp_sub(r->tool_m, r->given.mean_m);
    l->at.given = r->given;
    l->used = l->at;
    *f = (filling){.l = l,
                   .r = r,
                   .moved_m = moved,
                   .central = is_central(r),
                   .first = first,
                   .shots_left = PALP_LATTICE_SHOTS(r->most),
                   .crossings = crossings_of(r),
                   .rings = PALP_LATTICE_RINGS(r->most),
                   .feet = PALP_LATTICE_FEET(r->most),
                   .unsure_m = UNSURE * palp_norm(r->given.mean_m),
                   .far_m = ELSEWHERE * palp_norm(r->given.mean_m) + MARGIN * edge_of(r)};
    *r->count = first;
    place_watched(l, r);
}

/* Nodes to watch in the next filling: those nearest to touching, apart by more than the reach of
 * the contact. */
typedef struct {
    palp_lattice_watch of[PALP_LATTICE_WATCHED];
    uint32_t count;
} watch_list;

static void offer(watch_list *list, const palp_far_field *given, palp_lattice_watch w) {
    uint32_t in = list->count, farthest = 0;
    palp_vec3 d = palp_sub(w.x_m, given->at_m);
    if (!(palp_dot(d, d) * given->fade > 1.0f)) return;
    for (uint32_t k = 0; k < list->count; k++) {
        d = palp_sub(w.x_m, list->of[k].x_m);
        if (palp_dot(d, d) * given->fade <= 1.0f) in = k;
        if (list->of[k].gap_m > list->of[farthest].gap_m) farthest = k;
    }
    if (in == PALP_LATTICE_WATCHED) in = farthest;
    if (in < list->count && list->of[in].gap_m <= w.gap_m) return;
    list->of[in] = w;
    if (in == list->count) list->count++;
}

typedef enum { MEASURE, SEEK } purpose;

/* How a node of a zone is bent, the more the nearer it is to the tool. */
static void add_bent(filling *f, palp_far_field_sums *sums, uint32_t body, uint32_t node,
                     palp_vec3 v, float far) {
    const palp_lattice_room *r = f->r;
    if (r->done->bent == PALP_LATTICE_BENT) {
        f->crowded = true;
        return;
    }
    r->done->bent++;
    palp_far_field_add(sums, (1.0f - far) * (1.0f - far) + 1e-3f, v,
                       turned_out(r, body, palp_surface_bent(surface_of(r, body), node)),
                       r->size_m);
}

/* What a visit of nodes finds besides. */
typedef struct {
    purpose of;
    palp_vec3 c;         /* about which nodes are looked at */
    float bent_within_m; /* gap up to which a node says how its zone is bent */
    watch_list next;
    palp_far_field_sums bent;
} visit;

static void visit_node(filling *f, visit *v, uint32_t body, uint32_t node) {
    const palp_lattice_room *r = f->r;
    const palp_surface *surface = surface_of(r, body);
    const palp_blob *b = surface->blob;
    const float margin = MARGIN * b->meta->mean_edge_m;
    if (surface->assembly != NULL && palp_surface_is_inner(surface, b->regular.triangle[node]))
        return;
    palp_vec3 off = palp_sub(node_at(r, body, node), v->c);
    r->done->around++;
    if (palp_dot(off, off) > r->reach_m * r->reach_m) return;
    palp_gap gap = gap_of(f, palp_add(v->c, off));
    if (gap.gap_m < v->bent_within_m)
        add_bent(f, &v->bent, body, node, off, palp_max(gap.gap_m / r->size_m, 0.0f));
    if (gap.gap_m > f->far_m) return;
    palp_vec3 n = turned_out(r, body, palp_vec3_at(b->normal + 3u * (size_t)node));
    if (palp_dot(gap.normal, n) > 0.0f) return;
    offer(&v->next, &f->l->at.given,
          (palp_lattice_watch){
              .body = body, .node = node, .x_m = palp_add(v->c, off), .gap_m = gap.gap_m});
    if (gap.gap_m > margin) return;
    if (v->of == MEASURE) measure_node(f, body, node, gap.gap_m);
    if (v->of == SEEK) seek_region(f, body, node, gap.gap_m);
}

static void visit_body(filling *f, visit *v, uint32_t body) {
    const palp_blob *b = surface_of(f->r, body)->blob;
    const palp_meta *m = b->meta;
    cell_range cells = cells_around(b, into(f->r, body, v->c), f->r->reach_m);
    for (uint32_t z = cells.low[2]; z <= cells.high[2]; z++) {
        for (uint32_t y = cells.low[1]; y <= cells.high[1]; y++) {
            uint32_t row = (z * m->cells[1] + y) * m->cells[0];
            uint32_t end = b->cell_offset[row + cells.high[0] + 1u];
            f->r->done->around++;
            for (uint32_t k = b->cell_offset[row + cells.low[0]]; k < end; k++)
                visit_node(f, v, body, b->cell_node[k]);
        }
    }
}

/* Each node near the tool that faces it. */
static void visit_nodes(filling *f, purpose of) {
    const palp_lattice_room *r = f->r;
    visit v = {.of = of, .c = f->moved_m, .bent_within_m = -1e30f};
    if (of == MEASURE && r->surface[0].assembly != NULL)
        v.bent_within_m = (1.0f - f->l->narrowed) * r->size_m;
    if (r->other != NULL) v.c = palp_add(v.c, f->l->at.origin_m);
    for (uint32_t b = 0; b < r->bodies; b++) {
        const uint32_t body = r->first_body + b;
        const palp_blob *blob = surface_of(r, body)->blob;
        if (r->bodies == 1u || palp_surface_is_within(blob, into(r, body, v.c), r->reach_m))
            visit_body(f, &v, body);
    }
    if (of == MEASURE) {
        f->l->bent = palp_far_field_fit(&v.bent, v.c);
        f->l->narrowed = f->crowded ? f->l->narrowed + NARROWER * (1.0f - f->l->narrowed)
                                    : palp_max(f->l->narrowed - WIDER, 0.0f);
    }
    f->l->watched = v.next.count;
    for (uint32_t k = 0; k < v.next.count; k++) f->l->watch[k] = v.next.of[k];
}

/* ---- following the overlap ---- */

static void set_axis(palp_lattice *l, palp_vec3 axis) {
    float length = palp_norm(axis);
    if (!(length > 1e-20f)) return;
    l->at.axis = palp_scale(1.0f / length, axis);
    palp_vec3 t = palp_madd(l->at.tangent[0], -palp_dot(l->at.tangent[0], l->at.axis), l->at.axis);
    if (palp_norm(t) < 0.3f) {
        palp_vec3 x = {1.0f, 0.0f, 0.0f}, y = {0.0f, 1.0f, 0.0f};
        t = palp_abs(l->at.axis.x) < 0.7f ? x : y;
        t = palp_madd(t, -palp_dot(t, l->at.axis), l->at.axis);
    }
    l->at.tangent[0] = palp_scale(1.0f / palp_norm(t), t);
    l->at.tangent[1] = palp_cross(l->at.axis, l->at.tangent[0]);
}

static palp_vec3 center_of(const palp_lattice_room *r) {
    return is_central(r) ? r->tool->ball[0].center_m : (palp_vec3){0};
}

static void set_origin(palp_lattice *l, const palp_lattice_room *r) {
    if (is_central(r)) l->at.origin_m = palp_madd(center_of(r), -l->at.back_m, l->at.axis);
}

/* Spacing of `cells` cells in an area. */
static float wanted_cell2(const palp_lattice_room *r, float area_m2) {
    float floor = FLOOR * r->size_m;
    return (area_m2 + PALP_PI_F * floor * floor) / (PALP_LATTICE_CELL * r->cells);
}

static bool begin(palp_lattice *l, const palp_lattice_room *r) {
    filling a;
    l->placed = false;
    l->watched = 0;
    l->at.back_m = 0.0f;
    l->went = (palp_vec3){0};
    l->grew = 0.0f;
    start_filling(&a, l, r, *r->count);
    const uint32_t crossings = r->other != NULL ? crossings_of(r) : PALP_LATTICE_MEASURE;
    a.crossings = crossings;
    visit_nodes(&a, MEASURE);
    r->done->fillings++;
    r->done->crossings += crossings - a.crossings;
    if (!(a.gap_m < 0.0f)) return false;
    float size = r->size_m, depth = -a.gap_m;
    palp_vec3 c = palp_add(a.moved_m, center_of(r));
    const palp_vec3 deepest = world_of(r, &a.deepest);
    palp_gap gap = gap_of(&a, deepest);
    if (is_central(r)) {
        set_axis(l, palp_sub(deepest, c));
        set_origin(l, r);
    } else {
        set_axis(l, is_flat(r) ? r->tool->pad.axis[2] : gap.normal);
        l->at.origin_m = palp_sub(deepest, a.moved_m);
        l->at.origin_m =
            palp_madd(l->at.origin_m, -palp_dot(l->at.origin_m, l->at.axis), l->at.axis);
    }
    float area_m2 = palp_max(2.0f * PALP_PI_F * size * palp_min(depth, size), a.area_m2);
    float cell = palp_sqrt(wanted_cell2(r, 0.5f * area_m2));
    l->at.spacing = cell;
    if (is_central(r)) {
        float distance = palp_norm(palp_sub(deepest, palp_add(a.moved_m, l->at.origin_m)));
        l->at.spacing = palp_min(cell / palp_max(distance, 0.1f * size), 0.8f);
    }
    l->seeds = 1;
    l->seed[0] = a.deepest;
    l->placed = true;
    return true;
}

void palp_lattice_aim(palp_lattice *lattice, palp_vec3 axis, palp_vec3 given_m) {
    palp_lattice *l = lattice;
    *l = (palp_lattice){.placed = false};
    set_axis(l, axis);
    l->at.origin_m = given_m;
}

static float face_m2(const palp_tool *tool) {
    return 4.0f * tool->pad.half_m[0] * tool->pad.half_m[1];
}

/* How far the lattice keeps to the middle and the size of a pad. Where a face lies on the body as a
 * whole, what overlaps ends with the face: its mean place jumps as points come in at one side and
 * go out at the other, with the spacing after them, and a lattice that followed would go to and
 * fro. */
static float covered(const palp_lattice_room *r, float area_m2) {
    if (!is_flat(r)) return 0.0f;
    return palp_clamp((area_m2 / face_m2(r->tool) - COVERS) / (COVERED - COVERS), 0.0f, 1.0f);
}

/* A change that turns back on the last one is damped, so that a lattice does not go to and fro
 * between two places of which each points to the other. */
static float damping(float along) { return along < 0.0f ? DAMPED : 1.0f; }

/*
 * Where a sphere's axis is to point: to the mean of its regions' directions, each by its weight but
 * a large one not by more than a small one, so that all of them lie in the map. Shorter than 1 by
 * how far the overlap is apart.
 */
static palp_vec3 axis_toward(const palp_lattice_room *r, const filling *f) {
    palp_vec3 toward[PALP_LATTICE_SEEDS], mean = {.x = 0.0f};
    float weight[PALP_LATTICE_SEEDS], most = 0.0f, all = 0.0f;
    uint32_t k = f->first;
    for (uint32_t n = 0; n < f->regions; n++) {
        toward[n] = (palp_vec3){.x = 0.0f};
        weight[n] = 0.0f;
        for (; k < f->end[n]; k++) {
            const palp_contact_point *p = &r->point[k];
            float w = p->cell_m * p->cell_m * p->overlap_m;
            toward[n] = palp_madd(toward[n], w, p->direction);
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

/* Moves the lattice to what its points say of the overlap; true when another filling is worth it.
 */
static bool track(palp_lattice *l, const palp_lattice_room *r, const filling *f) {
    float weight = 0.0f, square = 0.0f, cells = 0.0f, deepest = 0.0f;
    palp_vec3 aside = {0}, out = {0};
    for (uint32_t k = f->first; k < *r->count; k++) {
        const palp_contact_point *p = &r->point[k];
        float area = PALP_LATTICE_CELL * p->cell_m * p->cell_m, w = area * p->overlap_m;
        palp_vec3 off = palp_sub(p->q, palp_add(f->moved_m, l->at.origin_m));
        weight += w;
        square += w * p->overlap_m;
        cells += w * area;
        deepest = palp_max(deepest, p->overlap_m);
        aside = palp_madd(aside, w, off);
        if (!f->central) out = palp_madd(out, -w, p->n);
    }
    if (!(weight > 0.0f) || !(square > 0.0f)) return false;
    float area_m2 = 4.0f / 3.0f * weight * weight / square;
    l->at.fixed = covered(r, area_m2);
    float cell2 = wanted_cell2(r, 0.5f * area_m2);
    if (l->at.fixed > 0.0f) /* all of it in contact */
        cell2 += l->at.fixed * (face_m2(r->tool) / (PALP_LATTICE_CELL * r->cells) - cell2);
    float change2 = cell2 * PALP_LATTICE_CELL * weight / cells;
    if (f->full) change2 = palp_max(change2, 1.3f);
    float change = palp_sqrt(palp_clamp(change2, 0.25f, 4.0f));
    const float slow = f->regions > 1u ? SLOWER : 1.0f;
    change = 1.0f + slow * damping((change - 1.0f) * l->grew) * (change - 1.0f);
    l->grew = change - 1.0f;
    palp_vec3 went;
    if (f->central) {
        const palp_vec3 before = l->at.axis, toward = axis_toward(r, f);
        const float follows = following(palp_norm(toward));
        l->apart = follows < 1.0f;
        set_axis(l, toward);
        went = palp_scale(1.0f / l->at.spacing, palp_sub(l->at.axis, before));
        float share = damping(palp_dot(went, l->went)) * follows;
        set_axis(l, palp_madd(before, share, palp_sub(l->at.axis, before)));
        went = palp_scale(share, went);
        l->at.spacing = palp_min(l->at.spacing * change, 0.8f);
    } else {
        palp_vec3 shift = palp_scale(1.0f / weight, aside);
        shift = palp_madd(palp_scale(1.0f - l->at.fixed, shift), -l->at.fixed, l->at.origin_m);
        if (!is_flat(r)) set_axis(l, out);
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
    const float back = f->central ? palp_max(deepest - SHALLOW * size, 0.0f) : 0.0f;
    const float moved = palp_norm(went) + palp_abs(back - l->at.back_m) / size;
    l->at.back_m = back;
    set_origin(l, r);
    return palp_abs(change - 1.0f) > CELL_CHANGE || moved > 0.25f;
}

/* All regions, first those that were there before. */
static void fill(filling *f, palp_lattice *l, const palp_lattice_room *r, uint32_t first) {
    const uint32_t seeds = l->seeds;
    start_filling(f, l, r, first);
    r->done->fillings++;
    l->seeds = 0;
    want_pressed(f);
    for (uint32_t k = 0; k < seeds;
         k++) { /* which puts a seed in place of this or an earlier one */
        const palp_surface_point seed = l->seed[k];
        (void)fill_region(f, &seed);
    }
    for (uint32_t k = 0; k < r->count_before; k++) { /* what has come apart since the last tick */
        const palp_contact_point *p = &r->before[k];
        if (p->patch == r->number && p->active && !is_known(f, world_of(r, &p->at)))
            (void)fill_region(f, &p->at);
    }
    visit_nodes(f, SEEK);
    r->done->crossings += crossings_of(r) - f->crossings;
}

uint32_t palp_lattice_fill(palp_lattice *lattice, const palp_lattice_room *room, uint32_t first) {
    palp_lattice *l = lattice;
    filling f;
    *room->count = first;
    palp_lattice_clear(room->table);
    if (!l->placed) return begin(l, room) ? PALP_LATTICE_BEGUN : 0u;
    fill(&f, l, room, first);
    l->placed = *room->count > first;
    if (!l->placed) return PALP_LATTICE_MOVED; /* gone, or overtaken */
    bool moved = track(l, room, &f);
    return (f.full ? PALP_LATTICE_FULL : 0u) | (f.crossings == 0u ? PALP_LATTICE_LOST : 0u) |
           (moved || f.full ? PALP_LATTICE_MOVED : 0u);
}
