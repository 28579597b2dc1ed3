/* SPDX-License-Identifier: MIT */
#include "tools/solver/bem.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include "tools/mesh/nearest.h"
#include "tools/solver/gauss.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846
#define MAX_ORDER 12 /* points per direction before a triangle is split */
#define SINGULAR_ORDER 16
#define MAX_SPLITS 12

static struct {
    triangle_rule regular[MAX_ORDER + 1];
    double node[SINGULAR_ORDER], weight[SINGULAR_ORDER];
} rules;

static void prepare_rules(void) {
    if (rules.regular[1].points != 0) return;
    for (uint32_t n = 1; n <= MAX_ORDER; n++) rules.regular[n] = triangle_rule_collapsed(n);
    gauss_legendre(SINGULAR_ORDER, rules.node, rules.weight);
}

/* Integrals of the kernels against the three hats of one triangle, up to the material's factors. */
typedef struct {
    double u_iso, u[6];         /* phi / r, phi r_i r_j / r */
    double t_iso, t[6], t_v[3]; /* phi dr/dn / r^2, the same times r_i r_j, phi r_i / r^2 */
} hat_moments;

typedef struct {
    double corner[3][3];
    double normal[3]; /* unit, outward */
    double area;
} element;

/* Adds one quadrature point; phi are the hats at y, `weight` carries the Jacobian. */
static void add_point(hat_moments moments[3], const double x[3], const double y[3],
                      const double normal[3], const double phi[3], double weight) {
    double d[3];
    v_sub(y, x, d);
    double inverse = 1 / sqrt(v_dot(d, d));
    double r[3] = {d[0] * inverse, d[1] * inverse, d[2] * inverse};
    double slope = v_dot(r, normal);
    double product[6] = {r[0] * r[0], r[1] * r[1], r[2] * r[2],
                         r[1] * r[2], r[0] * r[2], r[0] * r[1]};
    double weak = weight * inverse;
    double strong = weak * inverse;
    for (int k = 0; k < 3; k++) {
        hat_moments *m = &moments[k];
        double wu = weak * phi[k], wt = strong * phi[k], ws = wt * slope;
        m->u_iso += wu;
        m->t_iso += ws;
        for (int e = 0; e < 6; e++) m->u[e] += wu * product[e];
        for (int e = 0; e < 6; e++) m->t[e] += ws * product[e];
        for (int e = 0; e < 3; e++) m->t_v[e] += wt * r[e];
    }
}

static double distance_to_segment(const double x[3], const double a[3], const double b[3]) {
    double ab[3], ax[3];
    v_sub(b, a, ab);
    v_sub(x, a, ax);
    double t = v_dot(ax, ab) / v_dot(ab, ab);
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    double p[3] = {a[0] + t * ab[0], a[1] + t * ab[1], a[2] + t * ab[2]};
    return v_distance(x, p);
}

static double longest_edge(double c[3][3]) {
    return fmax(v_distance(c[0], c[1]), fmax(v_distance(c[1], c[2]), v_distance(c[2], c[0])));
}

/* Integrates over the sub-triangle with the given barycentric corners, split until the order
 * suffices. */
static void integrate_regular(hat_moments moments[3], const element *e, const double x[3],
                              double corner[3][3], double scale, double tolerance, int depth) {
    double c[3][3] = {{0}};
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            for (int a = 0; a < 3; a++) c[i][a] += corner[i][k] * e->corner[k][a];
        }
    }
    double nearest[3], place[3];
    double ratio = 2 * nearest_on_triangle(x, c[0], c[1], c[2], nearest, place) / longest_edge(c);
    uint32_t order = gauss_order(ratio, tolerance);
    if (order > MAX_ORDER && depth < MAX_SPLITS) {
        double mid[3][3];
        for (int i = 0; i < 3; i++) {
            for (int k = 0; k < 3; k++)
                mid[i][k] = 0.5 * (corner[(i + 1) % 3][k] + corner[(i + 2) % 3][k]);
        }
        for (int i = 0; i < 3; i++) {
            double child[3][3];
            memcpy(child[0], corner[i], sizeof child[0]);
            memcpy(child[1], mid[(i + 2) % 3], sizeof child[1]);
            memcpy(child[2], mid[(i + 1) % 3], sizeof child[2]);
            integrate_regular(moments, e, x, child, scale / 4, tolerance, depth + 1);
        }
        integrate_regular(moments, e, x, mid, scale / 4, tolerance, depth + 1);
        return;
    }
    const triangle_rule *r = &rules.regular[order > MAX_ORDER ? MAX_ORDER : order];
    for (uint32_t p = 0; p < r->points; p++) {
        double y[3] = {0}, phi[3] = {0};
        for (int i = 0; i < 3; i++) {
            for (int k = 0; k < 3; k++) {
                y[k] += r->corner[p][i] * c[i][k];
                phi[k] += r->corner[p][i] * corner[i][k];
            }
        }
        add_point(moments, x, y, e->normal, phi, 2 * e->area * scale * r->weight[p]);
    }
}

/*
 * The collocation point is corner 0. In y = x + s (a + t (b - a)) the Jacobian cancels the
 * singularity; the integrand is linear in s for U and, for the two hats that vanish at x, constant
 * in s for T. The angular interval [t0, t1] is split until its order suffices. T against the hat of
 * x itself is left to the row sum.
 */
static void integrate_singular(hat_moments moments[3], const element *e, int self, double t0,
                               double t1, double tolerance, int depth) {
    const double *x = e->corner[self];
    const double *a = e->corner[(self + 1) % 3];
    const double *b = e->corner[(self + 2) % 3];
    double p[3], q[3];
    for (int k = 0; k < 3; k++) {
        p[k] = a[k] + t0 * (b[k] - a[k]);
        q[k] = a[k] + t1 * (b[k] - a[k]);
    }
    double ratio = 2 * distance_to_segment(x, p, q) / v_distance(p, q);
    if (gauss_order(ratio, tolerance) > SINGULAR_ORDER && depth < MAX_SPLITS) {
        double middle = 0.5 * (t0 + t1);
        integrate_singular(moments, e, self, t0, middle, tolerance, depth + 1);
        integrate_singular(moments, e, self, middle, t1, tolerance, depth + 1);
        return;
    }
    static const double radial[2] = {0.21132486540518711775, 0.78867513459481288225};
    for (int i = 0; i < 2; i++) {
        for (int k = 0; k < SINGULAR_ORDER; k++) {
            double s = radial[i];
            double t = t0 + (t1 - t0) * rules.node[k];
            double phi[3], y[3];
            phi[self] = 1 - s;
            phi[(self + 1) % 3] = s * (1 - t);
            phi[(self + 2) % 3] = s * t;
            for (int axis = 0; axis < 3; axis++)
                y[axis] = x[axis] + s * (a[axis] + t * (b[axis] - a[axis]) - x[axis]);
            add_point(moments, x, y, e->normal, phi, e->area * s * (t1 - t0) * rules.weight[k]);
        }
    }
    /* dr/dn vanishes in the plane of the triangle; what rounding left of it is noise. */
    for (int k = 0; k < 3; k++) {
        moments[k].t_iso = 0;
        memset(moments[k].t, 0, sizeof moments[k].t);
    }
}

typedef struct {
    const mesh *m;
    const bem_material *material;
    const element *elements;
    double *h, *g;
    size_t h_stride, g_stride;
    const bem_traction *traction;
    bem_taker take; /* NULL: rows stay in h and g */
    void *take_context;
} assembly;

static const int symmetric_index[3][3] = {{0, 5, 4}, {5, 1, 3}, {4, 3, 2}};

/* Kelvin's U and T from the moments (Brebbia, Telles and Wrobel 1984). */
static void blocks_from_moments(const hat_moments *m, const double normal[3], double poisson,
                                double shear, double u[3][3], double t[3][3]) {
    double u_factor = 1 / (16 * PI * shear * (1 - poisson));
    double t_factor = -1 / (8 * PI * (1 - poisson));
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            int s = symmetric_index[i][j];
            double delta = i == j ? 1 : 0;
            u[i][j] = u_factor * ((3 - 4 * poisson) * delta * m->u_iso + m->u[s]);
            t[i][j] = t_factor * ((1 - 2 * poisson) * (delta * m->t_iso + normal[i] * m->t_v[j] -
                                                       normal[j] * m->t_v[i]) +
                                  3 * m->t[s]);
        }
    }
}

static void add_block(double *rows, size_t stride, size_t column, double b[3][3]) {
    for (size_t i = 0; i < 3; i++) {
        for (size_t j = 0; j < 3; j++) rows[i * stride + 3 * column + j] += b[i][j];
    }
}

static void add_traction(const bem_traction *p, size_t node, const double y[3], const element *e,
                         double u[3][3]) {
    double t[3 * BEM_MAX_TRACTIONS];
    p->at(p->context, y, e->normal, t);
    for (size_t i = 0; i < 3; i++) {
        for (size_t c = 0; c < p->columns; c++) {
            double sum =
                u[i][0] * t[c] + u[i][1] * t[p->columns + c] + u[i][2] * t[2 * p->columns + c];
            p->result[(3 * node + i) * p->columns + c] += sum;
        }
    }
}

/* The three rows of `node` of H and G. */
static void assemble_rows(const assembly *a, size_t node, double *h, size_t h_stride, double *g,
                          size_t g_stride) {
    const mesh *m = a->m;
    const bem_traction *p = a->traction;
    size_t order = 3 * (size_t)m->vertices;
    double poisson = a->material->poisson;
    double shear = a->material->young_Pa / (2 * (1 + poisson));
    for (size_t row = 0; row < 3; row++) {
        memset(h + row * h_stride, 0, order * sizeof(double));
        memset(g + row * g_stride, 0, order * sizeof(double));
    }
    for (uint32_t i = 0; i < m->triangles; i++) {
        const element *e = &a->elements[i];
        hat_moments moments[3] = {{0}};
        int self = -1;
        for (int k = 0; k < 3; k++) {
            if (m->t[i][k] == node) self = k;
        }
        if (self >= 0) {
            integrate_singular(moments, e, self, 0, 1, a->material->tolerance, 0);
        } else {
            double whole[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
            integrate_regular(moments, e, m->x[node], whole, 1, a->material->tolerance, 0);
        }
        for (int k = 0; k < 3; k++) {
            double u[3][3], t[3][3];
            uint32_t vertex = m->t[i][k];
            blocks_from_moments(&moments[k], e->normal, poisson, shear, u, t);
            size_t corner = 3 * (size_t)i + (size_t)k;
            bool dropped = p != NULL && p->dropped != NULL && p->dropped[corner] != 0;
            if (!dropped) add_block(g, g_stride, vertex, u);
            if (vertex != node) {
                add_block(h, h_stride, vertex, t);
                for (int b = 0; b < 9; b++) t[b / 3][b % 3] = -t[b / 3][b % 3];
                add_block(h, h_stride, node, t);
            }
            if (p != NULL && p->known[corner] != 0) add_traction(p, node, m->x[vertex], e, u);
        }
    }
    progress_add(1);
}

static void assemble_node(void *context, size_t node) {
    const assembly *a = context;
    assemble_rows(a, node, a->h + 3 * node * a->h_stride, a->h_stride,
                  a->g + 3 * node * a->g_stride, a->g_stride);
}

static void stream_node(void *context, size_t node) {
    const assembly *a = context;
    size_t order = 3 * (size_t)a->m->vertices;
    double *h = allocate(6 * order, sizeof *h);
    assemble_rows(a, node, h, order, h + 3 * order, order);
    a->take(a->take_context, node, h, h + 3 * order);
    free(h);
}

static void assemble(assembly *a) {
    const mesh *m = a->m;
    prepare_rules();
    element *elements = allocate(m->triangles, sizeof *elements);
    for (uint32_t i = 0; i < m->triangles; i++) {
        element *e = &elements[i];
        for (int k = 0; k < 3; k++) memcpy(e->corner[k], m->x[m->t[i][k]], sizeof e->corner[k]);
        triangle_normal(e->corner[0], e->corner[1], e->corner[2], e->normal);
        e->area = 0.5 * v_norm(e->normal);
        v_normalize(e->normal);
    }
    a->elements = elements;
    if (a->traction != NULL) {
        memset(a->traction->result, 0,
               3 * (size_t)m->vertices * a->traction->columns * sizeof *a->traction->result);
    }
    progress_begin("boundary integrals", m->vertices);
    parallel_for(m->vertices, a->take != NULL ? stream_node : assemble_node, a);
    progress_end();
    free(elements);
}

void bem_assemble(const mesh *m, const bem_material *material, double *h, size_t h_stride,
                  double *g, size_t g_stride, const bem_traction *traction) {
    assembly a = {.m = m,
                  .material = material,
                  .h = h,
                  .g = g,
                  .h_stride = h_stride,
                  .g_stride = g_stride,
                  .traction = traction};
    assemble(&a);
}

void bem_stream(const mesh *m, const bem_material *material, bem_taker take, void *context,
                const bem_traction *traction) {
    assembly a = {
        .m = m, .material = material, .traction = traction, .take = take, .take_context = context};
    assemble(&a);
}
