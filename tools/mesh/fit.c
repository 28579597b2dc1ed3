/* SPDX-License-Identifier: MIT */
#include "tools/mesh/fit.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define REPAIR_STEPS 40
#define FEATURE_ROUNDS 6
#define FEATURE_TOLERANCE 0.015 /* over the diagonal */
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

void fit_relax(const fit *f, uint32_t v, double fraction) {
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
        if (!f->pinned[v]) fit_relax(f, v, 0.5);
    }
}

static int compare_misses(const void *a, const void *b) {
    const miss *p = a;
    const miss *q = b;
    if (p->distance > q->distance) return -1;
    if (p->distance < q->distance) return 1;
    return p->vertex < q->vertex ? -1 : p->vertex > q->vertex;
}

uint32_t fit_nearest_vertex(const fit *f, const double x[3], const double facing[3]) {
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

uint32_t fit_misses(const fit *f, const mesh *original, double tolerance, miss *list,
                    uint32_t among) {
    uint32_t count = 0;
    bvh *b = bvh_build(f->m);
    for (uint32_t i = 0; i < (among > 0 ? among : original->vertices); i++) {
        const uint32_t v = among > 0 ? list[i].vertex : i;
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
        uint32_t count = fit_misses(f, original, tolerance, list, 0), taken = 0;
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
            uint32_t v = fit_nearest_vertex(f, x, facing);
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

bool fit_is_flipped(const mesh *m, const uint32_t *across, uint32_t triangle) {
    double n[3], sum = 0;
    mesh_unit_normal(m, triangle, n);
    for (size_t k = 0; k < 3; k++) {
        double beside[3];
        mesh_unit_normal(m, across[3 * (size_t)triangle + k], beside);
        sum += v_dot(n, beside);
    }
    return sum < 0;
}

/* Marks flipped triangles and needles; returns how many are flipped. */
static uint32_t find_bad(const fit *f, double smallest_angle_deg, bool *bad) {
    uint32_t flipped = 0;
    for (uint32_t i = 0; i < f->m->triangles; i++) {
        const bool against = fit_is_flipped(f->m, f->across, i);
        flipped += against ? 1 : 0;
        bad[i] = against || mesh_triangle_angle_deg(f->m, i) < smallest_angle_deg;
    }
    return flipped;
}

void fit_spread(const fit *f, bool *move) {
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
        (void)find_bad(f, smallest_angle_deg, bad);
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
        for (int ring = 0; ring < step / 8; ring++) fit_spread(f, move);
        for (int sweep = 0; sweep < 4; sweep++) {
            for (uint32_t v = 0; v < m->vertices; v++) {
                if (move[v] && !(f->pinned[v] && step < REPAIR_STEPS / 2)) fit_relax(f, v, 0.6);
            }
        }
    }
    memcpy(m->x, best, m->vertices * sizeof *best);
    for (int step = 0; step < REPAIR_STEPS && find_bad(f, 0, bad) > 0; step++) unfold(f, bad);
    free(best);
    free(move);
    free(bad);
}

uint32_t mesh_flipped(const mesh *m) {
    uint32_t *across = mesh_across(m), flipped = 0;
    for (uint32_t i = 0; i < m->triangles; i++) flipped += fit_is_flipped(m, across, i) ? 1 : 0;
    free(across);
    return flipped;
}
