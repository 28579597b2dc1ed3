/* SPDX-License-Identifier: MIT */
/* The tables and figures of the multiresolution paper from our own models, beside its own figures.
 */
#include "tools/bake/body.h"
#include "core/green/hierarchy.h"
#include "port/host/parallel.h"
#include "tools/study/reproduce.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const char help[] =
    "usage: palp reproduce [SMALL.model LARGE.model] [--dynamic MODEL] [-o DIR]\n"
    "\n"
    "Tables I-III and figures 9 and 14-21 of James and Pai's multiresolution paper: SMALL is baked "
    "with two fewer,\n"
    "one fewer and as many Loop steps as it says, LARGE with coarse constraint levels only. DIR "
    "(default: reproduce)\n"
    "gets index.html, and one CSV and SVG per figure. Takes about ten minutes on two cores.\n"
    "With a dynamic MODEL also (or only) figures 4-6 and the speed-up of Debunne et al.\n";

static const option options[] = {{"-o", 1}, {"--dynamic", 1}, {NULL, 0}};

typedef struct {
    const char *model[2], *folder, *dynamic;
    int models;
} reproduce_spec;

static void set_option(void *context, const argument *a) {
    reproduce_spec *s = context;
    if (a->option != NULL && strcmp(a->option, "--dynamic") == 0) {
        s->dynamic = a->value[0];
    } else if (a->option != NULL) {
        s->folder = a->value[0];
    } else if (s->models < 2) {
        s->model[s->models++] = a->value[0];
    } else {
        die(EXIT_USAGE, "two models, not also '%s'", a->value[0]);
    }
}

static void take_body_option(void *context, const argument *a) { (void)body_option(context, a); }

/* ---- models ---- */

static study_case bake_case(const char *path, uint32_t fewer, bool coarse) {
    static const option keys[] = {
        BODY_OPTIONS, {"--epsilon", 1}, {"--constraint-level", 1}, {NULL, 0}};
    body_spec body = body_defaults;
    body.folder = body_folder(path);
    args_parse_file(path, keys, take_body_option, &body);
    body_require(&body);
    if (body.mesh_path == NULL || body.loop <= fewer)
        die(EXIT_USAGE, "%s: needs 'mesh FILE' and 'loop N' with N above %" PRIu32, path, fewer);
    body.loop -= fewer;
    study_case c = study_case_begin(&body);
    study_case_bake(&c, &body, coarse ? LARGE_LEVEL : PALP_MAX_LEVELS);
    return c;
}

built build_case(const study_case *c, double epsilon) {
    const wavelet w = {WAVELET_LINEAR, true};
    domains d = domains_build(&c->m, c->fixed, c->area, w);
    double(*normal)[3] = allocate(c->m.vertices, sizeof *normal);
    double *area = allocate(c->m.vertices, sizeof *area);
    mesh_nodal(&c->m, area, normal);
    palp_meta meta = {.young_Pa = 1, .poisson = 0};
    build_options o = {.wavelet = w,
                       .compress = {.epsilon = epsilon},
                       .table_bytes = 8e6,
                       .constraint_level = c->stored};
    built b = blob_build(&c->m, &c->g, &d, area, normal, meta, &o);
    free(normal);
    free(area);
    domains_free(&d);
    return b;
}

uint32_t free_nodes(const study_case *c) {
    uint32_t n = 0;
    for (uint32_t i = 0; i < c->m.vertices; i++) n += c->fixed[i] == 0;
    return n;
}

/* ---- page ---- */

void add_plot(const work *w, const char *name, const plot_chart *chart) {
    output out = study_file(w->folder, name);
    plot_svg(out.file, chart);
    commit_output(&out);
    plot_svg(w->page, chart);
}

output begin_csv(const work *w, const char *name, const char *header) {
    output out = study_file(w->folder, name);
    fprintf(out.file, "%s\n", header);
    return out;
}

void begin_figure(const work *w, const char *title, const char *paper) {
    fprintf(w->page, "<h2>%s</h2>\n<p class='paper'>The paper: %s</p>\n", title, paper);
    printf("%s\n", title);
    fflush(stdout);
}

void add_chart(const work *w, const char *name, const char *title, abscissa a, ordinate o,
               const study_point *curve[], const char *const *label, size_t curves) {
    plot_series series[12] = {{{0}, 0, NULL, NULL, false, false}};
    double x[12][STUDY_EPSILONS], y[12][STUDY_EPSILONS];
    for (size_t k = 0; k < curves; k++) {
        for (size_t e = 0; e < STUDY_EPSILONS; e++) {
            x[k][e] = a == BY_EPSILON ? curve[k][e].epsilon : curve[k][e].compression;
            y[k][e] = o == RMS_ERROR ? curve[k][e].rms : curve[k][e].max;
        }
        series[k] = (plot_series){.count = STUDY_EPSILONS, .x = x[k], .y = y[k]};
        series[k].faint = !curve[k][0].w.lifted;
        snprintf(series[k].name, sizeof series[k].name, "%s", label[k]);
    }
    plot_chart p = {.title = title,
                    .x_label = a == BY_EPSILON ? "relative threshold epsilon" : "compression",
                    .y_label = o == RMS_ERROR ? "RMS error (MR 70)" : "MAX error (MR 71)",
                    .log_x = true,
                    .log_y = true,
                    .series = series,
                    .count = curves};
    add_plot(w, name, &p);
}

void save_curves(const work *w, const char *name, const study_case *c, const study_point *curve[],
                 size_t curves) {
    output csv = study_file(w->folder, name);
    study_csv_header(csv.file);
    for (size_t k = 0; k < curves; k++) study_csv(csv.file, c, curve[k], STUDY_EPSILONS);
    commit_output(&csv);
}

/* ---- tables ---- */

static double volume_of(const mesh *m, double *mean_area) {
    double volume = 0, area = 0;
    for (uint32_t t = 0; t < m->triangles; t++) {
        double n[3];
        triangle_normal(m->x[m->t[t][0]], m->x[m->t[t][1]], m->x[m->t[t][2]], n);
        volume += v_dot(m->x[m->t[t][0]], n) / 6;
        area += v_norm(n) / 2;
    }
    *mean_area = area / m->triangles;
    return volume;
}

static void table_1(work *w) {
    static const char *const paper[CASES + 1] = {
        "872, 320, 162, 133, (9,25,99), 0.64", "6903, 1280, 642, 537, (9,26,101,401), 10",
        "54475, 5120, 2562, 2145, (9,26,100,404,1606), 166",
        "176702, 19840, 9920, 7953, (123,372,1495,5963), 2277"};
    output csv = begin_csv(w, "table-1.csv", "model,tetra,faces,vertices,domain,levels,megabytes");
    begin_figure(w, "Table I: properties of the models", "see the last column");
    fprintf(w->page, "<table><tr><th>model<th>tetra<th>faces<th>vertices<th>domain<th>nodes per "
                     "level<th>dense MB<th>paper's model in its place</tr>\n");
    for (int k = 0; k <= CASES; k++) {
        const study_case *c = k < CASES ? &w->small[k] : &w->large;
        double area, n = free_nodes(c), volume = volume_of(&c->m, &area);
        double tetra = ceil(volume / (0.41358 * area * sqrt(area))); /* footnote 6, mended */
        domains d = domains_build(&c->m, c->fixed, c->area, (wavelet){WAVELET_LINEAR, true});
        const uint32_t *start = d.domain[PALP_FREE].view.level_start;
        char levels[96] = "";
        for (uint32_t l = 0; l < c->levels; l++) {
            size_t at = strlen(levels);
            snprintf(levels + at, sizeof levels - at, "%s%" PRIu32, l > 0 ? " " : "",
                     start[l + 1] - start[l]);
        }
        domains_free(&d);
        fprintf(csv.file, "%s,%.0f,%" PRIu32 ",%" PRIu32 ",%.0f,%s,%.4g\n", c->name, tetra,
                c->m.triangles, c->m.vertices, n, levels, 36e-6 * n * n);
        fprintf(w->page,
                "<tr><td>%s<td>%.0f<td>%" PRIu32 "<td>%" PRIu32
                "<td>%.0f<td>%s<td>%.3g<td>%s</tr>\n",
                c->name, tetra, c->m.triangles, c->m.vertices, n, levels, 36e-6 * n * n, paper[k]);
    }
    fprintf(w->page, "</table>\n");
    commit_output(&csv);
}

/* Median time of one point-like response: one column summed and one inverse transform, in us. */
static double response_us(const palp_blob *b) {
    const palp_domain *d = &b->domain[PALP_FREE];
    size_t bytes = PALP_FIELD_LANES * (size_t)d->slots * sizeof(float);
    float *x = allocate_aligned(bytes, 1);
    const float force[3] = {0.1f, 0.2f, -1};
    double best = HUGE_VAL;
    for (uint32_t round = 0; round < 200; round++) {
        double start = now_s();
        memset(x, 0, bytes);
        palp_columns_add(&b->columns[PALP_FREE][PALP_FREE], round % d->slots, force, x);
        palp_wavelet_inverse(d, x, d->levels - 1);
        best = fmin(best, now_s() - start);
    }
    free(x);
    return best * 1e6;
}

static void table_2(work *w) {
    static const char *const paper[CASES] = {"1.8 min, 0.07 ms", "40 min, 0.33 ms",
                                             "9 hours on eight processors, 1.3 ms"};
    output csv = begin_csv(w, "table-2.csv", "model,precomputation_s,response_us");
    begin_figure(w, "Table II: precomputation and simulation times",
                 "see the last column (Pentium III, 450 MHz, Java)");
    fprintf(w->page, "<table><tr><th>model<th>precomputation (s)<th>point response "
                     "(us)<th>paper</tr>\n");
    for (int k = 0; k < CASES; k++) {
        double us = response_us(&w->blob[k]);
        fprintf(csv.file, "%s,%.4g,%.4g\n", w->small[k].name, w->small[k].seconds, us);
        fprintf(w->page, "<tr><td>%s<td>%.3g<td>%.3g<td>%s</tr>\n", w->small[k].name,
                w->small[k].seconds, us, paper[k]);
    }
    fprintf(w->page, "</table>\n");
    commit_output(&csv);
}

typedef struct {
    double row_us, extract_us, lookup_us, entries, matches;
} extraction;

/* Times of blocks whose row node has `levels` levels to reconstruct. */
static extraction time_extraction(const palp_blob *b) {
    const palp_domain *d = &b->domain[PALP_FREE];
    palp_row_scratch scratch = {allocate(d->slots, sizeof(float)),
                                allocate((d->slots + 31) / 32, sizeof(uint32_t))};
    palp_row row = {.index = allocate(d->slots, sizeof(uint16_t)),
                    .weight = allocate(d->slots, sizeof(float))};
    extraction e = {.lookup_us = (double)NAN};
    const uint32_t rows = 64, columns = 64;
    float block[9], sum = 0;
    double row_s = 0, extract_s = 0;
    for (uint32_t i = 0; i < rows; i++) {
        uint32_t slot =
            d->level_start[d->levels - 1] + i * (d->slots - d->level_start[d->levels - 1]) / rows;
        double start = now_s();
        for (int repeat = 0; repeat < 10; repeat++)
            (void)palp_wavelet_row(d, slot, &scratch, &row, d->slots);
        row_s += (now_s() - start) / 10;
        e.entries += row.count / (double)rows;
        start = now_s();
        for (uint32_t j = 0; j < columns; j++) {
            palp_columns_extract(&b->columns[PALP_FREE][PALP_FREE], j * d->slots / columns, &row,
                                 block);
            sum += block[0];
        }
        extract_s += now_s() - start;
    }
    e.row_us = row_s / rows * 1e6;
    e.extract_us = extract_s / (rows * columns) * 1e6;
    uint32_t l = b->meta->constraint_level;
    while (l > 0 && b->level[l].table == NULL) l--;
    if (b->level[l].table != NULL) {
        uint32_t n = b->level[l].nodes;
        double start = now_s();
        for (uint32_t i = 0; i < 200; i++) {
            for (uint32_t j = 0; j < 200; j++) {
                palp_table_block(b, l, i * n / 200, j * n / 200, block);
                sum += block[0];
            }
        }
        e.lookup_us = (now_s() - start) / 40000 * 1e6;
    }
    if (!isfinite((double)sum)) warn("extraction gave no number");
    void *owned[] = {scratch.weight, scratch.mark, row.index, row.weight};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    return e;
}

static void table_3(work *w) {
    output csv = begin_csv(w, "table-3.csv",
                           "levels,row_entries,row_us,extract_us,block_us,lookup_us,ratio");
    begin_figure(w, "Table III: extraction of 3x3 blocks",
                 "8, 20 and 36 us per block for 2, 3 and 4 levels to reconstruct. A row of the "
                 "inverse transform serves all blocks of its node; a tick keeps it.");
    fprintf(
        w->page,
        "<table><tr><th>levels to reconstruct<th>entries of a row<th>row (us)<th>block with its "
        "row at hand (us)<th>both (us)<th>table look-up (us)<th>block / look-up</tr>\n");
    for (int k = 0; k < CASES; k++) {
        extraction e = time_extraction(&w->blob[k]);
        fprintf(csv.file, "%d,%.3g,%.4g,%.4g,%.4g,%.4g,%.4g\n", k + 2, e.entries, e.row_us,
                e.extract_us, e.row_us + e.extract_us, e.lookup_us, e.extract_us / e.lookup_us);
        fprintf(w->page, "<tr><td>%d<td>%.0f<td>%.3g<td>%.3g<td>%.3g<td>%.3g<td>%.0f</tr>\n", k + 2,
                e.entries, e.row_us, e.extract_us, e.row_us + e.extract_us, e.lookup_us,
                e.extract_us / e.lookup_us);
    }
    fprintf(w->page, "</table>\n");
    commit_output(&csv);
}

/* ---- figures ---- */

static void figure_9(work *w) {
    built b = build_case(&w->small[0], 0.1);
    palp_blob blob;
    if (palp_blob_open(&blob, b.bytes, b.size) != PALP_OK) die(EXIT_WORK, "figure 9");
    output csv = begin_csv(w, "figure-9.csv", "constraint_level,row,column");
    begin_figure(w, "Figure 9: sparsity of hierarchical wavelet GFs, L = 2, epsilon 0.1",
                 "4444, 1599 and 671 non-zero blocks on constraint levels 2, 1 and 0 (133 rows); "
                 "25 % of the largest kept");
    for (uint32_t l = blob.meta->constraint_level + 1; l-- > 0;) {
        const palp_columns *c = &blob.level[l].columns;
        size_t count = 0, room = (size_t)c->offset[blob.level[l].nodes] * PALP_LANES;
        double *x = allocate(room, sizeof *x), *y = allocate(room, sizeof *y);
        for (uint32_t j = 0; j < blob.level[l].nodes; j++) {
            for (uint32_t k = 0; k < palp_columns_stored(c, j); k++) {
                x[count] = j;
                y[count] = c->index[(size_t)c->offset[j] * PALP_LANES + k];
                fprintf(csv.file, "%" PRIu32 ",%.0f,%" PRIu32 "\n", l, y[count], j);
                y[count] = c->rows - 1 - y[count];
                count++;
            }
        }
        char title[96];
        snprintf(title, sizeof title, "level %" PRIu32 ": %zu blocks of %" PRIu32 " x %" PRIu32, l,
                 count, c->rows, blob.level[l].nodes);
        plot_series s = {.name = "", .count = count, .x = x, .y = y, .dots = true};
        plot_chart p = {.title = title,
                        .x_label = "column",
                        .y_label = "row, coarse levels on top",
                        .series = &s,
                        .count = 1};
        char name[32];
        snprintf(name, sizeof name, "figure-9-level-%" PRIu32 ".svg", l);
        add_plot(w, name, &p);
        free(x);
        free(y);
    }
    commit_output(&csv);
    free(b.bytes);
}

static void figures_14_15(work *w, study_point best[STUDY_EPSILONS]) {
    static study_point p[5][STUDY_EPSILONS];
    const study_point *curve[5];
    const char *label[5];
    const study_case *c = &w->small[CASES - 1];
    for (int k = 0; k < 5; k++) {
        wavelet v = {k == 1 || k == 3 ? WAVELET_BUTTERFLY : WAVELET_LINEAR, k != 2 && k != 3};
        study_curve(c, v, k == 4 ? THRESHOLD_GLOBAL : THRESHOLD_COLUMN, c->stored, p[k]);
        curve[k] = p[k];
        label[k] = k == 4 ? "linear lifted, global rule" : wavelet_label(v);
    }
    memcpy(best, p[0], sizeof p[0]);
    begin_figure(
        w, "Figure 14: error against compression, L = 4",
        "lifted linear compresses 8.4, 25 and 68 times at epsilon .01, .05 and .2; lifting "
        "helps, butterfly hardly more than linear");
    save_curves(w, "figure-14.csv", c, curve, 5);
    add_chart(w, "figure-14-rms.svg", "RMS error", BY_COMPRESSION, RMS_ERROR, curve, label, 5);
    add_chart(w, "figure-14-max.svg", "MAX error", BY_COMPRESSION, MAX_ERROR, curve, label, 5);
    fprintf(w->page, "<table><tr><th>epsilon<th>compression<th>RMS<th>MAX<th>at equal RMS, the "
                     "global rule (compression)<th>its MAX at the same epsilon</tr>\n");
    for (size_t e = 0; e < STUDY_EPSILONS; e++) {
        fprintf(w->page, "<tr><td>%g<td>%.1f<td>%.4f<td>%.3f<td>%.1f<td>%.3f</tr>\n",
                p[0][e].epsilon, p[0][e].compression, p[0][e].rms, p[0][e].max,
                study_compression_at(p[4], p[0][e].rms), p[4][e].max);
        printf("  lifted linear, epsilon %-5g compression %6.1f RMS %.4f MAX %.3f; global rule at "
               "this RMS %6.1f\n",
               p[0][e].epsilon, p[0][e].compression, p[0][e].rms, p[0][e].max,
               study_compression_at(p[4], p[0][e].rms));
    }
    fprintf(w->page, "</table>\n");
    begin_figure(w, "Figure 15: error against threshold, L = 4",
                 "linear and butterfly behave alike; errors are about proportional to epsilon");
    save_curves(w, "figure-15.csv", c, curve, 5);
    add_chart(w, "figure-15.svg", "RMS error", BY_EPSILON, RMS_ERROR, curve, label, 5);
}

static void figure_16(work *w) {
    static study_point p[CASES][STUDY_EPSILONS];
    const wavelet v = {WAVELET_LINEAR, true};
    output csv = begin_csv(w, "figure-16.csv", "rms,ratio_3_2,ratio_4_3");
    begin_figure(
        w, "Figure 16: how compression grows with resolution",
        "the ratio of speed-ups of adjacent resolutions lies between 1.5 and 4 and flattens "
        "once the error is above a few per cent");
    for (int k = 0; k < CASES; k++)
        study_curve(&w->small[k], v, THRESHOLD_COLUMN, w->small[k].stored, p[k]);
    double x[24], y[2][24];
    size_t n = 0;
    for (double rms = 0.002; rms < 0.12 && n < 24; rms *= 1.3) {
        double at[CASES];
        for (int k = 0; k < CASES; k++) at[k] = study_compression_at(p[k], rms);
        x[n] = rms;
        y[0][n] = at[1] / at[0];
        y[1][n] = at[2] / at[1];
        fprintf(csv.file, "%.5g,%.5g,%.5g\n", rms, y[0][n], y[1][n]);
        n++;
    }
    plot_series s[2] = {{.name = "L = 3 over L = 2", .count = n, .x = x, .y = y[0]},
                        {.name = "L = 4 over L = 3", .count = n, .x = x, .y = y[1]}};
    plot_chart chart = {.title = "speed-up(4 m) / speed-up(m), MR 73",
                        .x_label = "RMS error",
                        .y_label = "ratio",
                        .log_x = true,
                        .series = s,
                        .count = 2};
    add_plot(w, "figure-16.svg", &chart);
    commit_output(&csv);
}

/* Best time of a sum of all columns, per column, in us. */
static double sum_us(const palp_columns *c, float *x) {
    const float force[3] = {0.3f, -0.2f, 1};
    double best = HUGE_VAL;
    for (int round = 0; round < 12; round++) {
        double start = now_s();
        for (uint32_t j = 0; j < c->columns; j++) palp_columns_add(c, j, force, x);
        best = fmin(best, now_s() - start);
    }
    return best / c->columns * 1e6;
}

static void figure_17(work *w) {
    const study_case *c = &w->small[1];
    double x[STUDY_EPSILONS], y[STUDY_EPSILONS], dense_us = 0, inverse_us = HUGE_VAL;
    output csv = begin_csv(w, "figure-17.csv", "epsilon,blocks_per_column,us_per_column,dense_us");
    begin_figure(
        w, "Figure 17: fast summation cost per GF, L = 3",
        "proportional to the non-zero blocks; dense 0.19 ms per GF, inverse transform 0.38 "
        "ms (537 nodes)");
    domains d = domains_build(&c->m, c->fixed, c->area, (wavelet){WAVELET_LINEAR, true});
    const domain_data *f = &d.domain[PALP_FREE];
    size_t *first = allocate(f->view.slots, sizeof *first);
    for (size_t j = 0; j < f->view.slots; j++) first[j] = 3 * (size_t)f->node[j];
    gf_source source = {.m = c->g.m,
                        .width = c->g.width,
                        .first = first,
                        .columns = f->view.slots,
                        .counted = f->view.slots};
    float *field = allocate_aligned(PALP_FIELD_LANES * (size_t)f->view.slots, sizeof *field);
    for (size_t e = 0; e <= STUDY_EPSILONS; e++) {
        double epsilon = e > 0 ? study_epsilons[e - 1] : 0;
        columns_data columns =
            columns_build(&source, f, NULL, (compress_options){.epsilon = epsilon});
        double us = sum_us(&columns.view, field);
        if (e == 0) {
            dense_us = us;
        } else {
            x[e - 1] = (double)columns.blocks / f->view.slots;
            y[e - 1] = us;
            fprintf(csv.file, "%g,%.5g,%.5g,%.5g\n", epsilon, x[e - 1], us, dense_us);
        }
        columns_free(&columns);
    }
    for (int round = 0; round < 50; round++) {
        double start = now_s();
        palp_wavelet_inverse(&f->view, field, f->view.levels - 1);
        inverse_us = fmin(inverse_us, now_s() - start);
    }
    fprintf(w->page, "<p>All blocks kept: %.3g us per GF; inverse transform: %.3g us.</p>\n",
            dense_us, inverse_us * 1e6);
    plot_series s = {.name = "lifted linear", .count = STUDY_EPSILONS, .x = x, .y = y};
    plot_chart chart = {.title = "time per column summed (us)",
                        .x_label = "stored blocks per column",
                        .y_label = "us",
                        .series = &s,
                        .count = 1};
    add_plot(w, "figure-17.svg", &chart);
    commit_output(&csv);
    free(field);
    free(first);
    domains_free(&d);
}

/* Hierarchical GFs of one model on its constraint levels, both lifted wavelets. */
static void hierarchical(work *w, const study_case *c, const char *number, const char *next,
                         const char *title, const char *paper, uint32_t levels) {
    static study_point p[2 * PALP_MAX_LEVELS][STUDY_EPSILONS];
    static char text[2 * PALP_MAX_LEVELS][64];
    const study_point *curve[2 * PALP_MAX_LEVELS];
    const char *label[2 * PALP_MAX_LEVELS];
    char name[64], heading[160];
    size_t n = 0;
    for (int kind = 0; kind < 2; kind++) {
        wavelet v = {kind == 0 ? WAVELET_LINEAR : WAVELET_BUTTERFLY, true};
        for (uint32_t k = 0; k < levels; k++) {
            study_curve(c, v, THRESHOLD_COLUMN, c->stored - k, p[n]);
            snprintf(text[n], sizeof text[n], "%s, constraints %" PRIu32, wavelet_label(v),
                     c->stored - k);
            curve[n] = p[n];
            label[n] = text[n];
            n++;
        }
    }
    snprintf(heading, sizeof heading, "Figure %s: %s, error against compression", number, title);
    begin_figure(w, heading, paper);
    snprintf(name, sizeof name, "figure-%s.csv", number);
    save_curves(w, name, c, curve, n);
    snprintf(name, sizeof name, "figure-%s.svg", number);
    add_chart(w, name, "RMS error", BY_COMPRESSION, RMS_ERROR, curve, label, n);
    for (size_t k = 0; k < n; k++) {
        printf("  %-36s compression at 5 %% RMS %6.1f, at 1.8 %% %6.1f\n", label[k],
               study_compression_at(p[k], 0.05), study_compression_at(p[k], 0.018));
        fprintf(w->page, "<p>%s: %.1f times at 5 %% RMS, %.1f at 1.8 %%</p>\n", label[k],
                study_compression_at(p[k], 0.05), study_compression_at(p[k], 0.018));
    }
    snprintf(heading, sizeof heading, "Figure %s: %s, error against threshold", next, title);
    begin_figure(w, heading, paper);
    snprintf(name, sizeof name, "figure-%s.csv", next);
    save_curves(w, name, c, curve, n);
    snprintf(name, sizeof name, "figure-%s.svg", next);
    add_chart(w, name, "RMS error", BY_EPSILON, RMS_ERROR, curve, label, n);
}

static void begin_page(FILE *f) {
    fprintf(f, "<!doctype html><html lang='en'><meta charset='utf-8'><title>Palp: the "
               "multiresolution paper, reproduced</title>\n<style>body{font-family:sans-serif;"
               "max-width:760px;margin:2em auto;line-height:1.4}table{border-collapse:collapse;"
               "font-size:13px}td,th{border:1px solid #ccc;padding:2px 7px;text-align:right}"
               ".paper{color:#666}svg{max-width:100%%}</style>\n<h1>Multiresolution Green's "
               "functions, on our own models</h1>\n<p>Printed by <code>make reproduce</code>; the "
               "numbers behind each figure lie beside this page as CSV. Times are of the machine "
               "that ran it and mean little on a shared one.</p>\n");
}

/* The multiresolution paper. */
static void reproduce_greens(work *w, const reproduce_spec *s) {
    static study_point lifted[STUDY_EPSILONS];
    for (uint32_t k = 0; k < CASES; k++) {
        w->small[k] = bake_case(s->model[0], CASES - 1 - k, false);
        w->small[k].g.fixed = w->small[k].fixed;
        snprintf(w->small[k].name, sizeof w->small[k].name, "L%" PRIu32, w->small[k].levels - 1);
        built b = build_case(&w->small[k], 0.05);
        w->bytes[k] = b.bytes;
        if (palp_blob_open(&w->blob[k], b.bytes, b.size) != PALP_OK) die(EXIT_WORK, "blob");
    }
    w->large = bake_case(s->model[1], 0, true);
    w->large.g.fixed = w->large.fixed;
    snprintf(w->large.name, sizeof w->large.name, "large");
    progress_quiet(1);
    table_1(w);
    table_2(w);
    table_3(w);
    figure_9(w);
    figures_14_15(w, lifted);
    figure_16(w);
    figure_17(w);
    hierarchical(w, &w->small[CASES - 1], "18", "19", "hierarchical GFs, L = 4",
                 "all constraint levels compress about alike, coarser ones slightly better", 3);
    hierarchical(w, &w->large, "20", "21", "the large model with coarse constraints",
                 "dragon, level 0 only: about 100 times at 5 % RMS", LARGE_LEVEL + 1);
    compare_compressions(w, lifted);
    compare_levels(w);
    show_electrostatics(w);
}

int command_reproduce(int argc, char **argv) {
    static work w;
    reproduce_spec s = {.folder = "reproduce"};
    args_parse(argc, argv, options, help, set_option, &s);
    if (s.models != 2 && (s.models != 0 || s.dynamic == NULL))
        die(EXIT_USAGE, "two models needed, or a dynamic one (--help shows the usage)");
    w.folder = s.folder;
    output page = study_file(s.folder, "index.html");
    w.page = page.file;
    begin_page(page.file);
    if (s.models == 2) reproduce_greens(&w, &s);
    if (s.dynamic != NULL) reproduce_dynamics(&w, s.dynamic);
    commit_output(&page);
    printf("%s/index.html\n", s.folder);
    return EXIT_SUCCESS;
}
