/* SPDX-License-Identifier: MIT */
#include "tools/mesh/crossing.h"
#include "port/host/util.h"
#include <stdlib.h>

static double side(const double a[3], const double b[3], const double c[3], const double x[3]) {
    double n[3], d[3];
    triangle_normal(a, b, c, n);
    v_sub(x, a, d);
    return v_dot(n, d);
}

/* `least`: six times the volume that counts as no volume, so that what only touches does not meet. */
static bool segment_meets(const double p[3], const double q[3], const double a[3],
                          const double b[3], const double c[3], double least) {
    double at_p = side(a, b, c, p), at_q = side(a, b, c, q);
    if (at_p * at_q >= 0 || fabs(at_p) <= least || fabs(at_q) <= least) return false;
    double u = side(p, q, a, b), v = side(p, q, b, c), w = side(p, q, c, a);
    return (u > 0 && v > 0 && w > 0) || (u < 0 && v < 0 && w < 0);
}

static bool share_vertex(const uint32_t s[3], const uint32_t t[3]) {
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            if (s[i] == t[k]) return true;
        }
    }
    return false;
}

typedef struct {
    double low, high; /* along x */
    uint32_t triangle;
} span;

static int compare_spans(const void *a, const void *b) {
    const span *p = a, *q = b;
    return p->low < q->low ? -1 : p->low > q->low;
}

/* Whether their boxes do not overlap. */
static bool are_apart(const mesh *m, const uint32_t s[3], const uint32_t t[3]) {
    for (int k = 0; k < 3; k++) {
        double a = m->x[s[0]][k], b = m->x[s[1]][k], c = m->x[s[2]][k];
        double d = m->x[t[0]][k], e = m->x[t[1]][k], f = m->x[t[2]][k];
        if (fmax(a, fmax(b, c)) < fmin(d, fmin(e, f)) || fmax(d, fmax(e, f)) < fmin(a, fmin(b, c)))
            return true;
    }
    return false;
}

static bool triangles_meet(const mesh *m, uint32_t i, uint32_t j, double least) {
    const uint32_t *s = m->t[i], *t = m->t[j];
    if (share_vertex(s, t) || are_apart(m, s, t)) return false;
    for (int k = 0; k < 3; k++) {
        if (segment_meets(m->x[s[k]], m->x[s[(k + 1) % 3]], m->x[t[0]], m->x[t[1]], m->x[t[2]],
                          least) ||
            segment_meets(m->x[t[k]], m->x[t[(k + 1) % 3]], m->x[s[0]], m->x[s[1]], m->x[s[2]],
                          least))
            return true;
    }
    return false;
}

/* The first triangle that is cut; where `cut` is given, all that are get a mark, and none is passed
 * over for being found. */
static uint32_t find_crossings(const mesh *m, uint8_t *cut) {
    const double diagonal = mesh_diagonal(m), least = 1e-12 * diagonal * diagonal * diagonal;
    span *spans = allocate(m->triangles, sizeof *spans);
    uint32_t found = UINT32_MAX;
    for (uint32_t i = 0; i < m->triangles; i++) {
        const double a = m->x[m->t[i][0]][0], b = m->x[m->t[i][1]][0], c = m->x[m->t[i][2]][0];
        spans[i] = (span){fmin(a, fmin(b, c)), fmax(a, fmax(b, c)), i};
    }
    qsort(spans, m->triangles, sizeof *spans, compare_spans);
    for (uint32_t i = 0; i < m->triangles && (cut != NULL || found == UINT32_MAX); i++) {
        for (uint32_t j = i + 1; j < m->triangles && spans[j].low <= spans[i].high; j++) {
            if (!triangles_meet(m, spans[i].triangle, spans[j].triangle, least)) continue;
            if (found == UINT32_MAX) found = spans[i].triangle;
            if (cut == NULL) break;
            cut[spans[i].triangle] = cut[spans[j].triangle] = 1;
        }
    }
    free(spans);
    return found;
}

uint32_t mesh_self_intersection(const mesh *m) { return find_crossings(m, NULL); }

uint8_t *mesh_crossings(const mesh *m) {
    uint8_t *cut = allocate(m->triangles, 1);
    (void)find_crossings(m, cut);
    return cut;
}
