/* SPDX-License-Identifier: MIT */
#include "tools/mesh/holes.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

#define NONE UINT32_MAX
#define MOST_EDGES 300u
#define EVEN                                                                                       \
    1e-4 /* of the squared sides, added to a triangle's area: among equal areas, even triangles */

typedef struct {
    mesh *m;
    size_t triangle_room, vertex_room;
    const half_edge *side; /* of the surface as it was, sorted */
    size_t sides;
    const uint32_t *rim; /* vertices, in the order in which the new triangles run */
    uint32_t n;
    double *cost;   /* [n][n]: of the best triangles over rim[i..j] */
    uint16_t *apex; /* [n][n]: of the triangle at i-j in them */
} hole_work;

static void append_triangle(hole_work *w, uint32_t a, uint32_t b, uint32_t c) {
    mesh *m = w->m;
    m->t = grow(m->t, &w->triangle_room, m->triangles + 1u, sizeof *m->t);
    uint32_t *t = m->t[m->triangles++];
    t[0] = a;
    t[1] = b;
    t[2] = c;
}

static double triangle_cost(const hole_work *w, uint32_t i, uint32_t k, uint32_t j) {
    const double *a = w->m->x[w->rim[i]], *b = w->m->x[w->rim[k]], *c = w->m->x[w->rim[j]];
    const double ab = v_distance(a, b), bc = v_distance(b, c), ca = v_distance(c, a);
    double normal[3];
    triangle_normal(a, b, c, normal);
    return v_norm(normal) / 2 + EVEN * (ab * ab + bc * bc + ca * ca);
}

/* Costs of all stretches of the rim, short ones first; false where every way repeats an edge. */
static bool weigh(hole_work *w) {
    const uint32_t n = w->n;
    for (uint32_t i = 0; i + 1 < n; i++) w->cost[i * n + i + 1] = 0;
    for (uint32_t length = 2; length < n; length++) {
        for (uint32_t i = 0; i + length < n; i++) {
            const uint32_t j = i + length;
            double best = HUGE_VAL;
            const bool taken =
                length < n - 1 && half_edge_exists(w->side, w->sides, w->rim[i], w->rim[j]);
            for (uint32_t k = i + 1; k < j && !taken; k++) {
                const double parts = w->cost[i * n + k] + w->cost[k * n + j];
                if (parts >= best) continue;
                const double cost = parts + triangle_cost(w, i, k, j);
                if (cost >= best) continue;
                best = cost;
                w->apex[i * n + j] = (uint16_t)k;
            }
            w->cost[i * n + j] = best;
        }
    }
    return w->cost[n - 1] < HUGE_VAL;
}

static void append_weighed(hole_work *w) {
    uint32_t stack[MOST_EDGES][2], depth = 0;
    stack[depth][0] = 0;
    stack[depth++][1] = w->n - 1;
    while (depth > 0) {
        const uint32_t i = stack[--depth][0], j = stack[depth][1];
        if (j < i + 2) continue;
        const uint32_t k = w->apex[i * w->n + j];
        append_triangle(w, w->rim[i], w->rim[k], w->rim[j]);
        stack[depth][0] = i;
        stack[depth++][1] = k;
        stack[depth][0] = k;
        stack[depth++][1] = j;
    }
}

static void append_fan(hole_work *w, const double middle[3]) {
    mesh *m = w->m;
    m->x = grow(m->x, &w->vertex_room, m->vertices + 1u, sizeof *m->x);
    memcpy(m->x[m->vertices], middle, sizeof *m->x);
    for (uint32_t i = 0; i < w->n; i++)
        append_triangle(w, w->rim[i], w->rim[(i + 1) % w->n], m->vertices);
    m->vertices++;
}

static void close_hole(hole_work *w, const double middle[3]) {
    bool closed = false;
    if (w->n <= MOST_EDGES) {
        w->cost = allocate((size_t)w->n * w->n, sizeof *w->cost);
        w->apex = allocate((size_t)w->n * w->n, sizeof *w->apex);
        closed = weigh(w);
        if (closed) append_weighed(w);
        free(w->cost);
        free(w->apex);
    }
    if (!closed) append_fan(w, middle);
}

/* For each vertex of a rim the next one against the triangles' own direction; NONE elsewhere. */
static uint32_t *rim_successors(const mesh *m, const half_edge *h, size_t total) {
    uint32_t *next = allocate(m->vertices, sizeof *next);
    memset(next, 0xff, m->vertices * sizeof *next);
    for (size_t i = 0; i < total;) {
        const size_t j = half_edge_run_end(h, i, total);
        if (j == i + 1)
            next[h[i].forward ? h[i].high : h[i].low] = h[i].forward ? h[i].low : h[i].high;
        i = j;
    }
    return next;
}

uint32_t mesh_close_holes(mesh *m, double longest_m, mesh_hole *longest, mesh_hole *left) {
    (void)mesh_orient(m);
    const size_t total = 3 * (size_t)m->triangles;
    half_edge *h = mesh_half_edges(m);
    uint32_t *next = rim_successors(m, h, total), *rim = allocate(m->vertices, sizeof *rim);
    hole_work w = {.m = m,
                   .triangle_room = m->triangles,
                   .vertex_room = m->vertices,
                   .side = h,
                   .sides = total,
                   .rim = rim};
    uint32_t closed = 0;
    const uint32_t before = m->vertices;
    *longest = *left = (mesh_hole){.rim_m = 0};
    for (uint32_t start = 0; start < before; start++) {
        mesh_hole hole = {.rim_m = 0};
        uint32_t v = start;
        while (next[v] != NONE) {
            const uint32_t to = next[v];
            next[v] = NONE;
            rim[hole.edges++] = v;
            for (int k = 0; k < 3; k++) hole.middle[k] += m->x[v][k];
            hole.rim_m += v_distance(m->x[v], m->x[to]);
            v = to;
        }
        for (int k = 0; k < 3 && hole.edges > 0; k++) hole.middle[k] /= hole.edges;
        if (hole.edges < 3 || v != start) continue; /* a chain without end is no hole */
        mesh_hole *largest = hole.rim_m <= longest_m ? longest : left;
        if (hole.rim_m > largest->rim_m) *largest = hole;
        if (largest == left) continue;
        w.n = hole.edges;
        close_hole(&w, hole.middle);
        closed++;
    }
    free(next);
    free(rim);
    free(h);
    return closed;
}
