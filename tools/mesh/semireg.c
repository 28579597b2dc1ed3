/* SPDX-License-Identifier: MIT */
#include "tools/mesh/semireg.h"
#include "core/blob/format.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { UNKNOWN, EVEN, ODD };
#define SEED_TRIES 8u

level_mesh level_mesh_of(const uint32_t (*t)[3], uint32_t triangles, uint32_t vertices) {
    level_mesh m = {.vertices = vertices, .triangles = triangles, .t = t};
    const mesh view = {
        .vertices = vertices, .triangles = triangles, .t = (uint32_t(*)[3])(uintptr_t)t};
    mesh_stars(&view, &m.offset, &m.around);
    return m;
}

void level_mesh_free(level_mesh *m) {
    free(m->offset);
    free(m->around);
}

uint32_t ring_next(const level_mesh *m, uint32_t v, uint32_t w) {
    for (uint32_t i = m->offset[v]; i < m->offset[v + 1]; i++) {
        const uint32_t *t = m->t[m->around[i]];
        for (int k = 0; k < 3; k++) {
            if (t[k] == v && t[(k + 1) % 3] == w) return t[(k + 2) % 3];
        }
    }
    return v;
}

/* Marks what must be even and odd if `seed` is even; false when that contradicts itself. */
static bool propagate(const level_mesh *m, uint32_t seed, uint8_t *mark, uint32_t *queue) {
    uint32_t head = 0, tail = 0;
    mark[seed] = EVEN;
    queue[tail++] = seed;
    while (head < tail) {
        uint32_t v = queue[head++];
        for (uint32_t i = m->offset[v]; i < m->offset[v + 1]; i++) {
            const uint32_t *t = m->t[m->around[i]];
            int k = t[0] == v ? 0 : t[1] == v ? 1 : 2;
            uint32_t odd = t[(k + 1) % 3];
            if (mark[odd] == EVEN || level_valence(m, odd) != 6) return false;
            mark[odd] = ODD;
            uint32_t w = v;
            for (int step = 1; step <= 5; step++) {
                w = ring_next(m, odd, w);
                uint8_t wanted = step == 3 ? EVEN : ODD;
                if (mark[w] != UNKNOWN && mark[w] != wanted) return false;
                if (mark[w] == UNKNOWN && wanted == EVEN) queue[tail++] = w;
                mark[w] = wanted;
            }
        }
    }
    return true;
}

/* The even vertex behind edge (a, b) of the central triangle `t`, all of whose corners are odd. */
static uint32_t even_behind(const level_mesh *m, const uint8_t *mark, uint32_t a, uint32_t b) {
    uint32_t w = ring_next(m, b, a);
    return mark[w] == EVEN ? w : NO_PARENT;
}

/* Replaces the triangles by those of the next coarser level; false when a pattern is broken. */
static bool coarsen(const level_mesh *m, const uint8_t *mark, uint32_t (*coarse)[3], semireg *s) {
    uint32_t n = 0;
    for (uint32_t i = 0; i < m->triangles; i++) {
        const uint32_t *t = m->t[i];
        int odd = (mark[t[0]] == ODD) + (mark[t[1]] == ODD) + (mark[t[2]] == ODD);
        if (odd == 2) continue;
        if (odd != 3 || n == m->triangles / 4) return false;
        for (int k = 0; k < 3; k++) {
            coarse[n][k] = even_behind(m, mark, t[(k + 2) % 3], t[k]);
            if (coarse[n][k] == NO_PARENT) return false;
        }
        /* The odd vertex k stands between the even ones behind the edges that meet in it. */
        for (int k = 0; k < 3; k++) {
            uint32_t a = coarse[n][k], b = coarse[n][(k + 1) % 3];
            s->parent[t[k]][0] = a < b ? a : b;
            s->parent[t[k]][1] = a < b ? b : a;
        }
        n++;
    }
    return n == m->triangles / 4;
}

/* One step towards the coarse mesh; writes marks of the current level. */
static bool find_even(const level_mesh *m, const uint8_t *present, uint8_t *mark, uint32_t *queue) {
    uint32_t tries[SEED_TRIES];
    uint32_t count = 0, first = 0;
    while (first < m->vertices && present[first] == 0) first++;
    for (uint32_t v = 0; v < m->vertices && count < 1; v++) {
        if (present[v] != 0 && level_valence(m, v) != 6) tries[count++] = v;
    }
    if (count == 0) {
        /* A torus can be regular everywhere: one of a vertex and its neighbours must be even. */
        tries[count++] = first;
        for (uint32_t i = m->offset[first]; i < m->offset[first + 1] && count < SEED_TRIES; i++) {
            const uint32_t *t = m->t[m->around[i]];
            tries[count++] = t[0] == first ? t[1] : t[0];
        }
    }
    for (uint32_t i = 0; i < count; i++) {
        memset(mark, UNKNOWN, m->vertices);
        if (propagate(m, tries[i], mark, queue)) return true;
    }
    return false;
}

semireg semireg_detect(const mesh *m) {
    semireg s = {.levels = 1};
    uint32_t n = m->vertices;
    uint8_t *step_of = allocate(n, 1); /* how many coarsening steps the vertex survives */
    uint8_t *present = allocate(n, 1);
    uint8_t *mark = allocate(n, 1);
    uint32_t *queue = allocate(n, sizeof *queue);
    uint32_t(*t)[3] = allocate(m->triangles, sizeof *t);
    s.level = allocate(n, 1);
    s.parent = allocate(n, sizeof *s.parent);
    memset(s.parent, 0xff, n * sizeof *s.parent);
    uint32_t(*old)[2] = allocate(n, sizeof *old);
    memset(present, 1, n);
    memcpy(t, m->t, m->triangles * sizeof *t);
    uint32_t triangles = m->triangles;
    uint8_t steps = 0;
    while (triangles >= 16 && triangles % 4 == 0 && steps + 1u < PALP_MAX_LEVELS) {
        level_mesh level = level_mesh_of((const uint32_t(*)[3])t, triangles, n);
        uint32_t(*coarse)[3] = allocate(triangles / 4, sizeof *coarse);
        memcpy(old, s.parent, n * sizeof *old);
        bool found = find_even(&level, present, mark, queue) && coarsen(&level, mark, coarse, &s);
        level_mesh_free(&level);
        if (!found) {
            memcpy(s.parent, old, n * sizeof *old);
            free(coarse);
            break;
        }
        steps++;
        for (uint32_t v = 0; v < n; v++) {
            if (present[v] == 0) continue;
            present[v] = mark[v] == EVEN;
            if (present[v] != 0) step_of[v] = steps;
        }
        free(t);
        t = coarse;
        triangles /= 4;
    }
    s.levels = steps + 1u;
    for (uint32_t v = 0; v < n; v++) s.level[v] = (uint8_t)(steps - step_of[v]);
    free(old);
    free(t);
    free(queue);
    free(mark);
    free(present);
    free(step_of);
    return s;
}

void semireg_free(semireg *s) {
    free(s->level);
    free(s->parent);
    *s = (semireg){0};
}

static uint32_t edge_index(const mesh_edge *e, uint32_t count, uint32_t a, uint32_t b) {
    uint32_t low = 0, high = count;
    uint32_t p = a < b ? a : b, q = a < b ? b : a;
    while (low < high) {
        uint32_t mid = low + (high - low) / 2;
        bool before = e[mid].a < p || (e[mid].a == p && e[mid].b < q);
        if (before) {
            low = mid + 1;
        } else {
            high = mid;
        }
    }
    return low;
}

static mesh split(const mesh *m, mesh_edge **edges, uint32_t *count) {
    *edges = mesh_edges(m, count);
    mesh r = {.vertices = m->vertices + *count, .triangles = 4 * m->triangles};
    r.x = allocate(r.vertices, sizeof *r.x);
    r.t = allocate(r.triangles, sizeof *r.t);
    memcpy(r.x, m->x, m->vertices * sizeof *m->x);
    for (uint32_t i = 0; i < *count; i++) {
        for (int k = 0; k < 3; k++) {
            r.x[m->vertices + i][k] = 0.5 * (m->x[(*edges)[i].a][k] + m->x[(*edges)[i].b][k]);
        }
    }
    for (uint32_t i = 0; i < m->triangles; i++) {
        const uint32_t *t = m->t[i];
        uint32_t odd[3];
        for (int k = 0; k < 3; k++) {
            odd[k] = m->vertices + edge_index(*edges, *count, t[k], t[(k + 1) % 3]);
        }
        const uint32_t child[4][3] = {{t[0], odd[0], odd[2]},
                                      {t[1], odd[1], odd[0]},
                                      {t[2], odd[2], odd[1]},
                                      {odd[0], odd[1], odd[2]}};
        memcpy(r.t + 4 * i, child, sizeof child);
    }
    return r;
}

mesh subdivide_midpoint(const mesh *m) {
    uint32_t count;
    mesh_edge *edges;
    mesh r = split(m, &edges, &count);
    free(edges);
    return r;
}

static uint32_t opposite(const uint32_t t[3], uint32_t a, uint32_t b) {
    for (int k = 0; k < 3; k++) {
        if (t[k] != a && t[k] != b) return t[k];
    }
    return a;
}

void loop_rules(const mesh *m, loop_taker take, void *context) {
    uint32_t count, *offset, *ring;
    mesh_edge *edges;
    mesh r = split(m, &edges, &count);
    mesh_free(&r);
    for (uint32_t i = 0; i < count; i++) {
        const mesh_edge *e = &edges[i];
        uint32_t vertex = m->vertices + i;
        take(context, vertex, e->a, 0.375);
        take(context, vertex, e->b, 0.375);
        take(context, vertex, opposite(m->t[e->triangle[0]], e->a, e->b), 0.125);
        take(context, vertex, opposite(m->t[e->triangle[1]], e->a, e->b), 0.125);
    }
    mesh_rings(m, &offset, &ring);
    for (uint32_t v = 0; v < m->vertices; v++) {
        double n = offset[v + 1] - offset[v];
        double c = 0.375 + 0.25 * cos(2 * 3.14159265358979323846 / n);
        double beta = (0.625 - c * c) / n;
        take(context, v, v, 1 - n * beta);
        for (uint32_t i = offset[v]; i < offset[v + 1]; i++) take(context, v, ring[i], beta);
    }
    free(ring);
    free(offset);
    free(edges);
}

typedef struct {
    const mesh *from;
    mesh *to;
} mesh_pair;

static void add_vertex(void *context, uint32_t vertex, uint32_t old, double weight) {
    const mesh_pair *p = context;
    for (int k = 0; k < 3; k++) p->to->x[vertex][k] += weight * p->from->x[old][k];
}

mesh subdivide_loop(const mesh *m) {
    uint32_t count;
    mesh_edge *edges;
    mesh r = split(m, &edges, &count);
    memset(r.x, 0, r.vertices * sizeof *r.x);
    loop_rules(m, add_vertex, &(mesh_pair){m, &r});
    free(edges);
    return r;
}
