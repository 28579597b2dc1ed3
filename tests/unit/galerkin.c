/* SPDX-License-Identifier: MIT */
/* Galerkin boundary elements against identities, exact solutions and beam theory. */
#include "tests/models.h"
#include "tests/tap.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include "tools/solver/dense.h"
#include "tools/solver/galerkin.h"
#include <stdlib.h>
#include <string.h>

static const double poisson = 0.3, young = 1.0;

/* The constant stress of the patch test, and the displacement that belongs to it. */
static const double stress[3][3] = {{1.0, 0.3, -0.2}, {0.3, -0.7, 0.5}, {-0.2, 0.5, 0.4}};

static void stress_displacement(const double y[3], double u[3]) {
    double trace = stress[0][0] + stress[1][1] + stress[2][2];
    for (int i = 0; i < 3; i++) {
        u[i] = -poisson / young * trace * y[i];
        for (int k = 0; k < 3; k++) u[i] += (1 + poisson) / young * stress[i][k] * y[k];
    }
}

/* Middles of edges: exact for linear fields, and for quadratic ones on a plane. */
static void test_middles(void) {
    mesh m = model_box(1.0, 4);
    quadratic_surface q = quadratic_build(&m);
    double linear = 0, square = 0;
    for (uint32_t t = 0; t < m.triangles; t++) {
        for (int k = 0; k < 3; k++) {
            uint32_t e = q.edge[t][k];
            const double *a = m.x[m.t[t][(k + 1) % 3]], *b = m.x[m.t[t][(k + 2) % 3]];
            double sum = 0, x = 0.5 * (a[0] + b[0]), z = 0.5 * (a[2] + b[2]);
            for (uint32_t i = q.offset[e]; i < q.offset[e + 1]; i++) {
                const double *at = m.x[q.vertex[i]];
                sum += q.weight[i] * (at[0] * at[0] - 2 * at[2] * at[0]);
            }
            for (int c = 0; c < 3; c++)
                linear = fmax(linear, fabs(q.middle[e][c] - 0.5 * (a[c] + b[c])));
            square = fmax(square, fabs(sum - (x * x - 2 * x * z)));
        }
    }
    AT_MOST(linear, 1e-8, "middles of a cube's edges lie on it");
    AT_MOST(square, 0.25 / 16 / 8, "a quadratic field, of which linear ones are 1/64 off");
    quadratic_free(&q);
    mesh_free(&m);
}

/* D and B on rigid motions: none, and the same under the hats. */
static void test_rigid(mesh m, const char *name, double limit) {
    quadratic_surface q = quadratic_build(&m);
    galerkin_matrices g =
        galerkin_assemble(&q, &(galerkin_problem){.young_Pa = young, .poisson = poisson});
    const double omega[3] = {0.3, -0.5, 0.8};
    double turned = 0, moved = 0, largest = 0, asymmetry = 0;
    for (size_t i = 0; i < g.order; i++) {
        double force = 0, mean = 0, centre[3];
        for (size_t j = 0; j < m.vertices; j++) {
            double u[3];
            v_cross(omega, m.x[j], u);
            force += v_dot(g.d + i * g.order + 3 * j, u);
            mean += v_dot(g.b + i * g.order + 3 * j, u);
        }
        v_cross(omega, g.center[i / 3], centre);
        turned = fmax(turned, fabs(force));
        moved = fmax(moved, fabs(mean - centre[i % 3]));
        largest = fmax(largest, g.d[i * g.order + i]);
        for (size_t j = 0; j < i; j++)
            asymmetry = fmax(asymmetry, fabs(g.d[i * g.order + j] - g.d[j * g.order + i]) +
                                            fabs(g.v[i * g.order + j] - g.v[j * g.order + i]));
    }
    AT_MOST(turned / largest, limit, "%s: D annihilates a rotation", name);
    AT_MOST(moved, 10 * limit, "%s: B of a rotation is the rotation", name);
    CHECK(!(asymmetry > 0), "%s: V and D are symmetric to the last bit", name);
    galerkin_free(&g);
    quadratic_free(&q);
    mesh_free(&m);
}

/* D u = B^T t for a constant stress on a cube, face by face. */
static void test_patch(void) {
    mesh m = model_box(1.0, 3);
    quadratic_surface q = quadratic_build(&m);
    const size_t n = 3 * (size_t)m.vertices;
    galerkin_problem problem = {.young_Pa = young, .poisson = poisson};
    galerkin_matrices g = galerkin_assemble(&q, &problem);
    double *load = allocate(n, sizeof *load), off = 0, most = 0;
    uint8_t *dropped = allocate(3 * (size_t)m.triangles, 1);
    problem.dropped = dropped;
    for (int face = 0; face < 6; face++) {
        double out[3] = {0}, t[3];
        out[face / 2] = face % 2 == 0 ? -1 : 1;
        for (uint32_t i = 0; i < m.triangles; i++) {
            double normal[3];
            triangle_normal(m.x[m.t[i][0]], m.x[m.t[i][1]], m.x[m.t[i][2]], normal);
            for (size_t k = 0; k < 3; k++)
                dropped[3 * (size_t)i + k] = v_dot(normal, out) < 0.5 * v_norm(normal);
        }
        galerkin_matrices f = galerkin_assemble(&q, &problem);
        for (int k = 0; k < 3; k++) t[k] = v_dot(stress[k], out);
        for (size_t i = 0; i < n; i++) {
            for (size_t j = 0; j < n && f.area[i / 3] > 0; j++)
                load[j] += f.area[i / 3] * t[i % 3] * f.b[i * n + j];
        }
        galerkin_free(&f);
    }
    for (size_t i = 0; i < n; i++) {
        double sum = 0;
        for (size_t j = 0; j < m.vertices; j++) {
            double u[3];
            stress_displacement(m.x[j], u);
            sum += v_dot(g.d + i * n + 3 * j, u);
        }
        off = fmax(off, fabs(sum - load[i]));
        most = fmax(most, fabs(sum));
    }
    AT_MOST(off / most, 1e-4, "cube of 56 nodes: patch test, any constant stress");
    free(load);
    free(dropped);
    galerkin_free(&g);
    quadratic_free(&q);
    mesh_free(&m);
}

/* ---- bodies that float ---- */

/* Nodal displacements under nodal forces f in equilibrium, (D + s Z Z^T) u = B^T f. */
static void float_body(const mesh *m, galerkin_matrices *g, const double *f, double *u) {
    const size_t n = g->order;
    double z[6], scale = g->d[0] / (double)n;
    memset(u, 0, n * sizeof *u);
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < n; j++) {
            u[j] += f[i] * g->b[i * n + j];
            const double *x = m->x[i / 3], *y = m->x[j / 3], *p[2] = {x, y};
            double mode[2][6] = {{0}};
            for (int s = 0; s < 2; s++) {
                size_t axis = (s == 0 ? i : j) % 3;
                mode[s][axis] = 1;
                mode[s][3 + (axis + 1) % 3] = p[s][(axis + 2) % 3];
                mode[s][3 + (axis + 2) % 3] = -p[s][(axis + 1) % 3];
            }
            for (int k = 0; k < 6; k++) {
                z[k] = mode[0][k] * mode[1][k];
                g->d[i * n + j] += scale * z[k];
            }
        }
    }
    CHECK(dense_cholesky(g->d, n, n) == n, "D of a floating body is positive definite");
    dense_lower_solve(g->d, n, n, u, 1, 1);
    dense_lower_solve_transposed(g->d, n, n, u, 1, 1);
}

/* Tractions p_i of the exact field x, whose mean under each hat is that of x: hats interpolate
 * linearly, the surface is curved. */
static double *nodal_field(const mesh *m, const galerkin_matrices *g) {
    double *mean = allocate(m->vertices, sizeof *mean), *area = allocate(m->vertices, sizeof *area);
    double *p = allocate(m->vertices, sizeof *p);
    for (uint32_t t = 0; t < m->triangles; t++) {
        const uint32_t *v = m->t[t];
        double normal[3];
        triangle_normal(m->x[v[0]], m->x[v[1]], m->x[v[2]], normal);
        for (int e = 0; e < 9; e++) {
            double w = (e % 4 == 0 ? 2 : 1) * v_norm(normal) / 24;
            mean[v[e / 3]] += w * v_dot(m->x[v[e / 3]], m->x[v[e % 3]]);
            area[v[e / 3]] += w;
        }
    }
    for (uint32_t i = 0; i < m->vertices; i++)
        p[i] = v_dot(g->center[i], m->x[i]) * area[i] / mean[i];
    free(mean);
    free(area);
    return p;
}

static void test_sphere(uint32_t levels, double pressure_limit, double uniaxial_limit) {
    mesh m = model_sphere(levels);
    quadratic_surface q = quadratic_build(&m);
    for (int load = 0; load < 2; load++) {
        galerkin_matrices g =
            galerkin_assemble(&q, &(galerkin_problem){.young_Pa = young, .poisson = poisson});
        double *f = allocate(g.order, sizeof *f), *u = allocate(g.order, sizeof *u);
        double off = 0, most = 0, *p = nodal_field(&m, &g);
        for (size_t i = 0; i < g.order; i++) {
            if (load == 0)
                f[i] = -g.area[i / 3] * m.x[i / 3][i % 3] * p[i / 3];
            else
                f[i] = i % 3 == 2 ? g.area[i / 3] * m.x[i / 3][2] * p[i / 3] : 0;
        }
        free(p);
        float_body(&m, &g, f, u);
        for (size_t i = 0; i < g.order; i++) {
            double x = m.x[i / 3][i % 3] / young;
            double exact = load == 0 ? -(1 - 2 * poisson) * x : i % 3 == 2 ? x : -poisson * x;
            off += (u[i] - exact) * (u[i] - exact);
            most += exact * exact;
        }
        AT_MOST(sqrt(off / most), load == 0 ? pressure_limit : uniaxial_limit,
                "sphere of %u nodes, %s", m.vertices, load == 0 ? "pressure" : "uniaxial tension");
        free(f);
        free(u);
        galerkin_free(&g);
    }
    quadratic_free(&q);
    mesh_free(&m);
}

/* ---- a bar ---- */

/* A bar clamped at one end against Timoshenko's beam: bending of elements larger than it is thick. */
static void test_bar(void) {
    enum { LONG = 16, WIDE_CELLS = 4 };
    const double size[3] = {1.0, 0.25, 0.025};
    int cube[LONG * WIDE_CELLS][3];
    for (int i = 0; i < LONG * WIDE_CELLS; i++) {
        cube[i][0] = i / WIDE_CELLS;
        cube[i][1] = i % WIDE_CELLS;
        cube[i][2] = 0;
    }
    uint32_t *cell;
    mesh m = model_voxels((const int(*)[3])cube, LONG * WIDE_CELLS, size[0] / LONG, 1, &cell);
    for (uint32_t i = 0; i < m.vertices; i++) m.x[i][2] *= size[2] / (size[0] / LONG);
    uint8_t *fixed = allocate(m.vertices, 1);
    for (uint32_t i = 0; i < m.vertices; i++) fixed[i] = m.x[i][0] < 1e-9;
    const bem_material material = {.young_Pa = young, .poisson = poisson};
    greens g = greens_from_galerkin(&m, fixed, &material, 1000);
    double sum = 0, count = 0, least = HUGE_VAL, balance[3] = {0};
    for (uint32_t j = 0; j < m.vertices; j++) {
        if (m.x[j][0] < 1 - 1e-9) continue;
        count += 1;
        for (uint32_t i = 0; i < m.vertices; i++) {
            double value = greens_row(&g, i, 2)[3 * j + 2];
            if (m.x[i][0] > 1 - 1e-9) sum += value;
            if (fixed[i] != 0) balance[0] += value;
        }
        least = fmin(least, greens_row(&g, j, 2)[3 * j + 2]);
    }
    double inertia = size[1] * size[2] * size[2] * size[2] / 12;
    double exact = size[0] * size[0] * size[0] / (3 * young * inertia);
    AT_MOST(fabs(sum / count / count / exact - 1), 0.08,
            "bar of %u nodes, elements 2.5 times as long as it is thick, over Timoshenko's %.4g",
            m.vertices, exact);
    AT_MOST(fabs(balance[0] / count + 1), 1e-9, "reactions balance the load");
    greens_reciprocity(&g, &m, true);
    CHECK(!(g.reciprocity_residual > 0), "reciprocal to the last bit before any repair");
    free(g.m);
    free(fixed);
    free(cell);
    mesh_free(&m);
}

int main(void) {
    progress_quiet(1);
    test_middles();
    test_rigid(model_box(1.0, 3), "cube of 56 nodes", 5e-5);
    test_rigid(model_sphere(1), "sphere of 42 nodes", 1e-5);
    test_rigid(model_sphere(2), "sphere of 162 nodes", 1e-5);
    test_patch();
    test_sphere(2, 8e-4, 6e-4);
    test_sphere(3, 9e-5, 7e-5);
    if (getenv("FULL") != NULL) test_sphere(4, 2e-5, 2e-5); /* minutes */
    test_bar();
    return tap_done();
}
