/* SPDX-License-Identifier: MIT */
/* Nested cluster bases (H2 matrices), to compare with: baseline.h. */
#include "port/host/parallel.h"
#include "port/host/util.h"
#include "port/host/vec3.h"
#include "tools/solver/dense.h"
#include "tools/solver/eigen.h"
#include "tools/study/baseline.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define MOST_CLUSTERS 1024

typedef struct {
    size_t first, last; /* nodes, in the order of the tree */
    size_t child[2];    /* 0: a leaf */
    size_t parent;
    double center[3], radius;
    size_t rank, rows; /* of v: 3 nodes of a leaf, the ranks of the children of a parent */
    double *v;         /* [rows][rank] */
    double *whole;     /* [3 nodes][rank] of all of the cluster */
    double *far;       /* [rank][3 n] its rows in its basis, in what it is coupled with */
    uint8_t *coupled;  /* [n] nodes that it or an ancestor is coupled with */
} cluster;

typedef struct {
    const baseline_matrix *m;
    size_t *node; /* order of the tree */
    double *g;    /* m->g in that order */
    cluster *c;
    size_t clusters, leaf;
    double apart, drop, near, far, lost2, patch; /* entries stored; squared error */
} tree;

/* Center and radius; returns the longest axis of its box. */
static int measure(const tree *t, cluster *c) {
    int longest = 0;
    double low[3], high[3];
    for (int k = 0; k < 3; k++) {
        low[k] = HUGE_VAL;
        high[k] = -HUGE_VAL;
        for (size_t i = c->first; i < c->last; i++) {
            low[k] = fmin(low[k], t->m->x[t->node[i]][k]);
            high[k] = fmax(high[k], t->m->x[t->node[i]][k]);
        }
        c->center[k] = 0.5 * (low[k] + high[k]);
        if (high[k] - low[k] > high[longest] - low[longest]) longest = k;
    }
    for (size_t i = c->first; i < c->last; i++)
        c->radius = fmax(c->radius, v_distance(t->m->x[t->node[i]], c->center));
    return longest;
}

/* Parents stand before their children. */
static void build_tree(tree *t) {
    t->c = allocate(MOST_CLUSTERS, sizeof *t->c);
    t->c[0] = (cluster){.last = t->m->n};
    t->clusters = 1;
    for (size_t k = 0; k < t->clusters; k++) {
        cluster *c = &t->c[k];
        const int axis = measure(t, c);
        if (c->last - c->first <= t->leaf || t->clusters + 2 > MOST_CLUSTERS) continue;
        baseline_sort(t->m, t->node + c->first, c->last - c->first, axis);
        const size_t middle = (c->first + c->last) / 2;
        c->child[0] = t->clusters++;
        c->child[1] = t->clusters++;
        t->c[c->child[0]] = (cluster){.first = c->first, .last = middle, .parent = k};
        t->c[c->child[1]] = (cluster){.first = middle, .last = c->last, .parent = k};
    }
}

static bool is_far(const tree *t, const cluster *a, const cluster *b) {
    return v_distance(a->center, b->center) >=
           a->radius + b->radius + t->apart * fmax(a->radius, b->radius);
}

typedef void (*on_pair)(tree *t, size_t a, size_t b);

/* Calls `far` and `near` for the pairs that the matrix falls into, each with its transpose once. */
static void visit(tree *t, size_t a, size_t b, on_pair far, on_pair near) {
    const cluster *p = &t->c[a], *q = &t->c[b];
    if (a != b && is_far(t, p, q)) {
        far(t, a, b);
    } else if (p->child[0] == 0 && q->child[0] == 0) {
        near(t, a, b);
    } else if (a == b) {
        visit(t, p->child[0], p->child[0], far, near);
        visit(t, p->child[1], p->child[0], far, near);
        visit(t, p->child[1], p->child[1], far, near);
    } else if (q->child[0] == 0 || (p->child[0] != 0 && p->radius >= q->radius)) {
        visit(t, p->child[0], b, far, near);
        visit(t, p->child[1], b, far, near);
    } else {
        visit(t, a, q->child[0], far, near);
        visit(t, a, q->child[1], far, near);
    }
}

static void couple(tree *t, size_t a, size_t b) {
    for (size_t i = t->c[b].first; i < t->c[b].last; i++) t->c[a].coupled[i] = 1;
    for (size_t i = t->c[a].first; i < t->c[a].last; i++) t->c[b].coupled[i] = 1;
}
static void no_pair(tree *t, size_t a, size_t b) {
    (void)t;
    (void)a;
    (void)b;
}

/* Whether the dense rows of a pair meet the first clusters, which a patch loads. */
static bool is_of_patch(const tree *t, size_t a, size_t b) {
    return t->c[a].first < BASELINE_PATCH || t->c[b].first < BASELINE_PATCH;
}

static void count_near(tree *t, size_t a, size_t b) {
    const cluster *p = &t->c[a], *q = &t->c[b];
    const double entries =
        9 * (double)(p->last - p->first) * (double)(q->last - q->first) * (a == b ? 0.5 : 1);
    t->near += entries;
    if (is_of_patch(t, a, b)) t->patch += entries;
}

/* S = V_a^T G_ab V_b; what the bases miss of the block is the rest of its norm. */
static void count_far(tree *t, size_t a, size_t b) {
    const cluster *p = &t->c[a], *q = &t->c[b];
    const size_t columns = 3 * (q->last - q->first), order = 3 * t->m->n;
    double all = 0, kept = 0;
    for (size_t i = 3 * p->first; i < 3 * p->last; i++) {
        for (size_t j = 0; j < columns; j++)
            all += t->g[i * order + 3 * q->first + j] * t->g[i * order + 3 * q->first + j];
    }
    for (size_t i = 0; i < p->rank; i++) {
        for (size_t k = 0; k < q->rank; k++) {
            double sum = 0;
            for (size_t j = 0; j < columns; j++)
                sum += p->far[i * order + 3 * q->first + j] * q->whole[j * q->rank + k];
            kept += sum * sum;
        }
    }
    t->far += (double)(p->rank * q->rank);
    if (is_of_patch(t, a, b)) t->patch += (double)(p->rank * q->rank);
    t->lost2 += 2 * fmax(all - kept, 0);
}

/* The rows of a cluster in its children's bases, or themselves, where it is coupled. */
static double *gather_rows(const tree *t, const cluster *c) {
    const size_t order = 3 * t->m->n;
    double *rows = allocate_aligned(c->rows * order + 1, sizeof *rows);
    for (size_t r = 0, child = 0, at = 0; r < c->rows; r++, at++) {
        const double *from = t->g + (3 * c->first + r) * order;
        if (c->child[0] != 0) {
            while (at >= t->c[c->child[child]].rank) {
                child++;
                at = 0;
            }
            from = t->c[c->child[child]].far + at * order;
        }
        for (size_t j = 0; j < order; j++) rows[r * order + j] = c->coupled[j / 3] ? from[j] : 0;
    }
    return rows;
}

/* The basis from the eigenvectors of its rows' products. */
static void make_basis(tree *t, cluster *c) {
    const size_t order = 3 * t->m->n, nodes = c->last - c->first;
    c->rows = c->child[0] != 0 ? t->c[c->child[0]].rank + t->c[c->child[1]].rank : 3 * nodes;
    const size_t n = c->rows;
    double *rows = gather_rows(t, c);
    double *gram = allocate(n * n + 1, sizeof *gram), *vector = allocate(n * n + 1, sizeof *vector);
    for (size_t i = 0; i < n; i++) {
        for (size_t k = 0; k <= i; k++) {
            double sum = 0;
            for (size_t j = 0; j < order; j++) sum += rows[i * order + j] * rows[k * order + j];
            gram[i * n + k] = gram[k * n + i] = sum;
        }
    }
    symmetric_eigen(gram, vector, n);
    size_t *kept = allocate(n + 1, sizeof *kept);
    for (size_t k = 0; k < n; k++) {
        if (gram[k * n + k] > t->drop * t->drop) kept[c->rank++] = k;
    }
    c->v = allocate(n * c->rank + 1, sizeof *c->v);
    c->far = allocate_aligned(c->rank * order + 1, sizeof *c->far);
    c->whole = allocate(3 * nodes * c->rank + 1, sizeof *c->whole);
    for (size_t k = 0; k < c->rank; k++) {
        for (size_t i = 0; i < n; i++) {
            const double v = vector[i * n + kept[k]];
            c->v[i * c->rank + k] = v;
            for (size_t j = 0; j < order; j++) c->far[k * order + j] += v * rows[i * order + j];
        }
    }
    for (size_t r = 0, below = 0; r < 2 && c->child[0] != 0; below += t->c[c->child[r]].rank, r++) {
        const cluster *d = &t->c[c->child[r]];
        for (size_t i = 0; i < 3 * (d->last - d->first); i++) {
            for (size_t k = 0; k < c->rank; k++) {
                double sum = 0;
                for (size_t e = 0; e < d->rank; e++)
                    sum += d->whole[i * d->rank + e] * c->v[(below + e) * c->rank + k];
                c->whole[(3 * (d->first - c->first) + i) * c->rank + k] = sum;
            }
        }
    }
    if (c->child[0] == 0) memcpy(c->whole, c->v, 3 * nodes * c->rank * sizeof *c->v);
    free(rows);
    free(gram);
    free(vector);
    free(kept);
}

static void order_matrix(tree *t) {
    const size_t order = 3 * t->m->n;
    t->g = allocate_aligned(order * order, sizeof *t->g);
    for (size_t i = 0; i < order; i++) {
        const double *from = t->m->g + (3 * t->node[i / 3] + i % 3) * order;
        for (size_t j = 0; j < order; j++) t->g[i * order + j] = from[3 * t->node[j / 3] + j % 3];
    }
}

typedef struct {
    tree *t;
    size_t *which;
} batch;

static void make_basis_of(void *context, size_t k) {
    const batch *b = context;
    make_basis(b->t, &b->t->c[b->which[k]]);
}

/* Children first: the deepest of the tree, then those above. */
static void make_bases(tree *t) {
    size_t *depth = allocate(t->clusters, sizeof *depth), deepest = 0;
    batch b = {t, allocate(t->clusters, sizeof *b.which)};
    for (size_t k = 1; k < t->clusters; k++) {
        depth[k] = depth[t->c[k].parent] + 1;
        deepest = depth[k] > deepest ? depth[k] : deepest;
    }
    for (size_t level = deepest + 1; level-- > 0;) {
        size_t count = 0;
        for (size_t k = 0; k < t->clusters; k++) {
            if (depth[k] == level) b.which[count++] = k;
        }
        parallel_for(count, make_basis_of, &b);
    }
    free(depth);
    free(b.which);
}

baseline_result baseline_nested(const baseline_matrix *m, size_t leaf, double apart, double drop) {
    tree t = {
        .m = m, .leaf = leaf, .apart = apart, .drop = drop, .node = allocate(m->n, sizeof *t.node)};
    double total = 0, bases = 0;
    for (size_t i = 0; i < m->n; i++) t.node[i] = i;
    for (size_t k = 0; k < 9 * m->n * m->n; k++) total += m->g[k] * m->g[k];
    build_tree(&t);
    order_matrix(&t);
    for (size_t k = 0; k < t.clusters; k++) t.c[k].coupled = allocate(m->n, 1);
    visit(&t, 0, 0, couple, no_pair);
    for (size_t k = 1; k < t.clusters; k++) {
        for (size_t i = 0; i < m->n; i++) t.c[k].coupled[i] |= t.c[t.c[k].parent].coupled[i];
    }
    make_bases(&t);
    visit(&t, 0, 0, count_far, count_near);
    for (size_t k = 0; k < t.clusters; k++) bases += (double)(t.c[k].rows * t.c[k].rank);
    const double entries = 9 * (double)m->n * (double)m->n, stored = t.near + t.far + bases;
    for (size_t k = 0; k < t.clusters; k++) {
        void *owned[] = {t.c[k].v, t.c[k].whole, t.c[k].far, t.c[k].coupled};
        for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    }
    free(t.c);
    free(t.g);
    free(t.node);
    return (baseline_result){.compression = entries / stored,
                             .rms = sqrt(t.lost2 / total),
                             .work = (2 * t.near + 2 * t.far + 2 * bases) / entries,
                             .work_patch = (t.patch + bases) / (9 * (double)m->n * BASELINE_PATCH)};
}
