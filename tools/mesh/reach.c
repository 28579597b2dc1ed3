/* SPDX-License-Identifier: MIT */
#include "tools/mesh/reach.h"
#include "port/host/util.h"
#include "tools/mesh/crossing.h"
#include <stdlib.h>
#include <string.h>

#define RIM_ROUNDS 6
#define ANGLE_DEG 5.0
#define SWEEPS 8
#define MOST_AROUND 64u
#define MOST_TRIANGLES 1024u /* around a vertex and its neighbours; more are not looked at */
#define RIM_SPACINGS 0.2     /* of the mesh: nearer is near enough */
#define RIM_TOLERANCE 0.0015 /* over the diagonal */

typedef struct {
    double angle_deg; /* the smallest */
    uint32_t flipped; /* or folded */
} star_shape;

/* Whether a triangle faces against the surface where that is nearest to its middle. */
static bool is_folded(const reach *r, uint32_t triangle) {
    const mesh *m = r->f->m;
    double middle[3], n[3], there[3];
    for (int k = 0; k < 3; k++)
        middle[k] =
            (m->x[m->t[triangle][0]][k] + m->x[m->t[triangle][1]][k] + m->x[m->t[triangle][2]][k]) /
            3;
    mesh_unit_normal(m, triangle, n);
    mesh_unit_normal(r->original, bvh_triangle(r->on, middle), there);
    return v_dot(n, there) < 0;
}

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

typedef struct {
    uint32_t list[MOST_TRIANGLES], count;
} triangle_set;

static void include(triangle_set *set, uint32_t triangle) {
    for (uint32_t i = 0; i < set->count; i++) {
        if (set->list[i] == triangle) return;
    }
    if (set->count < MOST_TRIANGLES) set->list[set->count++] = triangle;
}

/* Of the triangles around those vertices; whether one is flipped also of the triangles beside. */
static star_shape shape_around(const reach *r, const kept_star *k) {
    const mesh *m = r->f->m;
    star_shape s = {.angle_deg = 180};
    triangle_set set = {.count = 0};
    for (uint32_t i = 0; i < k->count; i++) {
        for (uint32_t t = r->offset[k->vertex[i]]; t < r->offset[k->vertex[i] + 1]; t++)
            include(&set, r->star[t]);
    }
    const uint32_t around = set.count;
    for (uint32_t i = 0; i < around; i++) {
        s.angle_deg = fmin(s.angle_deg, mesh_triangle_angle_deg(m, set.list[i]));
        s.flipped += r->folds && is_folded(r, set.list[i]) ? 1 : 0;
        for (size_t side = 0; side < 3; side++)
            include(&set, r->f->across[3 * (size_t)set.list[i] + side]);
    }
    for (uint32_t i = 0; i < set.count; i++)
        s.flipped += fit_is_flipped(m, r->f->across, set.list[i]) ? 1 : 0;
    return s;
}

bool reach_take(const reach *r, uint32_t v, const double x[3], const double facing[3]) {
    const fit *f = r->f;
    kept_star kept;
    if (r->held[v] || !keep_star(f, v, &kept)) return false;
    const star_shape was = shape_around(r, &kept);
    memcpy(f->m->x[v], x, sizeof kept.x[0]);
    memcpy(f->facing[v], facing, sizeof kept.facing[0]);
    for (int sweep = 0; sweep <= SWEEPS; sweep++) {
        const star_shape is = shape_around(r, &kept);
        if (is.flipped <= was.flipped && is.angle_deg >= fmin(ANGLE_DEG, was.angle_deg))
            return true;
        for (uint32_t i = 1; i < kept.count && sweep < SWEEPS; i++) {
            if (!r->held[kept.vertex[i]]) fit_relax(f, kept.vertex[i], 0.5);
        }
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
        fit_spread(f, back);
        for (uint32_t v = 0; v < m->vertices; v++) {
            if (back[v]) memcpy(m->x[v], before[v], sizeof *before);
        }
    }
    free(was);
    free(back);
}

reach reach_begin(const fit *f, const mesh *original) {
    reach r = {.f = f,
               .original = original,
               .on = bvh_build(original),
               .held = allocate(f->m->vertices, sizeof *r.held),
               .before = allocate(f->m->vertices, sizeof *r.before)};
    memcpy(r.before, f->m->x, f->m->vertices * sizeof *r.before);
    mesh_stars(f->m, &r.offset, &r.star);
    return r;
}

void reach_end(reach *r) {
    undo_crossings(r->f, r->before);
    bvh_free(r->on);
    void *owned[] = {r->offset, r->star, r->held, r->before};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
}

void reach_rims(const reach *r) {
    const fit *f = r->f;
    const mesh *original = r->original;
    const double tolerance =
        fmax(RIM_SPACINGS * mesh_mean_edge(f->m), RIM_TOLERANCE * mesh_diagonal(original));
    miss *list = allocate(original->vertices, sizeof *list);
    uint8_t *tried = allocate(f->m->vertices, 1);
    uint32_t count = 0;
    for (int round = 0; round < RIM_ROUNDS; round++) {
        uint32_t taken = 0;
        count = fit_misses(f, original, tolerance, list, count);
        memset(tried, 0, f->m->vertices);
        for (uint32_t i = 0; i < count; i++) {
            const double *x = original->x[list[i].vertex];
            double facing[3], point[3];
            (void)bvh_closest(f->surface, x, NULL, 0, point, facing);
            const uint32_t v = fit_nearest_vertex(f, x, facing);
            if (v == UINT32_MAX || tried[v] != 0) continue;
            tried[v] = 1;
            taken += reach_take(r, v, x, facing);
        }
        if (taken == 0) break;
    }
    free(list);
    free(tried);
}
