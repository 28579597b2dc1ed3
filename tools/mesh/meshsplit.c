/* SPDX-License-Identifier: MIT */
#include "tools/mesh/meshsplit.h"
#include "port/host/util.h"
#include "tools/mesh/union_find.h"
#include <stdlib.h>
#include <string.h>

#define MOST_AROUND 16 /* triangles at one edge that are told apart */

/* Corners are numbered 3 triangle + corner, and joined where triangles belong together. */
static uint32_t corner_at(const mesh *m, uint32_t triangle, uint32_t vertex) {
    const uint32_t *t = m->t[triangle];
    return 3 * triangle + (t[0] == vertex ? 0 : t[1] == vertex ? 1 : 2);
}

static void join(const mesh *m, uint32_t *parent, const half_edge *a, const half_edge *b) {
    const uint32_t end[2] = {a->low, a->high};
    for (int i = 0; i < 2; i++)
        set_join(parent, corner_at(m, a->triangle, end[i]), corner_at(m, b->triangle, end[i]));
}

typedef struct {
    double angle;
    const half_edge *side;
} around_edge;

static int compare_angles(const void *a, const void *b) {
    const around_edge *p = a, *q = b;
    return p->angle < q->angle ? -1 : p->angle > q->angle;
}

/* Around the edge, seen along low -> high, the solid lies behind a triangle that runs backwards and
 * before the next, which runs forwards. False where they do not take turns. */
static bool join_around(const mesh *m, uint32_t *parent, const half_edge *side, size_t count) {
    around_edge list[MOST_AROUND];
    double d[3], first[3] = {0}, second[3];
    if (count > MOST_AROUND || count % 2 != 0) return false;
    v_sub(m->x[side->high], m->x[side->low], d);
    v_normalize(d);
    for (size_t i = 0; i < count; i++) {
        const uint32_t *t = m->t[side[i].triangle];
        uint32_t facing = t[0];
        for (int k = 1; k < 3; k++) {
            if (facing == side->low || facing == side->high) facing = t[k];
        }
        double r[3];
        v_sub(m->x[facing], m->x[side->low], r);
        double along = v_dot(r, d);
        for (int k = 0; k < 3; k++) r[k] -= along * d[k];
        if (i == 0) {
            memcpy(first, r, sizeof first);
            v_normalize(first);
            v_cross(d, first, second);
        }
        list[i] = (around_edge){atan2(v_dot(r, second), v_dot(r, first)), &side[i]};
    }
    qsort(list, count, sizeof *list, compare_angles);
    for (size_t i = 0; i < count; i++) {
        if (list[i].side->forward == list[(i + 1) % count].side->forward) return false;
    }
    for (size_t i = 0; i < count; i++) {
        if (!list[i].side->forward) join(m, parent, list[i].side, list[(i + 1) % count].side);
    }
    return true;
}

uint32_t mesh_split_touching(mesh *m) {
    const size_t total = 3 * (size_t)m->triangles;
    half_edge *side = mesh_half_edges(m);
    uint32_t *parent = allocate(total, sizeof *parent);
    bool resolved = true;
    for (size_t c = 0; c < total; c++) parent[c] = (uint32_t)c;
    for (size_t i = 0; i < total && resolved;) {
        size_t j = half_edge_run_end(side, i, total);
        if (j - i == 2) join(m, parent, &side[i], &side[i + 1]);
        if (j - i > 2) resolved = join_around(m, parent, &side[i], j - i);
        i = j;
    }
    free(side);
    /* The first fan of a vertex keeps it; each other has a new one. */
    uint32_t *name = allocate(total, sizeof *name), added = 0;
    bool *taken = allocate(m->vertices, sizeof *taken);
    size_t room = 0;
    double(*x)[3] = NULL;
    for (size_t c = 0; c < total && resolved; c++) {
        uint32_t v = m->t[c / 3][c % 3], root = set_of(parent, (uint32_t)c);
        if (root != c) continue;
        name[c] = v;
        if (taken[v]) {
            x = grow(x, &room, added + 1u, sizeof *x);
            memcpy(x[added], m->x[v], sizeof *x);
            name[c] = m->vertices + added++;
        }
        taken[v] = true;
    }
    if (added > 0) {
        double(*all)[3] = allocate((size_t)m->vertices + added, sizeof *all);
        memcpy(all, m->x, m->vertices * sizeof *all);
        memcpy(all + m->vertices, x, added * sizeof *all);
        free(m->x);
        m->x = all;
        m->vertices += added;
        for (size_t c = 0; c < total; c++) m->t[c / 3][c % 3] = name[set_of(parent, (uint32_t)c)];
    }
    void *owned[] = {parent, name, taken, x};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    return added;
}
