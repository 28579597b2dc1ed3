/* SPDX-License-Identifier: MIT */
#include "tools/bake/half_space.h"
#include "port/host/util.h"
#include "tools/solver/gauss.h"
#include "tools/solver/pairs.h"
#include <stdlib.h>
#include <string.h>

#define NEAR_EDGES 2.6              /* distance up to which hats are integrated over */
#define POINTS 5u                   /* Gauss points along each side of the Duffy square */
#define PAIR_POINTS 3u              /* in each direction where two triangles touch */
#define HEX_CELL 0.8660254037844386 /* area of a node of a regular lattice over its edge squared */

struct half_space {
    const mesh *m;
    double (*normal)[3];
    bool averaged;
    uint32_t *offset, *triangle; /* triangles around each node */
    double *edge;                /* of a regular lattice of the node's area */
    double *star_area;           /* integral of its hat */
    double at[POINTS], weight[POINTS];
    pair_rule touching[4];
    triangle_rule apart;
};

half_space *half_space_build(const mesh *m, double (*normal)[3], bool averaged) {
    half_space *s = allocate(1, sizeof *s);
    s->m = m;
    s->normal = normal;
    s->averaged = averaged;
    mesh_stars(m, &s->offset, &s->triangle);
    s->edge = allocate(m->vertices, sizeof *s->edge);
    s->star_area = allocate(m->vertices, sizeof *s->star_area);
    gauss_legendre(POINTS, s->at, s->weight);
    for (uint32_t c = 1; c <= 3; c++) s->touching[c] = pair_rule_build(c, PAIR_POINTS);
    s->apart = triangle_rule_symmetric(2);
    for (uint32_t t = 0; t < m->triangles; t++) {
        double n[3];
        triangle_normal(m->x[m->t[t][0]], m->x[m->t[t][1]], m->x[m->t[t][2]], n);
        for (int k = 0; k < 3; k++) s->star_area[m->t[t][k]] += v_norm(n) / 6;
    }
    for (uint32_t i = 0; i < m->vertices; i++) s->edge[i] = sqrt(s->star_area[i] / HEX_CELL);
    return s;
}

void half_space_free(half_space *s) {
    for (uint32_t c = 1; c <= 3; c++) pair_rule_free(&s->touching[c]);
    void *owned[] = {s->offset,       s->triangle,     s->edge, s->star_area,
                     s->apart.corner, s->apart.weight, s};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
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

static size_t corner_of(const uint32_t *t, uint32_t node) {
    return t[0] == node ? 0 : t[1] == node ? 1 : 2;
}

static double twice_area(const mesh *m, const uint32_t *t) {
    double normal[3];
    triangle_normal(m->x[t[0]], m->x[t[1]], m->x[t[2]], normal);
    return v_norm(normal);
}

/* x -= the place with these barycentric weights */
static void subtract_place(const mesh *m, const uint32_t *t, const double corner[3], double x[3]) {
    for (size_t c = 0; c < 3; c++) {
        for (int a = 0; a < 3; a++) x[a] -= corner[c] * m->x[t[c]][a];
    }
}

/* ---- node k, hat of l ---- */

/* Over one triangle of the star of l; the apex of Duffy's map lies at k where k is a corner. */
static void add_triangle(const half_space *s, const uint32_t *t, uint32_t k, uint32_t l,
                         const double n[3], double nu, double block[9]) {
    const mesh *m = s->m;
    size_t hat = corner_of(t, l), apex = hat;
    if (t[0] == k || t[1] == k || t[2] == k) apex = corner_of(t, k);
    double area2 = twice_area(m, t);
    for (size_t q = 0; q < POINTS * POINTS; q++) {
        double u = s->at[q / POINTS], v = s->at[q % POINTS];
        double w = s->weight[q / POINTS] * s->weight[q % POINTS] * u * area2;
        double corner[3], r[3];
        corner[apex] = 1 - u;
        corner[(apex + 1) % 3] = u * (1 - v);
        corner[(apex + 2) % 3] = u * v;
        memcpy(r, m->x[k], sizeof r);
        subtract_place(m, t, corner, r);
        add_kernel(block, w * corner[hat] / s->star_area[l], r, n, nu);
    }
}

static void add_node(const half_space *s, uint32_t k, uint32_t l, const double n[3], double nu,
                     double block[9]) {
    for (uint32_t i = s->offset[l]; i < s->offset[l + 1]; i++)
        add_triangle(s, s->m->t[s->triangle[i]], k, l, n, nu, block);
}

/* ---- hats of k and l ---- */

static void add_point_pair(const half_space *s, const uint32_t *t, const uint32_t *u,
                           const double x[3], const double y[3], double weight, const double n[3],
                           double nu, double block[9]) {
    double r[3] = {0}, from[3] = {-x[0], -x[1], -x[2]};
    subtract_place(s->m, t, from, r);
    subtract_place(s->m, u, y, r);
    add_kernel(block, weight, r, n, nu);
}

/* Over one triangle of the star of k and one of that of l. */
static void add_pair(const half_space *s, const uint32_t *t, const uint32_t *u, uint32_t k,
                     uint32_t l, const double n[3], double nu, double block[9]) {
    uint32_t of_t[3], of_u[3];
    size_t hat_k = corner_of(t, k), hat_l = corner_of(u, l);
    uint32_t common = pair_common_first(t, u, of_t, of_u);
    double area = twice_area(s->m, t) * twice_area(s->m, u) / (s->star_area[k] * s->star_area[l]);
    if (common == 0) {
        const triangle_rule *rule = &s->apart;
        for (uint32_t i = 0; i < rule->points * rule->points; i++) {
            const double *x = rule->corner[i / rule->points], *y = rule->corner[i % rule->points];
            double w = rule->weight[i / rule->points] * rule->weight[i % rule->points];
            add_point_pair(s, t, u, x, y, w * area * x[hat_k] * y[hat_l], n, nu, block);
        }
        return;
    }
    const pair_rule *rule = &s->touching[common];
    for (uint32_t g = 0; g < rule->groups; g++) {
        const pair_group *group = &rule->group[g];
        for (uint32_t i = group->first; i < group->first + group->count; i++) {
            const pair_partner *p = &rule->partner[i];
            double x[3], y[3];
            for (size_t c = 0; c < 3; c++) {
                x[of_t[c]] = group->in_x ? group->corner[c] : p->corner[c];
                y[of_u[c]] = group->in_x ? p->corner[c] : group->corner[c];
            }
            add_point_pair(s, t, u, x, y, p->weight * area * x[hat_k] * y[hat_l], n, nu, block);
        }
    }
}

static void add_hats(const half_space *s, uint32_t k, uint32_t l, const double n[3], double nu,
                     double block[9]) {
    for (uint32_t i = s->offset[k]; i < s->offset[k + 1]; i++) {
        for (uint32_t j = s->offset[l]; j < s->offset[l + 1]; j++)
            add_pair(s, s->m->t[s->triangle[i]], s->m->t[s->triangle[j]], k, l, n, nu, block);
    }
}

static double factor_of(half_space_material material) {
    return (1 + material.poisson) / (acos(-1.0) * material.young_Pa);
}

void half_space_point(const double x[3], const double y[3], const double normal_x[3],
                      const double normal_y[3], half_space_material material, double block[9]) {
    double r[3], n[3];
    v_sub(x, y, r);
    for (int a = 0; a < 3; a++) n[a] = 0.5 * (normal_x[a] + normal_y[a]);
    memset(block, 0, 9 * sizeof *block);
    add_kernel(block, factor_of(material), r, n, material.poisson);
}

void half_space_block(const half_space *s, half_space_material material, uint32_t k, uint32_t l,
                      double block[9]) {
    double r[3], n[3], back[9] = {0};
    v_sub(s->m->x[k], s->m->x[l], r);
    for (int a = 0; a < 3; a++) n[a] = 0.5 * (s->normal[k][a] + s->normal[l][a]);
    memset(block, 0, 9 * sizeof *block);
    if (v_norm(r) > NEAR_EDGES * fmax(s->edge[k], s->edge[l])) {
        add_kernel(block, 1, r, n, material.poisson);
    } else if (s->averaged) {
        add_hats(s, k, l, n, material.poisson, block);
    } else {
        add_node(s, k, l, n, material.poisson, block);
        add_node(s, l, k, n, material.poisson, back);
        for (size_t e = 0; e < 9; e++) block[e] = 0.5 * (block[e] + back[3 * (e % 3) + e / 3]);
    }
    for (int e = 0; e < 9; e++) block[e] *= factor_of(material);
}
