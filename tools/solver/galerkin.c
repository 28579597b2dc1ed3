/* SPDX-License-Identifier: MIT */
#include "tools/solver/galerkin.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include "tools/solver/gauss.h"
#include "tools/solver/kernel_sums.h"
#include "tools/solver/near_field.h"
#include "tools/solver/pairs.h"
#include "tools/mesh/nearest.h"
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846
#define TOLERANCE 1e-4
#define KEPT_ORDERS 6 /* the points of rules up to this order are kept at every triangle */
#define FAR_ORDER 4   /* most, of pairs whose distance is not looked at closely */
#define FAR_POINTS 3  /* of order 2, by far the most frequent */
#define ROW_ORDER 8   /* most Gauss points in each direction of a row triangle that is near */
#define NEAR_ORDER 7
#define TOUCHING_LEAST 4 /* Gauss points in each direction where triangles touch */
#define TOUCHING_MOST 16
#define THIN 0.05  /* thickness over the body's diagonal below which bending needs more of them */
#define CHUNK 48u  /* triangles whose rows are made before they are added up */
#define SLICE 256u /* columns that are added up at once */

typedef struct {
    double center[3], radius, longest;
    uint32_t touching; /* order of the rules for triangles that it touches */
} triangle_size;

/* The sums of one row triangle. */
typedef struct {
    uint32_t row;
    double (*node)[ROW_LANES];               /* [vertices + edges] */
    double (*far)[FAR_POINTS][SOURCE_LANES]; /* the same, at the row's far points */
    double (*hat)[3][OUTER_LANES];           /* [vertices] */
    double weight[3][3][3];                  /* [corner][axis][direction] */
    uint8_t *used;                           /* [edges]: middles that have near sums */
    surface_point *y;                        /* room for near pairs */
} row_sums;

typedef struct {
    const quadratic_surface *q;
    const galerkin_problem *problem;
    kernel_problem kernel;
    galerkin_matrices *out;
    surface_point *kept[KEPT_ORDERS + 1]; /* [triangles][points] */
    triangle_rule rule[ROW_ORDER + 1];
    pair_rule touching[4][TOUCHING_MOST + 1];
    triangle_size *size;
    size_t first, count, workers;     /* triangles of this chunk */
    row_sums *sums;                   /* [workers] */
    double *rows_d, *rows_b, *rows_v; /* [CHUNK][18 or 9][3n] */
    double *weight_v, *weight_b;      /* [CHUNK][27 or 3n * 3] */
} assembly;

static size_t source_node(const quadratic_surface *q, uint32_t triangle, int c) {
    return c < 3 ? q->m->t[triangle][c] : (size_t)q->m->vertices + q->edge[triangle][c - 3];
}

static bool dropped(const assembly *a, uint32_t triangle, size_t corner) {
    return a->problem->dropped != NULL && a->problem->dropped[3 * (size_t)triangle + corner] != 0;
}

static void add_hats(const assembly *a, row_sums *to, uint32_t source,
                     double hat[3][3][OUTER_LANES], double lower) {
    for (size_t c = 0; c < 3 && lower > 0; c++) {
        double(*sum)[OUTER_LANES] = to->hat[a->q->m->t[source][c]];
        for (size_t b = 0; b < 3 && !dropped(a, source, c); b++) {
            for (size_t e = 0; e < OUTER_LANES; e++) sum[b][e] += lower * hat[c][b][e];
        }
    }
}

/* Adds one pair of triangles; `lower`: the share of D and V that it has. */
static void add_pair_sums(const assembly *a, row_sums *to, uint32_t source, pair_sums *s,
                          double lower) {
    for (int c = 0; c < 6; c++) {
        double *lane = to->node[source_node(a->q, source, c)];
        if (c >= 3) to->used[a->q->edge[source][c - 3]] = 1;
        const int first = lower > 0 ? 0 : ROW_POLYNOMIALS * D_LANES;
        for (int e = first; e < ROW_LANES; e++)
            lane[e] += (e < ROW_POLYNOMIALS * D_LANES ? lower : 1) * s->node[c][e];
    }
    add_hats(a, to, source, s->hat, lower);
    for (int e = 0; e < 27; e++)
        to->weight[e / 9][e / 3 % 3][e % 3] += s->weight[e / 9][e / 3 % 3][e % 3];
}

/* ---- three kinds of pairs ---- */

static void add_touching(const assembly *a, row_sums *to, uint32_t source, uint32_t common,
                         const uint32_t order_x[3], const uint32_t order_y[3], double lower) {
    uint32_t n = a->size[to->row].touching;
    if (a->size[source].touching > n) n = a->size[source].touching;
    const pair_rule *rule = &a->touching[common][n];
    pair_sums sums = {0};
    surface_point list[TOUCHING_MOST * TOUCHING_MOST];
    for (uint32_t g = 0; g < rule->groups; g++) {
        const pair_group *group = &rule->group[g];
        const uint32_t *own = group->in_x ? order_x : order_y,
                       *other = group->in_x ? order_y : order_x;
        double corner[3];
        for (uint32_t i = 0; i < group->count; i++) {
            const pair_partner *p = &rule->partner[group->first + i];
            for (int k = 0; k < 3; k++) corner[other[k]] = p->corner[k];
            list[i] = surface_point_at(a->q, group->in_x ? source : to->row, corner, p->weight);
        }
        for (int k = 0; k < 3; k++) corner[own[k]] = group->corner[k];
        surface_point point = surface_point_at(a->q, group->in_x ? to->row : source, corner, 1);
        if (group->in_x) {
            source_sums s = {0};
            sum_sources(&a->kernel, point.at, list, group->count, &s);
            add_row_point(&sums, &point, 1, &s);
        } else {
            sum_rows(&a->kernel, list, group->count, &point, &sums);
        }
    }
    add_pair_sums(a, to, source, &sums, lower);
}

static void add_near(const assembly *a, row_sums *to, uint32_t source, double lower) {
    const quadratic_surface *q = a->q;
    const double *cx[3], *cy[3];
    for (int k = 0; k < 3; k++) {
        cx[k] = quadratic_node(q, to->row, k);
        cy[k] = quadratic_node(q, source, k);
    }
    double gap = triangle_distance(cx, cy), longest = a->size[source].longest;
    uint32_t order = gauss_order(2 * gap / a->size[to->row].longest, TOLERANCE);
    const triangle_rule *rule = &a->rule[order > ROW_ORDER ? ROW_ORDER : order];
    pair_sums sums = {0};
    for (uint32_t i = 0; i < rule->points; i++) {
        surface_point x = surface_point_at(q, to->row, rule->corner[i], rule->weight[i]);
        double apex[3], place[3];
        double far = nearest_on_triangle(x.at, cy[0], cy[1], cy[2], apex, place);
        uint32_t n = gauss_order(2 * far / longest, TOLERANCE);
        source_sums s = {0};
        if (n <= KEPT_ORDERS) {
            const uint32_t count = a->rule[n].points;
            sum_sources(&a->kernel, x.at, a->kept[n] + (size_t)source * count, count, &s);
        } else {
            uint32_t count = near_points(q, source, apex, far, NEAR_ORDER, to->y);
            sum_sources(&a->kernel, x.at, to->y, count, &s);
        }
        add_row_point(&sums, &x, x.weight, &s);
    }
    add_pair_sums(a, to, source, &sums, lower);
}

static void add_far(const assembly *a, row_sums *to, uint32_t source, uint32_t order,
                    double lower) {
    const uint32_t points = a->rule[order].points;
    const surface_point *x = a->kept[order] + (size_t)to->row * points;
    const surface_point *y = a->kept[order] + (size_t)source * points;
    if (order > 2) {
        pair_sums sums = {0};
        for (uint32_t i = 0; i < points; i++) {
            source_sums s = {0};
            sum_sources(&a->kernel, x[i].at, y, points, &s);
            add_row_point(&sums, &x[i], x[i].weight, &s);
        }
        add_pair_sums(a, to, source, &sums, lower);
        return;
    }
    for (uint32_t i = 0; i < FAR_POINTS; i++) {
        source_sums s = {0};
        sum_sources(&a->kernel, x[i].at, y, points, &s);
        for (int c = 0; c < 6; c++) {
            double *lane = to->far[source_node(a->q, source, c)][i];
            for (int e = 0; e < SOURCE_LANES; e++) lane[e] += s.node[c][e];
        }
        for (size_t b = 0; b < 3; b++) {
            double share = x[i].weight * x[i].corner[b] * x[i].jacobian;
            for (size_t c = 0; c < 3 && lower > 0; c++) {
                double *sum = to->hat[a->q->m->t[source][c]][b];
                for (int e = 0; e < OUTER_LANES && !dropped(a, source, c); e++)
                    sum[e] += share * lower * s.hat[c][e];
            }
            for (int e = 0; e < 9; e++)
                to->weight[b][e / 3][e % 3] += share * s.weight[e / 3][e % 3];
        }
    }
}

/* The sums of middles go to the vertices that these are made from, and are cleared. */
WIDE static void fold(const quadratic_surface *q, uint32_t edge, double *sums, uint32_t lanes) {
    double *from = sums + ((size_t)q->m->vertices + edge) * lanes;
    for (uint32_t i = q->offset[edge]; i < q->offset[edge + 1]; i++) {
        double *to = sums + (size_t)q->vertex[i] * lanes, w = q->weight[i];
        for (uint32_t k = 0; k < lanes; k++) to[k] += w * from[k];
    }
    memset(from, 0, lanes * sizeof *from);
}

/* Takes what was summed at the far points to the lanes of D, or to those of B. */
WIDE static void take_far(const assembly *a, row_sums *to, bool to_d) {
    const surface_point *x = a->kept[2] + (size_t)to->row * FAR_POINTS;
    for (uint32_t e = 0; e < a->q->edges; e++)
        fold(a->q, e, (double *)(void *)to->far, FAR_POINTS * SOURCE_LANES);
    for (size_t i = 0; i < a->q->m->vertices; i++) {
        for (int p = 0; p < FAR_POINTS; p++) {
            const double *from = to->far[i][p];
            double *lane = to->node[i];
            for (int t = 0; t < ROW_POLYNOMIALS && to_d; t++) {
                double share = x[p].weight * x[p].n[t];
                for (int e = 0; e < D_LANES; e++) lane[t * D_LANES + e] += share * from[e];
            }
            lane += ROW_POLYNOMIALS * D_LANES;
            for (int b = 0; b < 3 && !to_d; b++, lane += B_LANES) {
                double share = x[p].weight * x[p].corner[b] * x[p].jacobian;
                for (int e = 0; e < 9; e++) lane[e] += share * from[e];
                lane[9] += share * from[SOURCE_LAYER];
            }
        }
    }
}

static void add_pair(const assembly *a, row_sums *to, uint32_t source) {
    double lower = source < to->row ? 1 : source == to->row ? 0.5 : 0;
    uint32_t order_x[3], order_y[3];
    uint32_t common = pair_common_first(a->q->m->t[to->row], a->q->m->t[source], order_x, order_y);
    if (common > 0) {
        add_touching(a, to, source, common, order_x, order_y, lower);
        return;
    }
    const triangle_size *x = &a->size[to->row], *y = &a->size[source];
    double gap = v_distance(x->center, y->center) - x->radius - y->radius;
    uint32_t order = gap > 0 ? gauss_order(2 * gap / fmax(x->longest, y->longest), TOLERANCE) : 64;
    if (order > FAR_ORDER)
        add_near(a, to, source, lower);
    else
        add_far(a, to, source, order, lower);
}

/* ---- the rows of one triangle ---- */

/* Adds 1/2 <phi, N> of the row triangle itself, with the sign of K. */
static void add_mass(const assembly *a, row_sums *to) {
    const triangle_rule *rule = &a->rule[5];
    for (uint32_t i = 0; i < rule->points; i++) {
        surface_point x = surface_point_at(a->q, to->row, rule->corner[i], rule->weight[i]);
        for (int c = 0; c < 6; c++) {
            if (c >= 3) to->used[a->q->edge[to->row][c - 3]] = 1;
            for (int b = 0; b < 3; b++)
                to->node[source_node(a->q, to->row, c)]
                        [ROW_POLYNOMIALS * D_LANES + b * B_LANES + 9] -=
                    2 * PI * x.weight * x.jacobian * x.corner[b] * x.n[c];
        }
    }
}

/*
 * Rows of D: the six shape functions of the triangle, each along three axes. With the curls c of
 * these at its nodes, polynomials of degree 2, row (t, i) and column q have
 *
 *     mu / 4 pi sum_p (2 c . l I - c l^T + (Q x c) / (nu - 1)),    l = sum c' / r, Q = sum X (c' x e_q)
 */
WIDE static void rows_of_d(const assembly *a, const row_sums *s, double *rows) {
    const double nu = a->problem->poisson;
    const double both = a->problem->young_Pa / (2 * (1 + nu)) / (4 * PI), curl = -both / (1 - nu);
    static const double at[6][3] = {{1, 0, 0},   {0, 1, 0},   {0, 0, 1},
                                    {0, .5, .5}, {.5, 0, .5}, {.5, .5, 0}};
    double c[ROW_POLYNOMIALS][3][6]; /* [p][k][t] */
    for (int p = 0; p < ROW_POLYNOMIALS; p++) {
        surface_point x = surface_point_at(a->q, s->row, at[p], 1);
        for (int t = 0; t < 6; t++) {
            for (int k = 0; k < 3; k++)
                c[p][k][t] = x.n_u[t] * x.along_v[k] - x.n_v[t] * x.along_u[k];
        }
    }
    size_t order = a->out->order;
    for (uint32_t j = 0; j < a->q->m->vertices; j++) {
        double block[9][6] = {{0}}; /* [3 i + q][t] */
        for (int p = 0; p < ROW_POLYNOMIALS; p++) {
            const double *lane = s->node[j] + p * D_LANES, *l = lane + 9;
            const double *c0 = c[p][0], *c1 = c[p][1], *c2 = c[p][2];
            for (int t = 0; t < 6; t++) {
                double twice = 2 * both * (c0[t] * l[0] + c1[t] * l[1] + c2[t] * l[2]);
                for (int q = 0; q < 3; q++) {
                    double lq = both * l[q], q0 = curl * lane[q], q1 = curl * lane[3 + q],
                           q2 = curl * lane[6 + q];
                    block[q][t] += (q == 0 ? twice : 0) - c0[t] * lq + (q1 * c2[t] - q2 * c1[t]);
                    block[3 + q][t] +=
                        (q == 1 ? twice : 0) - c1[t] * lq + (q2 * c0[t] - q0 * c2[t]);
                    block[6 + q][t] +=
                        (q == 2 ? twice : 0) - c2[t] * lq + (q0 * c1[t] - q1 * c0[t]);
                }
            }
        }
        for (size_t t = 0; t < 6; t++) {
            for (size_t e = 0; e < 9; e++)
                rows[(3 * t + e / 3) * order + 3 * (size_t)j + e % 3] = block[e][t];
        }
    }
}

WIDE static void rows_of_hats(const assembly *a, const row_sums *s, size_t slot) {
    const double nu = a->problem->poisson, mu = a->problem->young_Pa / (2 * (1 + nu));
    const double curl = -1 / (8 * PI * (1 - nu)), layer = -1 / (4 * PI);
    const double kelvin = 1 / (16 * PI * mu * (1 - nu));
    static const int symmetric[9] = {0, 5, 4, 5, 1, 3, 4, 3, 2};
    size_t order = a->out->order;
    double *b_rows = a->rows_b + slot * 9 * order, *v_rows = a->rows_v + slot * 9 * order;
    for (uint32_t j = 0; j < a->q->m->vertices; j++) {
        for (size_t b = 0; b < 3; b++) {
            const double *lane = s->node[j] + ROW_POLYNOMIALS * D_LANES + b * B_LANES;
            const double *w = s->hat[j][b];
            double trace = (3 - 4 * nu) * (w[0] + w[1] + w[2]);
            for (size_t e = 0; e < 9; e++) {
                size_t at = (3 * b + e / 3) * order + 3 * (size_t)j + e % 3;
                bool diagonal = e % 4 == 0;
                b_rows[at] = curl * lane[e] + (diagonal ? layer * lane[9] : 0);
                v_rows[at] = kelvin * (w[symmetric[e]] + (diagonal ? trace : 0));
            }
        }
    }
    for (int e = 0; e < 27; e++)
        a->weight_v[slot * 27 + (size_t)e] = kelvin * s->weight[e / 9][e / 3 % 3][e % 3];
}

/* B^T of the tractions of weight on one triangle: its rows of B, with t = (y - origin)_d n / J at
 * the corners. On a curved triangle these interpolate the traction linearly. */
static void weight_on_triangle(const assembly *a, uint32_t row, size_t slot) {
    static const double at[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    size_t order = a->out->order;
    double *to = a->weight_b + slot * 3 * order;
    memset(to, 0, 3 * order * sizeof *to);
    for (size_t b = 0; b < 3; b++) {
        surface_point x = surface_point_at(a->q, row, at[b], 1);
        for (size_t i = 0; i < 3; i++) {
            const double *from = a->rows_b + (slot * 9 + 3 * b + i) * order;
            for (size_t d = 0; d < 3; d++) {
                double t = (x.at[d] - a->problem->origin[d]) * x.normal[i] / x.jacobian;
                for (size_t j = 0; j < order; j++) to[3 * j + d] += t * from[j];
            }
        }
    }
}

static void sum_row(const assembly *a, row_sums *s) {
    const mesh *m = a->q->m;
    memset(s->node, 0, m->vertices * sizeof *s->node);
    memset(s->far, 0, m->vertices * sizeof *s->far);
    memset(s->hat, 0, m->vertices * sizeof *s->hat);
    memset(s->weight, 0, sizeof s->weight);
    for (uint32_t source = 0; source < m->triangles; source++) {
        if (source == s->row) take_far(a, s, true);
        add_pair(a, s, source);
    }
    take_far(a, s, false);
    add_mass(a, s);
    for (uint32_t e = 0; e < a->q->edges; e++) {
        if (s->used[e] != 0) fold(a->q, e, (double *)(void *)s->node, ROW_LANES);
        s->used[e] = 0;
    }
}

static void make_rows(void *context, size_t worker) {
    const assembly *a = context;
    row_sums *s = &a->sums[worker];
    for (size_t slot = worker; slot < a->count; slot += a->workers) {
        s->row = (uint32_t)(a->first + slot);
        sum_row(a, s);
        rows_of_d(a, s, a->rows_d + slot * 18 * a->out->order);
        rows_of_hats(a, s, slot);
        weight_on_triangle(a, s->row, slot);
        progress_add(1);
    }
}

WIDE static void add_row(double *to, double factor, const double *from, size_t count) {
    for (size_t j = 0; j < count; j++) to[j] += factor * from[j];
}

/* Adds the rows of the chunk, in the order of the triangles, to a slice of columns. */
static void add_rows(void *context, size_t slice) {
    const assembly *a = context;
    const quadratic_surface *q = a->q;
    size_t order = a->out->order, begin = slice * SLICE;
    size_t count = order - begin < SLICE ? order - begin : SLICE;
    for (size_t slot = 0; slot < a->count; slot++) {
        uint32_t row = (uint32_t)(a->first + slot);
        const double *d = a->rows_d + slot * 18 * order + begin;
        for (size_t i = 0; i < 9; i++) {
            size_t node = q->m->t[row][i / 3];
            size_t at = (3 * node + i % 3) * order + begin;
            add_row(a->out->d + at, 1, d + i * order, count);
            if (dropped(a, row, i / 3)) continue;
            add_row(a->out->b + at, 1, a->rows_b + (slot * 9 + i) * order + begin, count);
            add_row(a->out->v + at, 1, a->rows_v + (slot * 9 + i) * order + begin, count);
        }
        for (size_t c = 0; c < 3; c++) {
            uint32_t e = q->edge[row][c];
            for (uint32_t k = q->offset[e]; k < q->offset[e + 1]; k++) {
                for (size_t i = 0; i < 3; i++)
                    add_row(a->out->d + (3 * (size_t)q->vertex[k] + i) * order + begin,
                            q->weight[k], d + (9 + 3 * c + i) * order, count);
            }
        }
        for (size_t j = begin; j < begin + count; j++) {
            for (size_t k = 0; k < 3; k++)
                a->out->b_weight[3 * j + k] += a->weight_b[(slot * order + j) * 3 + k];
        }
    }
}

static void add_weights(const assembly *a) {
    for (size_t slot = 0; slot < a->count; slot++) {
        for (size_t e = 0; e < 27; e++) {
            size_t c = e / 9, row = a->first + slot;
            if (dropped(a, (uint32_t)row, c)) continue;
            a->out->v_weight[9 * (size_t)a->q->m->t[row][c] + e % 9] += a->weight_v[slot * 27 + e];
        }
    }
}

/* ---- all of it ---- */

/* Bending is what little remains of D where membranes cancel, (thickness / size)^2 of it: thin walls
 * and slender triangles need more exact integrals. */
static uint32_t touching_order(double slender, double thin) {
    double for_shape = floor(2 + 1.6 * slender);
    double for_bending = ceil(TOUCHING_LEAST + 1.5 * log2(THIN / thin) - 0.3);
    return (uint32_t)fmin(fmax(TOUCHING_LEAST, fmax(for_shape, for_bending)), TOUCHING_MOST);
}

static triangle_size size_of(const quadratic_surface *q, uint32_t t, double thin) {
    const mesh *m = q->m;
    const uint32_t *v = m->t[t];
    triangle_size s = {.longest = mesh_longest_edge(m, t)};
    double normal[3];
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) s.center[k] += m->x[v[i]][k] / 3;
    }
    for (int i = 0; i < 6; i++)
        s.radius = fmax(s.radius, v_distance(s.center, quadratic_node(q, t, i)));
    triangle_normal(m->x[v[0]], m->x[v[1]], m->x[v[2]], normal);
    s.touching = touching_order(s.longest * s.longest / v_norm(normal), thin);
    return s;
}

static void prepare(assembly *a) {
    const mesh *m = a->q->m;
    for (uint32_t n = 2; n <= ROW_ORDER; n++)
        a->rule[n] = n <= 4 ? triangle_rule_symmetric(n) : triangle_rule_collapsed(n);
    for (uint32_t c = 1; c <= 3; c++) {
        for (uint32_t n = TOUCHING_LEAST; n <= TOUCHING_MOST; n++)
            a->touching[c][n] = pair_rule_build(c, n);
    }
    a->sums = allocate(a->workers, sizeof *a->sums);
    size_t nodes = (size_t)m->vertices + a->q->edges;
    for (size_t w = 0; w < a->workers; w++) {
        row_sums *r = &a->sums[w];
        r->node = allocate_aligned(nodes, sizeof *r->node);
        r->far = allocate_aligned(nodes, sizeof *r->far);
        r->hat = allocate_aligned(m->vertices, sizeof *r->hat);
        r->used = allocate(a->q->edges, sizeof *r->used);
        r->y = allocate(3 * NEAR_ORDER * NEAR_ORDER, sizeof *r->y);
    }
    a->size = allocate(m->triangles, sizeof *a->size);
    double diagonal = mesh_diagonal(m);
    for (uint32_t t = 0; t < m->triangles; t++)
        a->size[t] = size_of(
            a->q, t, a->problem->thickness != NULL ? a->problem->thickness[t] / diagonal : 1);
    for (uint32_t n = 2; n <= KEPT_ORDERS; n++) {
        const triangle_rule *rule = &a->rule[n];
        a->kept[n] = allocate_aligned((size_t)m->triangles * rule->points, sizeof *a->kept[n]);
        for (size_t i = 0; i < (size_t)m->triangles * rule->points; i++) {
            size_t p = i % rule->points;
            a->kept[n][i] = surface_point_at(a->q, (uint32_t)(i / rule->points), rule->corner[p],
                                             rule->weight[p]);
        }
    }
}

static void release(assembly *a) {
    for (uint32_t i = 2; i <= KEPT_ORDERS; i++) free(a->kept[i]);
    for (uint32_t i = 2; i <= ROW_ORDER; i++) {
        free(a->rule[i].corner);
        free(a->rule[i].weight);
    }
    for (uint32_t c = 1; c <= 3; c++) {
        for (uint32_t n = TOUCHING_LEAST; n <= TOUCHING_MOST; n++)
            pair_rule_free(&a->touching[c][n]);
    }
    for (size_t w = 0; w < a->workers; w++) {
        void *room[] = {a->sums[w].node, a->sums[w].far, a->sums[w].hat, a->sums[w].used,
                        a->sums[w].y};
        for (size_t i = 0; i < sizeof room / sizeof room[0]; i++) free(room[i]);
    }
    void *owned[] = {a->sums, a->size, a->rows_d, a->rows_b, a->rows_v, a->weight_b, a->weight_v};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
}

/* Hats of unit force: rows and columns of V and rows of B over the areas; D and V whole from their
 * lower sums. */
static void finish(void *context, size_t i) {
    const assembly *a = context;
    galerkin_matrices *g = a->out;
    double own = 1 / g->area[i / 3];
    for (size_t j = 0; j <= i; j++) {
        double d = g->d[i * g->order + j] + g->d[j * g->order + i];
        double v = (g->v[i * g->order + j] + g->v[j * g->order + i]) * own / g->area[j / 3];
        g->d[i * g->order + j] = g->d[j * g->order + i] = d;
        g->v[i * g->order + j] = g->v[j * g->order + i] = v;
    }
    for (size_t j = 0; j < g->order; j++) g->b[i * g->order + j] *= own;
    for (size_t k = 0; k < 3; k++) g->v_weight[3 * i + k] *= own;
}

/* Areas and middles of hats. */
static void measure_hats(const assembly *a) {
    const triangle_rule *rule = &a->rule[5];
    for (uint32_t t = 0; t < a->q->m->triangles; t++) {
        for (uint32_t i = 0; i < rule->points; i++) {
            surface_point x = surface_point_at(a->q, t, rule->corner[i], rule->weight[i]);
            for (size_t c = 0; c < 3; c++) {
                if (dropped(a, t, c)) continue;
                double share = x.weight * x.jacobian * x.corner[c];
                uint32_t v = a->q->m->t[t][c];
                a->out->area[v] += share;
                for (int k = 0; k < 3; k++) a->out->center[v][k] += share * x.at[k];
            }
        }
    }
    for (uint32_t v = 0; v < a->q->m->vertices; v++) {
        for (int k = 0; k < 3; k++) a->out->center[v][k] /= a->out->area[v];
    }
}

galerkin_matrices galerkin_assemble(const quadratic_surface *q, const galerkin_problem *problem) {
    size_t n = q->m->vertices, order = 3 * n;
    galerkin_matrices out = {.order = order};
    out.v = allocate_aligned(order * order, sizeof *out.v);
    out.b = allocate_aligned(order * order, sizeof *out.b);
    out.d = allocate_aligned(order * order, sizeof *out.d);
    out.area = allocate(n, sizeof *out.area);
    out.center = allocate(n, sizeof *out.center);
    out.v_weight = allocate(3 * order, sizeof *out.v_weight);
    out.b_weight = allocate(3 * order, sizeof *out.b_weight);
    assembly a = {.q = q, .problem = problem, .out = &out, .workers = thread_count()};
    a.kernel.poisson = problem->poisson;
    memcpy(a.kernel.origin, problem->origin, sizeof a.kernel.origin);
    prepare(&a);
    measure_hats(&a);
    a.rows_d = allocate_aligned(CHUNK * 18 * order, sizeof *a.rows_d);
    a.rows_b = allocate_aligned(CHUNK * 9 * order, sizeof *a.rows_b);
    a.rows_v = allocate_aligned(CHUNK * 9 * order, sizeof *a.rows_v);
    a.weight_b = allocate_aligned(CHUNK * 3 * order, sizeof *a.weight_b);
    a.weight_v = allocate(CHUNK * 27, sizeof *a.weight_v);
    progress_begin("boundary integrals", q->m->triangles);
    for (a.first = 0; a.first < q->m->triangles; a.first += CHUNK) {
        size_t left = q->m->triangles - a.first;
        a.count = left < CHUNK ? left : CHUNK;
        parallel_for(a.workers, make_rows, &a);
        parallel_for((order + SLICE - 1) / SLICE, add_rows, &a);
        add_weights(&a);
    }
    parallel_for(order, finish, &a);
    progress_end();
    release(&a);
    return out;
}

void galerkin_free(galerkin_matrices *g) {
    void *owned[] = {g->v, g->b, g->d, g->area, g->center, g->v_weight, g->b_weight};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
}
