/* SPDX-License-Identifier: MIT */
#include "tools/mesh/creases.h"
#include "port/host/util.h"
#include "tools/mesh/union_find.h"
#include <stdlib.h>
#include <string.h>

#define SHARP_DEG 40.0
#define TURN_DEG 40.0    /* where a crease has a corner */
#define SHORTEST_RIM 6.0 /* spacings of the mesh around a facet that it can show */
#define ROUNDS 6
#define MOST_FACETS 6u /* that meet in a corner */
#define NONE UINT32_MAX

typedef struct {
    uint32_t a, b, facet[2];
} crease;

/* Facets that a vertex of the mesh belongs to: one within it, more on its creases. */
typedef struct {
    uint32_t facet[MOST_FACETS], count;
} membership;

typedef struct {
    const mesh *original;
    uint32_t *facet; /* [triangles of the original] */
    crease *list;
    uint32_t count;
    uint32_t *first, *of_facet; /* creases around facet f: of_facet[first[f]..first[f + 1]) */
} creases;

static bool shares_facet(const membership *a, const membership *b) {
    for (uint32_t i = 0; i < a->count; i++) {
        for (uint32_t k = 0; k < b->count; k++) {
            if (a->facet[i] == b->facet[k]) return true;
        }
    }
    return false;
}

static void join_facet(membership *m, uint32_t facet) {
    for (uint32_t i = 0; i < m->count; i++) {
        if (m->facet[i] == facet) return;
    }
    if (m->count < MOST_FACETS) m->facet[m->count++] = facet;
}

static double cosine_between(const mesh *m, const mesh_edge *e) {
    double n[2][3];
    for (int s = 0; s < 2; s++) mesh_unit_normal(m, e->triangle[s], n[s]);
    return v_dot(n[0], n[1]);
}

static void sort_by_facet(creases *c) {
    const uint32_t facets = c->original->triangles;
    c->first = allocate(facets + 2u, sizeof *c->first);
    c->of_facet = allocate(2 * (size_t)c->count, sizeof *c->of_facet);
    for (uint32_t i = 0; i < 2 * c->count; i++) c->first[c->list[i / 2].facet[i % 2] + 2]++;
    for (uint32_t f = 2; f < facets + 2; f++) c->first[f] += c->first[f - 1];
    for (uint32_t i = 0; i < 2 * c->count; i++)
        c->of_facet[c->first[c->list[i / 2].facet[i % 2] + 1]++] = i / 2;
}

/* Facets, and the edges between them; facets with a shorter rim than `shortest` do not count, nor
 * do their edges. */
static creases find_creases(const mesh *m, double shortest) {
    creases c = {.original = m, .facet = allocate(m->triangles, sizeof *c.facet)};
    uint32_t edges;
    mesh_edge *e = mesh_edges(m, &edges);
    double *rim = allocate(m->triangles, sizeof *rim);
    for (uint32_t t = 0; t < m->triangles; t++) c.facet[t] = t;
    for (uint32_t i = 0; i < edges; i++) {
        if (cosine_between(m, &e[i]) >= cos(SHARP_DEG * M_PI / 180))
            set_join(c.facet, e[i].triangle[0], e[i].triangle[1]);
    }
    for (uint32_t t = 0; t < m->triangles; t++) c.facet[t] = set_of(c.facet, t);
    for (uint32_t i = 0; i < edges; i++) {
        const uint32_t p = c.facet[e[i].triangle[0]], q = c.facet[e[i].triangle[1]];
        if (p == q) continue;
        rim[p] += v_distance(m->x[e[i].a], m->x[e[i].b]);
        rim[q] += v_distance(m->x[e[i].a], m->x[e[i].b]);
    }
    c.list = allocate(edges, sizeof *c.list);
    for (uint32_t i = 0; i < edges; i++) {
        const uint32_t p = c.facet[e[i].triangle[0]], q = c.facet[e[i].triangle[1]];
        if (p == q || rim[p] < shortest || rim[q] < shortest) continue;
        c.list[c.count++] = (crease){e[i].a, e[i].b, {p, q}};
    }
    sort_by_facet(&c);
    free(e);
    free(rim);
    return c;
}

/* The place on the creases around `facet` that is nearest to x; returns which, NONE if it has none. */
static uint32_t nearest_crease(const creases *c, const double x[3], uint32_t facet, double place[3],
                               double *distance) {
    uint32_t found = NONE;
    *distance = HUGE_VAL;
    for (uint32_t i = c->first[facet]; i < c->first[facet + 1]; i++) {
        const crease *e = &c->list[c->of_facet[i]];
        const double *a = c->original->x[e->a], *b = c->original->x[e->b];
        double along[3], d[3], p[3];
        v_sub(b, a, along);
        v_sub(x, a, d);
        const double t = fmin(1, fmax(0, v_dot(d, along) / v_dot(along, along)));
        for (int k = 0; k < 3; k++) p[k] = a[k] + t * along[k];
        const double off = v_distance(x, p);
        if (off >= *distance) continue;
        *distance = off;
        found = c->of_facet[i];
        memcpy(place, p, sizeof p);
    }
    return found;
}

/* ---- corners ---- */

typedef struct {
    uint32_t count;
    double away[2][3]; /* directions of the first two creases from there */
    membership of;
} meeting;

static bool is_corner(const meeting *m) {
    return m->count > 2 ||
           (m->count == 2 && v_dot(m->away[0], m->away[1]) > -cos(TURN_DEG * M_PI / 180));
}

static void take_corners(const reach *r, const creases *c, membership *of) {
    meeting *at = allocate(c->original->vertices, sizeof *at);
    for (uint32_t i = 0; i < c->count; i++) {
        const uint32_t end[2] = {c->list[i].a, c->list[i].b};
        for (int s = 0; s < 2; s++) {
            meeting *m = &at[end[s]];
            if (m->count < 2) {
                v_sub(c->original->x[end[1 - s]], c->original->x[end[s]], m->away[m->count]);
                v_normalize(m->away[m->count]);
            }
            m->count++;
            for (int p = 0; p < 2; p++) join_facet(&m->of, c->list[i].facet[p]);
        }
    }
    for (uint32_t v = 0; v < c->original->vertices; v++) {
        if (!is_corner(&at[v])) continue;
        const double *x = c->original->x[v];
        double point[3], facing[3];
        (void)bvh_closest(r->f->surface, x, NULL, 0, point, facing);
        const uint32_t nearest = fit_nearest_vertex(r->f, x, facing);
        if (nearest == NONE || !reach_take(r, nearest, x, facing)) continue;
        r->held[nearest] = true;
        of[nearest] = at[v].of;
    }
    free(at);
}

/* ---- edges that cross a crease ---- */

typedef struct {
    double distance;
    uint32_t vertex;
} candidate;

static int compare_candidates(const void *a, const void *b) {
    const candidate *p = a, *q = b;
    if (p->distance < q->distance || p->distance > q->distance)
        return p->distance < q->distance ? -1 : 1;
    return p->vertex < q->vertex ? -1 : p->vertex > q->vertex;
}

static bool crosses_any(const fit *f, const membership *of, uint32_t v) {
    for (uint32_t i = f->offset[v]; i < f->offset[v + 1]; i++) {
        if (!shares_facet(&of[v], &of[f->ring[i]])) return true;
    }
    return false;
}

static uint32_t take_crossing(const reach *r, const creases *c, membership *of) {
    const fit *f = r->f;
    candidate *list = allocate(f->m->vertices, sizeof *list);
    uint32_t count = 0, taken = 0;
    double place[3], distance, point[3], facing[3];
    for (uint32_t v = 0; v < f->m->vertices; v++) {
        if (r->held[v] || !crosses_any(f, of, v)) continue;
        if (nearest_crease(c, f->m->x[v], of[v].facet[0], place, &distance) == NONE) continue;
        list[count++] = (candidate){distance, v};
    }
    qsort(list, count, sizeof *list, compare_candidates);
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t v = list[i].vertex;
        if (!crosses_any(f, of, v)) continue; /* a neighbour has gone there */
        const uint32_t on = nearest_crease(c, f->m->x[v], of[v].facet[0], place, &distance);
        (void)bvh_closest(f->surface, place, NULL, 0, point, facing);
        if (!reach_take(r, v, place, facing)) continue;
        r->held[v] = true;
        of[v] = (membership){{c->list[on].facet[0], c->list[on].facet[1]}, 2};
        taken++;
    }
    free(list);
    return taken;
}

void reach_creases(reach *r) {
    const fit *f = r->f;
    creases c = find_creases(r->original, SHORTEST_RIM * mesh_mean_edge(f->m));
    r->folds = c.count > 0;
    if (c.count > 0) {
        membership *of = allocate(f->m->vertices, sizeof *of);
        for (int round = 0; round < ROUNDS; round++) {
            for (uint32_t v = 0; v < f->m->vertices; v++) {
                if (!r->held[v])
                    of[v] = (membership){{c.facet[bvh_triangle(r->on, f->m->x[v])]}, 1};
            }
            if (round == 0) take_corners(r, &c, of);
            if (take_crossing(r, &c, of) == 0) break;
        }
        free(of);
    }
    void *owned[] = {c.facet, c.list, c.first, c.of_facet};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
}
