/* SPDX-License-Identifier: MIT */
#include "core/green/cma.h"
#include "tools/solver/dense.h"
#include "tools/solver/electrostatics.h"
#include "tools/study/reproduce.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    uint32_t node;
    double distance;
} near_node;

static int nearer(const void *a, const void *b) {
    const near_node *p = a, *q = b;
    return (p->distance > q->distance) - (p->distance < q->distance);
}

/* Total force of a flat push of the `count` nodes nearest to `center` on one level. */
static bool patch_force(palp_cma *cma, const near_node *list, uint32_t count, palp_vec3 push,
                        uint32_t level, palp_pairing pairing, float *u, float *f,
                        palp_vec3 *total) {
    palp_cma_clear(cma);
    (void)palp_cma_level(cma, level, pairing);
    for (uint32_t i = 0; i < count; i++) {
        if (palp_cma_prescribe(cma, list[i].node, PALP_PRESCRIBE_DISPLACEMENT, push) != PALP_OK)
            return false;
    }
    if (palp_cma_solve(cma, u, f) != PALP_OK) return false;
    *total = (palp_vec3){0};
    for (uint32_t i = 0; i < cma->blob->meta->nodes; i++) {
        if (!palp_node_is_fixed(cma->blob, i)) *total = palp_add(*total, palp_vec3_at(f + 3 * i));
    }
    return true;
}

typedef struct {
    double sum[2], largest[2], unknowns;
    uint32_t patches;
} patch_error;

/* Over patches about every `step`-th node of the two coarsest levels, on all levels. */
static void patch_errors(const palp_blob *b, uint32_t count, patch_error error[PALP_MAX_LEVELS]) {
    palp_cma cma;
    uint32_t n = b->meta->nodes, finest = b->meta->constraint_level;
    size_t bytes = palp_cma_memsize(b, 3 * count);
    void *memory = allocate_aligned(bytes, 1);
    if (palp_cma_init(&cma, b, 3 * count, memory, bytes) != PALP_OK) die(EXIT_WORK, "solver");
    float *u = allocate(3 * (size_t)n, sizeof *u), *f = allocate(3 * (size_t)n, sizeof *f);
    near_node *list = allocate(n, sizeof *list);
    for (uint32_t k = 0; k < b->level[1].nodes; k++) {
        uint32_t center = b->domain[PALP_FREE].node[k];
        palp_vec3 x = palp_vec3_at(b->rest_m + 3 * center);
        palp_vec3 push =
            palp_scale(-0.02f * b->meta->mean_edge_m, palp_vec3_at(b->normal + 3 * center));
        for (uint32_t i = 0; i < n; i++) {
            palp_vec3 off = palp_sub(palp_vec3_at(b->rest_m + 3 * i), x);
            list[i] = (near_node){i, (double)palp_dot(off, off)};
        }
        qsort(list, n, sizeof *list, nearer);
        bool usable = true;
        for (uint32_t i = 0; i < count; i++)
            usable = usable && !palp_node_is_fixed(b, list[i].node);
        palp_vec3 exact;
        if (!usable || !patch_force(&cma, list, count, push, finest, PALP_ENERGETIC, u, f, &exact))
            continue;
        for (uint32_t l = 0; l < finest; l++) {
            double off[2];
            bool sound = true;
            uint32_t hats = 0;
            for (uint32_t i = 0; i < count; i++)
                hats += palp_node_slot(b, list[i].node) < b->level[l].nodes;
            for (int p = 0; p < 2 && sound; p++) {
                palp_vec3 got;
                sound =
                    hats > 0 && patch_force(&cma, list, count, push, l,
                                            p == 0 ? PALP_ENERGETIC : PALP_COLLOCATED, u, f, &got);
                if (sound) off[p] = (double)(palp_norm(palp_sub(got, exact)) / palp_norm(exact));
            }
            if (!sound) continue;
            error[l].patches++;
            error[l].unknowns += cma.solved;
            for (int p = 0; p < 2; p++) {
                error[l].sum[p] += off[p];
                error[l].largest[p] = fmax(error[l].largest[p], off[p]);
            }
        }
    }
    free(memory);
    free(u);
    free(f);
    free(list);
}

void compare_levels(work *w) {
    static const uint32_t sizes[] = {40, 150};
    built exact = build_case(&w->small[CASES - 1], 0.002);
    palp_blob b;
    if (palp_blob_open(&b, exact.bytes, exact.size) != PALP_OK) die(EXIT_WORK, "levels");
    output csv = begin_csv(w, "levels.csv",
                           "patch_nodes,levels_down,patches,unknowns,energetic_mean,energetic_max,"
                           "collocated_mean,collocated_max,entries_ratio,factor_ratio");
    begin_figure(
        w, "Force of a flat push on coarser constraint levels, L = 4",
        "no figures; its section 8 predicts 4 times fewer constraints, 16 times fewer "
        "entries, 64 times less factorisation per level. Patches about every node of the two "
        "coarsest levels; all components prescribed; epsilon .002.");
    fprintf(w->page, "<table><tr><th>nodes<th>levels down<th>patches<th>unknowns<th>energetic, "
                     "mean<th>max<th>collocated, mean<th>max<th>entries, times fewer<th>factor, "
                     "times cheaper</tr>\n");
    for (int s = 0; s < 2; s++) {
        patch_error error[PALP_MAX_LEVELS] = {{{0}, {0}, 0, 0}};
        patch_errors(&b, sizes[s], error);
        for (uint32_t l = b.meta->constraint_level; l-- > 0;) {
            const patch_error *e = &error[l];
            if (e->patches == 0) continue;
            double n = e->patches, ratio = 3.0 * sizes[s] / (e->unknowns / n);
            uint32_t down = b.meta->constraint_level - l;
            fprintf(csv.file, "%u,%u,%u,%.3g,%.4g,%.4g,%.4g,%.4g,%.4g,%.4g\n", sizes[s], down,
                    e->patches, e->unknowns / n, e->sum[0] / n, e->largest[0], e->sum[1] / n,
                    e->largest[1], ratio * ratio, ratio * ratio * ratio);
            fprintf(w->page,
                    "<tr><td>%u<td>%u<td>%u<td>%.1f<td>%.1f %%<td>%.1f %%<td>%.1f %%<td>%.1f "
                    "%%<td>%.0f<td>%.0f</tr>\n",
                    sizes[s], down, e->patches, e->unknowns / n, 100 * e->sum[0] / n,
                    100 * e->largest[0], 100 * e->sum[1] / n, 100 * e->largest[1], ratio * ratio,
                    ratio * ratio * ratio);
            printf(
                "  %3u nodes, %u down (%3u patches, %5.1f unknowns): energetic mean %4.1f %% max "
                "%4.1f %%, collocated mean %4.1f %% max %4.1f %%\n",
                sizes[s], down, e->patches, e->unknowns / n, 100 * e->sum[0] / n,
                100 * e->largest[0], 100 * e->sum[1] / n, 100 * e->largest[1]);
        }
    }
    fprintf(w->page, "</table>\n");
    commit_output(&csv);
    free(exact.bytes);
}

/* The scalar matrix as multiples of the identity, which is how one-entry blocks come about. */
static greens embed(const study_case *c, const double *scalar) {
    greens g = {.nodes = c->m.vertices,
                .width = 3 * (size_t)c->m.vertices,
                .fixed = c->fixed,
                .scalar = true};
    size_t n = free_nodes(c);
    g.m = allocate_aligned(g.width * g.width, sizeof *g.m);
    for (size_t i = 0, row = 0; i < g.nodes; i++) {
        if (c->fixed[i] != 0) continue;
        for (size_t j = 0, column = 0; j < g.nodes; j++) {
            if (c->fixed[j] != 0) continue;
            for (size_t k = 0; k < 3; k++)
                greens_row(&g, i, k)[3 * j + k] = scalar[row * n + column];
            column++;
        }
        row++;
    }
    return g;
}

/* Charge that raises every free node to unit potential, from the blob and by elimination. */
static double charge_error(const study_case *c, const double *scalar, const palp_blob *b) {
    palp_cma cma;
    uint32_t n = c->m.vertices, m = free_nodes(c);
    size_t bytes = palp_cma_memsize(b, m);
    void *memory = allocate_aligned(bytes, 1);
    float *v = allocate(3 * (size_t)n, sizeof *v), *q = allocate(3 * (size_t)n, sizeof *q);
    if (palp_cma_init(&cma, b, m, memory, bytes) != PALP_OK) die(EXIT_WORK, "solver");
    for (uint32_t i = 0; i < n; i++) {
        if (c->fixed[i] == 0)
            (void)palp_cma_prescribe(&cma, i, PALP_PRESCRIBE_DISPLACEMENT, (palp_vec3){1, 0, 0});
    }
    if (palp_cma_solve(&cma, v, q) != PALP_OK) die(EXIT_WORK, "the charges cannot be solved for");
    double *a = allocate_aligned((size_t)m * m, sizeof *a), *x = allocate(m, sizeof *x);
    memcpy(a, scalar, (size_t)m * m * sizeof *a);
    for (uint32_t i = 0; i < m; i++) x[i] = 1;
    uint32_t *perm = allocate(m, sizeof *perm);
    if (dense_lu(a, m, m, perm) < m) die(EXIT_WORK, "singular potentials");
    dense_lu_solve(a, m, m, perm, x, 1, 1);
    double got = 0, exact = 0;
    for (uint32_t i = 0; i < n; i++) got += c->fixed[i] == 0 ? (double)q[3 * i] : 0;
    for (uint32_t i = 0; i < m; i++) exact += x[i];
    void *owned[] = {memory, v, q, a, x, perm};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    return fabs(got / exact - 1);
}

void show_electrostatics(work *w) {
    study_case *c = &w->small[1];
    greens elastic = c->g;
    static study_point p[4][STUDY_EPSILONS];
    const study_point *curve[4];
    const char *label[4];
    double *scalar = electrostatic_greens(&c->m, c->fixed, c->area);
    c->g = embed(c, scalar);
    begin_figure(w, "An electrostatic problem: scalar blocks, L = 3",
                 "names electrostatics as another use, without figures. Charges on an insulator in "
                 "free space, its foot grounded; potentials are what displacements were.");
    for (int k = 0; k < 4; k++) {
        wavelet v = {k % 2 == 0 ? WAVELET_LINEAR : WAVELET_BUTTERFLY, k < 2};
        study_curve(c, v, THRESHOLD_COLUMN, c->stored, p[k]);
        curve[k] = p[k];
        label[k] = wavelet_label(v);
    }
    save_curves(w, "electrostatics.csv", c, curve, 4);
    add_chart(w, "electrostatics.svg", "RMS error of the potentials", BY_COMPRESSION, RMS_ERROR,
              curve, label, 4);
    output npy = study_file(w->folder, "electrostatics.npy");
    npy_write(npy.file, scalar, free_nodes(c));
    commit_output(&npy);
    char path[512];
    snprintf(path, sizeof path, "%s/electrostatics.obj", w->folder);
    mesh_save_obj(&c->m, path);
    fprintf(w->page, "<table><tr><th>epsilon<th>blob bytes<th>charge at unit potential, "
                     "error</tr>\n");
    static const double epsilons[] = {0, 0.01, 0.05};
    for (int e = 0; e < 3; e++) {
        built b = build_case(c, epsilons[e]);
        palp_blob blob;
        if (palp_blob_open(&blob, b.bytes, b.size) != PALP_OK) die(EXIT_WORK, "electrostatics");
        double off = charge_error(c, scalar, &blob);
        fprintf(w->page, "<tr><td>%g<td>%zu<td>%.1e</tr>\n", epsilons[e], b.size, off);
        printf("  epsilon %g: %zu bytes, total charge at unit potential off by %.1e\n", epsilons[e],
               b.size, off);
        free(b.bytes);
    }
    fprintf(w->page, "</table>\n<p><code>palp bake electrostatics.obj --as-is --compliance "
                     "electrostatics.npy ...</code> makes the blob.</p>\n");
    free(scalar);
    free(c->g.m);
    c->g = elastic;
}
