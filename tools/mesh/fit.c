/* SPDX-License-Identifier: MIT */
#include "tools/mesh/fit.h"
#include "tools/mesh/crossing.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define REPAIR_STEPS 40
#define FEATURE_ROUNDS 6
#define FEATURE_TOLERANCE 0.015 /* over the diagonal */
#define RIM_ROUNDS 6
#define RIM_ANGLE_DEG 5.0
#define RIM_SWEEPS 8
#define MOST_AROUND 64u
#define RIM_SPACINGS 0.2     /* of the mesh: nearer is near enough */
#define RIM_TOLERANCE 0.0015 /* over the diagonal */
#define FACING_COSINE                                                                              \
    (-0.2) /* how far a particle may turn in one move: past a right angle, not around */

/* To the closest point that does not face away. */
static void draw_onto(const fit *f, uint32_t v) {
    double point[3];
    double d =
        bvh_closest(f->surface, f->m->x[v], f->facing[v], FACING_COSINE, point, f->facing[v]);
    if (!isfinite(d)) (void)bvh_closest(f->surface, f->m->x[v], NULL, 0, point, f->facing[v]);
    memcpy(f->m->x[v], point, sizeof point);
}

/* Moves vertex v along the surface a fraction of the way to the mean of its ring. */
static void relax(const fit *f, uint32_t v, double fraction) {
    double d[3] = {0};
    double n = f->offset[v + 1] - f->offset[v];
    for (uint32_t i = f->offset[v]; i < f->offset[v + 1]; i++) {
        for (int k = 0; k < 3; k++) d[k] += (f->m->x[f->ring[i]][k] - f->m->x[v][k]) / n;
    }
    double out = v_dot(d, f->facing[v]);
    for (int k = 0; k < 3; k++) f->m->x[v][k] += fraction * (d[k] - out * f->facing[v][k]);
    draw_onto(f, v);
}

void fit_relax_all(const fit *f) {
    for (uint32_t v = 0; v < f->m->vertices; v++) {
        if (!f->pinned[v]) relax(f, v, 0.5);
    }
}

typedef struct {
    double distance;
    uint32_t vertex; /* of the original */
} miss;

static int compare_misses(const void *a, const void *b) {
    const miss *p = a;
    const miss *q = b;
    if (p->distance > q->distance) return -1;
    if (p->distance < q->distance) return 1;
    return p->vertex < q->vertex ? -1 : p->vertex > q->vertex;
}

static uint32_t nearest_vertex(const fit *f, const double x[3], const double facing[3]) {
    uint32_t best = UINT32_MAX;
    double nearest = HUGE_VAL;
    for (uint32_t v = 0; v < f->m->vertices; v++) {
        double d = v_distance(x, f->m->x[v]);
        if (d >= nearest || v_dot(facing, f->facing[v]) < FACING_COSINE) continue;
        nearest = d;
        best = v;
    }
    return best;
}

/* The original vertices farther than that from the mesh, the farthest first. */
static uint32_t find_misses(const fit *f, const mesh *original, double tolerance, miss *list) {
    uint32_t count = 0;
    bvh *b = bvh_build(f->m);
    for (uint32_t v = 0; v < original->vertices; v++) {
        double point[3];
        const double d = bvh_closest(b, original->x[v], NULL, 0, point, NULL);
        if (d > tolerance) list[count++] = (miss){d, v};
    }
    bvh_free(b);
    qsort(list, count, sizeof *list, compare_misses);
    return count;
}

void fit_reach_features(const fit *f, const mesh *original) {
    double tolerance = FEATURE_TOLERANCE * mesh_diagonal(original);
    double spacing = mesh_mean_edge(f->m);
    miss *list = allocate(original->vertices, sizeof *list);
    for (int round = 0; round < FEATURE_ROUNDS; round++) {
        uint32_t count = find_misses(f, original, tolerance, list), taken = 0;
        for (uint32_t i = 0; i < count; i++) {
            const double *x = original->x[list[i].vertex];
            bool covered = false;
            for (uint32_t k = 0; k < taken && !covered; k++) {
                covered = v_distance(x, original->x[list[k].vertex]) < 3 * spacing;
            }
            if (covered) continue;
            list[taken++] = list[i];
            double point[3], facing[3];
            (void)bvh_closest(f->surface, x, NULL, 0, point, facing);
            uint32_t v = nearest_vertex(f, x, facing);
            if (v == UINT32_MAX) continue;
            memcpy(f->m->x[v], x, sizeof point);
            memcpy(f->facing[v], facing, sizeof facing);
            f->pinned[v] = true;
        }
        if (taken == 0) break;
        for (int step = 0; step < 4; step++) fit_relax_all(f);
    }
    free(list);
}

/* A triangle is flipped when it faces against the sum of its three neighbours. */
static uint32_t find_bad(const mesh *m, double smallest_angle_deg, bool *bad) {
    uint32_t edges, flipped = 0;
    mesh_edge *e = mesh_edges(m, &edges);
    double(*normal)[3] = allocate(m->triangles, sizeof *normal);
    double(*sum)[3] = allocate(m->triangles, sizeof *sum);
    for (uint32_t i = 0; i < m->triangles; i++) {
        const uint32_t *t = m->t[i];
        triangle_normal(m->x[t[0]], m->x[t[1]], m->x[t[2]], normal[i]);
        v_normalize(normal[i]);
    }
    for (uint32_t i = 0; i < edges; i++) {
        uint32_t a = e[i].triangle[0], b = e[i].triangle[1];
        for (int k = 0; k < 3; k++) {
            sum[a][k] += normal[b][k];
            sum[b][k] += normal[a][k];
        }
    }
    for (uint32_t i = 0; i < m->triangles; i++) {
        bool against = v_dot(normal[i], sum[i]) < 0;
        flipped += against ? 1 : 0;
        if (bad == NULL) continue;
        mesh one = {.vertices = m->vertices, .triangles = 1, .x = m->x, .t = m->t + i};
        bad[i] = against || mesh_smallest_angle_deg(&one) < smallest_angle_deg;
    }
    free(sum);
    free(normal);
    free(e);
    return flipped;
}

static void spread(const fit *f, bool *move) {
    bool *old = allocate(f->m->vertices, sizeof *old);
    memcpy(old, move, f->m->vertices * sizeof *old);
    for (uint32_t v = 0; v < f->m->vertices; v++) {
        for (uint32_t i = f->offset[v]; old[v] && i < f->offset[v + 1]; i++)
            move[f->ring[i]] = true;
    }
    free(old);
}

/* A last resort where the surface itself is folded: smoothing in space, off the surface. */
static void unfold(const fit *f, const bool *bad) {
    for (uint32_t i = 0; i < f->m->triangles; i++) {
        for (int k = 0; k < 3 && bad[i]; k++) {
            uint32_t v = f->m->t[i][k];
            double mean[3] = {0};
            double n = f->offset[v + 1] - f->offset[v];
            for (uint32_t r = f->offset[v]; r < f->offset[v + 1]; r++) {
                for (int c = 0; c < 3; c++) mean[c] += f->m->x[f->ring[r]][c] / n;
            }
            memcpy(f->m->x[v], mean, sizeof mean);
        }
    }
}

void fit_repair(const fit *f, double smallest_angle_deg) {
    const mesh *m = f->m;
    bool *bad = allocate(m->triangles, sizeof *bad);
    bool *move = allocate(m->vertices, sizeof *move);
    double(*best)[3] = allocate(m->vertices, sizeof *best);
    uint32_t fewest = UINT32_MAX;
    for (int step = 0; step < REPAIR_STEPS; step++) {
        uint32_t count = 0;
        (void)find_bad(m, smallest_angle_deg, bad);
        memset(move, 0, m->vertices * sizeof *move);
        for (uint32_t i = 0; i < m->triangles; i++) {
            for (int k = 0; k < 3 && bad[i]; k++) move[m->t[i][k]] = true;
            count += bad[i] ? 1 : 0;
        }
        if (count < fewest) {
            fewest = count;
            memcpy(best, m->x, m->vertices * sizeof *best);
        }
        if (count == 0) break;
        for (int ring = 0; ring < step / 8; ring++) spread(f, move);
        for (int sweep = 0; sweep < 4; sweep++) {
            for (uint32_t v = 0; v < m->vertices; v++) {
                if (move[v] && !(f->pinned[v] && step < REPAIR_STEPS / 2)) relax(f, v, 0.6);
            }
        }
    }
    memcpy(m->x, best, m->vertices * sizeof *best);
    for (int step = 0; step < REPAIR_STEPS && find_bad(m, 0, bad) > 0; step++) unfold(f, bad);
    free(best);
    free(move);
    free(bad);
}

static void unit_normal(const mesh *m, uint32_t triangle, double n[3]) {
    const uint32_t *t = m->t[triangle];
    triangle_normal(m->x[t[0]], m->x[t[1]], m->x[t[2]], n);
    v_normalize(n);
}

/* Whether a triangle faces against the sum of its three neighbours, as find_bad has it. */
static bool is_flipped(const mesh *m, const uint32_t *across, uint32_t triangle) {
    double n[3], sum = 0;
    unit_normal(m, triangle, n);
    for (size_t k = 0; k < 3; k++) {
        double beside[3];
        unit_normal(m, across[3 * (size_t)triangle + k], beside);
        sum += v_dot(n, beside);
    }
    return sum < 0;
}

typedef struct {
    double angle_deg; /* the smallest */
    uint32_t flipped; /* counted once for each way to them */
} star_shape;

/* Of the triangles around v and those beside them. */
static star_shape shape_of_star(const mesh *m, const uint32_t *across, const uint32_t *offset,
                                const uint32_t *star, uint32_t v) {
    star_shape s = {.angle_deg = 180};
    for (uint32_t i = offset[v]; i < offset[v + 1]; i++) {
        const uint32_t triangle = star[i];
        mesh one = {.vertices = m->vertices, .triangles = 1, .x = m->x, .t = m->t + triangle};
        s.angle_deg = fmin(s.angle_deg, mesh_smallest_angle_deg(&one));
        s.flipped += is_flipped(m, across, triangle);
        for (size_t k = 0; k < 3; k++)
            s.flipped += is_flipped(m, across, across[3 * (size_t)triangle + k]);
    }
    return s;
}

typedef struct {
    const fit *f;
    uint32_t *across, *offset, *star; /* triangles beyond each side, around each vertex */
} rims;

/* A vertex and those around it, as they were. */
typedef struct {
    uint32_t vertex[MOST_AROUND], count;
    double x[MOST_AROUND][3], facing[MOST_AROUND][3];
} kept_star;

static bool keep_star(const fit *f, uint32_t v, kept_star *k) {
    if (f->offset[v + 1] - f->offset[v] >= MOST_AROUND) return false;
    k->count = 1;
    k->vertex[0] = v;
    for (uint32_t i = f->offset[v]; i < f->offset[v + 1]; i++) k->vertex[k->count++] = f->ring[i];
    for (uint32_t i = 0; i < k->count; i++) {
        memcpy(k->x[i], f->m->x[k->vertex[i]], sizeof k->x[i]);
        memcpy(k->facing[i], f->facing[k->vertex[i]], sizeof k->facing[i]);
    }
    return true;
}

static void restore_star(const fit *f, const kept_star *k) {
    for (uint32_t i = 0; i < k->count; i++) {
        memcpy(f->m->x[k->vertex[i]], k->x[i], sizeof k->x[i]);
        memcpy(f->facing[k->vertex[i]], k->facing[i], sizeof k->facing[i]);
    }
}

/* Over all stars of those. */
static star_shape shape_around(const rims *r, const kept_star *k) {
    star_shape all = {.angle_deg = 180};
    for (uint32_t i = 0; i < k->count; i++) {
        const star_shape s = shape_of_star(r->f->m, r->across, r->offset, r->star, k->vertex[i]);
        all.angle_deg = fmin(all.angle_deg, s.angle_deg);
        all.flipped += s.flipped;
    }
    return all;
}

/* Takes vertex v to x, alone or with those around it evened out, unless a triangle there turns over
 * or becomes a needle. */
static bool take_to(const rims *r, uint32_t v, const double x[3], const double facing[3]) {
    const fit *f = r->f;
    kept_star kept;
    if (!keep_star(f, v, &kept)) return false;
    const star_shape was = shape_around(r, &kept);
    memcpy(f->m->x[v], x, sizeof kept.x[0]);
    memcpy(f->facing[v], facing, sizeof kept.facing[0]);
    for (int sweep = 0; sweep <= RIM_SWEEPS; sweep++) {
        const star_shape is = shape_around(r, &kept);
        if (is.flipped <= was.flipped && is.angle_deg >= fmin(RIM_ANGLE_DEG, was.angle_deg))
            return true;
        for (uint32_t i = 1; i < kept.count && sweep < RIM_SWEEPS; i++)
            relax(f, kept.vertex[i], 0.5);
    }
    restore_star(f, &kept);
    return false;
}

/* Back to `before` at triangles that cross others now and did not then, and around them, until there
 * are none. */
static void undo_crossings(const fit *f, double (*before)[3]) {
    mesh *m = f->m;
    double(*now)[3] = m->x;
    m->x = before;
    uint8_t *was = mesh_crossings(m);
    m->x = now;
    bool *back = allocate(m->vertices, sizeof *back);
    for (bool any = true; any;) {
        uint8_t *cut = mesh_crossings(m);
        any = false;
        for (uint32_t i = 0; i < m->triangles; i++) {
            for (int k = 0; k < 3 && cut[i] > was[i]; k++) {
                const uint32_t v = m->t[i][k];
                any = any || memcmp(m->x[v], before[v], sizeof *before) != 0;
                back[v] = true;
            }
        }
        free(cut);
        spread(f, back);
        for (uint32_t v = 0; v < m->vertices; v++) {
            if (back[v]) memcpy(m->x[v], before[v], sizeof *before);
        }
    }
    free(was);
    free(back);
}

void fit_reach_rims(const fit *f, const mesh *original) {
    const double tolerance =
        fmax(RIM_SPACINGS * mesh_mean_edge(f->m), RIM_TOLERANCE * mesh_diagonal(original));
    rims r = {.f = f, .across = mesh_across(f->m)};
    miss *list = allocate(original->vertices, sizeof *list);
    uint8_t *tried = allocate(f->m->vertices, 1);
    double(*before)[3] = allocate(f->m->vertices, sizeof *before);
    memcpy(before, f->m->x, f->m->vertices * sizeof *before);
    mesh_stars(f->m, &r.offset, &r.star);
    for (int round = 0; round < RIM_ROUNDS; round++) {
        uint32_t count = find_misses(f, original, tolerance, list), taken = 0;
        memset(tried, 0, f->m->vertices);
        for (uint32_t i = 0; i < count; i++) {
            const double *x = original->x[list[i].vertex];
            double facing[3], point[3];
            (void)bvh_closest(f->surface, x, NULL, 0, point, facing);
            const uint32_t v = nearest_vertex(f, x, facing);
            if (v == UINT32_MAX || tried[v] != 0) continue;
            tried[v] = 1;
            taken += take_to(&r, v, x, facing);
        }
        if (taken == 0) break;
    }
    undo_crossings(f, before);
    void *owned[] = {list, tried, before, r.across, r.offset, r.star};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
}

uint32_t mesh_flipped(const mesh *m) { return find_bad(m, 0, NULL); }
