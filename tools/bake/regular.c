/* SPDX-License-Identifier: MIT */
#include "tools/bake/regular.h"
#include "core/blob/format.h"
#include "tools/solver/dense.h"
#include "tools/solver/eigen.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SPARE_MODES 16u
#define ITERATIONS 6u

/* ---- the modes ---- */

typedef struct {
    const regular_body *body;
    const half_space *half_space;
    double *x;
    size_t width;
} subtraction;

/* Takes R_l^T of the half-space's rows away from the three rows of a free node. */
static void subtract_rows(void *context, size_t slot) {
    const subtraction *s = context;
    const palp_domain *d = &s->body->h->domain;
    uint32_t k = d->node[slot];
    double *row = allocate(9 * (size_t)d->slots, sizeof *row);
    for (uint32_t j = 0; j < d->slots; j++) {
        double block[9];
        half_space_block(s->half_space, s->body->material, k, d->node[j], block);
        for (size_t e = 0; e < 9; e++) row[e / 3 * 3 * d->slots + 3 * j + e % 3] = block[e];
    }
    for (size_t a = 0; a < 3; a++) {
        double *from = row + a * 3 * d->slots, *to = s->x + (3 * (size_t)k + a) * s->width;
        hierarchy_gather(s->body->h, d->levels - 1, s->body->level, from);
        for (size_t j = 0; j < s->width; j++) to[j] -= from[j];
    }
    free(row);
    progress_add(1);
}

/* The `count` eigenpairs of largest magnitude of the symmetric h (n x n), by subspace iteration:
 * `value` in falling magnitude, vectors in the columns of the result ([n][count], to be freed). */
static double *largest_modes(const double *h, size_t n, size_t count, double *value) {
    double *q = allocate_aligned(n * count, sizeof *q), *y = allocate_aligned(n * count, sizeof *y);
    double *small = allocate(count * count, sizeof *small), *v = allocate(count * count, sizeof *v);
    uint64_t seed = 1;
    for (size_t i = 0; i < n * count; i++) {
        seed = seed * 6364136223846793005ull + 1442695040888963407ull;
        q[i] = (double)(seed >> 11) / 4503599627370496.0 - 1.0;
    }
    orthonormalise(q, n, count, 0, count);
    for (uint32_t it = 0; it < ITERATIONS; it++) {
        memset(y, 0, n * count * sizeof *y);
        dense_subtract_product(y, count, h, n, q, count, n, count, n);
        if (it + 1 < ITERATIONS) {
            memcpy(q, y, n * count * sizeof *q);
            orthonormalise(q, n, count, 0, count);
        }
        progress_add((double)n);
    }
    for (size_t a = 0; a < count; a++) {
        for (size_t b = 0; b <= a; b++) {
            double dot = 0;
            for (size_t i = 0; i < n; i++) dot -= q[i * count + a] * y[i * count + b];
            small[a * count + b] = small[b * count + a] = dot;
        }
    }
    symmetric_eigen(small, v, count);
    uint32_t *order = allocate(count, sizeof *order);
    for (uint32_t a = 0; a < count; a++) {
        uint32_t k = a;
        for (; k > 0 && fabs(small[order[k - 1] * (count + 1)]) < fabs(small[a * (count + 1)]); k--)
            order[k] = order[k - 1];
        order[k] = a;
    }
    for (size_t i = 0; i < n; i++) {
        for (size_t a = 0; a < count; a++) {
            double sum = 0;
            for (size_t b = 0; b < count; b++) sum += q[i * count + b] * v[b * count + order[a]];
            y[i * count + a] = sum;
        }
    }
    for (size_t a = 0; a < count; a++) value[a] = small[order[a] * (count + 1)];
    void *owned[] = {q, small, v, order};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    return y;
}

/* Modes at the slots of `level` become modes at all slots, by P_l: u[slots][3][count]. */
static void prolong(const palp_domain *d, uint32_t level, size_t count, double *u) {
    for (uint32_t s = d->level_start[level + 1]; s < d->slots; s++) {
        double *to = u + 3 * (size_t)s * count;
        for (size_t side = 0; side < 2; side++) {
            double w = (double)d->predict[2 * (size_t)s + side];
            const double *from = u + 3 * (size_t)d->parent[2 * (size_t)s + side] * count;
            for (size_t i = 0; i < 3 * count && w > 0; i++) to[i] += w * from[i];
        }
    }
}

/* Rounds the modes at node[nodes] to 16 bits each, with the unit of each mode in its eigenvalue. */
static void store(regular_data *r, uint32_t vertices, const uint32_t *node, size_t nodes,
                  const double *u, size_t count, const double *value) {
    r->value = allocate(r->modes, sizeof *r->value);
    r->vector = allocate(3 * (size_t)vertices * r->modes, sizeof *r->vector);
    for (size_t a = 0; a < r->modes && a < count; a++) {
        double most = 0;
        for (size_t i = 0; i < 3 * nodes; i++) most = fmax(most, fabs(u[i * count + a]));
        if (!(most > 0)) continue;
        r->value[a] = (float)(value[a] * most * most);
        for (size_t s = 0; s < nodes; s++) {
            for (size_t k = 0; k < 3; k++) {
                double unit = u[(3 * s + k) * count + a] / most;
                r->vector[(3 * (size_t)node[s] + k) * r->modes + a] =
                    (int16_t)lrint(unit * (double)PALP_MODE_UNIT);
            }
        }
    }
}

/* How many modes are stored; returns how many are sought. */
static size_t choose_modes(regular_data *r, size_t n, uint32_t modes) {
    size_t rounded = (n + PALP_MODE_LANES - 1) / PALP_MODE_LANES * PALP_MODE_LANES;
    r->modes = modes < rounded ? modes : (uint32_t)rounded;
    return modes + SPARE_MODES < n ? modes + SPARE_MODES : n;
}

regular_data regular_build(const regular_body *body, double *x, uint32_t modes) {
    const palp_domain *d = &body->h->domain;
    const size_t n = 3 * (size_t)d->level_start[body->level + 1];
    regular_data r = {.across = mesh_across(body->m),
                      .triangle = allocate(body->m->vertices, sizeof *r.triangle)};
    for (uint32_t t = 0; t < body->m->triangles; t++) {
        for (int k = 0; k < 3; k++) r.triangle[body->m->t[t][k]] = t;
    }
    size_t count = choose_modes(&r, n, modes);
    progress_begin("regular part", (double)d->slots + ITERATIONS * (double)n);
    half_space *there = half_space_build(body->m, body->normal, body->averaged);
    subtraction s = {.body = body, .half_space = there, .x = x, .width = n};
    double *g = hierarchy_compliance(body->h, body->level, x, n);
    double norm2 = 0, left2 = 0;
    double *root = allocate(n, sizeof *root), mean = 0;
    for (size_t i = 0; i < n; i += 3) mean += body->h->area[body->level][i / 3] / ((double)n / 3);
    for (size_t i = 0; i < n; i++) root[i] = sqrt(body->h->area[body->level][i / 3] / mean);
    for (size_t i = 0; i < n * n; i++) {
        double w = g[i] * root[i / n] * root[i % n];
        norm2 += w * w;
    }
    free(g);
    parallel_for(d->slots, subtract_rows, &s);
    double *h = hierarchy_compliance(body->h, body->level, x, n);
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j <= i; j++) {
            double w = 0.5 * (h[i * n + j] + h[j * n + i]) * root[i] * root[j];
            h[i * n + j] = h[j * n + i] = w;
            left2 += (i == j ? 1 : 2) * w * w;
        }
    }
    double *value = allocate(count, sizeof *value);
    double *y = largest_modes(h, n, count, value);
    double *u = allocate(3 * (size_t)d->slots * count, sizeof *u);
    for (size_t i = 0; i < n; i++) {
        for (size_t a = 0; a < count; a++) u[i * count + a] = y[i * count + a] / root[i];
    }
    for (size_t a = 0; a < r.modes && a < count; a++) left2 -= value[a] * value[a];
    r.left_over = sqrt(fmax(left2, 0) / norm2);
    prolong(d, body->level, count, u);
    store(&r, body->m->vertices, d->node, d->slots, u, count, value);
    progress_end();
    half_space_free(there);
    void *owned[] = {root, h, value, y, u};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    return r;
}

/* ---- given nodes ---- */

typedef struct {
    const regular_nodes *nodes;
    const half_space *half_space;
    const double *root;
    double *g;
} node_subtraction;

/* Mean of what a half-space gives way by, and of Poisson's ratios. */
static half_space_material mean_of(half_space_material a, half_space_material b) {
    if (!(fabs(a.young_Pa - b.young_Pa) > 0) && !(fabs(a.poisson - b.poisson) > 0)) return a;
    double nu = 0.5 * (a.poisson + b.poisson);
    double soft = 0.5 * ((1 + a.poisson) / a.young_Pa + (1 + b.poisson) / b.young_Pa);
    return (half_space_material){(1 + nu) / soft, nu};
}

/* Takes the half-space's away from the three rows of a node, weighted by areas. */
static void subtract_from_node(void *context, size_t i) {
    const node_subtraction *s = context;
    const regular_nodes *p = s->nodes;
    const size_t n = 3 * (size_t)p->nodes;
    for (size_t j = 0; j < p->nodes; j++) {
        const half_space_material between = mean_of(p->material[i], p->material[j]);
        double block[9];
        half_space_block(s->half_space, between, p->node[i], p->node[j], block);
        for (size_t e = 0; e < 9; e++) {
            double *at = s->g + (3 * i + e / 3) * n + 3 * j + e % 3;
            *at = (*at - block[e]) * s->root[i] * s->root[j];
        }
    }
    progress_add(1);
}

regular_data regular_build_nodes(const regular_body *body, const regular_nodes *nodes, double *g,
                                 uint32_t modes) {
    const size_t n = 3 * (size_t)nodes->nodes;
    regular_data r = {.modes = 0};
    size_t count = choose_modes(&r, n, modes);
    progress_begin("regular part", (double)nodes->nodes + ITERATIONS * (double)n);
    double *root = allocate(nodes->nodes, sizeof *root), mean = 0, norm2 = 0, left2 = 0;
    for (uint32_t i = 0; i < nodes->nodes; i++) mean += body->area[nodes->node[i]] / nodes->nodes;
    for (uint32_t i = 0; i < nodes->nodes; i++) root[i] = sqrt(body->area[nodes->node[i]] / mean);
    for (size_t i = 0; i < n * n; i++) {
        double w = g[i] * root[i / n / 3] * root[i % n / 3];
        norm2 += w * w;
    }
    half_space *there = half_space_build(body->m, body->normal, body->averaged);
    const node_subtraction s = {nodes, there, root, g};
    parallel_for(nodes->nodes, subtract_from_node, (void *)(uintptr_t)&s);
    for (size_t i = 0; i < n * n; i++) left2 += g[i] * g[i];
    double *value = allocate(count, sizeof *value), *u = largest_modes(g, n, count, value);
    for (size_t i = 0; i < n * count; i++) u[i] /= root[i / count / 3];
    for (size_t a = 0; a < r.modes && a < count; a++) left2 -= value[a] * value[a];
    r.left_over = sqrt(fmax(left2, 0) / norm2);
    store(&r, body->m->vertices, nodes->node, nodes->nodes, u, count, value);
    progress_end();
    half_space_free(there);
    void *owned[] = {root, value, u};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    return r;
}

void regular_close_borders(regular_data *r, const mesh *m, const uint8_t *inner) {
    r->across = mesh_across(m);
    r->triangle = allocate(m->vertices, sizeof *r->triangle);
    for (uint32_t t = 0; t < m->triangles; t++) {
        for (size_t k = 0; k < 3; k++) {
            uint32_t *across = &r->across[3 * (size_t)t + k];
            if (inner[t] != 0 || inner[*across] != 0) *across = t;
        }
    }
    for (int pass = 1; pass >= 0; pass--) { /* outer ones last, so that they are kept */
        for (uint32_t t = 0; t < m->triangles; t++) {
            for (int k = 0; k < 3 && inner[t] == pass; k++) r->triangle[m->t[t][k]] = t;
        }
    }
}

void regular_free(regular_data *r) {
    free(r->across);
    free(r->triangle);
    free(r->value);
    free(r->vector);
}
