/* SPDX-License-Identifier: MIT */
/* Figures 4 to 6 of Debunne et al. (2001) and the gain of adaptivity, for `palp reproduce`. */
#include "tools/study/oscillate.h"
#include "tools/study/plot.h"
#include "tools/study/reproduce.h"
#include "tools/study/speedup.h"
#include "tools/tet/tetbake.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define EDGE 0.1
#define MESHES 3
#define SAMPLES 2000
#define INTERVAL 1e-3

static const swing_setup soft = {.lambda_Pa =
                                     1e4, /* Young's modulus 25 kPa, Poisson's ratio 0.25 */
                                 .mu_Pa = 1e4,
                                 .density = 1000,
                                 .gravity_m_s2 = {0, 0, -9.81},
                                 .step_s = 1e-4,
                                 .below = 1e-6};

typedef struct {
    tetmesh mesh[MESHES + 1]; /* the last: ten times ten times ten cells, for comparison */
    uint32_t corner[MESHES + 1];
} cubes;

static uint32_t far_corner(const tetmesh *m) {
    const double corner[3] = {EDGE, EDGE, EDGE};
    uint32_t best = 0;
    for (uint32_t i = 0; i < m->nodes; i++) {
        if (v_distance(m->x[i], corner) < v_distance(m->x[best], corner)) best = i;
    }
    return best;
}

static mesh cube_surface(void) {
    static const double size[3] = {EDGE, EDGE, EDGE};
    static const uint32_t n[3] = {6, 6, 6};
    tetmesh block = tetmesh_block(size, n, false);
    mesh m = {.vertices = block.nodes, .x = block.x};
    m.t = tetmesh_boundary(&block, &m.triangles);
    (void)mesh_drop_unused(&m);
    free(block.t);
    return m;
}

static cubes make_cubes(void) {
    static const double size[3] = {EDGE, EDGE, EDGE}, phase[3] = {0, 0, 0};
    static const uint32_t coarse[3] = {2, 2, 2}, fine[3] = {10, 10, 10};
    cubes c;
    mesh surface = cube_surface();
    bvh *on = bvh_build(&surface);
    double dropped;
    c.mesh[0] = tetmesh_block(size, coarse, true);
    c.mesh[1] = stuff(&surface, on, EDGE / 2, phase, &dropped);
    c.mesh[2] = stuff(&surface, on, EDGE / 3, phase, &dropped);
    c.mesh[3] = tetmesh_block(size, fine, true);
    for (int k = 0; k <= MESHES; k++) c.corner[k] = far_corner(&c.mesh[k]);
    bvh_free(on);
    mesh_free(&surface);
    return c;
}

static void draw_swing(const work *w, const char *name, const char *title, const cubes *c,
                       double z[MESHES + 1][SAMPLES]) {
    plot_series series[MESHES + 1];
    double *t = allocate(SAMPLES, sizeof *t);
    char file[64];
    for (int i = 0; i < SAMPLES; i++) t[i] = i * INTERVAL;
    for (int k = 0; k <= MESHES; k++) {
        series[k] = (plot_series){.count = SAMPLES, .x = t, .y = z[k], .faint = k == MESHES};
        snprintf(series[k].name, sizeof series[k].name, "%" PRIu32 " nodes", c->mesh[k].nodes);
    }
    snprintf(file, sizeof file, "%s.csv", name);
    output csv = begin_csv(w, file, "t_s,z_27,z_59,z_145,z_1331");
    for (int i = 0; i < SAMPLES; i++)
        fprintf(csv.file, "%.4g,%.6g,%.6g,%.6g,%.6g\n", t[i], z[0][i], z[1][i], z[2][i], z[3][i]);
    commit_output(&csv);
    snprintf(file, sizeof file, "%s.svg", name);
    add_plot(w, file,
             &(plot_chart){.title = title,
                           .x_label = "time (s)",
                           .y_label = "height of a corner (m)",
                           .series = series,
                           .count = MESHES + 1});
    free(t);
}

/* The corner of the same mesh in the engine itself, in single precision. */
static void in_the_engine(const tetmesh *m, uint32_t corner, double *z) {
    static const uint8_t sha[32] = {0};
    body_spec body = body_defaults;
    body.young_Pa = 25e3;
    body.poisson = 0.25;
    body.density = soft.density;
    const tet_model model = {.levels = 1};
    uint8_t *pinned = allocate(m->nodes, 1);
    for (uint32_t i = 0; i < m->nodes; i++) pinned[i] = m->x[i][0] <= soft.below;
    size_t bytes;
    uint32_t joined;
    uint8_t *blob = tet_assemble(m, &pinned, 1, &body, &model, sha, &joined, &bytes);
    palp_tets tets;
    palp_dyna dyna;
    (void)palp_tets_open(&tets, blob, bytes);
    const palp_dyna_config config = {.material = palp_material_of(25e3f, 0.25f, 1000.0f, 0, 0),
                                     .gravity_m_s2 = {0, 0, -9.81f},
                                     .tick_s = (float)INTERVAL,
                                     .most_class = PALP_STEP_CLASSES - 1};
    size_t room = palp_dyna_memsize(&tets);
    void *memory = allocate_aligned(room, 1);
    if (palp_dyna_init(&dyna, &tets, &config, memory, room) != PALP_OK)
        die(EXIT_WORK, "the cube does not open");
    for (int k = 0; k < SAMPLES; k++) {
        z[k] = (double)palp_dyna_position(&dyna, corner).z;
        palp_dyna_tick(&dyna, PALP_STEP_CLASSES - 1);
    }
    free(memory);
    free(blob);
    free(pinned);
}

static void frequencies(const work *w, const cubes *c, double f[LAWS + 1][MESHES + 1]) {
    static const char *const name[LAWS + 1] = {"springs", "Cauchy", "Green",
                                               "Green, the engine in single precision"};
    output csv = begin_csv(w, "oscillations.csv", "law,hz_27,hz_59,hz_145,hz_1331,spread");
    fprintf(w->page, "<table><tr><th>frequency (Hz)");
    for (int k = 0; k <= MESHES; k++) fprintf(w->page, "<th>%" PRIu32 " nodes", c->mesh[k].nodes);
    fprintf(w->page, "<th>spread of the first three</tr>\n");
    for (int law = 0; law <= LAWS; law++) {
        double low = fmin(f[law][0], fmin(f[law][1], f[law][2]));
        double high = fmax(f[law][0], fmax(f[law][1], f[law][2]));
        fprintf(w->page, "<tr><td>%s", name[law]);
        for (int k = 0; k <= MESHES; k++) fprintf(w->page, "<td>%.3f", f[law][k]);
        fprintf(w->page, "<td>%.1f %%</tr>\n", 100 * (high / low - 1));
        fprintf(csv.file, "%s,%.5g,%.5g,%.5g,%.5g,%.4g\n", law < LAWS ? law_name[law] : "engine",
                f[law][0], f[law][1], f[law][2], f[law][3], high / low - 1);
        printf("%-38s %.3f, %.3f, %.3f Hz, fine %.3f; spread %.1f %%\n", name[law], f[law][0],
               f[law][1], f[law][2], f[law][3], 100 * (high / low - 1));
    }
    fprintf(w->page, "</table>\n");
    commit_output(&csv);
}

/* Edges of the boundary seen along y. */
static void draw_shape(FILE *f, const tetmesh *m, double (*x)[3], double left) {
    uint32_t count;
    uint32_t(*t)[3] = tetmesh_boundary(m, &count);
    for (uint32_t i = 0; i < count; i++) {
        fputs("<polygon points='", f);
        for (int k = 0; k < 3; k++)
            fprintf(f, "%.1f,%.1f ", left + 1500 * x[t[i][k]][0], 190 - 1300 * x[t[i][k]][2]);
        fputs("' fill='none' stroke='#456' stroke-width='0.6'/>\n", f);
    }
    free(t);
}

static void figure_6(const work *w, const cubes *c) {
    swing_setup s = soft;
    double z[1], (*x)[3] = allocate(c->mesh[2].nodes, sizeof *x);
    s.lambda_Pa = s.mu_Pa = 5e3;
    begin_figure(w, "Figure 6: deformed shapes, Cauchy's and Green's strain",
                 "Cauchy's tensor distorts what turns; its simplified form, (b), is not described");
    output svg = study_file(w->folder, "figure-6.svg");
    FILE *both[2] = {svg.file, w->page};
    for (int f = 0; f < 2; f++) {
        fputs("<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 560 280' width='560' "
              "height='280'>\n<text x='40' y='20' font-size='13'>Cauchy</text><text x='320' y='20' "
              "font-size='13'>Green</text>\n",
              both[f]);
        for (int law = LAW_CAUCHY; law <= LAW_GREEN; law++) {
            oscillate(&c->mesh[2], (force_law)law, &s, c->corner[2], 1900, z, 1, x);
            draw_shape(both[f], &c->mesh[2], x, law == LAW_CAUCHY ? 40 : 320);
        }
        fputs("</svg>\n", both[f]);
    }
    commit_output(&svg);
    free(x);
}

static void show_oscillations(const work *w) {
    static double z[LAWS + 1][MESHES + 1][SAMPLES], damped[MESHES + 1][SAMPLES];
    double f[LAWS + 1][MESHES + 1];
    cubes c = make_cubes();
    for (int k = 0; k <= MESHES; k++) {
        for (int law = 0; law < LAWS; law++)
            oscillate(&c.mesh[k], (force_law)law, &soft, c.corner[k], 10, z[law][k], SAMPLES, NULL);
        in_the_engine(&c.mesh[k], c.corner[k], z[LAWS][k]);
        for (int law = 0; law <= LAWS; law++)
            f[law][k] = frequency_of(z[law][k], SAMPLES, INTERVAL);
        swing_setup s = soft;
        s.damping_s = 4e-3;
        s.step_s = 5e-5;
        oscillate(&c.mesh[k], LAW_GREEN, &s, c.corner[k], 20, damped[k], SAMPLES, NULL);
    }
    begin_figure(w, "Figure 4: a hanging cube, masses and springs (a) or Cauchy's strain (b)",
                 "amplitude and frequency change with the resolution. On our meshes, which are "
                 "regular, less than on theirs");
    draw_swing(w, "figure-4a", "masses and springs", &c, z[LAW_SPRINGS]);
    draw_swing(w, "figure-4b", "Cauchy's strain", &c, z[LAW_CAUCHY]);
    begin_figure(w, "Figure 5: the same with Green's strain (a), and damped (b)",
                 "closer resemblance between the levels of detail");
    draw_swing(w, "figure-5a", "Green's strain", &c, z[LAW_GREEN]);
    draw_swing(w, "figure-5b", "Green's strain, damped", &c, damped);
    frequencies(w, &c, f);
    figure_6(w, &c);
    for (int k = 0; k <= MESHES; k++) tetmesh_free(&c.mesh[k]);
}

typedef struct {
    body_spec body;
    tet_model tets;
} dynamic_spec;

static void take_key(void *context, const argument *a) {
    dynamic_spec *s = context;
    if (!tet_option(&s->tets, &s->body, a)) (void)body_option(&s->body, a);
}

static void show_speedup(const work *w, const char *path) {
    static const option keys[] = {BODY_OPTIONS, TET_OPTIONS, {NULL, 0}};
    static const double share[] = {0.004, 0.008, 0.016, 0.032};
    dynamic_spec s = {.body = body_defaults};
    s.body.folder = body_folder(path);
    args_parse_file(path, keys, take_key, &s);
    if (s.tets.levels < 2) die(EXIT_USAGE, "%s: needs 'tets N N ..'", path);
    size_t bytes;
    FILE *nowhere = tmpfile();
    if (nowhere == NULL) die(EXIT_WORK, "no temporary file");
    uint8_t *blob = tet_bake(&s.tets, &s.body, NULL, nowhere, &bytes);
    fclose(nowhere);
    palp_tets tets;
    (void)palp_tets_open(&tets, blob, bytes);
    const palp_tets_meta *m = tets.meta;
    palp_material material =
        palp_material_of(m->young_Pa, m->poisson, m->density_kg_m3, m->damping_s, m->drag_per_s);
    poke p = poke_for(&tets);
    output csv = begin_csv(w, "speed-up.csv",
                           "gamma_max_share,fine_evaluations,adaptive_evaluations,speed_up,"
                           "surface_worst,surface_mean,force_mean,most_nodes");
    begin_figure(w, "Speed-up: adaptive against uniformly fine, the same poke",
                 "between 5 and 20 times, a few hundred active points");
    fprintf(w->page,
            "<table><tr><th>gamma_max, of the diagonal<th>element evaluations, fine<th>"
            "adaptive<th>times fewer<th>surface off at most, of the diagonal<th>in the "
            "mean<th>force off in the mean<th>nodes at most, of %" PRIu32 "</tr>\n",
            m->nodes - m->first_node[m->levels - 1]);
    for (size_t k = 0; k < sizeof share / sizeof share[0]; k++) {
        speedup r = speedup_measure(&tets, material, &p, share[k]);
        double size = (double)m->diagonal_m;
        fprintf(csv.file, "%g,%.0f,%.0f,%.4g,%.4g,%.4g,%.4g,%" PRIu32 "\n", share[k], r.fine,
                r.adaptive, r.fine / r.adaptive, r.worst_m / size, r.mean_m / size, r.force_mean,
                r.most_nodes);
        fprintf(w->page,
                "<tr><td>%g<td>%.0f<td>%.0f<td>%.1f<td>%.2f %%<td>%.2f %%<td>%.1f %%<td>%" PRIu32
                "</tr>\n",
                share[k], r.fine, r.adaptive, r.fine / r.adaptive, 100 * r.worst_m / size,
                100 * r.mean_m / size, 100 * r.force_mean, r.most_nodes);
        printf("gamma_max %g: %.1f times fewer evaluations, surface off %.2f %% at most\n",
               share[k], r.fine / r.adaptive, 100 * r.worst_m / size);
        fflush(stdout);
    }
    fprintf(w->page, "</table>\n");
    commit_output(&csv);
    free(blob);
}

void reproduce_dynamics(work *w, const char *model) {
    fputs("<h1>Adaptive dynamics, on our own models</h1>\n", w->page);
    show_oscillations(w);
    show_speedup(w, model);
}
