/* SPDX-License-Identifier: MIT */
/* What nodes around a tool say: where it overlaps the surface, and regions that no site has shown.
 */
#include "core/contact/lattice_internal.h"

#define NARROWER 0.3f /* share that is left out more when too many nodes say how zones are bent */
#define WIDER 0.01f   /* and less in a filling that has room for all */
#define FEET 4u       /* steps towards the nearest point of the surface */

/* Direction from a tool's core to the nearest point of the edges at a node: on a ridge the
 * deepest point may lie between nodes, where no normal leads to it. */
static palp_vec3 way_to_edges(const palp_lattice_filling *f, uint32_t body, uint32_t node,
                              palp_vec3 at) {
    const palp_blob *b = palp_lattice_surface(f->r, body)->blob;
    const palp_vec3 x = palp_vec3_at(b->rest_m + 3u * (size_t)node);
    const palp_vec3 back = palp_sub(palp_lattice_into(f->r, body, at), x);
    palp_vec3 way = palp_scale(-1.0f, back);
    for (uint32_t k = b->ring_offset[node]; k < b->ring_offset[node + 1u]; k++) {
        palp_vec3 e = palp_sub(palp_vec3_at(b->rest_m + 3u * (size_t)b->ring[k]), x);
        float share = palp_clamp(palp_dot(back, e) / palp_dot(e, e), 0.0f, 1.0f);
        palp_vec3 to = palp_sub(palp_scale(share, e), back);
        f->r->done->around++;
        if (palp_dot(to, to) < palp_dot(way, way)) way = to;
    }
    way = palp_scale(1.0f / palp_max(palp_norm(way), 1e-30f), way);
    return palp_lattice_turned_out(f->r, body, way);
}

/* Of which a tool is all that is within a radius: a ball's centre, or the middle of a cylinder. */
static bool has_core(const palp_lattice_filling *f) {
    return f->central || (f->r->other.surface == NULL && f->r->tool->shape == PALP_TOOL_CYLINDER);
}

/* Whether one of a field's extremes is looked from: in turn with the nearest place, which goes to
 * and fro between a thin tool and the surface but little by little. */
static bool from_extreme(const palp_lattice_filling *f, uint32_t look) {
    return f->r->other.surface == NULL && f->r->tool->shape == PALP_TOOL_FIELD &&
           f->r->tool->field.extremes > 0u && look % 2u == 0u;
}

/* Where the search for the foot begins, before a surface with the normal n at rest: a ball's
 * centre, the place inside a cylinder or the extreme of a field that lies deepest; of any other
 * tool its nearest place. */
static palp_vec3 foot_from(const palp_lattice_filling *f, palp_vec3 y, palp_gap gap, palp_vec3 n,
                           uint32_t look) {
    const palp_lattice_room *r = f->r;
    const bool extreme = from_extreme(f, look);
    float gone;
    if (!has_core(f) && !extreme) return palp_madd(y, -gap.gap_m, gap.normal);
    const palp_vec3 beside = palp_lattice_beside(f, y, &gone);
    if (f->central) return palp_sub(palp_add(f->moved.t, palp_lattice_center(r)), beside);
    const palp_vec3 down = palp_rotate_back(f->moved.r, palp_scale(-1.0f, n));
    const palp_vec3 own = palp_carry_back(&f->moved, palp_add(y, beside));
    const palp_vec3 place = extreme ? palp_tool_field_extreme(&r->tool->field, down)
                                    : palp_tool_core(&r->tool->cylinder, down, own);
    return palp_sub(palp_carry(&f->moved, place), beside);
}

/* From a node towards the point of the surface that lies deepest in the tool nearby. Each shot goes
 * against the normal where the last one met the surface, which finds the foot on smooth places;
 * where that leads away, as it does about an edge, it turns half back. *gap_m: the gap there. */
PALP_APART static bool walk_to_foot(palp_lattice_filling *f, uint32_t node, palp_surface_point *p,
                                    float *gap_m) {
    const palp_lattice_room *r = f->r;
    palp_gap least = palp_lattice_gap(f, palp_lattice_world(r, p));
    palp_vec3 best = least.normal, way = best;
    palp_surface_point trial = *p;
    if (has_core(f))
        way = best = way_to_edges(
            f, p->body, node,
            foot_from(f, palp_lattice_world(r, p), least, palp_lattice_normal(r, p), 0));
    bool met = false;
    r->done->feet++;
    for (uint32_t k = 0; k < FEET; k++) {
        const palp_vec3 n = palp_lattice_normal(r, p);
        const palp_vec3 at = foot_from(f, palp_lattice_world(r, p), least, n, k);
        const bool extreme = from_extreme(f, k);
        const palp_vec3 along = extreme ? palp_scale(-1.0f, n) : way;
        if (!palp_lattice_enter(f, at, along, &trial)) {
            if (extreme) continue; /* it lies beyond an edge */
            break;
        }
        palp_gap gap = palp_lattice_gap(f, palp_lattice_world(r, &trial));
        if (gap.gap_m < least.gap_m || (!met && !extreme)) {
            best = along;
            least = gap;
            *p = trial;
            met = true;
            way = palp_scale(-1.0f, palp_lattice_normal(r, p));
        } else if (!extreme) {
            way = palp_add(way, best);
            way = palp_scale(1.0f / palp_max(palp_norm(way), 1e-6f), way);
        }
    }
    *gap_m = least.gap_m;
    return met && palp_dot(least.normal, palp_lattice_normal(r, p)) < 0.0f;
}

static bool find_foot(palp_lattice_filling *f, uint32_t node, palp_surface_point *p, float *gap_m) {
    if (f->feet == 0u) return false;
    f->feet--;
    return walk_to_foot(f, node, p, gap_m);
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
PALP_APART static bool is_below_ring(palp_lattice_filling *f, uint32_t body, uint32_t node,
                                     float gap_m) {
    const palp_blob *b = palp_lattice_surface(f->r, body)->blob;
    for (uint32_t k = b->ring_offset[node]; k < b->ring_offset[node + 1u]; k++) {
        if (palp_lattice_gap(f, palp_lattice_node(f->r, body, b->ring[k])).gap_m < gap_m)
            return false;
    }
    return true;
}

static bool is_deepest(palp_lattice_filling *f, uint32_t body, uint32_t node, float gap_m) {
    if (f->rings == 0u) return false;
    f->rings--;
    return is_below_ring(f, body, node, gap_m);
}

float palp_lattice_reach(const palp_tool *tool, const palp_blob *blob) {
    return palp_tool_extent(tool) + PALP_LATTICE_MARGIN * blob->meta->mean_edge_m;
}

/* Before there is a lattice: the deepest point, and the area that nodes see overlapped. */
static void measure_node(palp_lattice_filling *f, uint32_t body, uint32_t node, float gap_m) {
    const palp_surface *surface = palp_lattice_surface(f->r, body);
    if (gap_m < 0.0f) f->area_m2 += surface->blob->area_m2[node];
    if (gap_m >= f->gap_m && !is_deepest(f, body, node, gap_m)) return;
    palp_surface_point p = palp_lattice_at_node(surface, body, node), foot = p;
    float least = gap_m, at_foot_m;
    if (find_foot(f, node, &foot, &at_foot_m)) {
        if (at_foot_m < least) p = foot;
        least = palp_min(at_foot_m, least);
    }
    if (least >= f->gap_m) return;
    f->gap_m = least;
    f->deepest = p;
}

/* A region that no site has shown yet. */
static void seek_region(palp_lattice_filling *f, uint32_t body, uint32_t node, float gap_m) {
    palp_surface_point p = palp_lattice_at_node(palp_lattice_surface(f->r, body), body, node);
    float at_foot_m;
    if (gap_m < 0.0f) {
        palp_lattice_fill_unknown(f, &p);
        return;
    }
    if (!is_deepest(f, body, node, gap_m)) return;
    if (!find_foot(f, node, &p, &at_foot_m) || at_foot_m >= 0.0f) return;
    palp_lattice_fill_unknown(f, &p);
}

void palp_lattice_move_watched(palp_lattice *l, const palp_lattice_room *r) {
    for (uint32_t k = 0; k < l->watched; k++) {
        palp_lattice_watch *w = &l->watch[k];
        const palp_surface *surface = palp_lattice_surface(r, w->body);
        w->u_m = palp_surface_corner(surface, w->node, r->far_modes, r->load);
        w->u_m = palp_scale(r->share, w->u_m);
        w->u_m = palp_add(w->u_m, palp_surface_bent(surface, w->node));
        w->u_m = palp_lattice_turned_out(r, w->body, w->u_m);
    }
}

/* Nodes to watch in the next filling: those nearest to touching, apart by more than the reach of
 * the contact. */
typedef struct {
    palp_lattice_watch of[PALP_LATTICE_WATCHED];
    uint32_t count;
} watch_list;

static void offer(watch_list *list, const palp_far_field *far_field, palp_lattice_watch w) {
    uint32_t in = list->count, farthest = 0;
    palp_vec3 d = palp_sub(w.x_m, far_field->at_m);
    if (!(palp_dot(d, d) * far_field->fade > 1.0f)) return;
    for (uint32_t k = 0; k < list->count; k++) {
        d = palp_sub(w.x_m, list->of[k].x_m);
        if (palp_dot(d, d) * far_field->fade <= 1.0f) in = k;
        if (list->of[k].gap_m > list->of[farthest].gap_m) farthest = k;
    }
    if (in == PALP_LATTICE_WATCHED) in = farthest;
    if (in < list->count && list->of[in].gap_m <= w.gap_m) return;
    list->of[in] = w;
    if (in == list->count) list->count++;
}

/* How a node of a zone is bent, the more the nearer it is to the tool. */
static void add_bent(palp_lattice_filling *f, palp_far_field_sums *sums, uint32_t body,
                     uint32_t node, palp_vec3 v, float far) {
    const palp_lattice_room *r = f->r;
    if (r->done->bent == PALP_LATTICE_BENT) {
        f->crowded = true;
        return;
    }
    r->done->bent++;
    palp_far_field_add(
        sums, (1.0f - far) * (1.0f - far) + 1e-3f, v,
        palp_lattice_turned_out(r, body, palp_surface_bent(palp_lattice_surface(r, body), node)),
        r->size_m);
}

/* What a visit of nodes finds besides. */
typedef struct {
    palp_lattice_purpose of;
    palp_vec3 c;         /* about which nodes are visited */
    float bent_within_m; /* gap up to which a node says how its zone is bent */
    watch_list next;
    palp_far_field_sums bent;
} visit;

/* Whether a place, from the tool's reference point, is to be tested: not what lies beyond the box
 * of a long tool. */
PALP_APART static bool field_may_meet(palp_lattice_filling *f, palp_vec3 off) {
    const palp_lattice_room *r = f->r;
    const float reach = palp_max(r->size_m, f->far_m); /* whichever a visit asks for */
    r->done->around++;
    if (!palp_tool_may_reach(r->tool, palp_rotate_back(f->moved.r, off), reach)) return false;
    if (f->tests == 0u) return false;
    f->tests--;
    return true;
}

static bool may_meet(palp_lattice_filling *f, palp_vec3 off) {
    const palp_lattice_room *r = f->r;
    if (r->other.surface != NULL || r->tool->shape != PALP_TOOL_FIELD) return true;
    return field_may_meet(f, off);
}

/* A node within reach, at `off` from the middle of the visit. */
PALP_APART static void test_node(palp_lattice_filling *f, visit *v, uint32_t body, uint32_t node,
                                 palp_vec3 off) {
    const palp_lattice_room *r = f->r;
    const palp_blob *b = palp_lattice_surface(r, body)->blob;
    const float margin = PALP_LATTICE_MARGIN * b->meta->mean_edge_m;
    r->done->nodes++;
    palp_gap gap = palp_lattice_gap(f, palp_add(v->c, off));
    if (gap.gap_m < v->bent_within_m)
        add_bent(f, &v->bent, body, node, off, palp_max(gap.gap_m / r->size_m, 0.0f));
    if (gap.gap_m > f->far_m) return;
    palp_vec3 n = palp_lattice_turned_out(r, body, palp_vec3_at(b->normal + 3u * (size_t)node));
    if (palp_dot(gap.normal, n) > 0.0f) return;
    offer(&v->next, &f->l->at.far_field,
          (palp_lattice_watch){
              .body = body, .node = node, .x_m = palp_add(v->c, off), .gap_m = gap.gap_m});
    if (gap.gap_m > margin) return;
    if (v->of == PALP_LATTICE_TO_MEASURE)
        measure_node(f, body, node, gap.gap_m);
    else
        seek_region(f, body, node, gap.gap_m);
}

static void visit_node(palp_lattice_filling *f, visit *v, uint32_t body, uint32_t node) {
    const palp_lattice_room *r = f->r;
    const palp_surface *surface = palp_lattice_surface(r, body);
    if (surface->assembly != NULL &&
        palp_surface_is_inner(surface, surface->blob->regular.triangle[node]))
        return;
    palp_vec3 off = palp_sub(palp_lattice_node(r, body, node), v->c);
    r->done->around++;
    if (palp_dot(off, off) > r->reach_m * r->reach_m || !may_meet(f, off)) return;
    test_node(f, v, body, node, off);
}

static void visit_body(palp_lattice_filling *f, visit *v, uint32_t body) {
    const palp_blob *b = palp_lattice_surface(f->r, body)->blob;
    const palp_meta *m = b->meta;
    cell_range cells = cells_around(b, palp_lattice_into(f->r, body, v->c), f->r->reach_m);
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

void palp_lattice_visit(palp_lattice_filling *f, palp_lattice_purpose of) {
    const palp_lattice_room *r = f->r;
    visit v = {.of = of, .c = f->moved.t, .bent_within_m = -1e30f};
    if (of == PALP_LATTICE_TO_MEASURE && r->surface[0].assembly != NULL)
        v.bent_within_m = (1.0f - f->l->narrowed) * r->size_m;
    if (r->other.surface != NULL) v.c = palp_add(v.c, f->l->at.origin_m);
    for (uint32_t b = 0; b < r->bodies; b++) {
        const uint32_t body = r->first_body + b;
        const palp_blob *blob = palp_lattice_surface(r, body)->blob;
        if (r->bodies == 1u ||
            palp_surface_is_within(blob, palp_lattice_into(r, body, v.c), r->reach_m))
            visit_body(f, &v, body);
    }
    if (of == PALP_LATTICE_TO_MEASURE) {
        f->l->bent = palp_far_field_fit(&v.bent, v.c);
        f->l->narrowed = f->crowded ? f->l->narrowed + NARROWER * (1.0f - f->l->narrowed)
                                    : palp_max(f->l->narrowed - WIDER, 0.0f);
    }
    f->l->watched = v.next.count;
    for (uint32_t k = 0; k < v.next.count; k++) f->l->watch[k] = v.next.of[k];
}
