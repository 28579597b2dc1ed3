/* SPDX-License-Identifier: MIT */
/* Compression against error of every way to store the free-free block. */
#include "port/host/util.h"
#include "tools/bake/build.h"
#include "tools/bake/split.h"
#include "tools/study/baseline.h"
#include "tools/study/reproduce.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SCHEMES 6
#define MOST_POINTS 16
#define NESTED_LEAF 8     /* which compressed most of 8 to 32 .. */
#define NESTED_APART 0.01 /* .. and 0.01 to 1 */

typedef enum { WAVELETS, TRUNCATED, HALVES, LOW_RANK, NESTED, SPLIT } scheme;
static const char *const scheme_name[SCHEMES] = {"lifted linear wavelets", "truncated dense",
                                                 "dense in halves",        "block low rank",
                                                 "nested bases",           "split form"};

typedef struct {
    size_t count;
    double rms[MOST_POINTS], compression[MOST_POINTS], patch[MOST_POINTS];
    double worst_column[MOST_POINTS], worst_own[MOST_POINTS]; /* of the split form */
} curve;

static void add_point(curve *c, baseline_result r) {
    if (c->count == MOST_POINTS) return;
    c->rms[c->count] = r.rms;
    c->compression[c->count] = r.compression;
    c->patch[c->count++] = r.work_patch;
}

/* Log-linear between the points next to an RMS error; 0 outside. */
static double compression_at(const curve *c, double rms) {
    double best = 0;
    for (size_t i = 0; i < c->count; i++) {
        for (size_t k = 0; k < c->count; k++) {
            if (!(c->rms[i] <= rms && c->rms[k] >= rms)) continue;
            const double span = log(c->rms[k] / c->rms[i]);
            const double share = span > 0 ? log(rms / c->rms[i]) / span : 0;
            const double got =
                c->compression[i] * pow(c->compression[k] / c->compression[i], share);
            if (c->compression[k] >= c->compression[i]) best = fmax(best, got);
        }
        if (c->rms[i] <= rms) best = fmax(best, c->compression[i]);
    }
    return best;
}

/* The free-free block, nodes in the mesh's order. */
static baseline_matrix dense_of(const study_case *c) {
    const size_t n = free_nodes(c);
    double *g = allocate_aligned(9 * n * n, sizeof *g), (*x)[3] = allocate(n, sizeof *x);
    uint32_t *node = allocate(n, sizeof *node);
    size_t k = 0;
    for (uint32_t i = 0; i < c->m.vertices; i++) {
        if (c->fixed[i] != 0) continue;
        memcpy(x[k], c->m.x[i], sizeof *x);
        node[k++] = i;
    }
    for (size_t i = 0; i < 3 * n; i++) {
        for (size_t j = 0; j < 3 * n; j++)
            g[i * 3 * n + j] = greens_row(&c->g, node[i / 3], i % 3)[3 * node[j / 3] + j % 3];
    }
    free(node);
    return (baseline_matrix){.g = g, .x = (const double(*)[3])x, .n = n};
}

/* With so many modes of those that were found. */
static void add_split(curve *points, const split_body *body, uint32_t modes, double epsilon) {
    const regular_data *all = body->regular;
    const size_t nodes = body->m->vertices, n = body->free->slots;
    regular_data some = {.modes = modes, .value = all->value};
    some.vector = allocate(3 * nodes * modes, sizeof *some.vector);
    for (size_t i = 0; i < 3 * nodes; i++)
        memcpy(some.vector + i * modes, all->vector + i * all->modes, modes * sizeof *some.vector);
    split_body with = *body;
    with.regular = &some;
    const compress_options options = {.epsilon = epsilon, .half = true};
    split_data d = split_build(&with, &options);
    const double column =
        8 + (double)d.columns.offset[n] / (double)n * (2 * PALP_GROUP_VALUES + 2 * PALP_LANES);
    const double bases = 6 * (double)(n * modes), dense = 36 * (double)(n * n);
    if (points->count < MOST_POINTS) {
        points->worst_column[points->count] = d.worst_column;
        points->worst_own[points->count] = d.worst_own;
    }
    add_point(points, (baseline_result){.compression = dense / (bases + (double)n * column),
                                        .rms = d.columns.rms,
                                        .work_patch = (bases + BASELINE_PATCH * column) /
                                                      (36 * (double)n * BASELINE_PATCH)});
    columns_free(&d.columns);
    free(some.vector);
}

static void split_curve(curve *points, const study_case *c) {
    static const uint32_t modes[] = {8, 16, 32, 56, 128};
    static const double epsilons[] = {0.1, 0.05, 0.02};
    domains d = domains_build(&c->m, c->fixed, c->area, (wavelet){WAVELET_LINEAR, true});
    double(*normal)[3] = allocate(c->m.vertices, sizeof *normal);
    double *area = allocate(c->m.vertices, sizeof *area);
    mesh_nodal(&c->m, area, normal);
    const half_space_material material = {c->young_Pa, c->poisson};
    const palp_domain *free_nodes_of = &d.domain[PALP_FREE].view;
    const regular_body surface = {.m = &c->m,
                                  .area = area,
                                  .normal = normal,
                                  .material = material,
                                  .h = &d.h,
                                  .level = free_nodes_of->levels - 1,
                                  .averaged = c->g.averaged};
    size_t *first = allocate(free_nodes_of->slots, sizeof *first);
    for (size_t j = 0; j < free_nodes_of->slots; j++) first[j] = 3 * (size_t)free_nodes_of->node[j];
    double *x = hierarchy_columns(&d.h, surface.level, surface.level, c->g.m, c->g.width, first,
                                  3 * (size_t)c->g.nodes);
    regular_data regular = regular_build(&surface, x, modes[4]);
    const split_body body = {.m = &c->m,
                             .normal = normal,
                             .material = material,
                             .g = &c->g,
                             .free = free_nodes_of,
                             .regular = &regular};
    for (size_t k = 0; k < 5; k++) {
        for (size_t e = 0; e < 3; e++) add_split(points, &body, modes[k], epsilons[e]);
    }
    regular_free(&regular);
    domains_free(&d);
    void *owned[] = {normal, area, first, x};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
}

/* Those of equal RMS error or less that compress more are drawn; so is their line, by error. */
static size_t best_points(const curve *c, double *x, double *y) {
    size_t count = 0;
    double last = 0;
    for (size_t done = 0; done < c->count; done++) {
        size_t next = c->count;
        for (size_t i = 0; i < c->count; i++) {
            const bool later = count == 0 || c->rms[i] > last;
            if (later && (next == c->count || c->rms[i] < c->rms[next])) next = i;
        }
        if (next == c->count) break;
        last = c->rms[next];
        if (count > 0 && c->compression[next] <= x[count - 1]) continue;
        x[count] = c->compression[next];
        y[count++] = last;
    }
    return count;
}

static void write_points(const work *w, const curve *all) {
    output csv =
        begin_csv(w, "compressions.csv",
                  "method,rms,compression,share_of_40_columns,worst_column,worst_own_block");
    for (size_t s = 0; s < SCHEMES; s++) {
        for (size_t i = 0; i < all[s].count; i++)
            fprintf(csv.file, "%s,%.4g,%.4g,%.4g,%.4g,%.4g\n", scheme_name[s], all[s].rms[i],
                    all[s].compression[i], all[s].patch[i], all[s].worst_column[i],
                    all[s].worst_own[i]);
    }
    commit_output(&csv);
}

static void draw(const work *w, const curve *all) {
    double x[SCHEMES][MOST_POINTS], y[SCHEMES][MOST_POINTS];
    plot_series series[SCHEMES];
    for (size_t s = 0; s < SCHEMES; s++) {
        series[s] = (plot_series){.count = best_points(&all[s], x[s], y[s]), .x = x[s], .y = y[s]};
        snprintf(series[s].name, sizeof series[s].name, "%s", scheme_name[s]);
        series[s].dots = s == HALVES;
    }
    const plot_chart p = {.title = "RMS error against compression, every way to store",
                          .x_label = "compression (bytes of dense floats over bytes)",
                          .y_label = "RMS error (MR 70)",
                          .log_x = true,
                          .log_y = true,
                          .series = series,
                          .count = SCHEMES};
    add_plot(w, "compressions.svg", &p);
}

void compare_compressions(work *w, const study_point *wavelets) {
    static curve all[SCHEMES];
    const study_case *c = &w->small[CASES - 1];
    baseline_matrix m = dense_of(c);
    double norm2 = 0;
    for (size_t k = 0; k < 9 * m.n * m.n; k++) norm2 += m.g[k] * m.g[k];
    begin_figure(
        w, "Do wavelets pay? Every way to store the Green's functions, L = 4",
        "no such comparison. Bytes with indices; wavelets, truncated blocks, block low rank "
        "and nested bases in floats (in halves they would take half), the split form in "
        "halves and 16-bit modes. Block low rank, nested bases and the split form use that "
        "the matrix is symmetric.");
    add_point(&all[HALVES], baseline_half(&m));
    for (size_t e = 1; e < STUDY_EPSILONS; e += 2) {
        const double rms = wavelets[e].rms, kept = wavelets[e].compression;
        add_point(&all[WAVELETS], (baseline_result){kept * 36 / 38, rms, 1 / kept, 1 / kept});
        add_point(&all[TRUNCATED], baseline_truncated(&m, rms));
        add_point(&all[LOW_RANK], baseline_low_rank(&m, 32, rms));
    }
    for (double drop = 3e-2; drop > 4e-4; drop /= 2.5)
        add_point(&all[NESTED],
                  baseline_nested(&m, NESTED_LEAF, NESTED_APART, drop * sqrt(norm2 / 100)));
    split_curve(&all[SPLIT], c);
    write_points(w, all);
    fprintf(w->page, "<table><tr><th>way<th>at 0.5 %% RMS<th>at 1.8 %% RMS</tr>\n");
    for (size_t s = 0; s < SCHEMES; s++) {
        const double fine = compression_at(&all[s], 0.005), rough = compression_at(&all[s], 0.018);
        fprintf(w->page, "<tr><td>%s<td>%.1f<td>%.1f</tr>\n", scheme_name[s], fine, rough);
        printf("  %-22s %6.1f times at 0.5 %% RMS, %6.1f at 1.8 %%\n", scheme_name[s], fine, rough);
    }
    fprintf(w->page, "</table>\n<table><tr><th>split form<th>RMS<th>times<th>worst column<th>worst "
                     "own block</tr>\n");
    const curve *ours = &all[SPLIT];
    for (size_t i = 0; i < ours->count; i++)
        fprintf(w->page, "<tr><td><td>%.4f<td>%.1f<td>%.3f<td>%.5f</tr>\n", ours->rms[i],
                ours->compression[i], ours->worst_column[i], ours->worst_own[i]);
    fprintf(w->page, "</table>\n");
    draw(w, all);
    free((void *)(uintptr_t)m.g);
    free((void *)(uintptr_t)m.x);
}
