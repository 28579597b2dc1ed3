/* SPDX-License-Identifier: MIT */
/* The constraint hierarchy against its definition in double precision, and definiteness of every
 * level. */
#include "tests/models.h"
#include "tests/tap.h"
#include "tools/solver/dense.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

/* G between two weightings of the free nodes, from the dense matrix. */
static void weighted_block(const baked *b, const double *left, const double *right, double g[9]) {
    const palp_domain *d = &b->blob.domain[PALP_FREE];
    memset(g, 0, 9 * sizeof *g);
    for (uint32_t i = 0; i < d->slots; i++) {
        for (uint32_t j = 0; j < d->slots && left[i] > 0; j++) {
            if (!(right[j] > 0)) continue;
            for (size_t e = 0; e < 9; e++)
                g[e] += left[i] * right[j] *
                        greens_row(&b->g, d->node[i], e / 3)[3 * d->node[j] + e % 3];
        }
    }
}

static double largest_entry(const double g[9]) {
    double m = 0;
    for (int e = 0; e < 9; e++) m = fmax(m, fabs(g[e]));
    return m;
}

/* Entries of any two basis functions, of equal and of different levels: extracted from compressed
 * hierarchical columns, and looked up. */
static void test_entries(const baked *b) {
    const palp_blob *blob = &b->blob;
    const palp_domain *d = &blob->domain[PALP_FREE];
    double *left = allocate(d->slots, sizeof *left), *right = allocate(d->slots, sizeof *right);
    palp_row_scratch scratch = {allocate(d->slots, sizeof(float)),
                                allocate((d->slots + 31) / 32, sizeof(uint32_t))};
    palp_row row = {.index = allocate(d->slots, sizeof(uint16_t)),
                    .weight = allocate(d->slots, sizeof(float))};
    double extracted = 0, looked_up = 0;
    uint64_t seed = 17;
    for (int trial = 0; trial < 60; trial++) {
        uint32_t la = (uint32_t)trial % d->levels, lb = (uint32_t)(trial / 4) % d->levels;
        uint32_t a = (uint32_t)((tap_random(&seed) + 1) / 2 * (double)blob->level[la].nodes);
        uint32_t c = (uint32_t)((tap_random(&seed) + 1) / 2 * (double)blob->level[lb].nodes);
        a = a < blob->level[la].nodes ? a : 0;
        c = c < blob->level[lb].nodes ? c : 0;
        hierarchy_distribute(&b->d.h, la, a, left);
        hierarchy_distribute(&b->d.h, lb, c, right);
        double exact[9];
        float block[9];
        weighted_block(b, left, right, exact);
        (void)palp_basis_row(blob, (palp_basis){la, a}, &scratch, &row, d->slots);
        palp_columns_extract(&blob->level[lb].columns, c, &row, block);
        for (int e = 0; e < 9; e++)
            extracted = fmax(extracted, fabs((double)block[e] - exact[e]) / largest_entry(exact));
        if (la != lb || blob->level[la].table == NULL) continue;
        palp_table_block(blob, la, a, c, block);
        for (int e = 0; e < 9; e++)
            looked_up = fmax(looked_up, fabs((double)block[e] - exact[e]) / largest_entry(exact));
    }
    AT_MOST(extracted, 2e-5, "entries of any two basis functions against R G R^T in double");
    AT_MOST(looked_up, 1e-6, "and those looked up in tables");
    double sums = 0;
    for (uint32_t l = 0; l + 1 < d->levels; l++) {
        for (uint32_t k = 0; k < blob->level[l].nodes; k++) {
            double sum = (double)palp_own_share(blob, l, k);
            palp_child_range r = palp_children(d, k, l + 1);
            for (uint32_t c = r.first; c < r.end; c++)
                sum += (double)palp_child_share(blob, l, k, d->child[c]);
            sums = fmax(sums, fabs(sum - 1));
        }
    }
    AT_MOST(sums, 1e-6, "shares of every force on the way down sum to one");
}

/* Least pivot over diagonal of a level's table, in double. */
static double least_pivot(const palp_blob *b, uint32_t level) {
    const size_t n = b->level[level].nodes, order = 3 * n;
    double *c = allocate_aligned(order * order, sizeof *c),
           *diagonal = allocate(order, sizeof(double));
    for (uint32_t j = 0; j < n; j++) {
        for (uint32_t i = 0; i < n; i++) {
            float block[9];
            palp_table_block(b, level, i, j, block);
            for (size_t e = 0; e < 9; e++)
                c[(3 * i + e / 3) * order + 3 * j + e % 3] = (double)block[e];
        }
    }
    for (size_t i = 0; i < order; i++) diagonal[i] = c[i * order + i];
    double least = HUGE_VAL;
    size_t done = dense_cholesky(c, order, order);
    for (size_t i = 0; i < done; i++)
        least = fmin(least, c[i * order + i] * c[i * order + i] / diagonal[i]);
    free(c);
    free(diagonal);
    return done == order ? least : -1;
}

static mesh refined(const char *control, uint32_t splits) {
    mesh m = mesh_load(control);
    for (uint32_t l = 0; l < splits; l++) {
        mesh finer = subdivide_loop(&m);
        mesh_free(&m);
        m = finer;
    }
    return m;
}

static void test_definite(const char *name, uint32_t splits, double below) {
    static const double epsilons[] = {0.01, 0.05, 0.2};
    for (int e = 0; e < 3; e++) {
        baked b = model_bake_tables(refined(name, splits), below, epsilons[e], false, false, 1e6);
        for (uint32_t l = 0; l < b.blob.meta->levels && b.blob.level[l].table != NULL; l++) {
            double least = least_pivot(&b.blob, l);
            CHECK(least > 0,
                  "%s of %u nodes, epsilon %g, table of level %u (%u nodes): positive definite, "
                  "least "
                  "pivot %.1e of its diagonal",
                  name, b.m.vertices, epsilons[e], l, b.blob.level[l].nodes, least);
        }
        free(b.bytes);
        free(b.g.m);
    }
}

int main(void) {
    progress_quiet(1);
    baked exact = model_bake_tables(model_sphere(2), -0.7, 0, false, false, 8e6);
    test_entries(&exact);
    test_definite("blobs/ball.obj", 1, -0.5);
    test_definite("blobs/rabbit.obj", 2, 0.004);
    return tap_done();
}
