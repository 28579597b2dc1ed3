/* SPDX-License-Identifier: MIT */
#include "tools/tet/tethierarchy.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SPREAD 2.0 /* most of the sum of absolute weights in a container */
#define REACH 2.0  /* and in a mean of children, before a family takes in a neighbour */
#define FEW 10     /* children that stand for a parent */
#define NONE UINT32_MAX

/* ---- places ---- */

typedef struct {
    const tetmesh *m;
    double (*gradient)[3][3], (*middle)[3], *radius;
    double (*x)[3];
    tet_place *place;
} search;

/* Weights of x in a tetrahedron; the smallest is returned. */
static double weights_in(const search *s, uint32_t tet, const double x[3], double w[4]) {
    double r[3], least;
    v_sub(x, s->m->x[s->m->t[tet][0]], r);
    w[0] = 1;
    for (int k = 0; k < 3; k++) {
        w[k + 1] = v_dot(s->gradient[tet][k], r);
        w[0] -= w[k + 1];
    }
    least = w[0];
    for (int k = 1; k < 4; k++) least = fmin(least, w[k]);
    return least;
}

/* Draws weights towards the middle until their absolute sum is bounded. */
static void draw_in(double w[4]) {
    double sum = 0;
    for (int k = 0; k < 4; k++) sum += fabs(w[k]);
    if (sum <= SPREAD) return;
    double share = (SPREAD - 1) / (sum - 1); /* the sum of absolute values is convex in it */
    for (int k = 0; k < 4; k++) w[k] = 0.25 + share * (w[k] - 0.25);
}

static void find_place(void *context, size_t i) {
    search *s = context;
    double best = -HUGE_VAL, w[4];
    for (uint32_t t = 0; t < s->m->tets && best < 0; t++) {
        /* a weight falls by 1 over a height, which is at most the diameter */
        double away = v_distance(s->x[i], s->middle[t]) - s->radius[t];
        if (away > 0 && -away / (2 * s->radius[t]) < best) continue;
        double least = weights_in(s, t, s->x[i], w);
        if (least <= best) continue;
        best = least;
        s->place[i].tet = t;
        memcpy(s->place[i].weight, w, sizeof w);
    }
    draw_in(s->place[i].weight);
}

tet_place *tet_places(const tetmesh *m, double (*x)[3], uint32_t count) {
    search s = {.m = m, .x = x, .place = allocate((size_t)count + 1, sizeof *s.place)};
    s.gradient = allocate((size_t)m->tets + 1, sizeof *s.gradient);
    s.middle = allocate((size_t)m->tets + 1, sizeof *s.middle);
    s.radius = allocate((size_t)m->tets + 1, sizeof *s.radius);
    for (uint32_t t = 0; t < m->tets; t++) {
        tet_gradients(m, t, s.gradient[t]);
        for (int k = 0; k < 4; k++) {
            for (int a = 0; a < 3; a++) s.middle[t][a] += 0.25 * m->x[m->t[t][k]][a];
        }
        for (int k = 0; k < 4; k++)
            s.radius[t] = fmax(s.radius[t], v_distance(s.middle[t], m->x[m->t[t][k]]));
    }
    parallel_for(count, find_place, &s);
    free(s.gradient);
    free(s.middle);
    free(s.radius);
    return s.place;
}

/* ---- families ---- */

/* Solves the symmetric positive definite 4x4 system in place by Cholesky; false if it is not. */
static bool solve4(double a[4][4], double b[4]) {
    double largest = 0;
    for (int i = 0; i < 4; i++) largest = fmax(largest, a[i][i]);
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j <= i; j++) {
            double sum = a[i][j];
            for (int k = 0; k < j; k++) sum -= a[i][k] * a[j][k];
            if (i == j && !(sum > 1e-9 * largest)) return false;
            a[i][j] = i == j ? sqrt(sum) : sum / a[j][j];
        }
    }
    for (int i = 0; i < 4; i++) {
        for (int k = 0; k < i; k++) b[i] -= a[i][k] * b[k];
        b[i] /= a[i][i];
    }
    for (int i = 3; i >= 0; i--) {
        for (int k = i + 1; k < 4; k++) b[i] -= a[k][i] * b[k];
        b[i] /= a[i][i];
    }
    return true;
}

/*
 * Weights of children at x[] that reproduce affine functions at p, the nearer the heavier: the
 * smallest sum of w^2 (d^2 + (scale / 4)^2). False if there are none with a bounded sum.
 */
static bool affine_weights(const tetmesh *fine, const uint32_t *child, uint32_t count,
                           const double p[3], double scale, double *w) {
    double a[4][4] = {{0}}, b[4] = {1, 0, 0, 0};
    for (int pass = 0; pass < 2; pass++) {
        double sum = 0;
        for (uint32_t i = 0; i < count; i++) {
            double r[4] = {1}, d[3];
            v_sub(fine->x[child[i]], p, d);
            for (int k = 0; k < 3; k++) r[k + 1] = d[k] / scale;
            double q = scale * scale / (v_dot(d, d) + scale * scale / 16);
            if (pass == 0) {
                for (int k = 0; k < 16; k++) a[k / 4][k % 4] += q * r[k / 4] * r[k % 4];
            } else {
                w[i] = q * (r[0] * b[0] + r[1] * b[1] + r[2] * b[2] + r[3] * b[3]);
                sum += fabs(w[i]);
            }
        }
        if (pass == 0 && !solve4(a, b)) return false;
        if (pass == 1 && sum > REACH) return false;
    }
    return true;
}

typedef struct {
    const tetmesh *coarse, *fine;
    double scale;
    uint32_t *root;    /* of each parent: the first parent of its family */
    uint32_t *nearest; /* parent of each child */
    uint32_t *list, count;
    double *weight;
    struct relative {
        double away;
        uint32_t node;
    } * relative;
} kinship;

static uint32_t root_of(const kinship *k, uint32_t i) {
    while (k->root[i] != i) i = k->root[i];
    return i;
}

static void list_children(kinship *k, uint32_t root) {
    k->count = 0;
    for (uint32_t i = 0; i < k->fine->nodes; i++) {
        if (root_of(k, k->nearest[i]) == root) k->list[k->count++] = i;
    }
}

/* Joins the family of p with that of the nearest parent of another one. */
static bool take_in(kinship *k, uint32_t p) {
    double best = HUGE_VAL;
    uint32_t found = NONE, mine = root_of(k, p);
    for (uint32_t i = 0; i < k->coarse->nodes; i++) {
        double d = v_distance(k->coarse->x[i], k->coarse->x[p]);
        if (d < best && root_of(k, i) != mine) {
            best = d;
            found = root_of(k, i);
        }
    }
    if (found == NONE) return false;
    k->root[found < mine ? mine : found] = found < mine ? found : mine;
    return true;
}

static int by_distance(const void *a, const void *b) {
    const struct relative *p = a, *q = b;
    if (p->away < q->away || p->away > q->away) return p->away < q->away ? -1 : 1;
    return (p->node > q->node) - (p->node < q->node);
}

/* Whether the family of p stands for it: if they can, the nearest FEW children, else all. */
static bool stands(kinship *k, uint32_t p) {
    const double *x = k->coarse->x[p];
    list_children(k, root_of(k, p));
    for (uint32_t i = 0; i < k->count; i++)
        k->relative[i] = (struct relative){v_distance(k->fine->x[k->list[i]], x), k->list[i]};
    qsort(k->relative, k->count, sizeof *k->relative, by_distance);
    for (uint32_t i = 0; i < k->count; i++) k->list[i] = k->relative[i].node;
    uint32_t all = k->count;
    k->count = all < FEW ? all : FEW;
    for (; k->count >= 4; k->count = all) {
        if (affine_weights(k->fine, k->list, k->count, x, k->scale, k->weight)) return true;
        if (k->count == all) break;
    }
    return false;
}

/* A family that grows is looked at again. */
static void settle(kinship *k) {
    for (bool joined = true; joined;) {
        joined = false;
        for (uint32_t p = 0; p < k->coarse->nodes; p++) {
            if (stands(k, p)) continue;
            joined = true;
            if (take_in(k, p)) continue;
            die(EXIT_WORK,
                "a level of %u nodes cannot follow one of %u: give them more different resolutions",
                k->coarse->nodes, k->fine->nodes);
        }
    }
}

static double mean_edge(const tetmesh *m) {
    double sum = 0;
    for (uint32_t i = 0; i < m->tets; i++) sum += v_distance(m->x[m->t[i][0]], m->x[m->t[i][1]]);
    return sum / m->tets;
}

tet_families tet_families_build(const tetmesh *coarse, const tetmesh *fine) {
    kinship k = {.coarse = coarse, .fine = fine, .scale = mean_edge(fine)};
    k.root = allocate((size_t)coarse->nodes + 1, sizeof *k.root);
    k.nearest = allocate((size_t)fine->nodes + 1, sizeof *k.nearest);
    k.list = allocate((size_t)fine->nodes + 1, sizeof *k.list);
    k.weight = allocate((size_t)fine->nodes + 1, sizeof *k.weight);
    for (uint32_t p = 0; p < coarse->nodes; p++) k.root[p] = p;
    for (uint32_t i = 0; i < fine->nodes; i++) {
        double best = HUGE_VAL;
        for (uint32_t p = 0; p < coarse->nodes; p++) {
            double d = v_distance(fine->x[i], coarse->x[p]);
            if (d < best) {
                best = d;
                k.nearest[i] = p;
            }
        }
    }
    k.relative = allocate((size_t)fine->nodes + 1, sizeof *k.relative);
    settle(&k);
    tet_families f = {.families = 0};
    uint32_t *number = allocate((size_t)coarse->nodes + 1, sizeof *number);
    f.of_parent = allocate((size_t)coarse->nodes + 1, sizeof *f.of_parent);
    f.of_child = allocate((size_t)fine->nodes + 1, sizeof *f.of_child);
    f.mean_offset = allocate((size_t)coarse->nodes + 2, sizeof *f.mean_offset);
    for (uint32_t p = 0; p < coarse->nodes; p++) {
        uint32_t root = root_of(&k, p);
        if (root == p)
            number[p] = f.families++;
        else
            f.joined++;
        f.of_parent[p] = number[root];
    }
    for (uint32_t i = 0; i < fine->nodes; i++) f.of_child[i] = f.of_parent[k.nearest[i]];
    size_t room = 0, weight_room = 0;
    for (uint32_t p = 0; p < coarse->nodes; p++) {
        (void)stands(&k, p); /* as it settled */
        uint32_t at = f.mean_offset[p];
        f.mean = grow(f.mean, &room, at + k.count, sizeof *f.mean);
        f.mean_weight = grow(f.mean_weight, &weight_room, at + k.count, sizeof *f.mean_weight);
        memcpy(f.mean + at, k.list, k.count * sizeof *f.mean);
        memcpy(f.mean_weight + at, k.weight, k.count * sizeof *f.mean_weight);
        f.mean_offset[p + 1] = at + k.count;
    }
    void *owned[] = {number, k.root, k.nearest, k.list, k.weight, k.relative};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    return f;
}

void tet_families_free(tet_families *f) {
    void *owned[] = {f->of_parent, f->of_child, f->mean_offset, f->mean, f->mean_weight};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    *f = (tet_families){.families = 0};
}
