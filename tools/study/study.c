/* SPDX-License-Identifier: MIT */
#include "tools/study/study.h"
#include "tools/bake/body.h"
#include "port/host/blobfile.h"
#include "core/green/split.h"
#include "port/host/parallel.h"
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

const double study_epsilons[STUDY_EPSILONS] = {0.002, 0.005, 0.01, 0.02, 0.03, 0.05,
                                               0.1,   0.2,   0.3,  0.5,  0.8};

const char *wavelet_label(wavelet w) {
    if (w.kind == WAVELET_LINEAR) return w.lifted ? "linear lifted" : "linear";
    return w.lifted ? "butterfly lifted" : "butterfly";
}

output study_file(const char *folder, const char *name) {
    if (mkdir(folder, 0777) != 0 && errno != EEXIST)
        die(EXIT_WORK, "cannot make %s: %s", folder, strerror(errno));
    size_t n = strlen(folder) + strlen(name) + 2;
    char *path = allocate(n, 1);
    snprintf(path, n, "%s/%s", folder, name);
    return open_output(path);
}

void study_curve(const study_case *c, wavelet w, threshold_rule rule, uint32_t level,
                 study_point *point) {
    domains d = domains_build(&c->m, c->fixed, c->area, w);
    const domain_data *f = &d.domain[PALP_FREE];
    uint32_t n = f->view.level_start[level + 1], stored = f->view.level_start[c->stored + 1];
    size_t *first = allocate(stored, sizeof *first);
    for (size_t j = 0; j < stored; j++) first[j] = 3 * (c->g.basis_count > 0 ? j : f->node[j]);
    gf_source source = {
        .m = c->g.m, .width = c->g.width, .first = first, .columns = n, .counted = n};
    double *gathered = NULL;
    if (level < c->stored) {
        gathered = hierarchy_columns(&d.h, c->stored, level, c->g.m, c->g.width, first,
                                     3 * (size_t)c->m.vertices);
        for (size_t j = 0; j < n; j++) first[j] = 3 * j;
        source.m = gathered;
        source.width = 3 * (size_t)n;
    }
    for (size_t e = 0; e < STUDY_EPSILONS; e++) {
        compress_options o = {.epsilon = study_epsilons[e], .rule = rule, .measure_only = true};
        columns_data columns = columns_build(&source, f, NULL, o);
        point[e] = (study_point){.w = w,
                                 .rule = rule,
                                 .level = level,
                                 .epsilon = o.epsilon,
                                 .blocks = (double)columns.blocks,
                                 .compression = (double)n * f->view.slots / (double)columns.blocks,
                                 .rms = columns.rms,
                                 .max = columns.max};
        columns_free(&columns);
    }
    free(first);
    free(gathered);
    domains_free(&d);
}

double study_compression_at(const study_point *point, double rms) {
    for (size_t e = 0; e + 1 < STUDY_EPSILONS; e++) {
        const study_point *a = &point[e], *b = &point[e + 1];
        if (!(a->rms <= rms && b->rms >= rms && b->rms > a->rms)) continue;
        double t = log(rms / a->rms) / log(b->rms / a->rms);
        return exp((1 - t) * log(a->compression) + t * log(b->compression));
    }
    return (double)NAN;
}

void study_csv_header(FILE *f) {
    fprintf(f, "model,free_nodes,levels,constraint_level,wavelet,rule,epsilon,blocks,compression,"
               "rms,max\n");
}

void study_csv(FILE *f, const study_case *c, const study_point *point, size_t count) {
    uint32_t nodes = 0;
    for (uint32_t i = 0; i < c->m.vertices; i++) nodes += c->fixed[i] == 0;
    for (size_t k = 0; k < count; k++) {
        const study_point *p = &point[k];
        fprintf(f, "%s,%" PRIu32 ",%" PRIu32 ",%" PRIu32 ",%s,%s,%.9g,%.0f,%.9g,%.9g,%.9g\n",
                c->name, nodes, c->levels, p->level, wavelet_label(p->w),
                p->rule == THRESHOLD_COLUMN ? "column" : "global", p->epsilon, p->blocks,
                p->compression, p->rms, p->max);
    }
}

study_case study_case_begin(const body_spec *body) { return (study_case){.m = body_mesh(body)}; }

void study_case_bake(study_case *c, const body_spec *body, uint32_t finest) {
    double(*normal)[3] = allocate(c->m.vertices, sizeof *normal), start = now_s();
    c->area = allocate(c->m.vertices, sizeof *c->area);
    mesh_nodal(&c->m, c->area, normal);
    free(normal);
    c->fixed = body_fixed(body, &c->m);
    c->young_Pa = body->young_Pa;
    c->poisson = body->poisson;
    domains d = domains_build(&c->m, c->fixed, c->area, (wavelet){WAVELET_LINEAR, true});
    const palp_domain *f = &d.domain[PALP_FREE].view;
    c->levels = f->levels;
    c->stored = finest < c->levels - 1 ? finest : c->levels - 1;
    bool coarse = c->stored + 1 < c->levels;
    body_require_memory(body, &c->m, coarse ? f->level_start[c->stored + 1] : c->m.vertices,
                        coarse);
    body_spec paper = *body; /* its figures are of its own method */
    paper.collocation = true;
    c->g = body_greens(&paper, &c->m, c->fixed, &d, c->stored, false);
    c->seconds = now_s() - start;
    domains_free(&d);
}

void study_free(study_case *c) {
    free(c->g.m);
    free(c->fixed);
    free(c->area);
    mesh_free(&c->m);
}

/* ---- the command ---- */

static const char help[] =
    "usage: palp study MESH-or-BLOB ... [-o DIR] [options of bake for meshes]\n"
    "\n"
    "Error against compression for every wavelet, threshold, rule and constraint level: DIR gets "
    "study.csv,\n"
    "two charts (SVG) per model and index.html (default: study). A mesh without material gets "
    "Young 3e4 Pa,\n"
    "Poisson 0.45, without fixed nodes the lowest tenth of it is held; it is taken as it is if it "
    "has\n"
    "subdivision connectivity, else remeshed. Models (.model) say it all themselves.\n"
    "Of a blob --reference BLOB, one of the same body baked with --epsilon 0, says what is exact; "
    "without it the "
    "blob is\n"
    "its own reference, and the errors are those of compressing it once more.\n";

static const option options[] = {BODY_OPTIONS, {"-o", 1}, {"--reference", 1}, {NULL, 0}};
#define MAX_INPUTS 32

typedef struct {
    body_spec body;
    const char *input[MAX_INPUTS], *folder, *reference;
    int inputs;
} study_spec;

static void set_option(void *context, const argument *a) {
    study_spec *s = context;
    if (a->option == NULL) {
        if (s->inputs == MAX_INPUTS) die(EXIT_USAGE, "more than %d inputs", MAX_INPUTS);
        s->input[s->inputs++] = a->value[0];
    } else if (strcmp(a->option, "-o") == 0) {
        s->folder = a->value[0];
    } else if (strcmp(a->option, "--reference") == 0) {
        s->reference = a->value[0];
    } else {
        (void)body_option(&s->body, a);
    }
}

/* A model file may hold keys of bake that do not matter here. */
static void set_model_option(void *context, const argument *a) { (void)body_option(context, a); }

static void read_model(const char *path, body_spec *body) {
    static const option keys[] = {
        BODY_OPTIONS,       {"--epsilon", 1},          {"--wavelet", 1},  {"--unlifted", 0},
        {"--threshold", 1}, {"--storage", 1},          {"--table-mb", 1}, {"--reciprocity", 1},
        {"--save-mesh", 1}, {"--constraint-level", 1}, {NULL, 0}};
    *body = body_defaults;
    body->folder = body_folder(path);
    args_parse_file(path, keys, set_model_option, body);
    if (body->mesh_path == NULL) die(EXIT_USAGE, "%s: no 'mesh FILE' line", path);
}

static bool ends_in(const char *path, const char *end) {
    size_t n = strlen(path), k = strlen(end);
    return n >= k && strcmp(path + n - k, end) == 0;
}

static void hold_lowest_tenth(body_spec *body, const mesh *m) {
    double low = HUGE_VAL, high = -HUGE_VAL;
    for (uint32_t i = 0; i < m->vertices; i++) {
        low = fmin(low, m->x[i][2]);
        high = fmax(high, m->x[i][2]);
    }
    body->fixes[0] = (fix){.kind = FIX_BELOW, .axis = 2, .value = {low + 0.1 * (high - low)}};
    body->fix_count = 1;
}

/* The blob that says what is exact: itself, or one of the same body. */
static palp_blob reference_of(const char *path, const palp_blob *b, const char *reference) {
    if (reference == NULL) {
        if (b->meta->epsilon > 0)
            warn("%s: was compressed with epsilon %g and is its own reference, so these are not "
                 "its errors "
                 "but those of compressing it once more: name one baked with --epsilon 0 by "
                 "--reference "
                 "(bake measured an RMS of %.4f)",
                 path, (double)b->meta->epsilon, (double)b->meta->rms_error);
        return *b;
    }
    const palp_blob r = load_blob(reference);
    if (memcmp(r.meta->mesh_sha256, b->meta->mesh_sha256, sizeof r.meta->mesh_sha256) != 0 ||
        r.meta->nodes != b->meta->nodes ||
        r.meta->domain_nodes[PALP_FREE] != b->meta->domain_nodes[PALP_FREE])
        die(EXIT_WORK, "%s is not of the body of %s: another mesh, or other fixed nodes", reference,
            path);
    if (r.meta->epsilon > 0)
        warn("%s: was compressed itself (epsilon %g): what is exact is not known better than that",
             reference, (double)r.meta->epsilon);
    return r;
}

static study_case case_of_blob(const char *path, const char *reference) {
    const palp_blob b = load_blob(path), exact = reference_of(path, &b, reference);
    const palp_domain *d = &b.domain[PALP_FREE];
    uint32_t n = b.meta->nodes;
    if (b.meta->constraint_level + 1 < b.meta->levels) {
        die(EXIT_WORK, "%s: holds coarse constraint levels only; study its mesh", path);
    }
    study_case c = {.levels = b.meta->levels, .stored = b.meta->constraint_level};
    c.m = (mesh){.vertices = n,
                 .triangles = b.meta->triangles,
                 .x = allocate(n, sizeof *c.m.x),
                 .t = allocate(b.meta->triangles, sizeof *c.m.t)};
    for (uint32_t i = 0; i < 3 * n; i++) c.m.x[i / 3][i % 3] = (double)b.rest_m[i];
    memcpy(c.m.t, b.triangle, b.meta->triangles * sizeof *c.m.t);
    c.fixed = allocate(n, 1);
    c.area = allocate(n, sizeof *c.area);
    for (uint32_t i = 0; i < n; i++) {
        c.fixed[i] = palp_node_is_fixed(&b, i);
        c.area[i] = (double)b.area_m2[i];
    }
    c.g = (greens){.nodes = n, .width = 3 * (size_t)n, .fixed = c.fixed};
    c.g.m = allocate_aligned(9 * (size_t)n * n, sizeof *c.g.m);
    const size_t lanes = PALP_FIELD_LANES * (size_t)d->slots;
    float *x = allocate(lanes, sizeof *x), *own = allocate(lanes, sizeof *own);
    double off = 0, all = 0;
    for (uint32_t j = 0; j < 3 * d->slots; j++) {
        float force[3] = {0};
        force[j % 3] = 1;
        palp_nodal_response(&exact, j / 3, force, x);
        if (reference != NULL) palp_nodal_response(&b, j / 3, force, own);
        for (uint32_t i = 0; i < 3 * d->slots; i++)
            greens_row(&c.g, d->node[i / 3], i % 3)[3 * d->node[j / 3] + j % 3] =
                (double)x[PALP_FIELD_LANES * (i / 3) + i % 3];
        for (size_t i = 0; i < lanes && reference != NULL; i++) {
            if (i % PALP_FIELD_LANES == 3) continue;
            off += ((double)own[i] - (double)x[i]) * ((double)own[i] - (double)x[i]);
            all += (double)x[i] * (double)x[i];
        }
    }
    if (reference != NULL)
        printf("%s against %s: RMS %.5f, %zu of %zu bytes\n", path, reference, sqrt(off / all),
               b.bytes, exact.bytes);
    free(x);
    free(own);
    return c;
}

static study_case case_of_mesh(const study_spec *s, const char *path) {
    body_spec body = s->body;
    if (ends_in(path, ".model")) {
        read_model(path, &body);
        body_require(&body);
    } else {
        body.mesh_path = path;
        if (!(body.young_Pa > 0)) body.young_Pa = 3e4;
        if (isnan(body.poisson)) body.poisson = 0.45;
        if (!body.levels_given && body.loop == 0) {
            mesh as_given = mesh_load(path);
            semireg levels = semireg_detect(&as_given);
            body.as_is = body.as_is || levels.levels > 1;
            semireg_free(&levels);
            mesh_free(&as_given);
        }
    }
    study_case c = study_case_begin(&body);
    if (body.fix_count == 0) hold_lowest_tenth(&body, &c.m);
    study_case_bake(&c, &body, PALP_MAX_LEVELS);
    return c;
}

/* File name without folder and ending. */
static void name_case(study_case *c, const char *path) {
    const char *slash = strrchr(path, '/');
    snprintf(c->name, sizeof c->name, "%s", slash != NULL ? slash + 1 : path);
    char *dot = strrchr(c->name, '.');
    if (dot != NULL) *dot = '\0';
}

static void chart(const char *folder, const study_case *c, const char *suffix, bool against_epsilon,
                  const study_point (*curve)[STUDY_EPSILONS], size_t curves, FILE *page) {
    plot_series series[16] = {{{0}, 0, NULL, NULL, false, false}};
    double x[16][STUDY_EPSILONS], y[16][STUDY_EPSILONS];
    char name[128], title[160];
    for (size_t k = 0; k < curves && k < 16; k++) {
        for (size_t e = 0; e < STUDY_EPSILONS; e++) {
            x[k][e] = against_epsilon ? curve[k][e].epsilon : curve[k][e].compression;
            y[k][e] = curve[k][e].rms;
        }
        series[k] = (plot_series){
            .count = STUDY_EPSILONS, .x = x[k], .y = y[k], .faint = !curve[k][0].w.lifted};
        snprintf(series[k].name, sizeof series[k].name, "%s%s, level %" PRIu32,
                 wavelet_label(curve[k][0].w),
                 curve[k][0].rule == THRESHOLD_GLOBAL ? ", global" : "", curve[k][0].level);
    }
    snprintf(title, sizeof title, "%s: RMS error against %s", c->name,
             against_epsilon ? "threshold" : "compression");
    plot_chart p = {.title = title,
                    .x_label = against_epsilon ? "epsilon" : "compression",
                    .y_label = "RMS error (MR 70)",
                    .log_x = true,
                    .log_y = true,
                    .series = series,
                    .count = curves};
    snprintf(name, sizeof name, "%s-%s.svg", c->name, suffix);
    output out = study_file(folder, name);
    plot_svg(out.file, &p);
    commit_output(&out);
    plot_svg(page, &p);
}

static void study_one(const char *folder, const study_case *c, FILE *csv, FILE *page) {
    study_point curve[16][STUDY_EPSILONS];
    size_t curves = 0;
    for (int k = 0; k < 4; k++) {
        wavelet w = {k < 2 ? WAVELET_LINEAR : WAVELET_BUTTERFLY, k % 2 == 0};
        study_curve(c, w, THRESHOLD_COLUMN, c->stored, curve[curves++]);
    }
    const wavelet usual = {WAVELET_LINEAR, true};
    study_curve(c, usual, THRESHOLD_GLOBAL, c->stored, curve[curves++]);
    for (uint32_t l = c->stored; l-- > 0 && curves < 10;)
        study_curve(c, usual, THRESHOLD_COLUMN, l, curve[curves++]);
    study_csv(csv, c, curve[0], curves * STUDY_EPSILONS);
    fputs("<h2>", page);
    print_escaped(page, c->name);
    fputs("</h2>\n", page);
    chart(folder, c, "compression", false, (const study_point(*)[STUDY_EPSILONS])curve, curves,
          page);
    chart(folder, c, "epsilon", true, (const study_point(*)[STUDY_EPSILONS])curve, curves, page);
    for (size_t k = 0; k < curves; k++) {
        printf("%-12s %-17s %-6s level %" PRIu32 "  epsilon .05: compression %6.1f, RMS %.4f, MAX "
               "%.4f   at RMS .018: %6.1f\n",
               c->name, wavelet_label(curve[k][5].w),
               curve[k][5].rule == THRESHOLD_COLUMN ? "column" : "global", curve[k][5].level,
               curve[k][5].compression, curve[k][5].rms, curve[k][5].max,
               study_compression_at(curve[k], 0.018));
    }
}

int command_study(int argc, char **argv) {
    study_spec s = {.body = body_defaults, .folder = "study"};
    args_parse(argc, argv, options, help, set_option, &s);
    if (s.inputs == 0) die(EXIT_USAGE, "no mesh or blob named (--help shows the usage)");
    output csv = study_file(s.folder, "study.csv"), page = study_file(s.folder, "index.html");
    study_csv_header(csv.file);
    fprintf(page.file, "<!doctype html><meta charset='utf-8'><title>palp study</title>"
                       "<body style='font-family:sans-serif;max-width:700px;margin:auto'>\n");
    for (int i = 0; i < s.inputs; i++) {
        study_case c = ends_in(s.input[i], ".palp") ? case_of_blob(s.input[i], s.reference)
                                                    : case_of_mesh(&s, s.input[i]);
        c.g.fixed = c.fixed;
        name_case(&c, s.input[i]);
        study_one(s.folder, &c, csv.file, page.file);
        study_free(&c);
    }
    fprintf(page.file, "</body>\n");
    commit_output(&csv);
    commit_output(&page);
    printf("%s/index.html\n", s.folder);
    return EXIT_SUCCESS;
}
