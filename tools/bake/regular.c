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

#define NEAR_EDGES 2.6 /* distance up to which the hat of the load is integrated over */
#define POINTS 5u      /* Gauss points along each side of the Duffy square */
#define SPARE_MODES 16u
#define ITERATIONS 6u
#define HEX_CELL                                                                                   \
    0.8660254037844386 /* area of a node of a regular lattice, over its edge squared               \
                        */

static const double gauss_at[POINTS] = {0.0469100770306680, 0.2307653449471585, 0.5,
                                        0.7692346550528415, 0.9530899229693320};
static const double gauss_weight[POINTS] = {0.1184634425280945, 0.2393143352496832,
                                            0.2844444444444444, 0.2393143352496832,
                                            0.1184634425280945};

uint32_t *regular_across(const mesh *m) {
    uint32_t count;
    mesh_edge *edge = mesh_edges(m, &count);
    uint32_t *across = allocate(3 * (size_t)m->triangles, sizeof *across);
    for (uint32_t e = 0; e < count; e++) {
        for (int side = 0; side < 2; side++) {
            const uint32_t *t = m->t[edge[e].triangle[side]];
            for (size_t k = 0; k < 3; k++) {
                if (t[k] == edge[e].a || t[k] == edge[e].b) continue;
                across[3 * (size_t)edge[e].triangle[side] + k] = edge[e].triangle[1 - side];
            }
        }
    }
    free(edge);
    return across;
}

struct regular_stars {
    const regular_body *body;
    uint32_t *offset, *triangle; /* triangles around each node */
    double *edge;                /* of a regular lattice of the node's area */
    double *star_area;           /* integral of its hat */
};

regular_stars *regular_stars_build(const regular_body *body) {
    const mesh *m = body->m;
    regular_stars *s = allocate(1, sizeof *s);
    s->body = body;
    s->offset = allocate(m->vertices + 1u, sizeof *s->offset);
    s->triangle = allocate(3 * (size_t)m->triangles, sizeof *s->triangle);
    s->edge = allocate(m->vertices, sizeof *s->edge);
    s->star_area = allocate(m->vertices, sizeof *s->star_area);
    for (uint32_t t = 0; t < m->triangles; t++) {
        double n[3];
        triangle_normal(m->x[m->t[t][0]], m->x[m->t[t][1]], m->x[m->t[t][2]], n);
        for (int k = 0; k < 3; k++) {
            s->offset[m->t[t][k] + 1]++;
            s->star_area[m->t[t][k]] += v_norm(n) / 6;
        }
    }
    for (uint32_t i = 0; i < m->vertices; i++) {
        s->offset[i + 1] += s->offset[i];
        s->edge[i] = sqrt(s->star_area[i] / HEX_CELL);
    }
    uint32_t *next = allocate(m->vertices, sizeof *next);
    for (uint32_t t = 0; t < m->triangles; t++) {
        for (int k = 0; k < 3; k++) {
            uint32_t v = m->t[t][k];
            s->triangle[s->offset[v] + next[v]++] = t;
        }
    }
    free(next);
    return s;
}

void regular_stars_free(regular_stars *s) {
    free(s->offset);
    free(s->triangle);
    free(s->edge);
    free(s->star_area);
    free(s);
}

/* block += weight B(r) without its factor (1 + nu) / (pi E) */
static void add_kernel(double block[9], double weight, const double r[3], const double n[3],
                       double nu) {
    double d = v_norm(r), e[3] = {r[0] / d, r[1] / d, r[2] / d};
    weight /= d;
    for (size_t i = 0; i < 3; i++) {
        for (size_t j = 0; j < 3; j++) {
            double b = nu * e[i] * e[j] + (0.5 - nu) * (e[i] * n[j] - n[i] * e[j]);
            block[3 * i + j] += weight * (b + (i == j ? 1 - nu : 0));
        }
    }
}

/* Over one triangle of the star of l; the apex of Duffy's map lies at k where k is a corner. */
static void add_triangle(const regular_stars *s, const uint32_t *t, uint32_t k, uint32_t l,
                         const double n[3], double nu, double block[9]) {
    const mesh *m = s->body->m;
    size_t apex = 0, hat = 0;
    for (size_t c = 0; c < 3; c++) {
        if (t[c] == l) hat = c;
    }
    apex = hat;
    for (size_t c = 0; c < 3; c++) {
        if (t[c] == k) apex = c;
    }
    double normal[3];
    triangle_normal(m->x[t[0]], m->x[t[1]], m->x[t[2]], normal);
    for (size_t q = 0; q < POINTS * POINTS; q++) {
        double u = gauss_at[q / POINTS], v = gauss_at[q % POINTS];
        double w = gauss_weight[q / POINTS] * gauss_weight[q % POINTS] * u * v_norm(normal);
        double corner[3], r[3];
        corner[apex] = 1 - u;
        corner[(apex + 1) % 3] = u * (1 - v);
        corner[(apex + 2) % 3] = u * v;
        for (int a = 0; a < 3; a++) {
            r[a] = m->x[k][a];
            for (size_t c = 0; c < 3; c++) r[a] -= corner[c] * m->x[t[c]][a];
        }
        add_kernel(block, w * corner[hat] / s->star_area[l], r, n, nu);
    }
}

void regular_half_space(const regular_stars *s, regular_material material, uint32_t k, uint32_t l,
                        double block[9]) {
    const regular_body *b = s->body;
    double r[3], n[3];
    v_sub(b->m->x[k], b->m->x[l], r);
    for (int a = 0; a < 3; a++) n[a] = 0.5 * (b->normal[k][a] + b->normal[l][a]);
    memset(block, 0, 9 * sizeof *block);
    if (v_norm(r) > NEAR_EDGES * fmax(s->edge[k], s->edge[l])) {
        add_kernel(block, 1, r, n, material.poisson);
    } else {
        for (uint32_t i = s->offset[l]; i < s->offset[l + 1]; i++)
            add_triangle(s, b->m->t[s->triangle[i]], k, l, n, material.poisson, block);
    }
    double factor = (1 + material.poisson) / (acos(-1.0) * material.young_Pa);
    for (int e = 0; e < 9; e++) block[e] *= factor;
}

/* ---- the modes ---- */

typedef struct {
    const regular_body *body;
    const regular_stars *stars;
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
        double there[9], back[9];
        regular_half_space(s->stars, s->body->material, k, d->node[j], there);
        regular_half_space(s->stars, s->body->material, d->node[j], k, back);
        for (size_t e = 0; e < 9; e++)
            row[e / 3 * 3 * d->slots + 3 * j + e % 3] =
                0.5 * (there[e] + back[3 * (e % 3) + e / 3]);
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
    regular_data r = {.across = regular_across(body->m),
                      .triangle = allocate(body->m->vertices, sizeof *r.triangle)};
    for (uint32_t t = 0; t < body->m->triangles; t++) {
        for (int k = 0; k < 3; k++) r.triangle[body->m->t[t][k]] = t;
    }
    size_t count = choose_modes(&r, n, modes);
    progress_begin("regular part", (double)d->slots + ITERATIONS * (double)n);
    subtraction s = {.body = body, .stars = regular_stars_build(body), .x = x, .width = n};
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
    regular_stars_free((regular_stars *)(uintptr_t)s.stars);
    void *owned[] = {root, h, value, y, u};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    return r;
}

/* ---- given nodes ---- */

typedef struct {
    const regular_nodes *nodes;
    const regular_stars *stars;
    const double *root;
    double *g;
} node_subtraction;

/* Mean of what a half-space gives way by, and of Poisson's ratios. */
static regular_material mean_of(regular_material a, regular_material b) {
    if (!(fabs(a.young_Pa - b.young_Pa) > 0) && !(fabs(a.poisson - b.poisson) > 0)) return a;
    double nu = 0.5 * (a.poisson + b.poisson);
    double soft = 0.5 * ((1 + a.poisson) / a.young_Pa + (1 + b.poisson) / b.young_Pa);
    return (regular_material){(1 + nu) / soft, nu};
}

/* Takes the half-space's away from the three rows of a node, weighted by areas. */
static void subtract_from_node(void *context, size_t i) {
    const node_subtraction *s = context;
    const regular_nodes *p = s->nodes;
    const size_t n = 3 * (size_t)p->nodes;
    for (size_t j = 0; j < p->nodes; j++) {
        const regular_material between = mean_of(p->material[i], p->material[j]);
        double there[9], back[9];
        regular_half_space(s->stars, between, p->node[i], p->node[j], there);
        regular_half_space(s->stars, between, p->node[j], p->node[i], back);
        for (size_t e = 0; e < 9; e++) {
            double *at = s->g + (3 * i + e / 3) * n + 3 * j + e % 3;
            *at = (*at - 0.5 * (there[e] + back[3 * (e % 3) + e / 3])) * s->root[i] * s->root[j];
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
    regular_stars *stars = regular_stars_build(body);
    const node_subtraction s = {nodes, stars, root, g};
    parallel_for(nodes->nodes, subtract_from_node, (void *)(uintptr_t)&s);
    for (size_t i = 0; i < n * n; i++) left2 += g[i] * g[i];
    double *value = allocate(count, sizeof *value), *u = largest_modes(g, n, count, value);
    for (size_t i = 0; i < n * count; i++) u[i] /= root[i / count / 3];
    for (size_t a = 0; a < r.modes && a < count; a++) left2 -= value[a] * value[a];
    r.left_over = sqrt(fmax(left2, 0) / norm2);
    store(&r, body->m->vertices, nodes->node, nodes->nodes, u, count, value);
    progress_end();
    regular_stars_free(stars);
    void *owned[] = {root, value, u};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    return r;
}

void regular_close_borders(regular_data *r, const mesh *m, const uint8_t *inner) {
    r->across = regular_across(m);
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
