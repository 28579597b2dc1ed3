/* SPDX-License-Identifier: MIT */
#include "tools/tool/inside.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>

#define ASIDE_Y 1.618e-6 /* of the step: where a row's line lies */
#define ASIDE_Z 2.414e-6

typedef struct {
    double x;
    int turn; /* +1: into the mesh */
} crossing;

typedef struct {
    const mesh *m;
    const place_grid *g;
    size_t *offset; /* [rows + 1] triangles that may cross the line of a row */
    uint32_t *triangle;
    uint8_t *inside;
} sweep;

static double line_y(const place_grid *g, uint32_t j) {
    return g->origin[1] + g->step * (j + ASIDE_Y);
}
static double line_z(const place_grid *g, uint32_t k) {
    return g->origin[2] + g->step * (k + ASIDE_Z);
}

/* Rows that a triangle's box meets along one axis. */
static void rows_of(const mesh *m, const place_grid *g, uint32_t t, int axis, uint32_t range[2]) {
    double low = HUGE_VAL, high = -HUGE_VAL;
    for (int k = 0; k < 3; k++) {
        low = fmin(low, m->x[m->t[t][k]][axis]);
        high = fmax(high, m->x[m->t[t][k]][axis]);
    }
    const double last = g->count[axis] - 1.0;
    range[0] = (uint32_t)fmin(fmax(floor((low - g->origin[axis]) / g->step) - 1, 0), last);
    range[1] = (uint32_t)fmin(fmax(ceil((high - g->origin[axis]) / g->step) + 1, 0), last);
}

/* Sorts the triangles by rows: counts first, then lists. */
static void sort_by_rows(sweep *s) {
    const place_grid *g = s->g;
    const size_t rows = (size_t)g->count[1] * g->count[2];
    s->offset = allocate(rows + 2, sizeof *s->offset);
    for (int pass = 0; pass < 2; pass++) {
        for (uint32_t t = 0; t < s->m->triangles; t++) {
            uint32_t y[2], z[2];
            rows_of(s->m, g, t, 1, y);
            rows_of(s->m, g, t, 2, z);
            for (uint32_t k = z[0]; k <= z[1]; k++) {
                for (uint32_t j = y[0]; j <= y[1]; j++) {
                    size_t *at = &s->offset[(size_t)k * g->count[1] + j + (pass == 0 ? 2 : 1)];
                    if (pass == 1) s->triangle[*at] = t;
                    (*at)++;
                }
            }
        }
        if (pass == 1) return;
        for (size_t r = 0; r < rows; r++) s->offset[r + 2] += s->offset[r + 1];
        s->triangle = allocate(s->offset[rows + 1] + 1, sizeof *s->triangle);
    }
}

/* Where the line along x at (y, z) crosses a triangle; false if it does not. */
static bool cross_line(const mesh *m, uint32_t t, double y, double z, crossing *c) {
    double e[3], sum = 0, x = 0;
    for (int k = 0; k < 3; k++) { /* twice the areas of the three parts of its shadow */
        const double *p = m->x[m->t[t][(k + 1) % 3]], *q = m->x[m->t[t][(k + 2) % 3]];
        e[k] = (p[1] - y) * (q[2] - z) - (p[2] - z) * (q[1] - y);
        sum += e[k];
        x += e[k] * m->x[m->t[t][k]][0];
    }
    const bool in = (e[0] >= 0 && e[1] >= 0 && e[2] >= 0) || (e[0] <= 0 && e[1] <= 0 && e[2] <= 0);
    if (!in || !(fabs(sum) > 0)) return false;
    *c = (crossing){x / sum, sum > 0 ? -1 : 1}; /* outward along +x: the line leaves */
    return true;
}

bool mesh_holds(const mesh *m, const double x[3]) {
    int around = 0;
    for (uint32_t t = 0; t < m->triangles; t++) {
        crossing c;
        if (cross_line(m, t, x[1], x[2], &c) && c.x > x[0]) around -= c.turn;
    }
    return around > 0;
}

static int by_place(const void *a, const void *b) {
    const crossing *p = a, *q = b;
    return (p->x > q->x) - (p->x < q->x);
}

static void sweep_row(void *context, size_t row) {
    const sweep *s = context;
    const place_grid *g = s->g;
    const uint32_t j = (uint32_t)(row % g->count[1]), k = (uint32_t)(row / g->count[1]);
    const size_t first = s->offset[row], end = s->offset[row + 1];
    crossing *c = allocate(end - first + 1, sizeof *c);
    size_t count = 0, next = 0;
    int around = 0;
    for (size_t i = first; i < end; i++)
        count += cross_line(s->m, s->triangle[i], line_y(g, j), line_z(g, k), &c[count]) ? 1 : 0;
    qsort(c, count, sizeof *c, by_place);
    for (uint32_t i = 0; i < g->count[0]; i++) {
        const double x = g->origin[0] + g->step * i;
        while (next < count && c[next].x <= x) around += c[next++].turn;
        s->inside[row * g->count[0] + i] = around > 0 ? 1 : 0;
    }
    free(c);
}

uint8_t *mesh_inside(const mesh *m, const place_grid *grid) {
    const size_t rows = (size_t)grid->count[1] * grid->count[2];
    sweep s = {.m = m, .g = grid, .inside = allocate(rows * grid->count[0], 1)};
    sort_by_rows(&s);
    parallel_for(rows, sweep_row, &s);
    free(s.offset);
    free(s.triangle);
    return s.inside;
}
