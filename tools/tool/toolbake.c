/* SPDX-License-Identifier: MIT */
#include "tools/tool/toolbake.h"
#include "core/contact/tool_field.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include "tools/bake/blobwrite.h"
#include "tools/mesh/bvh.h"
#include "tools/tool/inside.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define OFF_LOOKS 1000 /* directions in which extremes are held against the mesh */
#define MARGIN 3       /* steps of the grid beyond the surface */
#define ASIDE 1e-3     /* steps: just outside */
#define PROBES 20000   /* places at which the field is compared */
#define DEEP 0.2       /* steps below the surface, from which a part is certainly seen */
#define SEEN 0.3       /* of the depth under the surface that the field must have */
#define WITHIN 1.5     /* steps in which that is looked for */
#define BLIND 0.002    /* share of the surface that may be missed */
#define RADIUS_STEP 0.25
#define LARGEST_RADIUS 3.0 /* steps */

typedef struct {
    const mesh *m;
    mesh outer;      /* its triangles that do not lie inside it altogether */
    const bvh *near; /* of these */
    place_grid grid;
    uint8_t *inside;
    double *distance; /* then coefficients */
    int16_t *sample;
    palp_tool_field field;
} baking;

/* ---- what lies inside ---- */

/* Whether a place of a triangle, just outside it, lies in the mesh: where components cross. */
static bool is_covered(const baking *b, const double x[3], const double n[3]) {
    double out[3];
    for (int k = 0; k < 3; k++) out[k] = x[k] + ASIDE * b->grid.step * n[k];
    return mesh_holds(b->m, out);
}

typedef struct {
    const baking *b;
    uint8_t *covered;
} search;

static void look_at(void *context, size_t t) {
    const search *s = context;
    const mesh *m = s->b->m;
    double n[3], middle[3];
    mesh_unit_normal(m, (uint32_t)t, n);
    for (int k = 0; k < 3; k++)
        middle[k] = (m->x[m->t[t][0]][k] + m->x[m->t[t][1]][k] + m->x[m->t[t][2]][k]) / 3;
    s->covered[t] = is_covered(s->b, middle, n) ? 1 : 0;
    for (int c = 0; c < 3 && s->covered[t] != 0; c++) {
        double x[3];
        for (int k = 0; k < 3; k++) x[k] = 0.98 * m->x[m->t[t][c]][k] + 0.02 * middle[k];
        s->covered[t] = is_covered(s->b, x, n) ? 1 : 0;
    }
}

static void leave_out_covered(baking *b) {
    search s = {b, allocate(b->m->triangles, 1)};
    parallel_for(b->m->triangles, look_at, &s);
    b->outer = mesh_copy(b->m);
    uint32_t kept = 0;
    for (uint32_t t = 0; t < b->m->triangles; t++) {
        if (s.covered[t] == 0) memcpy(b->outer.t[kept++], b->m->t[t], sizeof b->m->t[t]);
    }
    b->outer.triangles = kept;
    free(s.covered);
}

/* ---- samples ---- */

static size_t samples_of(const place_grid *g) {
    return (size_t)g->count[0] * g->count[1] * g->count[2];
}

/* A grid around the mesh with so many cells along its longest side. */
static place_grid grid_around(const mesh *m, double cells, double beyond_m) {
    double low[3], high[3], longest = 0;
    place_grid g;
    mesh_bounds(m, low, high);
    for (int k = 0; k < 3; k++) longest = fmax(longest, high[k] - low[k]);
    g.step = longest / cells;
    for (int k = 0; k < 3; k++) {
        const double margin = MARGIN * g.step + beyond_m;
        const double across = high[k] - low[k] + 2 * margin;
        g.count[k] = (uint32_t)ceil(across / g.step) + 1;
        g.origin[k] = 0.5 * (low[k] + high[k]) - 0.5 * g.step * (g.count[k] - 1);
    }
    return g;
}

/* The most cells that fit into TOOL_BYTES. */
static double cells_that_fit(const mesh *m, double beyond_m) {
    double low = TOOL_LEAST_CELLS, high = TOOL_MOST_CELLS;
    while (high - low > 0.5) {
        const double middle = 0.5 * (low + high);
        const place_grid g = grid_around(m, middle, beyond_m);
        *(sizeof(int16_t) * (double)samples_of(&g) > TOOL_BYTES ? &high : &low) = middle;
    }
    return floor(low);
}

static void measure_row(void *context, size_t row) {
    baking *b = context;
    const place_grid *g = &b->grid;
    const size_t j = row % g->count[1], k = row / g->count[1];
    for (uint32_t i = 0; i < g->count[0]; i++) {
        const double x[3] = {g->origin[0] + g->step * i, g->origin[1] + g->step * (double)j,
                             g->origin[2] + g->step * (double)k};
        double at[3];
        const double d = bvh_closest(b->near, x, NULL, 0, at, NULL);
        const size_t place = row * g->count[0] + i;
        b->distance[place] = b->inside[place] != 0 ? -d : d;
    }
    progress_add(1);
}

/*
 * Coefficients of one line: c_(i-1)/8 + 3/4 c_i + c_(i+1)/8 = d_i, straight on beyond its ends, where
 * so c = d. Thomas' algorithm.
 */
static void solve_line(double *d, size_t stride, uint32_t count, double *upper) {
    upper[0] = 0;
    for (uint32_t i = 1; i + 1 < count; i++) {
        const double pivot = 0.75 - 0.125 * upper[i - 1];
        upper[i] = 0.125 / pivot;
        d[i * stride] = (d[i * stride] - 0.125 * d[(i - 1) * stride]) / pivot;
    }
    for (uint32_t i = count - 1; i-- > 1;) d[i * stride] -= upper[i] * d[(i + 1) * stride];
}

static void find_coefficients(baking *b) {
    const uint32_t *n = b->grid.count;
    const size_t plane = (size_t)n[0] * n[1];
    double *upper = allocate(samples_of(&b->grid), sizeof *upper);
    for (uint32_t k = 0; k < n[2]; k++) {
        for (uint32_t j = 0; j < n[1]; j++)
            solve_line(b->distance + k * plane + (size_t)j * n[0], 1, n[0], upper);
        for (uint32_t i = 0; i < n[0]; i++)
            solve_line(b->distance + k * plane + i, n[0], n[1], upper);
    }
    for (size_t p = 0; p < plane; p++) solve_line(b->distance + p, plane, n[2], upper);
    free(upper);
}

/* Rounds them, and makes the field of them as it will be read. */
static void quantise(baking *b) {
    const size_t samples = samples_of(&b->grid);
    double most = 0;
    for (size_t i = 0; i < samples; i++) most = fmax(most, fabs(b->distance[i]));
    const float unit = (float)(most / 32766.0);
    b->sample = allocate(samples, sizeof *b->sample);
    for (size_t i = 0; i < samples; i++)
        b->sample[i] = (int16_t)lrint(b->distance[i] / (double)unit);
    b->field = (palp_tool_field){
        .sample = b->sample,
        .count = {b->grid.count[0], b->grid.count[1], b->grid.count[2]},
        .origin_m = {(float)b->grid.origin[0], (float)b->grid.origin[1], (float)b->grid.origin[2]},
        .step_m = (float)b->grid.step,
        .unit_m = unit};
}

/* ---- how exact it is ---- */

/* A place of the surface and the normal there. */
typedef struct {
    double x[3], n[3];
} probe;

/* Evenly over the surface, the same each time. */
static probe *spread_probes(const mesh *m, size_t count) {
    double *upto = allocate(m->triangles + 1, sizeof *upto);
    probe *p = allocate(count, sizeof *p);
    for (uint32_t t = 0; t < m->triangles; t++) {
        double n[3];
        triangle_normal(m->x[m->t[t][0]], m->x[m->t[t][1]], m->x[m->t[t][2]], n);
        upto[t + 1] = upto[t] + v_norm(n);
    }
    uint32_t t = 0;
    for (size_t i = 0; i < count; i++) {
        const double at = ((double)i + 0.5) / (double)count * upto[m->triangles];
        while (t + 1 < m->triangles && upto[t + 1] <= at) t++;
        double u = fmod(0.5 + (double)i * 0.7548776662466927, 1),
               w = fmod(0.5 + (double)i * 0.5698402909980532, 1);
        if (u + w > 1) u = 1 - u, w = 1 - w;
        for (int k = 0; k < 3; k++)
            p[i].x[k] = (1 - u - w) * m->x[m->t[t][0]][k] + u * m->x[m->t[t][1]][k] +
                        w * m->x[m->t[t][2]][k];
        mesh_unit_normal(m, t, p[i].n);
    }
    free(upto);
    return p;
}

static double field_at(const baking *b, const probe *p, double out_m) {
    const palp_vec3 x = {(float)(p->x[0] + out_m * p->n[0]), (float)(p->x[1] + out_m * p->n[1]),
                         (float)(p->x[2] + out_m * p->n[2])};
    return (double)palp_tool_field_at(&b->field, x).distance_m;
}

/* Whether what lies under a place is too thin for the field: it does not go as deep as it should. */
static bool is_blind(const baking *b, const probe *p, double radius_m) {
    double deepest = HUGE_VAL, exact = 0;
    for (double down = 0.5; down <= WITHIN; down += 0.5)
        deepest = fmin(deepest, field_at(b, p, -down * b->grid.step) - radius_m);
    if (deepest < -DEEP * b->grid.step) return false;
    for (double down = 0.25; down <= WITHIN; down += 0.25) {
        double x[3], at[3];
        for (int k = 0; k < 3; k++) x[k] = p->x[k] - down * b->grid.step * p->n[k];
        const double d = bvh_closest(b->near, x, NULL, 0, at, NULL);
        if (d < exact) break; /* out at the other side */
        exact = d;
    }
    return deepest > -SEEN * (exact + radius_m);
}

/* Compares the field of a radius with the distances from the mesh at the surface that it has. */
static void compare(const baking *b, const probe *p, size_t count, double radius_m,
                    tool_report *r) {
    size_t blind = 0;
    r->radius_m = radius_m;
    r->error_mean_m = r->error_max_m = 0;
    for (size_t i = 0; i < count; i++) {
        double x[3], at[3];
        for (int k = 0; k < 3; k++) x[k] = p[i].x[k] + radius_m * p[i].n[k];
        const double exact = radius_m > 0 ? bvh_closest(b->near, x, NULL, 0, at, NULL) : 0;
        if (exact < radius_m * (1 - 1e-6)) continue; /* in a hollow: not on the surface */
        if (is_covered(b, p[i].x, p[i].n)) continue;
        const double off = fabs(field_at(b, &p[i], radius_m) - exact);
        blind += is_blind(b, &p[i], radius_m) ? 1 : 0;
        r->error_mean_m += off / (double)count;
        if (off <= r->error_max_m) continue;
        r->error_max_m = off;
        memcpy(r->worst, p[i].x, sizeof r->worst);
    }
    r->thin = (double)blind / (double)count;
}

/* The radius that was asked for, or the least that the field is exact with. */
static void choose_radius(const baking *b, const tool_options *o, tool_report *r) {
    probe *p = spread_probes(&b->outer, PROBES);
    if (o->radius_given) {
        compare(b, p, PROBES, o->radius_m, r);
    } else {
        for (double steps = 0; steps <= LARGEST_RADIUS; steps += RADIUS_STEP) {
            compare(b, p, PROBES, steps * b->grid.step, r);
            if (r->error_max_m <= TOOL_ERROR * r->diagonal_m && r->thin <= TOOL_BLIND) break;
        }
    }
    free(p);
}

/* ---- all together ---- */

/* Radius of the largest ball inside, as the samples see it. */
static double largest_ball(const baking *b, double radius_m) {
    int lowest = 0;
    for (size_t i = 0; i < samples_of(&b->grid); i++)
        lowest = b->sample[i] < lowest ? b->sample[i] : lowest;
    return fmax(-(double)b->field.unit_m * lowest, 0.5 * b->grid.step) + radius_m;
}

/* Direction k of `count` spread over the sphere. */
static void spread(uint32_t k, uint32_t count, double d[3]) {
    const double turn = 2.399963229728653; /* golden angle */
    const double z = 1 - (2.0 * k + 1) / count, r = sqrt(1 - z * z);
    d[0] = r * cos(turn * k);
    d[1] = r * sin(turn * k);
    d[2] = z;
}

static uint32_t outermost(const mesh *m, const double d[3]) {
    uint32_t best = 0;
    for (uint32_t v = 1; v < m->vertices; v++)
        best = v_dot(m->x[v], d) > v_dot(m->x[best], d) ? v : best;
    return best;
}

/* The vertices of the mesh that lie outermost in directions spread over the sphere, each once, as the device
 * holds them; returns how many. */
static uint32_t find_extremes(const mesh *m, const double reference[3],
                              float extreme[PALP_TOOL_EXTREMES][3], float *off_m) {
    uint32_t vertex[PALP_TOOL_EXTREMES], count = 0;
    double off = 0;
    for (uint32_t k = 0; k < PALP_TOOL_EXTREMES; k++) {
        double d[3];
        spread(k, PALP_TOOL_EXTREMES, d);
        const uint32_t best = outermost(m, d);
        uint32_t i = 0;
        while (i < count && vertex[i] != best) i++;
        if (i < count) continue;
        for (int e = 0; e < 3; e++) extreme[count][e] = (float)(m->x[best][e] - reference[e]);
        vertex[count++] = best;
    }
    for (uint32_t k = 0; k < OFF_LOOKS; k++) {
        double d[3], most = -1e300;
        spread(k, OFF_LOOKS, d);
        for (uint32_t i = 0; i < count; i++) most = fmax(most, v_dot(m->x[vertex[i]], d));
        off = fmax(off, v_dot(m->x[outermost(m, d)], d) - most);
    }
    *off_m = (float)(1.1 * off); /* between the directions that were looked at */
    return count;
}

uint8_t *tool_bake(const mesh *m, const tool_options *o, const uint8_t sha[32], tool_report *r,
                   size_t *bytes) {
    baking b = {.m = m};
    const double beyond = o->radius_given ? o->radius_m : 0;
    const double cells = o->cells > 0 ? o->cells : cells_that_fit(m, beyond);
    b.grid = grid_around(m, cells, beyond);
    *r = (tool_report){.diagonal_m = mesh_diagonal(m), .step_m = b.grid.step};
    mesh_extent(m, r->size);
    memcpy(r->count, b.grid.count, sizeof r->count);
    const size_t rows = (size_t)b.grid.count[1] * b.grid.count[2];
    leave_out_covered(&b);
    bvh *near = bvh_build(&b.outer);
    b.near = near;
    b.inside = mesh_inside(m, &b.grid);
    b.distance = allocate(samples_of(&b.grid), sizeof *b.distance);
    progress_begin("distances", (double)rows);
    parallel_for(rows, measure_row, &b);
    progress_end();
    find_coefficients(&b);
    quantise(&b);
    choose_radius(&b, o, r);
    r->size_m = largest_ball(&b, r->radius_m);
    palp_tool_meta meta = {.step_m = b.field.step_m,
                           .unit_m = b.field.unit_m,
                           .radius_m = (float)r->radius_m,
                           .size_m = (float)r->size_m,
                           .error_max_m = (float)r->error_max_m};
    for (int k = 0; k < 3; k++) {
        meta.count[k] = b.grid.count[k];
        meta.origin_m[k] = (float)(b.grid.origin[k] - o->reference[k]);
    }
    memcpy(meta.mesh_sha256, sha, sizeof meta.mesh_sha256);
    float extreme[PALP_TOOL_EXTREMES][3];
    meta.extremes = find_extremes(m, o->reference, extreme, &meta.extreme_off_m);
    section_list l = {.count = 0};
    section_add(&l, PALP_SEC_TOOL, &meta, 1, sizeof meta);
    section_add(&l, PALP_SEC_TOOL_SAMPLE, b.sample, samples_of(&b.grid), sizeof *b.sample);
    section_add(&l, PALP_SEC_TOOL_EXTREME, extreme, meta.extremes, sizeof extreme[0]);
    uint8_t *out = blob_assemble(l.entry, l.data, l.count, bytes);
    void *owned[] = {b.inside, b.distance, b.sample};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    bvh_free(near);
    mesh_free(&b.outer);
    return out;
}
