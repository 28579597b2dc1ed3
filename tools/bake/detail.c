/* SPDX-License-Identifier: MIT */
#include "tools/bake/detail.h"
#include "tools/mesh/bvh.h"
#include "tools/mesh/semireg.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define FACING_COSINE 0.3

/* Rows of weights over the baked nodes, one per vertex. */
typedef struct {
    uint32_t *node;
    double *weight;
    size_t count, capacity, weight_capacity;
} stencil_row;

typedef struct {
    const stencil_row *from;
    stencil_row *to;
} stencil_pair;

static void add_weight(stencil_row *r, uint32_t node, double weight) {
    for (size_t i = 0; i < r->count; i++) {
        if (r->node[i] != node) continue;
        r->weight[i] += weight;
        return;
    }
    r->node = grow(r->node, &r->capacity, r->count + 1, sizeof *r->node);
    r->weight = grow(r->weight, &r->weight_capacity, r->count + 1, sizeof *r->weight);
    r->node[r->count] = node;
    r->weight[r->count++] = weight;
}

static void compose(void *context, uint32_t vertex, uint32_t old, double weight) {
    const stencil_pair *p = context;
    const stencil_row *row = &p->from[old];
    for (size_t i = 0; i < row->count; i++)
        add_weight(&p->to[vertex], row->node[i], weight * row->weight[i]);
}

static void free_rows(stencil_row *rows, uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        free(rows[i].node);
        free(rows[i].weight);
    }
    free(rows);
}

static void find_heights(detail_data *d, const mesh *smooth, const mesh *fine) {
    double *area = allocate(smooth->vertices, sizeof *area);
    double(*normal)[3] = allocate(smooth->vertices, sizeof *normal);
    mesh_nodal(smooth, area, normal);
    bvh *surface = bvh_build(fine);
    for (uint32_t v = 0; v < smooth->vertices; v++) {
        double point[3], off[3];
        double far = bvh_closest(surface, smooth->x[v], normal[v], FACING_COSINE, point, NULL);
        if (!isfinite(far)) continue;
        v_sub(point, smooth->x[v], off);
        double height = v_dot(off, normal[v]), rest[3];
        for (int k = 0; k < 3; k++) rest[k] = smooth->x[v][k] + height * normal[v][k];
        double left = bvh_closest(surface, rest, NULL, 0, point, NULL);
        d->height[v] = (float)height;
        d->mean += left / smooth->vertices;
        d->largest = fmax(d->largest, left);
    }
    bvh_free(surface);
    free(area);
    free(normal);
}

/* Vertices by the node of which they are mostly made. */
static void list_near(detail_data *d, const stencil_row *rows, uint32_t nodes) {
    uint32_t *owner = allocate(d->vertices, sizeof *owner);
    d->near = allocate(nodes + 1u, sizeof *d->near);
    d->list = allocate(d->vertices, sizeof *d->list);
    for (uint32_t v = 0; v < d->vertices; v++) {
        size_t best = 0;
        for (size_t i = 1; i < rows[v].count; i++) {
            if (rows[v].weight[i] > rows[v].weight[best]) best = i;
        }
        owner[v] = rows[v].node[best];
        d->near[owner[v] + 1]++;
    }
    for (uint32_t i = 0; i < nodes; i++) d->near[i + 1] += d->near[i];
    uint32_t *at = allocate(nodes, sizeof *at);
    for (uint32_t v = 0; v < d->vertices; v++) d->list[d->near[owner[v]] + at[owner[v]]++] = v;
    free(at);
    free(owner);
}

detail_data detail_build(const mesh *m, uint32_t levels, const mesh *fine) {
    mesh smooth = mesh_copy(m);
    stencil_row *rows = allocate(m->vertices, sizeof *rows);
    for (uint32_t v = 0; v < m->vertices; v++) add_weight(&rows[v], v, 1);
    for (uint32_t l = 0; l < levels; l++) {
        mesh next = subdivide_loop(&smooth);
        stencil_row *finer = allocate(next.vertices, sizeof *finer);
        loop_rules(&smooth, compose, &(stencil_pair){rows, finer});
        free_rows(rows, smooth.vertices);
        mesh_free(&smooth);
        rows = finer;
        smooth = next;
    }
    detail_data d = {.vertices = smooth.vertices, .triangles = smooth.triangles};
    d.offset = allocate(d.vertices + 1u, sizeof *d.offset);
    d.height = allocate(d.vertices, sizeof *d.height);
    for (uint32_t v = 0; v < d.vertices; v++)
        d.offset[v + 1] = d.offset[v] + (uint32_t)rows[v].count;
    d.node = allocate(d.offset[d.vertices], sizeof *d.node);
    d.weight = allocate(d.offset[d.vertices], sizeof *d.weight);
    for (uint32_t v = 0; v < d.vertices; v++) {
        for (size_t i = 0; i < rows[v].count; i++) {
            d.node[d.offset[v] + i] = rows[v].node[i];
            d.weight[d.offset[v] + i] = (float)rows[v].weight[i];
        }
    }
    d.t = allocate(d.triangles, sizeof *d.t);
    memcpy(d.t, smooth.t, d.triangles * sizeof *d.t);
    find_heights(&d, &smooth, fine);
    list_near(&d, rows, m->vertices);
    free_rows(rows, d.vertices);
    mesh_free(&smooth);
    return d;
}

void detail_free(detail_data *d) {
    void *owned[] = {d->offset, d->node, d->near, d->list, d->weight, d->height, d->t};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
}
