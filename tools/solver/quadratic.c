/* SPDX-License-Identifier: MIT */
#include "tools/solver/quadratic.h"
#include "port/host/util.h"
#include "tools/solver/dense.h"
#include <stdlib.h>
#include <string.h>

#define ENOUGH 6            /* neighbours that determine a quadratic polynomial */
#define MAX_PATCH 96        /* triangles of a patch */
#define TERMS 5             /* s, t, s^2 / 2, s t, t^2 / 2 */
#define RIDGE 1e-3          /* on the second derivatives that the neighbours leave open */
#define LARGEST_OFFSET 0.13 /* of a middle from its chord, over the edge: an arc of 60 degrees */

/* What patches are made from: neighbours of triangles, their unit normals. */
typedef struct {
    const mesh *m;
    uint32_t *across; /* the triangle beyond the edge that faces each corner */
    double (*normal)[3];
} surface;

static bool smooth(const surface *s, uint32_t a, uint32_t b) {
    return v_dot(s->normal[a], s->normal[b]) > QUADRATIC_SMOOTH_COS;
}

/* The smooth piece around vertex v that has triangle `first`; returns how many triangles. */
static uint32_t fan(const surface *s, uint32_t v, uint32_t first, uint32_t *to) {
    uint32_t count = 0;
    to[count++] = first;
    for (int turn = 1; turn <= 2; turn++) {
        uint32_t t = first;
        while (count < MAX_PATCH) {
            const uint32_t *c = s->m->t[t];
            int k = c[0] == v ? 0 : c[1] == v ? 1 : 2;
            uint32_t next = s->across[3 * t + (uint32_t)(k + turn) % 3];
            if (next == first) return count;
            if (!smooth(s, t, next)) break;
            to[count++] = next;
            t = next;
        }
    }
    return count;
}

static bool listed(const uint32_t *list, uint32_t count, uint32_t value) {
    for (uint32_t i = 0; i < count; i++) {
        if (list[i] == value) return true;
    }
    return false;
}

/* The vertices of the patch other than v. */
static uint32_t patch_vertices(const surface *s, uint32_t v, const uint32_t *triangle,
                               uint32_t count, uint32_t *vertex) {
    uint32_t found = 0;
    for (uint32_t i = 0; i < count; i++) {
        for (int k = 0; k < 3; k++) {
            uint32_t w = s->m->t[triangle[i]][k];
            if (w != v && !listed(vertex, found, w)) vertex[found++] = w;
        }
    }
    return found;
}

/* One more ring of triangles on the same smooth piece. */
static uint32_t widen(const surface *s, uint32_t *triangle, uint32_t count) {
    uint32_t inner = count;
    for (uint32_t i = 0; i < inner; i++) {
        for (uint32_t k = 0; k < 3; k++) {
            uint32_t next = s->across[3 * triangle[i] + k];
            if (count < MAX_PATCH && smooth(s, triangle[0], next) && smooth(s, triangle[i], next) &&
                !listed(triangle, count, next))
                triangle[count++] = next;
        }
    }
    return count;
}

/*
 * Adds scale times the second derivative along d of the polynomial fitted around v, on the side of
 * `first`, to the weights of the vertices.
 */
static void add_curvature(const surface *s, uint32_t v, uint32_t first, const double d[3],
                          double scale, double *weight, uint32_t *used, uint32_t *used_count) {
    uint32_t triangle[MAX_PATCH], vertex[3 * MAX_PATCH];
    uint32_t count = fan(s, v, first, triangle);
    uint32_t n = patch_vertices(s, v, triangle, count, vertex);
    for (int ring = 0; ring < 2 && n < ENOUGH; ring++) {
        count = widen(s, triangle, count);
        n = patch_vertices(s, v, triangle, count, vertex);
    }
    double axis[3][3] = {{0}};
    for (uint32_t i = 0; i < count; i++) {
        for (int k = 0; k < 3; k++) axis[2][k] += s->normal[triangle[i]][k];
    }
    v_normalize(axis[2]);
    double along = v_dot(d, axis[2]);
    for (int k = 0; k < 3; k++) axis[0][k] = d[k] - along * axis[2][k];
    v_normalize(axis[0]);
    v_cross(axis[2], axis[0], axis[1]);
    double size = v_norm(d), gram[TERMS * TERMS] = {0}, row[3 * MAX_PATCH][TERMS];
    double share[3 * MAX_PATCH], total = 0;
    for (uint32_t i = 0; i < n; i++) {
        double r[3];
        v_sub(s->m->x[vertex[i]], s->m->x[v], r);
        double a = v_dot(r, axis[0]) / size, b = v_dot(r, axis[1]) / size;
        const double terms[TERMS] = {a, b, 0.5 * a * a, a * b, 0.5 * b * b};
        memcpy(row[i], terms, sizeof terms);
        share[i] = 1 / (v_dot(r, r) / (size * size) + 0.01);
        total += share[i];
    }
    for (uint32_t i = 0; i < n; i++) {
        share[i] /= total;
        for (int p = 0; p < TERMS * TERMS; p++)
            gram[p] += share[i] * row[i][p / TERMS] * row[i][p % TERMS];
    }
    for (int p = 0; p < TERMS; p++) gram[p * (TERMS + 1)] += p < 2 ? 1e-9 : RIDGE;
    double pick[TERMS] = {0, 0, 1, 0, 0}; /* d runs along the first axis */
    uint32_t perm[TERMS];
    if (dense_lu(gram, TERMS, TERMS, perm) < TERMS) return;
    dense_lu_solve(gram, TERMS, TERMS, perm, pick, 1, 1);
    double size_in_plane = v_dot(d, axis[0]) / size;
    scale *= size_in_plane * size_in_plane;
    double sum = 0;
    for (uint32_t i = 0; i <= n; i++) {
        double w = -sum;
        if (i < n) {
            w = 0;
            for (int p = 0; p < TERMS; p++) w += scale * share[i] * row[i][p] * pick[p];
            sum += w;
        }
        uint32_t to = i < n ? vertex[i] : v;
        if (!listed(used, *used_count, to)) used[(*used_count)++] = to;
        weight[to] += w;
    }
}

/* Weights of the middle of an edge as they leave the fits: first those of a and b. */
static uint32_t fit_middle(const surface *s, const mesh_edge *e, double *weight, uint32_t *used) {
    uint32_t count = 0;
    double d[3];
    v_sub(s->m->x[e->b], s->m->x[e->a], d);
    for (int i = 0; i < 4; i++) {
        add_curvature(s, i % 2 == 0 ? e->a : e->b, e->triangle[i / 2], d, -0.125 / 4, weight, used,
                      &count);
    }
    double offset[3] = {0};
    for (uint32_t i = 0; i < count; i++) {
        for (int k = 0; k < 3; k++) offset[k] += weight[used[i]] * s->m->x[used[i]][k];
    }
    double far = v_norm(offset) / (LARGEST_OFFSET * v_norm(d));
    for (uint32_t i = 0; i < count && far > 1; i++) weight[used[i]] /= far;
    weight[e->a] += 0.5;
    weight[e->b] += 0.5;
    return count;
}

quadratic_surface quadratic_build(const mesh *m) {
    quadratic_surface q = {.m = m};
    mesh_edge *edge = mesh_edges(m, &q.edges);
    surface s = {.m = m};
    s.across = mesh_across(m);
    s.normal = allocate(m->triangles, sizeof *s.normal);
    q.edge = allocate(m->triangles, sizeof *q.edge);
    q.offset = allocate(q.edges + 1u, sizeof *q.offset);
    q.middle = allocate(q.edges, sizeof *q.middle);
    for (uint32_t t = 0; t < m->triangles; t++) {
        triangle_normal(m->x[m->t[t][0]], m->x[m->t[t][1]], m->x[m->t[t][2]], s.normal[t]);
        v_normalize(s.normal[t]);
    }
    for (uint32_t e = 0; e < q.edges; e++) {
        for (int side = 0; side < 2; side++) {
            uint32_t t = edge[e].triangle[side];
            for (int k = 0; k < 3; k++) {
                if (m->t[t][k] == edge[e].a || m->t[t][k] == edge[e].b) continue;
                q.edge[t][k] = e;
            }
        }
    }
    double *weight = allocate(m->vertices, sizeof *weight);
    uint32_t *used = allocate(m->vertices, sizeof *used);
    size_t room_v = 0, room_w = 0;
    for (uint32_t e = 0; e < q.edges; e++) {
        uint32_t count = fit_middle(&s, &edge[e], weight, used);
        size_t need = (size_t)q.offset[e] + count;
        q.vertex = grow(q.vertex, &room_v, need, sizeof *q.vertex);
        q.weight = grow(q.weight, &room_w, need, sizeof *q.weight);
        for (uint32_t i = 0; i < count; i++) {
            q.vertex[q.offset[e] + i] = used[i];
            q.weight[q.offset[e] + i] = weight[used[i]];
            for (int k = 0; k < 3; k++) q.middle[e][k] += weight[used[i]] * m->x[used[i]][k];
            weight[used[i]] = 0;
        }
        q.offset[e + 1] = q.offset[e] + count;
    }
    void *owned[] = {weight, used, edge, s.across, s.normal};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    return q;
}

void quadratic_free(quadratic_surface *q) {
    free(q->edge);
    free(q->offset);
    free(q->vertex);
    free(q->weight);
    free(q->middle);
}
