/* SPDX-License-Identifier: MIT */
#include "tools/mesh/components.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

static uint32_t root_of(uint32_t *parent, uint32_t v) {
    while (parent[v] != v) {
        parent[v] = parent[parent[v]];
        v = parent[v];
    }
    return v;
}

mesh_components mesh_find_components(const mesh *m) {
    mesh_components c = {.of = allocate(m->triangles, sizeof *c.of)};
    uint32_t *parent = allocate(m->vertices, sizeof *parent);
    uint32_t *number = allocate(m->vertices, sizeof *number), *order;
    double *area = allocate(m->vertices, sizeof *area);
    for (uint32_t v = 0; v < m->vertices; v++) parent[v] = v;
    for (uint32_t t = 0; t < m->triangles; t++) {
        for (int k = 1; k < 3; k++) {
            uint32_t a = root_of(parent, m->t[t][0]), b = root_of(parent, m->t[t][k]);
            parent[a > b ? a : b] = a > b ? b : a;
        }
    }
    for (uint32_t t = 0; t < m->triangles; t++) {
        const uint32_t *v = m->t[t], root = root_of(parent, v[0]);
        double n[3];
        if (number[root] == 0) number[root] = ++c.count;
        triangle_normal(m->x[v[0]], m->x[v[1]], m->x[v[2]], n);
        c.of[t] = number[root] - 1;
        area[c.of[t]] += v_norm(n);
    }
    order = allocate(c.count, sizeof *order); /* place of each by falling area */
    c.triangles = allocate(c.count, sizeof *c.triangles);
    for (uint32_t a = 0; a < c.count; a++) {
        for (uint32_t b = 0; b < c.count; b++)
            order[a] += area[b] > area[a] || (b < a && !(area[b] < area[a]));
    }
    for (uint32_t t = 0; t < m->triangles; t++) c.triangles[c.of[t] = order[c.of[t]]]++;
    void *owned[] = {parent, number, order, area};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    return c;
}

void mesh_components_free(mesh_components *c) {
    free(c->of);
    free(c->triangles);
}

void mesh_keep_component(mesh *m, const char *path, uint32_t component) {
    mesh_components c = mesh_find_components(m);
    if (component >= c.count)
        die(EXIT_USAGE, "%s: no component %" PRIu32 ": there are %" PRIu32 ", from 0", path,
            component, c.count);
    uint32_t kept = 0;
    for (uint32_t t = 0; t < m->triangles; t++) {
        if (c.of[t] == component) memcpy(m->t[kept++], m->t[t], sizeof m->t[t]);
    }
    if (c.count > 1)
        fprintf(stderr,
                "%s: component %" PRIu32 " of %" PRIu32 " kept: %" PRIu32 " of %" PRIu32
                " triangles\n",
                path, component, c.count, kept, m->triangles);
    m->triangles = kept;
    (void)mesh_drop_unused(m);
    mesh_components_free(&c);
}
