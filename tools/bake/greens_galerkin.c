/* SPDX-License-Identifier: MIT */
#include "port/host/parallel.h"
#include "port/host/util.h"
#include "tools/mesh/thickness.h"
#include "tools/bake/greens.h"
#include "tools/bake/rbvp.h"
#include "tools/solver/dense.h"
#include "tools/solver/galerkin.h"
#include "tools/solver/gauss.h"
#include <stdlib.h>
#include <string.h>

#define MODES 6 /* rigid motions: three translations, three rotations about the middle */

/*
 * The compliance of the floating body, N, and what the fixed nodes take from it. Forces f on F, mean
 * displacements d on U and the weight leave reactions t on U and a rigid motion c:
 *
 *     N_UU t + R_U c = d - N_UF f - q_U,      R_U^T t = - R_F^T f - g
 *
 * With N_UU = L L^T, R_U^T N_UU^-1 R_U = S = M M^T and the columns (f | nodal values on U | weight),
 *
 *     A = L^-1 (N_UF | -P | q_U),             Z = M^-1 ((R_F^T | 0 | g) - (L^-1 R_U)^T A)
 *     Q = (N_FF | 0 | q_F) - A^T A + Z^T Z
 *
 * P takes nodal values on U to means there. Rows of F are displacements, those of U the reactions
 * with the opposite sign. Symmetric, G_FF positive definite, reactions in equilibrium with the load
 * and rigid motions free of them whatever the mesh.
 */
typedef struct {
    const mesh *m;
    const uint8_t *fixed;
    const bem_material *material;
    double origin[3];
    double *thickness; /* [triangles] */
    uint8_t *on_patch; /* [nodes]: a fixed node whose hat is that of the fixed patch */
    uint8_t *dropped;  /* [3 triangles] */
    galerkin_matrices g;
    double (*mode)[MODES]; /* [3n]: of nodes, orthonormal */
    double (*mean)[MODES]; /* [3n]: of the means that nodes stand for */
    double *weight;        /* [3n][3]: answer to weight */
    double weight_force[MODES][3];
} rbvp;

/*
 * A fixed node's reaction is spread over its hat: to the first free nodes on a smooth surface, so
 * that a patch ends about halfway to them, but not round an edge of the body, nor, where the patch
 * is to be `crisp`, beyond its own triangles.
 */
static void find_patches(rbvp *p) {
    const mesh *m = p->m;
    p->on_patch = allocate(m->vertices, 1);
    p->dropped = allocate(3 * (size_t)m->triangles, 1);
    double(*normal)[3] = allocate(m->triangles, sizeof *normal);
    uint8_t *smooth = allocate(3 * (size_t)m->triangles, 1);
    for (uint32_t i = 0; i < m->triangles; i++) {
        triangle_normal(m->x[m->t[i][0]], m->x[m->t[i][1]], m->x[m->t[i][2]], normal[i]);
        v_normalize(normal[i]);
        for (int k = 0; k < 3 && all_fixed(m, p->fixed, i); k++) p->on_patch[m->t[i][k]] = 1;
    }
    uint32_t *offset, *around;
    mesh_stars(m, &offset, &around);
    for (uint32_t i = 0; i < m->triangles; i++) {
        for (size_t k = 0; k < 3 && !all_fixed(m, p->fixed, i); k++) {
            uint32_t v = m->t[i][k];
            for (uint32_t e = offset[v]; e < offset[v + 1] && !p->material->crisp; e++) {
                if (all_fixed(m, p->fixed, around[e]) &&
                    v_dot(normal[i], normal[around[e]]) > QUADRATIC_SMOOTH_COS)
                    smooth[3 * (size_t)i + k] = 1;
            }
            p->dropped[3 * (size_t)i + k] = p->on_patch[v] != 0 && smooth[3 * (size_t)i + k] == 0;
        }
    }
    for (uint32_t i = 0; i < 3 * m->triangles; i++) {
        if (smooth[i] != 0) p->on_patch[m->t[i / 3][i % 3]] = 0;
    }
    void *owned[] = {normal, smooth, offset, around};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
}

/* Modes of nodes made orthonormal; those of hats are carried along. */
static void find_modes(rbvp *p) {
    size_t n = p->m->vertices;
    p->mode = allocate(3 * n, sizeof *p->mode);
    p->mean = allocate(3 * n, sizeof *p->mean);
    for (size_t i = 0; i < n; i++) {
        for (size_t a = 0; a < MODES; a++) {
            double u[3], v[3], x[3], y[3];
            v_sub(p->m->x[i], p->origin, x);
            v_sub(p->g.center[i], p->origin, y);
            rigid_mode(x, a, u);
            rigid_mode(y, a, v);
            for (size_t k = 0; k < 3; k++) {
                p->mode[3 * i + k][a] = u[k];
                p->mean[3 * i + k][a] = v[k];
            }
        }
    }
    for (size_t a = 0; a < MODES; a++) {
        for (size_t b = 0; b <= a; b++) {
            double dot = 0;
            for (size_t i = 0; i < 3 * n; i++) dot += p->mode[i][a] * p->mode[i][b];
            double factor = b < a ? dot : 1 / sqrt(dot);
            for (size_t i = 0; i < 3 * n; i++) {
                if (b < a) {
                    p->mode[i][a] -= factor * p->mode[i][b];
                    p->mean[i][a] -= factor * p->mean[i][b];
                } else {
                    p->mode[i][a] *= factor;
                    p->mean[i][a] *= factor;
                }
            }
        }
    }
}

/* What quadrature has left of the rigid motions in D, D Z, and in B. */
typedef struct {
    const rbvp *p;
    double (*left)[MODES], gram[MODES][MODES], own;
} projection;

static void find_left(void *context, size_t i) {
    const projection *s = context;
    const galerkin_matrices *g = &s->p->g;
    const size_t n = g->order;
    double wrong[MODES];
    memcpy(wrong, s->p->mean[i], sizeof wrong);
    for (size_t j = 0; j < n; j++) {
        for (size_t a = 0; a < MODES; a++) {
            s->left[i][a] += g->d[i * n + j] * s->p->mode[j][a];
            wrong[a] -= g->b[i * n + j] * s->p->mode[j][a];
        }
    }
    for (size_t j = 0; j < n; j++) {
        for (size_t a = 0; a < MODES; a++) g->b[i * n + j] += wrong[a] * s->p->mode[j][a];
    }
}

/* A row of (I - Z Z^T) D (I - Z Z^T) + own Z Z^T = D - Z L^T - L Z^T with 2 L = 2 D Z - Z (Z^T D Z +
 * own I). */
static void project_row(void *context, size_t i) {
    const projection *s = context;
    const galerkin_matrices *g = &s->p->g;
    for (size_t j = 0; j <= i; j++) {
        double sum = g->d[i * g->order + j];
        for (size_t a = 0; a < MODES; a++)
            sum -= s->p->mode[i][a] * s->left[j][a] + s->left[i][a] * s->p->mode[j][a];
        g->d[i * g->order + j] = sum;
    }
}

/* Takes what quadrature has left of the rigid motions out of D, puts a stiffness of their own in
 * its place, and makes B exact for them. */
static void project_rigid_motions(rbvp *p) {
    const size_t n = p->g.order;
    projection s = {.p = p, .left = allocate(n, sizeof *s.left)};
    for (size_t i = 0; i < n; i++) s.own += p->g.d[i * n + i] / (double)n;
    parallel_for(n, find_left, &s);
    for (size_t i = 0; i < n; i++) {
        for (size_t a = 0; a < MODES * MODES; a++)
            s.gram[a / MODES][a % MODES] += p->mode[i][a / MODES] * s.left[i][a % MODES];
    }
    for (size_t i = 0; i < n; i++) {
        for (size_t a = 0; a < MODES; a++) {
            for (size_t b = 0; b < MODES; b++)
                s.left[i][a] -= 0.5 * p->mode[i][b] * (s.gram[b][a] + (a == b ? s.own : 0));
        }
    }
    parallel_for(n, project_row, &s);
    free(s.left);
}

/* Means under the hats of the particular displacement for unit acceleration along each axis. */
static void add_particular_means(const rbvp *p, const quadratic_surface *q, double *to) {
    triangle_rule rule = triangle_rule_collapsed(5);
    for (uint32_t t = 0; t < p->m->triangles; t++) {
        for (uint32_t i = 0; i < rule.points; i++) {
            double n[6], nu[6], nv[6], y[3] = {0}, u[3] = {0}, v[3] = {0}, normal[3];
            quadratic_shape(rule.corner[i], n, nu, nv);
            for (int c = 0; c < 6; c++) {
                const double *x = quadratic_node(q, t, c);
                for (int k = 0; k < 3; k++) {
                    y[k] += n[c] * (x[k] - p->origin[k]);
                    u[k] += nu[c] * x[k];
                    v[k] += nv[c] * x[k];
                }
            }
            v_cross(u, v, normal);
            for (size_t c = 0; c < 3; c++) {
                uint32_t node = p->m->t[t][c];
                if (p->dropped[3 * (size_t)t + c] != 0) continue;
                double share =
                    rule.weight[i] * v_norm(normal) * rule.corner[i][c] / p->g.area[node];
                for (size_t d = 0; d < 3; d++) {
                    double particular[3];
                    particular_displacement(p->material, y, d, particular);
                    for (size_t k = 0; k < 3; k++)
                        to[(3 * node + k) * 3 + d] += share * particular[k];
                }
            }
        }
    }
    free(rule.corner);
    free(rule.weight);
}

typedef struct {
    double *a;
    size_t n;
} square;

static void transpose_row(void *context, size_t i) {
    const square *s = context;
    for (size_t j = 0; j < i; j++) {
        double t = s->a[i * s->n + j];
        s->a[i * s->n + j] = s->a[j * s->n + i];
        s->a[j * s->n + i] = t;
    }
}

static void mirror_row(void *context, size_t i) {
    const square *s = context;
    for (size_t j = 0; j <= i; j++) s->a[j * s->n + i] = s->a[i * s->n + j] = -s->a[i * s->n + j];
}

/* What contact on plates changed by, in the mean, when they were baked twice as fine: 9, 6 and 4 %
 * at walls of 1/2, 1 and 2 edges (FULL=1 tests/check/solids.sh). */
static void warn_of_thin_walls(const rbvp *p) {
    double thinnest = HUGE_VAL;
    uint32_t at = 0;
    for (uint32_t t = 0; t < p->m->triangles; t++) {
        double edges = p->thickness[t] / mesh_longest_edge(p->m, t);
        if (edges >= thinnest) continue;
        thinnest = edges;
        at = t;
    }
    if (thinnest >= 0.5) return;
    const double *x = p->m->x[p->m->t[at][0]];
    warn("the wall near (%.4g, %.4g, %.4g) is %.2g mm thick, %.2g of an edge: forces there may be "
         "off by about %.0f %%; a mesh with edges of that length halves this",
         x[0], x[1], x[2], 1e3 * p->thickness[at], thinnest, 6 * pow(thinnest, -0.6));
}

/* Names the place and the shape there: what makes the integrals fail are triangles much larger
 * than the wall is thick, needles, and surfaces that cross. */
_Noreturn static void die_of_shape(const rbvp *p, size_t node) {
    const mesh *m = p->m;
    double wall = HUGE_VAL, longest = 0, slender = 0;
    for (uint32_t t = 0; t < m->triangles; t++) {
        const uint32_t *v = m->t[t];
        if (v[0] != node && v[1] != node && v[2] != node) continue;
        double normal[3], edge = mesh_longest_edge(m, t);
        triangle_normal(m->x[v[0]], m->x[v[1]], m->x[v[2]], normal);
        wall = fmin(wall, p->thickness[t]);
        longest = fmax(longest, edge);
        slender = fmax(slender, edge * edge / v_norm(normal));
    }
    die(EXIT_WORK,
        "the surface cannot be integrated near node %zu (0-based) at (%.4g, %.4g, %.4g): the wall "
        "is %.2g mm thick, edges are up to %.2g mm long, triangles up to %.2g times as long as "
        "high; refine where edges are much longer than the wall is thick, and mend needles and "
        "places where the surface crosses itself",
        node, m->x[node][0], m->x[node][1], m->x[node][2], 1e3 * wall, 1e3 * longest, slender);
}

/* Cholesky's factor; exits at a pivot that is not positive. `node` says whose rows they are. */
static void factor(const rbvp *p, double *a, size_t n, const uint32_t *node) {
    size_t bad = dense_cholesky(a, n, n);
    if (bad < n) die_of_shape(p, node != NULL ? node[bad / 3] : bad / 3);
}

/* N in g.v, whole; the answer to weight in p->weight. Frees the other matrices. */
static void floating_body(rbvp *p, const quadratic_surface *q) {
    galerkin_matrices *g = &p->g;
    size_t n = g->order;
    for (size_t a = 0; a < MODES; a++) {
        for (size_t d = 0; d < 3; d++) {
            for (size_t i = 0; i < n; i++)
                p->weight_force[a][d] += p->mode[i][a] * g->b_weight[3 * i + d];
        }
    }
    project_rigid_motions(p);
    progress_begin("factorisation", (double)n);
    factor(p, g->d, n, NULL);
    progress_end();
    parallel_for(n, transpose_row, &(square){g->b, n});
    progress_begin("Green's functions", 0);
    dense_lower_solve(g->d, n, n, g->b, n, n);
    dense_lower_solve(g->d, n, n, g->b_weight, 3, 3);
    free(g->d);
    g->d = NULL;
    for (size_t i = 0; i < n * n; i++) g->v[i] = -g->v[i];
    dense_subtract_gram(g->v, n, g->b, n, n, n);
    parallel_for(n, mirror_row, &(square){g->v, n});
    p->weight = allocate(3 * n, sizeof *p->weight);
    for (size_t k = 0; k < n; k++) {
        for (size_t i = 0; i < n; i++) {
            for (size_t d = 0; d < 3; d++)
                p->weight[3 * i + d] += g->b[k * n + i] * g->b_weight[3 * k + d];
        }
    }
    for (size_t i = 0; i < 3 * n; i++) p->weight[i] += g->v_weight[i];
    add_particular_means(p, q, p->weight);
    progress_end();
    free(g->b);
    g->b = NULL;
}

/* Means under the hats of the fixed patch from nodal values there: P_ik = int phi_i phi_k / a_i. */
static double *patch_means(const rbvp *p, const uint32_t *node, const uint32_t *slot,
                           size_t count) {
    double *means = allocate(count * count, sizeof *means);
    for (uint32_t t = 0; t < p->m->triangles; t++) {
        if (!all_fixed(p->m, p->fixed, t)) continue;
        const uint32_t *v = p->m->t[t];
        double normal[3];
        triangle_normal(p->m->x[v[0]], p->m->x[v[1]], p->m->x[v[2]], normal);
        for (size_t e = 0; e < 9; e++)
            means[slot[v[e / 3]] * count + slot[v[e % 3]]] += (e % 4 == 0 ? 2 : 1) * v_norm(normal);
    }
    for (size_t i = 0; i < count; i++) {
        double sum = 0;
        for (size_t k = 0; k < count; k++) sum += means[i * count + k];
        for (size_t k = 0; k < count && sum > 0; k++) means[i * count + k] /= sum;
        if (sum > 0 && p->on_patch[node[i]] != 0) continue;
        memset(means + i * count, 0, count * sizeof *means);
        means[i * count + i] = 1;
    }
    return means;
}

/* The rigid motions that nodes of a patch interpolate, as means. */
static void patch_modes(const rbvp *p, const uint32_t *node, size_t count, const double *means) {
    for (size_t i = 0; i < count; i++) {
        if (p->on_patch[node[i]] == 0) continue;
        for (size_t k = 0; k < 3; k++) {
            for (size_t a = 0; a < MODES; a++) {
                double sum = 0;
                for (size_t j = 0; j < count; j++)
                    sum += means[i * count + j] * p->mode[3 * (size_t)node[j] + k][a];
                p->mean[3 * (size_t)node[i] + k][a] = sum;
            }
        }
    }
}

/* The nodes with the free ones first. */
static uint32_t *sort_nodes(const rbvp *p, size_t *free_count) {
    uint32_t *node = allocate(p->m->vertices, sizeof *node);
    size_t count = 0;
    for (int pass = 0; pass < 2; pass++) {
        for (uint32_t i = 0; i < p->m->vertices; i++) {
            if ((p->fixed[i] != 0) == (pass == 1)) node[count++] = i;
        }
        if (pass == 0) *free_count = count;
    }
    return node;
}

/* Row or column r of the sorted problem in N: 3 node + axis. */
static size_t sorted(const uint32_t *node, size_t r) { return 3 * (size_t)node[r / 3] + r % 3; }

/* A, and Z below it, before M^-1. */
static double *reactions(const rbvp *p, const uint32_t *node, size_t f, double s6[MODES * MODES]) {
    const size_t n = p->g.order, u = n - f, width = n + 3, held = u / 3;
    const uint32_t *on_u = node + f / 3;
    uint32_t *slot = allocate(p->m->vertices, sizeof *slot);
    for (size_t i = 0; i < held; i++) slot[on_u[i]] = (uint32_t)i;
    double *means = patch_means(p, on_u, slot, held);
    patch_modes(p, on_u, held, means);
    double *l = allocate_aligned(u * u, sizeof *l),
           *a = allocate_aligned((u + MODES) * width, sizeof *a);
    double(*r)[MODES] = allocate(u, sizeof *r), *z = a + u * width;
    for (size_t i = 0; i < u; i++) {
        const size_t row = sorted(node, f + i);
        for (size_t j = 0; j < f; j++) a[i * width + j] = p->g.v[row * n + sorted(node, j)];
        for (size_t j = 0; j < u; j++) l[i * u + j] = p->g.v[row * n + sorted(node, f + j)];
        for (size_t j = 0; j < held; j++)
            a[i * width + f + 3 * j + i % 3] = -means[i / 3 * held + j];
        memcpy(a + i * width + n, p->weight + 3 * row, 3 * sizeof *a);
        memcpy(r[i], p->mean[row], sizeof r[i]);
    }
    factor(p, l, u, on_u);
    dense_lower_solve(l, u, u, a, width, width);
    dense_lower_solve(l, u, u, (double *)(void *)r, MODES, MODES);
    for (size_t e = 0; e < MODES; e++) {
        for (size_t j = 0; j < f; j++) z[e * width + j] = p->mean[sorted(node, j)][e];
        memcpy(z + e * width + n, p->weight_force[e], sizeof p->weight_force[e]);
        for (size_t i = 0; i < u; i++) {
            for (size_t j = 0; j < width; j++) z[e * width + j] -= r[i][e] * a[i * width + j];
            for (size_t k = 0; k < MODES; k++) s6[e * MODES + k] += r[i][e] * r[i][k];
        }
    }
    void *owned[] = {slot, means, l, r};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    return a;
}

/* The lower triangle of Q, in the sorted order, [n + 3][n + 3]. */
static double *fix_nodes(const rbvp *p, const uint32_t *node, size_t f) {
    const size_t n = p->g.order, u = n - f, width = n + 3;
    double s6[MODES * MODES] = {0}, *a = reactions(p, node, f, s6), *z = a + u * width;
    if (dense_cholesky(s6, MODES, MODES) < MODES)
        die(EXIT_WORK, "the fixed nodes must hold the body against every translation and rotation");
    dense_lower_solve(s6, MODES, MODES, z, width, width);
    double *q = allocate_aligned(width * width, sizeof *q);
    for (size_t i = 0; i < f; i++) {
        const double *row = p->g.v + sorted(node, i) * n;
        for (size_t j = 0; j <= i; j++) q[i * width + j] = -row[sorted(node, j)];
        for (size_t d = 0; d < 3; d++) q[(n + d) * width + i] = -p->weight[3 * sorted(node, i) + d];
    }
    dense_subtract_gram(q, width, z, width, width, MODES);
    for (size_t i = 0; i < width; i++) {
        for (size_t j = 0; j <= i; j++) q[i * width + j] = -q[i * width + j];
    }
    dense_subtract_gram(q, width, a, width, width, u);
    free(a);
    return q;
}

greens greens_from_galerkin(const mesh *m, const uint8_t *fixed, const bem_material *material,
                            double density_kg_m3) {
    rbvp p = {.m = m, .fixed = fixed, .material = material};
    for (uint32_t i = 0; i < m->vertices; i++) {
        for (int k = 0; k < 3; k++) p.origin[k] += m->x[i][k] / m->vertices;
    }
    p.thickness = mesh_thickness(m, 1);
    warn_of_thin_walls(&p);
    find_patches(&p);
    quadratic_surface q = quadratic_build(m);
    p.g =
        galerkin_assemble(&q, &(galerkin_problem){.young_Pa = material->young_Pa,
                                                  .poisson = material->poisson,
                                                  .origin = {p.origin[0], p.origin[1], p.origin[2]},
                                                  .thickness = p.thickness,
                                                  .dropped = p.dropped});
    find_modes(&p);
    floating_body(&p, &q);
    quadratic_free(&q);
    size_t free_count, n = p.g.order, width = n + 3;
    uint32_t *node = sort_nodes(&p, &free_count);
    double *sum = fix_nodes(&p, node, 3 * free_count);
    galerkin_free(&p.g);
    greens g = {.nodes = m->vertices,
                .width = width,
                .fixed = fixed,
                .gravity = true,
                .reactions = true,
                .averaged = true};
    g.m = allocate_aligned(n * width, sizeof *g.m);
    for (size_t i = 0; i < width; i++) {
        for (size_t j = 0; j <= i; j++) {
            size_t row = i < n ? sorted(node, i) : i, column = j < n ? sorted(node, j) : j;
            double value = sum[i * width + j] * (i < n ? 1 : density_kg_m3);
            if (j < n) g.m[column * width + row] = j < 3 * free_count ? value : -value;
            if (i < n) g.m[row * width + column] = i < 3 * free_count ? value : -value;
        }
    }
    void *owned[] = {p.thickness, p.on_patch, p.dropped, p.mode, p.mean, p.weight, node, sum};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    return g;
}
