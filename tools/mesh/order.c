/* SPDX-License-Identifier: MIT */
#include "tools/mesh/order.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

typedef struct {
    double x[3];
    uint32_t vertex;
} placed;

static int compare_places(const void *a, const void *b) {
    const placed *p = a, *q = b;
    for (int k = 0; k < 3; k++) {
        if (p->x[k] < q->x[k] || p->x[k] > q->x[k]) return p->x[k] < q->x[k] ? -1 : 1;
    }
    return p->vertex < q->vertex ? -1 : p->vertex > q->vertex;
}

static int compare_corners(const void *a, const void *b) {
    const uint32_t *p = a, *q = b;
    for (int k = 0; k < 3; k++) {
        if (p[k] != q[k]) return p[k] < q[k] ? -1 : 1;
    }
    return 0;
}

void mesh_sort(mesh *m) {
    placed *order = allocate(m->vertices, sizeof *order);
    uint32_t *now = allocate(m->vertices, sizeof *now);
    for (uint32_t v = 0; v < m->vertices; v++) {
        memcpy(order[v].x, m->x[v], sizeof order[v].x);
        order[v].vertex = v;
    }
    qsort(order, m->vertices, sizeof *order, compare_places);
    for (uint32_t i = 0; i < m->vertices; i++) {
        memcpy(m->x[i], order[i].x, sizeof m->x[i]);
        now[order[i].vertex] = i;
    }
    for (uint32_t i = 0; i < m->triangles; i++) {
        uint32_t t[3];
        for (int k = 0; k < 3; k++) t[k] = now[m->t[i][k]];
        const int first = t[0] < t[1] ? (t[0] < t[2] ? 0 : 2) : (t[1] < t[2] ? 1 : 2);
        for (int k = 0; k < 3; k++) m->t[i][k] = t[(first + k) % 3];
    }
    qsort(m->t, m->triangles, sizeof *m->t, compare_corners);
    free(order);
    free(now);
}
