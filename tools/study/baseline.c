/* SPDX-License-Identifier: MIT */
#include "tools/study/baseline.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static double block_norm2(const baseline_matrix *m, size_t i, size_t j) {
    double sum = 0;
    for (size_t e = 0; e < 9; e++) {
        double v = m->g[(3 * i + e / 3) * 3 * m->n + 3 * j + e % 3];
        sum += v * v;
    }
    return sum;
}

static double norm2(const baseline_matrix *m) {
    double sum = 0;
    for (size_t k = 0; k < 9 * m->n * m->n; k++) sum += m->g[k] * m->g[k];
    return sum;
}

static int ascending(const void *a, const void *b) {
    double p = *(const double *)a, q = *(const double *)b;
    return (p > q) - (p < q);
}

baseline_result baseline_truncated(const baseline_matrix *m, double rms) {
    size_t blocks = m->n * m->n, dropped = 0;
    double *norm = allocate(blocks, sizeof *norm), total = norm2(m), lost = 0;
    for (size_t k = 0; k < blocks; k++) norm[k] = block_norm2(m, k / m->n, k % m->n);
    qsort(norm, blocks, sizeof *norm, ascending);
    while (dropped < blocks && lost + norm[dropped] <= rms * rms * total) lost += norm[dropped++];
    free(norm);
    double kept = (double)(blocks - dropped);
    double share = kept / (double)blocks;
    return (baseline_result){.compression = 36 * (double)blocks / (38 * kept),
                             .rms = sqrt(lost / total),
                             .work = share,
                             .work_patch = share};
}

baseline_result baseline_half(const baseline_matrix *m) {
    double lost = 0;
    size_t order = 3 * m->n;
    for (size_t j = 0; j < order; j++) {
        double largest = 0;
        for (size_t i = 0; i < order; i++) largest = fmax(largest, fabs(m->g[i * order + j]));
        for (size_t i = 0; i < order; i++) {
            double v = m->g[i * order + j] / largest;
            int exponent;
            (void)frexp(v, &exponent);
            double unit = ldexp(1, (exponent < -13 ? -13 : exponent) - 11);
            double off = (nearbyint(v / unit) * unit - v) * largest;
            lost += off * off;
        }
    }
    return (baseline_result){
        .compression = 2, .rms = sqrt(lost / norm2(m)), .work = 1, .work_patch = 1};
}

/* ---- block low rank ---- */

typedef struct {
    size_t *node;  /* order of the nodes */
    size_t *start; /* [clusters + 1] */
    size_t clusters;
} clustering;

static const double (*sort_x)[3];
static int sort_axis;
static int by_coordinate(const void *a, const void *b) {
    double p = sort_x[*(const size_t *)a][sort_axis], q = sort_x[*(const size_t *)b][sort_axis];
    return (p > q) - (p < q);
}

void baseline_sort(const baseline_matrix *m, size_t *node, size_t count, int axis) {
    sort_x = m->x;
    sort_axis = axis;
    qsort(node, count, sizeof *node, by_coordinate);
}

/* Halves the longest side of the fullest cluster until all are small enough. */
static clustering cluster_nodes(const baseline_matrix *m, size_t leaf) {
    clustering c = {.node = allocate(m->n, sizeof *c.node),
                    .start = allocate(m->n + 1, sizeof *c.start),
                    .clusters = 1};
    for (size_t i = 0; i < m->n; i++) c.node[i] = i;
    c.start[1] = m->n;
    for (size_t k = 0; k < c.clusters;) {
        size_t first = c.start[k], last = c.start[k + 1];
        if (last - first <= leaf) {
            k++;
            continue;
        }
        double longest = -1;
        int along = 0;
        for (int axis = 0; axis < 3; axis++) {
            double low = HUGE_VAL, high = -HUGE_VAL;
            for (size_t i = first; i < last; i++) {
                low = fmin(low, m->x[c.node[i]][axis]);
                high = fmax(high, m->x[c.node[i]][axis]);
            }
            if (high - low > longest) along = axis;
            longest = fmax(longest, high - low);
        }
        baseline_sort(m, c.node + first, last - first, along);
        memmove(c.start + k + 2, c.start + k + 1, (c.clusters - k) * sizeof *c.start);
        c.start[k + 1] = (first + last) / 2;
        c.clusters++;
    }
    return c;
}

typedef struct {
    const baseline_matrix *m;
    const clustering *c;
    double allowed2; /* squared error per entry */
    double *stored, *lost2;
} low_rank;

/* Cross approximation of one pair of clusters until its error is small or it is no gain. */
static void approximate(void *context, size_t pair) {
    const low_rank *l = context;
    size_t a = pair / l->c->clusters, b = pair % l->c->clusters;
    size_t rows = 3 * (l->c->start[a + 1] - l->c->start[a]);
    size_t columns = 3 * (l->c->start[b + 1] - l->c->start[b]);
    double *r = allocate(rows * columns, sizeof *r), left = 0;
    for (size_t i = 0; i < rows; i++) {
        size_t row = 3 * l->c->node[l->c->start[a] + i / 3] + i % 3;
        for (size_t j = 0; j < columns; j++) {
            size_t column = 3 * l->c->node[l->c->start[b] + j / 3] + j % 3;
            r[i * columns + j] = l->m->g[row * 3 * l->m->n + column];
            left += r[i * columns + j] * r[i * columns + j];
        }
    }
    double allowed = l->allowed2 * (double)(rows * columns);
    size_t rank = 0;
    while (left > allowed && (rank + 1) * (rows + columns) < rows * columns) {
        size_t best = 0;
        for (size_t k = 0; k < rows * columns; k++) {
            if (fabs(r[k]) > fabs(r[best])) best = k;
        }
        size_t p = best / columns, q = best % columns;
        double pivot = r[best], *u = allocate(rows, sizeof *u);
        for (size_t i = 0; i < rows; i++) u[i] = r[i * columns + q] / pivot;
        double *v = allocate(columns, sizeof *v);
        memcpy(v, r + p * columns, columns * sizeof *v);
        left = 0;
        for (size_t i = 0; i < rows; i++) {
            for (size_t j = 0; j < columns; j++) {
                r[i * columns + j] -= u[i] * v[j];
                left += r[i * columns + j] * r[i * columns + j];
            }
        }
        free(u);
        free(v);
        rank++;
    }
    bool dense = left > allowed;
    l->stored[pair] = dense ? (double)(rows * columns) : (double)(rank * (rows + columns));
    l->lost2[pair] = dense ? 0 : left;
    free(r);
}

baseline_result baseline_low_rank(const baseline_matrix *m, size_t leaf, double rms) {
    clustering c = cluster_nodes(m, leaf);
    size_t pairs = c.clusters * c.clusters;
    double total = norm2(m), entries = 9 * (double)m->n * (double)m->n;
    low_rank l = {.m = m,
                  .c = &c,
                  .allowed2 = rms * rms * total / entries,
                  .stored = allocate(pairs, sizeof(double)),
                  .lost2 = allocate(pairs, sizeof(double))};
    progress_begin("block low rank", 0);
    parallel_for(pairs, approximate, &l);
    progress_end();
    double stored = 0, lost = 0, patch = 0, patch_nodes = 0;
    for (size_t k = 0; k < pairs; k++) {
        stored += 0.5 * l.stored[k]; /* clusters with themselves by their triangle */
        lost += l.lost2[k];
    }
    /* A patch loads the fewest clusters that hold it: those of its nodes if it lies well. */
    for (size_t b = 0; b < c.clusters && patch_nodes < BASELINE_PATCH; b++) {
        for (size_t a = 0; a < c.clusters; a++) patch += l.stored[a * c.clusters + b];
        patch_nodes += (double)(c.start[b + 1] - c.start[b]);
    }
    free(c.node);
    free(c.start);
    free(l.stored);
    free(l.lost2);
    return (baseline_result){.compression = entries / stored,
                             .rms = sqrt(lost / total),
                             .work = 2 * stored / entries,
                             .work_patch =
                                 patch / (9 * (double)m->n * fmax(patch_nodes, BASELINE_PATCH))};
}
