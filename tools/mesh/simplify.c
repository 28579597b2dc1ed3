/* SPDX-License-Identifier: MIT */
#include "tools/mesh/simplify.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define MAX_RING 256u
#define MAX_VALENCE 9u

/* x^T A x + 2 b^T x + c, A symmetric: xx xy xz yy yz zz */
typedef struct {
    double a[6], b[3], c;
} quadric;

typedef struct {
    double cost, x[3];
    uint32_t a, b;
    uint32_t stamp_a, stamp_b;
} collapse;

/*
 * One collapse: the triangles of the patch with their corners in the plane. The first `after` of
 * them live on; the rest vanish with the edge.
 */
typedef struct {
    uint32_t triangle;
    double before[3][2], after[3][2];
} patch_triangle;

typedef struct {
    size_t first, before, after;
} patch;

struct collapse_log {
    patch *patches;
    size_t count, capacity;
    patch_triangle *triangles;
    size_t used, triangle_capacity;
    uint32_t original_triangles;
};

typedef struct {
    mesh m;
    collapse_log *log;
    uint32_t alive; /* triangles left */
    bool *dead;     /* per triangle */
    quadric *q;
    uint32_t *stamp; /* grows when a vertex changes; UINT32_MAX when it is gone */
    uint32_t **around;
    size_t *count, *capacity;
    collapse *heap;
    size_t heap_used, heap_capacity;
} work;

static void add_plane(quadric *q, const double n[3], double d, double weight) {
    const double a[6] = {n[0] * n[0], n[0] * n[1], n[0] * n[2],
                         n[1] * n[1], n[1] * n[2], n[2] * n[2]};
    for (int k = 0; k < 6; k++) q->a[k] += weight * a[k];
    for (int k = 0; k < 3; k++) q->b[k] += weight * d * n[k];
    q->c += weight * d * d;
}

static double evaluate(const quadric *q, const double x[3]) {
    return q->a[0] * x[0] * x[0] + q->a[3] * x[1] * x[1] + q->a[5] * x[2] * x[2] +
           2 * (q->a[1] * x[0] * x[1] + q->a[2] * x[0] * x[2] + q->a[4] * x[1] * x[2]) +
           2 * v_dot(q->b, x) + q->c;
}

/* Minimiser of the quadric, if it is well determined. */
static bool minimise(const quadric *q, double x[3]) {
    const double *a = q->a;
    double c0[3] = {a[0], a[1], a[2]}, c1[3] = {a[1], a[3], a[4]}, c2[3] = {a[2], a[4], a[5]};
    double u[3], v[3], w[3];
    v_cross(c1, c2, u);
    v_cross(c2, c0, v);
    v_cross(c0, c1, w);
    double det = v_dot(c0, u);
    double trace = a[0] + a[3] + a[5];
    if (!(fabs(det) > 1e-4 * trace * trace * trace)) return false;
    for (int k = 0; k < 3; k++) x[k] = -(u[k] * q->b[0] + v[k] * q->b[1] + w[k] * q->b[2]) / det;
    return true;
}

static uint32_t ring_of(const work *w, uint32_t v, uint32_t *ring) {
    uint32_t n = 0;
    for (size_t i = 0; i < w->count[v]; i++) {
        const uint32_t *t = w->m.t[w->around[v][i]];
        for (int k = 0; k < 3; k++) {
            uint32_t u = t[k];
            uint32_t j = 0;
            while (j < n && ring[j] != u) j++;
            if (u != v && j == n && n < MAX_RING) ring[n++] = u;
        }
    }
    return n;
}

/* Quality 1 for equilateral, 0 for degenerate. */
static double quality(const double a[3], const double b[3], const double c[3], double n[3]) {
    double ab = v_distance(a, b), bc = v_distance(b, c), ca = v_distance(c, a);
    triangle_normal(a, b, c, n);
    return 2 * sqrt(3.0) * v_norm(n) / (ab * ab + bc * bc + ca * ca + 1e-300);
}

/*
 * Worst quality of the triangles that keep one of a, b when both move to x; negative when one turns
 * by more than about 75 degrees.
 */
static double worst_after(const work *w, uint32_t a, uint32_t b, const double x[3]) {
    double worst = 1;
    for (int side = 0; side < 2; side++) {
        uint32_t v = side == 0 ? a : b;
        uint32_t other = side == 0 ? b : a;
        for (size_t i = 0; i < w->count[v]; i++) {
            const uint32_t *t = w->m.t[w->around[v][i]];
            if (t[0] == other || t[1] == other || t[2] == other) continue;
            const double *corner[3];
            double old[3], new[3];
            for (int k = 0; k < 3; k++) corner[k] = w->m.x[t[k]];
            triangle_normal(corner[0], corner[1], corner[2], old);
            for (int k = 0; k < 3; k++) {
                if (t[k] == v) corner[k] = x;
            }
            worst = fmin(worst, quality(corner[0], corner[1], corner[2], new));
            if (v_dot(old, new) < 0.25 * v_norm(old) * v_norm(new)) return -1;
        }
    }
    return worst;
}

static void push(work *w, collapse c) {
    w->heap = grow(w->heap, &w->heap_capacity, w->heap_used + 1, sizeof *w->heap);
    size_t i = w->heap_used++;
    while (i > 0 && w->heap[(i - 1) / 2].cost > c.cost) {
        w->heap[i] = w->heap[(i - 1) / 2];
        i = (i - 1) / 2;
    }
    w->heap[i] = c;
}

static collapse pop(work *w) {
    collapse top = w->heap[0];
    collapse last = w->heap[--w->heap_used];
    size_t i = 0;
    for (;;) {
        size_t child = 2 * i + 1;
        if (child >= w->heap_used) break;
        if (child + 1 < w->heap_used && w->heap[child + 1].cost < w->heap[child].cost) child++;
        if (w->heap[child].cost >= last.cost) break;
        w->heap[i] = w->heap[child];
        i = child;
    }
    w->heap[i] = last;
    return top;
}

/*
 * Error of the merged quadric, a little edge length so that flat parts shrink evenly, all divided
 * by the quality that would remain, so that slivers come last.
 */
static void consider(work *w, uint32_t a, uint32_t b) {
    quadric q = w->q[a];
    for (int k = 0; k < 6; k++) q.a[k] += w->q[b].a[k];
    for (int k = 0; k < 3; k++) q.b[k] += w->q[b].b[k];
    q.c += w->q[b].c;
    collapse c = {.a = a, .b = b, .stamp_a = w->stamp[a], .stamp_b = w->stamp[b]};
    double length = v_distance(w->m.x[a], w->m.x[b]);
    for (int k = 0; k < 3; k++) c.x[k] = 0.5 * (w->m.x[a][k] + w->m.x[b][k]);
    double optimum[3];
    if (minimise(&q, optimum) && v_distance(optimum, c.x) < length)
        memcpy(c.x, optimum, sizeof optimum);
    double worst = worst_after(w, a, b, c.x);
    if (worst < 0) return;
    double error = fmax(evaluate(&q, c.x), 0);
    c.cost = (error + 1e-3 * length * length * length * length) / (worst * worst + 1e-3);
    push(w, c);
}

static bool links_in_two(const work *w, uint32_t a, uint32_t b) {
    uint32_t ring_a[MAX_RING], ring_b[MAX_RING];
    uint32_t na = ring_of(w, a, ring_a), nb = ring_of(w, b, ring_b);
    uint32_t common = 0;
    for (uint32_t i = 0; i < na; i++) {
        for (uint32_t k = 0; k < nb; k++) common += ring_a[i] == ring_b[k];
    }
    return common == 2 && na + nb - 4 <= MAX_VALENCE + (w->alive > 2000 ? MAX_VALENCE : 0);
}

static void remove_around(work *w, uint32_t v, uint32_t triangle) {
    for (size_t i = 0; i < w->count[v]; i++) {
        if (w->around[v][i] != triangle) continue;
        w->around[v][i] = w->around[v][--w->count[v]];
        return;
    }
}

/* ---- the map ---- */

/* Ring around the edge (a, b), or around `a` alone when b == a, in counter-clockwise order. */
static uint32_t ordered_ring(const work *w, uint32_t a, uint32_t b, uint32_t *ring) {
    uint32_t from[MAX_RING], to[MAX_RING];
    uint32_t n = 0, length = 0;
    for (int side = 0; side < (a == b ? 1 : 2); side++) {
        uint32_t v = side == 0 ? a : b;
        uint32_t other = side == 0 ? b : a;
        for (size_t i = 0; i < w->count[v] && n < MAX_RING; i++) {
            const uint32_t *t = w->m.t[w->around[v][i]];
            int k = t[0] == v ? 0 : t[1] == v ? 1 : 2;
            if (t[(k + 1) % 3] == other || t[(k + 2) % 3] == other) continue;
            from[n] = t[(k + 1) % 3];
            to[n++] = t[(k + 2) % 3];
        }
    }
    uint32_t at = from[0];
    for (; length < n; length++) {
        uint32_t i = 0;
        while (i < n && from[i] != at) i++;
        if (i == n) break;
        ring[length] = at;
        at = to[i];
    }
    return length == n ? n : 0;
}

/* Mean value weight of edge (v, u) (Floater 2003): positive, from the two triangles beside it. */
static double mean_value(const work *w, uint32_t v, uint32_t u) {
    double sum = 0;
    for (size_t i = 0; i < w->count[v]; i++) {
        const uint32_t *t = w->m.t[w->around[v][i]];
        int k = t[0] == v ? 0 : t[1] == v ? 1 : 2;
        uint32_t p = t[(k + 1) % 3], q = t[(k + 2) % 3];
        if (p != u && q != u) continue;
        double d[3], e[3], n[3];
        v_sub(w->m.x[p], w->m.x[v], d);
        v_sub(w->m.x[q], w->m.x[v], e);
        v_cross(d, e, n);
        double sine = v_norm(n), cosine = v_dot(d, e);
        sum += sine /
               (fmax(v_norm(d) * v_norm(e) + cosine, 0) + 1e-9 * v_norm(d) * v_norm(e) + 1e-300);
    }
    return sum / (v_distance(w->m.x[v], w->m.x[u]) + 1e-300) + 1e-300;
}

/* Weighted sum of the ring neighbours of v in the plane, without the edge to `other`. */
static double pull(const work *w, uint32_t v, uint32_t other, const uint32_t *ring,
                   const double (*uv)[2], uint32_t n, double sum[2]) {
    double total = 0;
    sum[0] = sum[1] = 0;
    for (uint32_t i = 0; i < n; i++) {
        bool joined = false;
        for (size_t k = 0; k < w->count[v]; k++) {
            const uint32_t *t = w->m.t[w->around[v][k]];
            joined = joined || t[0] == ring[i] || t[1] == ring[i] || t[2] == ring[i];
        }
        if (!joined || ring[i] == other) continue;
        double weight = mean_value(w, v, ring[i]);
        sum[0] += weight * uv[i][0];
        sum[1] += weight * uv[i][1];
        total += weight;
    }
    return total;
}

/* Ring on a circle, arcs in proportion to edge lengths. */
static void flatten_ring(const work *w, const uint32_t *ring, uint32_t n, double (*uv)[2]) {
    double total = 0, at = 0;
    for (uint32_t i = 0; i < n; i++)
        total += v_distance(w->m.x[ring[i]], w->m.x[ring[(i + 1) % n]]);
    for (uint32_t i = 0; i < n; i++) {
        uv[i][0] = cos(2 * 3.14159265358979323846 * at);
        uv[i][1] = sin(2 * 3.14159265358979323846 * at);
        double share = v_distance(w->m.x[ring[i]], w->m.x[ring[(i + 1) % n]]) / (total + 1e-300);
        at += (share + 0.2 / n) / 1.2;
    }
}

static void corner_uv(const uint32_t t[3], const uint32_t *ring, const double (*uv)[2], uint32_t n,
                      uint32_t a, const double at_a[2], uint32_t b, const double at_b[2],
                      double out[3][2]) {
    for (int k = 0; k < 3; k++) {
        const double *from = t[k] == a ? at_a : t[k] == b ? at_b : NULL;
        for (uint32_t i = 0; i < n && from == NULL; i++) {
            if (ring[i] == t[k]) from = uv[i];
        }
        memcpy(out[k], from, 2 * sizeof(double));
    }
}

/* The flattened patch before the collapse of b into a; false when the patch is no disc. */
static bool log_before(work *w, uint32_t a, uint32_t b, uint32_t *ring, double (*uv)[2],
                       uint32_t *n) {
    collapse_log *l = w->log;
    *n = ordered_ring(w, a, b, ring);
    if (*n < 3) return false;
    flatten_ring(w, ring, *n, uv);
    double pa[2], pb[2], at_a[2], at_b[2];
    double wa = pull(w, a, b, ring, (const double(*)[2])uv, *n, pa);
    double wb = pull(w, b, a, ring, (const double(*)[2])uv, *n, pb);
    double ab = mean_value(w, a, b), ba = mean_value(w, b, a);
    double det = (wa + ab) * (wb + ba) - ab * ba;
    for (int k = 0; k < 2; k++) {
        at_a[k] = (pa[k] * (wb + ba) + ab * pb[k]) / det;
        at_b[k] = (pb[k] * (wa + ab) + ba * pa[k]) / det;
    }
    patch p = {.first = l->used};
    for (int shared = 0; shared < 2; shared++) {
        for (int side = 0; side < 2; side++) {
            uint32_t v = side == 0 ? a : b, other = side == 0 ? b : a;
            for (size_t i = 0; i < w->count[v]; i++) {
                uint32_t id = w->around[v][i];
                const uint32_t *t = w->m.t[id];
                bool both = t[0] == other || t[1] == other || t[2] == other;
                if (both != (shared == 1) || (both && side == 1)) continue;
                l->triangles =
                    grow(l->triangles, &l->triangle_capacity, l->used + 1, sizeof *l->triangles);
                patch_triangle *q = &l->triangles[l->used++];
                q->triangle = id;
                corner_uv(t, ring, (const double(*)[2])uv, *n, a, at_a, b, at_b, q->before);
                p.before++;
                p.after += both ? 0 : 1;
            }
        }
    }
    l->patches = grow(l->patches, &l->capacity, l->count + 1, sizeof *l->patches);
    l->patches[l->count++] = p;
    return true;
}

static void log_after(work *w, uint32_t a, const uint32_t *ring, const double (*uv)[2],
                      uint32_t n) {
    const patch *p = &w->log->patches[w->log->count - 1];
    double at_a[2];
    double total = pull(w, a, a, ring, uv, n, at_a);
    for (int k = 0; k < 2; k++) at_a[k] /= total;
    for (size_t i = p->first; i < p->first + p->after; i++) {
        patch_triangle *q = &w->log->triangles[i];
        corner_uv(w->m.t[q->triangle], ring, uv, n, a, at_a, a, at_a, q->after);
    }
}

/* Barycentric weights of (x, y) in a flat triangle; returns the smallest. */
static double locate(double c[3][2], const double x[2], double weight[3]) {
    double det =
        (c[1][0] - c[0][0]) * (c[2][1] - c[0][1]) - (c[2][0] - c[0][0]) * (c[1][1] - c[0][1]);
    if (!(fabs(det) > 1e-300)) return -1e300;
    weight[1] =
        ((x[0] - c[0][0]) * (c[2][1] - c[0][1]) - (c[2][0] - c[0][0]) * (x[1] - c[0][1])) / det;
    weight[2] =
        ((c[1][0] - c[0][0]) * (x[1] - c[0][1]) - (x[0] - c[0][0]) * (c[1][1] - c[0][1])) / det;
    weight[0] = 1 - weight[1] - weight[2];
    return fmin(weight[0], fmin(weight[1], weight[2]));
}

static void undo(const collapse_log *l, const patch *p, const patch_triangle *q, surface_point *s) {
    double x[2] = {0}, best = -1e301;
    for (int k = 0; k < 3; k++) {
        x[0] += s->weight[k] * q->after[k][0];
        x[1] += s->weight[k] * q->after[k][1];
    }
    for (size_t i = p->first; i < p->first + p->before; i++) {
        double weight[3];
        double smallest = locate(l->triangles[i].before, x, weight);
        if (smallest <= best) continue;
        best = smallest;
        s->triangle = l->triangles[i].triangle;
        memcpy(s->weight, weight, sizeof weight);
    }
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        s->weight[k] = fmax(s->weight[k], 0);
        sum += s->weight[k];
    }
    for (int k = 0; k < 3; k++) s->weight[k] /= sum;
}

void simplified_map(const simplified *s, surface_point *point, size_t count) {
    const collapse_log *l = s->log;
    /* Points hang in one list per triangle. */
    size_t *head = allocate(l->original_triangles, sizeof *head);
    size_t *next = allocate(count + 1, sizeof *next);
    for (size_t i = 0; i < count; i++) {
        point[i].triangle = s->triangle_of[point[i].triangle];
        next[i + 1] = head[point[i].triangle];
        head[point[i].triangle] = i + 1;
    }
    for (size_t k = l->count; k-- > 0;) {
        const patch *p = &l->patches[k];
        size_t moved = 0; /* taken out first, so that none is moved twice */
        for (size_t i = p->first; i < p->first + p->after; i++) {
            const patch_triangle *q = &l->triangles[i];
            for (size_t at = head[q->triangle]; at != 0;) {
                size_t following = next[at];
                undo(l, p, q, &point[at - 1]);
                next[at] = moved;
                moved = at;
                at = following;
            }
            head[q->triangle] = 0;
        }
        while (moved != 0) {
            size_t following = next[moved];
            next[moved] = head[point[moved - 1].triangle];
            head[point[moved - 1].triangle] = moved;
            moved = following;
        }
    }
    free(next);
    free(head);
}

/* ---- collapsing ---- */

static void apply(work *w, const collapse *c) {
    uint32_t a = c->a, b = c->b;
    uint32_t loop[MAX_RING], loop_length;
    double uv[MAX_RING][2];
    if (!log_before(w, a, b, loop, uv, &loop_length)) return;
    memcpy(w->m.x[a], c->x, sizeof c->x);
    for (int k = 0; k < 6; k++) w->q[a].a[k] += w->q[b].a[k];
    for (int k = 0; k < 3; k++) w->q[a].b[k] += w->q[b].b[k];
    w->q[a].c += w->q[b].c;
    while (w->count[b] > 0) {
        uint32_t i = w->around[b][w->count[b] - 1];
        uint32_t *t = w->m.t[i];
        bool shared = t[0] == a || t[1] == a || t[2] == a;
        w->count[b]--;
        if (shared) {
            for (int k = 0; k < 3; k++) {
                if (t[k] != b) remove_around(w, t[k], i);
            }
            w->dead[i] = true;
            w->alive--;
            continue;
        }
        for (int k = 0; k < 3; k++) {
            if (t[k] == b) t[k] = a;
        }
        w->around[a] = grow(w->around[a], &w->capacity[a], w->count[a] + 1, sizeof **w->around);
        w->around[a][w->count[a]++] = i;
    }
    w->stamp[b] = UINT32_MAX;
    w->stamp[a]++;
    log_after(w, a, loop, (const double(*)[2])uv, loop_length);
    uint32_t ring[MAX_RING];
    uint32_t n = ring_of(w, a, ring);
    for (uint32_t i = 0; i < n; i++)
        consider(w, a < ring[i] ? a : ring[i], a < ring[i] ? ring[i] : a);
}

static work start(const mesh *m) {
    work w = {.m = mesh_copy(m), .alive = m->triangles, .log = allocate(1, sizeof *w.log)};
    w.log->original_triangles = m->triangles;
    w.dead = allocate(m->triangles, sizeof *w.dead);
    w.q = allocate(m->vertices, sizeof *w.q);
    w.stamp = allocate(m->vertices, sizeof *w.stamp);
    w.around = allocate(m->vertices, sizeof *w.around);
    w.count = allocate(m->vertices, sizeof *w.count);
    w.capacity = allocate(m->vertices, sizeof *w.capacity);
    for (uint32_t i = 0; i < m->triangles; i++) {
        const uint32_t *t = m->t[i];
        double n[3];
        triangle_normal(m->x[t[0]], m->x[t[1]], m->x[t[2]], n);
        double area = 0.5 * v_norm(n);
        v_normalize(n);
        for (int k = 0; k < 3; k++) {
            uint32_t v = t[k];
            add_plane(&w.q[v], n, -v_dot(n, m->x[t[0]]), area / 3);
            w.around[v] = grow(w.around[v], &w.capacity[v], w.count[v] + 1, sizeof **w.around);
            w.around[v][w.count[v]++] = i;
        }
    }
    uint32_t edges;
    mesh_edge *e = mesh_edges(m, &edges);
    for (uint32_t i = 0; i < edges; i++) consider(&w, e[i].a, e[i].b);
    free(e);
    return w;
}

simplified simplify(const mesh *m, uint32_t triangles) {
    work w = start(m);
    while (w.alive > triangles && w.heap_used > 0) {
        collapse c = pop(&w);
        if (w.stamp[c.a] != c.stamp_a || w.stamp[c.b] != c.stamp_b) continue;
        if (!links_in_two(&w, c.a, c.b) || worst_after(&w, c.a, c.b, c.x) < 0) continue;
        apply(&w, &c);
    }
    simplified s = {
        .base = w.m, .log = w.log, .triangle_of = allocate(w.alive, sizeof *s.triangle_of)};
    uint32_t kept = 0;
    for (uint32_t i = 0; i < m->triangles; i++) {
        if (w.dead[i]) continue;
        s.triangle_of[kept] = i;
        memmove(s.base.t[kept++], s.base.t[i], sizeof s.base.t[i]);
    }
    s.base.triangles = kept;
    for (uint32_t i = 0; i < m->vertices; i++) free(w.around[i]);
    free(w.around);
    free(w.count);
    free(w.capacity);
    free(w.stamp);
    free(w.q);
    free(w.dead);
    free(w.heap);
    (void)mesh_drop_unused(&s.base);
    return s;
}

void simplified_free(simplified *s) {
    mesh_free(&s->base);
    free(s->triangle_of);
    free(s->log->patches);
    free(s->log->triangles);
    free(s->log);
}
