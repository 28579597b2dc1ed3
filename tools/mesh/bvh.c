/* SPDX-License-Identifier: MIT */
#include "tools/mesh/bvh.h"
#include "tools/mesh/nearest.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define LEAF 4u
#define SMOOTHING 2

typedef struct {
    double lo[3], hi[3];
    uint32_t first, count; /* leaf: triangles; inner: count 0, children first and first + 1 */
} box;

struct bvh {
    const mesh *m;
    box *boxes;
    uint32_t used;
    uint32_t *order;
    double (*normal)[3]; /* unit, per triangle, smoothed */
};

static void bound(const bvh *b, box *x, uint32_t first, uint32_t count) {
    for (int k = 0; k < 3; k++) {
        x->lo[k] = HUGE_VAL;
        x->hi[k] = -HUGE_VAL;
    }
    for (uint32_t i = first; i < first + count; i++) {
        for (int c = 0; c < 3; c++) {
            const double *v = b->m->x[b->m->t[b->order[i]][c]];
            for (int k = 0; k < 3; k++) {
                x->lo[k] = fmin(x->lo[k], v[k]);
                x->hi[k] = fmax(x->hi[k], v[k]);
            }
        }
    }
}

static double center(const mesh *m, uint32_t t, int axis) {
    return m->x[m->t[t][0]][axis] + m->x[m->t[t][1]][axis] + m->x[m->t[t][2]][axis];
}

static void split(bvh *b, uint32_t node, uint32_t first, uint32_t count) {
    box *x = &b->boxes[node];
    bound(b, x, first, count);
    x->first = first;
    x->count = count;
    int axis = 0;
    for (int k = 1; k < 3; k++) {
        if (x->hi[k] - x->lo[k] > x->hi[axis] - x->lo[axis]) axis = k;
    }
    if (count <= LEAF) return;
    double middle = 0;
    for (uint32_t i = first; i < first + count; i++)
        middle += center(b->m, b->order[i], axis) / count;
    uint32_t left = first;
    for (uint32_t i = first; i < first + count; i++) {
        if (center(b->m, b->order[i], axis) >= middle) continue;
        uint32_t t = b->order[i];
        b->order[i] = b->order[left];
        b->order[left++] = t;
    }
    uint32_t half = left - first;
    if (half == 0 || half == count) half = count / 2;
    uint32_t child = b->used;
    b->used += 2;
    x->first = child;
    x->count = 0;
    split(b, child, first, half);
    split(b, child + 1, first + half, count - half);
}

/* Sums of vertex normals over triangles and back, a few times. */
static void smooth_normals(const mesh *m, double (*normal)[3]) {
    double(*at_vertex)[3] = allocate(m->vertices, sizeof *at_vertex);
    for (uint32_t i = 0; i < m->triangles; i++) {
        const uint32_t *t = m->t[i];
        triangle_normal(m->x[t[0]], m->x[t[1]], m->x[t[2]], normal[i]);
    }
    for (int round = 0; round < SMOOTHING; round++) {
        memset(at_vertex, 0, m->vertices * sizeof *at_vertex);
        for (uint32_t i = 0; i < m->triangles; i++) {
            for (int k = 0; k < 9; k++) at_vertex[m->t[i][k / 3]][k % 3] += normal[i][k % 3];
        }
        for (uint32_t v = 0; v < m->vertices; v++) v_normalize(at_vertex[v]);
        for (uint32_t i = 0; i < m->triangles; i++) {
            const uint32_t *t = m->t[i];
            for (int k = 0; k < 3; k++)
                normal[i][k] = at_vertex[t[0]][k] + at_vertex[t[1]][k] + at_vertex[t[2]][k];
            v_normalize(normal[i]);
        }
    }
    free(at_vertex);
}

bvh *bvh_build(const mesh *m) {
    bvh *b = allocate(1, sizeof *b);
    b->m = m;
    b->boxes = allocate(2 * (size_t)m->triangles, sizeof *b->boxes);
    b->order = allocate(m->triangles, sizeof *b->order);
    b->normal = allocate(m->triangles, sizeof *b->normal);
    for (uint32_t i = 0; i < m->triangles; i++) b->order[i] = i;
    smooth_normals(m, b->normal);
    b->used = 1;
    split(b, 0, 0, m->triangles);
    return b;
}

void bvh_free(bvh *b) {
    free(b->boxes);
    free(b->order);
    free(b->normal);
    free(b);
}

const double *bvh_facing(const bvh *b, uint32_t triangle) { return b->normal[triangle]; }

static double box_distance2(const box *b, const double x[3]) {
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        const double d = x[k] < b->lo[k] ? b->lo[k] - x[k] : x[k] > b->hi[k] ? x[k] - b->hi[k] : 0;
        sum += d * d;
    }
    return sum;
}

/* The distance; `found` is the triangle, as it was if there is none. */
static double search(const bvh *b, const double x[3], const double *normal, double cosine,
                     double point[3], uint32_t *found) {
    uint32_t stack[128];
    int top = 0;
    double best = HUGE_VAL;
    stack[top++] = 0;
    while (top > 0) {
        const box *n = &b->boxes[stack[--top]];
        if (box_distance2(n, x) >= best) continue;
        if (n->count == 0) {
            bool left_first =
                box_distance2(&b->boxes[n->first], x) < box_distance2(&b->boxes[n->first + 1], x);
            stack[top++] = n->first + (left_first ? 1 : 0);
            stack[top++] = n->first + (left_first ? 0 : 1);
            continue;
        }
        for (uint32_t i = n->first; i < n->first + n->count; i++) {
            const uint32_t *t = b->m->t[b->order[i]];
            double p[3], d[3], corner[3];
            if (normal != NULL && v_dot(normal, b->normal[b->order[i]]) < cosine) continue;
            (void)nearest_on_triangle(x, b->m->x[t[0]], b->m->x[t[1]], b->m->x[t[2]], corner, p);
            v_sub(p, x, d);
            if (v_dot(d, d) >= best) continue;
            best = v_dot(d, d);
            *found = b->order[i];
            memcpy(point, p, sizeof p);
        }
    }
    return sqrt(best);
}

double bvh_closest(const bvh *b, const double x[3], const double *normal, double cosine,
                   double point[3], double facing[3]) {
    uint32_t found = 0;
    const double distance = search(b, x, normal, cosine, point, &found);
    if (facing != NULL && isfinite(distance))
        memcpy(facing, b->normal[found], sizeof b->normal[found]);
    return distance;
}

uint32_t bvh_triangle(const bvh *b, const double x[3]) {
    uint32_t found = 0;
    double point[3];
    (void)search(b, x, NULL, 0, point, &found);
    return found;
}
