/* SPDX-License-Identifier: MIT */
#include "tools/mesh/components.h"
#include "port/host/util.h"
#include "tools/mesh/union_find.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#define SAMPLES 8u /* vertices of a component that are looked at */

/* A component as it was met, and its area. */
typedef struct {
    double area;
    uint32_t met;
} sized;

/* Larger ones first, then in the order in which they were met. */
static int compare_sizes(const void *a, const void *b) {
    const sized *p = a, *q = b;
    if (p->area < q->area || p->area > q->area) return p->area > q->area ? -1 : 1;
    return p->met < q->met ? -1 : 1;
}

mesh_components mesh_find_components(const mesh *m) {
    mesh_components c = {.of = allocate(m->triangles, sizeof *c.of)};
    uint32_t *parent = allocate(m->vertices, sizeof *parent);
    uint32_t *number = allocate(m->vertices, sizeof *number); /* of each set, from 1; 0: not met */
    for (uint32_t v = 0; v < m->vertices; v++) parent[v] = v;
    for (uint32_t t = 0; t < m->triangles; t++) {
        for (int k = 1; k < 3; k++) set_join(parent, m->t[t][0], m->t[t][k]);
    }
    for (uint32_t t = 0; t < m->triangles; t++) {
        const uint32_t set = set_of(parent, m->t[t][0]);
        if (number[set] == 0) number[set] = ++c.count;
        c.of[t] = number[set] - 1;
    }
    sized *size = allocate(c.count, sizeof *size);
    uint32_t *place = allocate(c.count, sizeof *place);
    c.triangles = allocate(c.count, sizeof *c.triangles);
    for (uint32_t i = 0; i < c.count; i++) size[i].met = i;
    for (uint32_t t = 0; t < m->triangles; t++) {
        const uint32_t *v = m->t[t];
        double n[3];
        triangle_normal(m->x[v[0]], m->x[v[1]], m->x[v[2]], n);
        size[c.of[t]].area += v_norm(n);
    }
    qsort(size, c.count, sizeof *size, compare_sizes);
    for (uint32_t i = 0; i < c.count; i++) place[size[i].met] = i;
    for (uint32_t t = 0; t < m->triangles; t++) c.triangles[c.of[t] = place[c.of[t]]]++;
    void *owned[] = {parent, number, size, place};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    return c;
}

void mesh_components_free(mesh_components *c) {
    free(c->of);
    free(c->triangles);
}

/* How often component k goes around x: the sum of its solid angles over 4 pi (Van Oosterom and
 * Strackee 1983). */
static double winding(const mesh *m, const mesh_components *c, uint32_t k, const double x[3]) {
    double sum = 0;
    for (uint32_t t = 0; t < m->triangles; t++) {
        double r[3][3], length[3], cross[3];
        if (c->of[t] != k) continue;
        for (int i = 0; i < 3; i++) {
            v_sub(m->x[m->t[t][i]], x, r[i]);
            length[i] = v_norm(r[i]);
        }
        v_cross(r[1], r[2], cross);
        sum += atan2(v_dot(r[0], cross),
                     length[0] * length[1] * length[2] + v_dot(r[0], r[1]) * length[2] +
                         v_dot(r[1], r[2]) * length[0] + v_dot(r[2], r[0]) * length[1]);
    }
    return sum / (2 * M_PI);
}

typedef struct {
    double low[3], high[3];
    double x[SAMPLES][3]; /* some of its vertices */
    uint32_t samples, met;
} sampled;

static void take_place(sampled *s, const double x[3], bool sample) {
    for (int k = 0; k < 3; k++) {
        s->low[k] = s->met == 0 ? x[k] : fmin(s->low[k], x[k]);
        s->high[k] = s->met == 0 ? x[k] : fmax(s->high[k], x[k]);
    }
    if (sample && s->samples < SAMPLES) memcpy(s->x[s->samples++], x, sizeof s->x[0]);
    s->met++;
}

static bool box_holds(const sampled *outer, const sampled *inner) {
    for (int k = 0; k < 3; k++) {
        if (inner->low[k] < outer->low[k] || inner->high[k] > outer->high[k]) return false;
    }
    return true;
}

/* All samples go well around, none lies on the surface. */
static bool lies_within(const mesh *m, const mesh_components *c, const sampled *inner, uint32_t k) {
    for (uint32_t i = 0; i < inner->samples; i++) {
        if (fabs(winding(m, c, k, inner->x[i])) < 0.75) return false;
    }
    return true;
}

void mesh_refuse_cavities(const mesh *m, const mesh_components *c, const char *path) {
    sampled *of = allocate(c->count, sizeof *of);
    for (uint32_t t = 0; t < m->triangles; t++) {
        sampled *s = &of[c->of[t]];
        const uint32_t every = c->triangles[c->of[t]] / SAMPLES + 1;
        for (int k = 0; k < 3; k++)
            take_place(s, m->x[m->t[t][k]], k == 0 && s->met / 3 % every == 0);
    }
    for (uint32_t own = 0; own < c->count; own++) {
        for (uint32_t k = 0; k < c->count; k++) {
            if (k == own || !box_holds(&of[k], &of[own]) || !lies_within(m, c, &of[own], k))
                continue;
            die(EXIT_WORK,
                "%s: component %" PRIu32 " lies inside component %" PRIu32
                ": hollow bodies are not baked: keep one by --largest or --component N",
                path, own, k);
        }
    }
    free(of);
}

void mesh_take_component(mesh *m, const mesh_components *c, uint32_t component) {
    uint32_t kept = 0;
    for (uint32_t t = 0; t < m->triangles; t++) {
        if (c->of[t] == component) memcpy(m->t[kept++], m->t[t], sizeof m->t[t]);
    }
    m->triangles = kept;
    (void)mesh_drop_unused(m);
}

void mesh_keep_component(mesh *m, const char *path, uint32_t component) {
    mesh_components c = mesh_find_components(m);
    if (component >= c.count)
        die(EXIT_USAGE, "%s: no component %" PRIu32 ": there are %" PRIu32 ", from 0", path,
            component, c.count);
    const uint32_t before = m->triangles;
    mesh_take_component(m, &c, component);
    if (c.count > 1)
        fprintf(stderr,
                "%s: component %" PRIu32 " of %" PRIu32 " kept: %" PRIu32 " of %" PRIu32
                " triangles\n",
                path, component, c.count, m->triangles, before);
    mesh_components_free(&c);
}
