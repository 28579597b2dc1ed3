/* SPDX-License-Identifier: MIT */
#include "tools/mesh/meshsplit.h"
#include "port/host/util.h"
#include "tools/mesh/union_find.h"
#include <stdlib.h>
#include <string.h>

#define PASSES 8       /* of cutting edges in their middle */
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
 * before the next, which runs forwards: those two are a pair. False where as many do not run either
 * way; `pair` then holds nothing. */
static bool pair_around(const mesh *m, const half_edge *side, size_t count,
                        const half_edge *pair[][2]) {
    around_edge list[MOST_AROUND];
    double d[3], first[3] = {0}, second[3];
    size_t forward = 0;
    for (size_t i = 0; i < count; i++) forward += side[i].forward;
    if (count > MOST_AROUND || 2 * forward != count) return false;
    v_sub(m->x[side->high], m->x[side->low], d);
    v_normalize(d);
    for (size_t i = 0; i < count; i++) {
        double r[3];
        v_sub(m->x[half_edge_facing(m, &side[i])], m->x[side->low], r);
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
    /* Neighbours that close in a wedge of the solid belong together; then those that they stood
     * between, as brackets do. */
    while (count > 0) {
        size_t i = 0;
        while (list[i].side->forward || !list[(i + 1) % count].side->forward) i++;
        const size_t k = (i + 1) % count;
        (*pair)[0] = list[i].side;
        (*pair++)[1] = list[k].side;
        const size_t low = i < k ? i : k, high = i < k ? k : i;
        memmove(list + high, list + high + 1, (count - high - 1) * sizeof *list);
        memmove(list + low, list + low + 1, (count - low - 2) * sizeof *list);
        count -= 2;
    }
    return true;
}

static uint32_t double_vertices(mesh *m) {
    const size_t total = 3 * (size_t)m->triangles;
    half_edge *side = mesh_half_edges(m);
    uint32_t *parent = allocate(total, sizeof *parent);
    const half_edge *pair[MOST_AROUND / 2][2];
    for (size_t c = 0; c < total; c++) parent[c] = (uint32_t)c;
    for (size_t i = 0; i < total;) {
        size_t j = half_edge_run_end(side, i, total);
        if (j - i == 2) join(m, parent, &side[i], &side[i + 1]);
        if (j - i > 2 && pair_around(m, &side[i], j - i, pair)) {
            for (size_t k = 0; k < (j - i) / 2; k++) join(m, parent, pair[k][0], pair[k][1]);
        } else if (j - i > 2) {
            for (size_t k = i + 1; k < j; k++) join(m, parent, &side[i], &side[k]); /* it stays */
        }
        i = j;
    }
    free(side);
    /* The first fan of a vertex keeps it; each other has a new one. */
    uint32_t *name = allocate(total, sizeof *name), added = 0;
    bool *taken = allocate(m->vertices, sizeof *taken);
    size_t room = 0;
    double(*x)[3] = NULL;
    for (size_t c = 0; c < total; c++) {
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

/* Where both ends of an edge have one fan, no doubling tells its pairs apart: each gets a vertex of
 * its own in the middle. One edge of a triangle at a time; returns how many vertices were added. */
static uint32_t add_middles(mesh *m) {
    const size_t total = 3 * (size_t)m->triangles;
    half_edge *side = mesh_half_edges(m);
    bool *changed = allocate(m->triangles, sizeof *changed);
    const half_edge *pair[MOST_AROUND / 2][2];
    const uint32_t before = m->vertices;
    size_t room = m->triangles, vertex_room = m->vertices;
    for (size_t i = 0, j; i < total; i = j) {
        j = half_edge_run_end(side, i, total);
        bool free_to_cut = j - i > 2;
        for (size_t k = i; k < j; k++) free_to_cut = free_to_cut && !changed[side[k].triangle];
        if (!free_to_cut || !pair_around(m, &side[i], j - i, pair)) continue;
        for (size_t k = 0; k < (j - i) / 2; k++) /* a fold: its halves would be folds again */
            free_to_cut =
                free_to_cut && half_edge_facing(m, pair[k][0]) != half_edge_facing(m, pair[k][1]);
        if (!free_to_cut) continue;
        for (size_t k = 0; k < (j - i) / 2; k++) {
            const uint32_t middle = mesh_add_middle(m, &vertex_room, &side[i]);
            for (int s = 0; s < 2; s++) {
                changed[pair[k][s]->triangle] = true;
                mesh_cut_side(m, &room, pair[k][s], middle);
            }
        }
    }
    free(side);
    free(changed);
    return m->vertices - before;
}

uint32_t mesh_split_touching(mesh *m) {
    uint32_t added = double_vertices(m);
    for (int pass = 0; pass < PASSES; pass++) {
        const uint32_t more = add_middles(m);
        if (more == 0) break;
        added += more;
    }
    return added + double_vertices(m);
}
