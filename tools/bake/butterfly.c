/* SPDX-License-Identifier: MIT */
#include "tools/bake/butterfly.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.141592653589793

static void add(butterfly_stencil *s, uint32_t node, double weight) {
    for (uint32_t i = 0; i < s->count; i++) {
        if (s->node[i] != node) continue;
        s->weight[i] += weight;
        return;
    }
    if (s->count == BUTTERFLY_MAX)
        die(EXIT_WORK, "vertex %u: valence too high for butterfly", node);
    s->node[s->count] = node;
    s->weight[s->count++] = weight;
}

/* The regular rule for the edge (p, q), both of valence six. */
static void regular(butterfly_stencil *s, const level_mesh *m, uint32_t p, uint32_t q) {
    for (int side = 0; side < 2; side++) {
        uint32_t a = side == 0 ? p : q, b = side == 0 ? q : p;
        uint32_t wing = ring_next(m, a, b);
        add(s, a, 0.5);
        add(s, wing, 0.125);
        add(s, ring_next(m, a, wing), -0.0625);
        add(s, ring_next(m, wing, b), -0.0625);
    }
}

/* The rule around the extraordinary vertex p, `share` of it. */
static void extraordinary(butterfly_stencil *s, const level_mesh *m, uint32_t p, uint32_t q,
                          double share) {
    uint32_t k = level_valence(m, p);
    uint32_t r = q;
    add(s, p, 0.75 * share);
    for (uint32_t j = 0; j < k; j++, r = ring_next(m, p, r)) {
        double w;
        if (k == 3) {
            w = j == 0 ? 5.0 / 12 : -1.0 / 12;
        } else if (k == 4) {
            w = j == 0 ? 3.0 / 8 : j == 2 ? -1.0 / 8 : 0;
        } else {
            double angle = 2 * PI * j / k;
            w = (0.25 + cos(angle) + 0.5 * cos(2 * angle)) / k;
        }
        add(s, r, w * share);
    }
}

static uint32_t shared_parent(const semireg *s, uint32_t a, uint32_t b) {
    const uint32_t *p = s->parent[a], *q = s->parent[b];
    return p[0] == q[0] || p[0] == q[1] ? p[0] : p[1];
}

/* The triangles of the level below: one for each whose corners are all odd on `level`. */
static uint32_t coarsen(const semireg *s, uint32_t level, const uint32_t (*fine)[3], uint32_t count,
                        uint32_t (*coarse)[3]) {
    uint32_t n = 0;
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t *t = fine[i];
        if (s->level[t[0]] != level || s->level[t[1]] != level || s->level[t[2]] != level) continue;
        for (int k = 0; k < 3; k++) coarse[n][k] = shared_parent(s, t[(k + 2) % 3], t[k]);
        n++;
    }
    return n;
}

void butterfly_stencils(const mesh *m, const semireg *s, butterfly_taker take, void *context) {
    uint32_t(*t)[3] = allocate(m->triangles, sizeof *t);
    uint32_t count = m->triangles;
    memcpy(t, m->t, count * sizeof *t);
    for (uint32_t l = s->levels - 1; l > 0; l--) {
        uint32_t(*coarse)[3] = allocate(count / 4, sizeof *coarse);
        count = coarsen(s, l, (const uint32_t(*)[3])t, count, coarse);
        free(t);
        t = coarse;
        level_mesh v = level_mesh_of((const uint32_t(*)[3])t, count, m->vertices);
        for (uint32_t i = 0; i < m->vertices; i++) {
            if (s->level[i] != l) continue;
            uint32_t p = s->parent[i][0], q = s->parent[i][1];
            bool odd_p = level_valence(&v, p) != 6, odd_q = level_valence(&v, q) != 6;
            butterfly_stencil stencil = {.count = 0};
            if (!odd_p && !odd_q) regular(&stencil, &v, p, q);
            if (odd_p) extraordinary(&stencil, &v, p, q, odd_q ? 0.5 : 1);
            if (odd_q) extraordinary(&stencil, &v, q, p, odd_p ? 0.5 : 1);
            take(context, i, &stencil);
        }
        level_mesh_free(&v);
    }
    free(t);
}
