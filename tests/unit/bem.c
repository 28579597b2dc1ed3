/* SPDX-License-Identifier: MIT */
/* The boundary element solver against exact solutions. */
#include "tests/models.h"
#include "tests/tap.h"
#include "tools/solver/dense.h"
#include "tools/solver/gauss.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

static const double poisson = 0.3, young = 1.0;

static void test_quadrature(void) {
    double node[16], weight[16], worst = 0;
    for (uint32_t n = 1; n <= 16; n++) {
        gauss_legendre(n, node, weight);
        for (uint32_t degree = 0; degree < 2 * n; degree++) {
            double sum = 0;
            for (uint32_t i = 0; i < n; i++) sum += weight[i] * pow(node[i], degree);
            worst = fmax(worst, fabs(sum - 1.0 / (degree + 1)));
        }
    }
    AT_MOST(worst, 1e-14, "Gauss-Legendre is exact to degree 2n - 1");
}

/* The constant stress of the patch test. */
static const double stress[3][3] = {{1.0, 0.3, -0.2}, {0.3, -0.7, 0.5}, {-0.2, 0.5, 0.4}};

static void stress_traction(const void *context, const double y[3], const double n[3], double *t) {
    (void)context;
    (void)y;
    for (int i = 0; i < 3; i++)
        t[i] = stress[i][0] * n[0] + stress[i][1] * n[1] + stress[i][2] * n[2];
}

/* u = strain y for that stress. */
static void stress_displacement(const double y[3], double u[3]) {
    double trace = stress[0][0] + stress[1][1] + stress[2][2];
    for (int i = 0; i < 3; i++) {
        u[i] = -poisson / young * trace * y[i];
        for (int k = 0; k < 3; k++) u[i] += (1 + poisson) / young * stress[i][k] * y[k];
    }
}

static void test_patch(mesh m, const char *name, double tolerance, double limit) {
    size_t order = 3 * (size_t)m.vertices;
    double *h = allocate(order * order, sizeof *h), *g = allocate(order * order, sizeof *g);
    double *t = allocate(order, sizeof *t);
    uint8_t *all = allocate(3 * (size_t)m.triangles, 1);
    memset(all, 1, 3 * (size_t)m.triangles);
    bem_material material = {.young_Pa = young, .poisson = poisson, .tolerance = tolerance};
    bem_traction traction = {.columns = 1, .at = stress_traction, .known = all, .result = t};
    bem_assemble(&m, &material, h, order, g, order, &traction);
    const double omega[3] = {0.3, -0.5, 0.8};
    double rotation = 0, patch = 0, scale = 0;
    for (size_t i = 0; i < order; i++) {
        double turned = 0, strained = -t[i];
        for (size_t j = 0; j < m.vertices; j++) {
            double u[3], v[3];
            v_cross(omega, m.x[j], u);
            stress_displacement(m.x[j], v);
            turned += v_dot(h + i * order + 3 * j, u);
            strained += v_dot(h + i * order + 3 * j, v);
            scale = fmax(scale, v_norm(v));
        }
        rotation = fmax(rotation, fabs(turned));
        patch = fmax(patch, fabs(strained));
    }
    AT_MOST(rotation / scale, limit, "%s, quadrature %g: H annihilates a rotation", name,
            tolerance);
    AT_MOST(patch / scale, limit, "%s, quadrature %g: linear patch test", name, tolerance);
    free(all);
    free(t);
    free(g);
    free(h);
    mesh_free(&m);
}

/* Removes the rigid motion of x nearest to the exact field by least squares on six modes. */
static double error_up_to_rigid(const mesh *m, const double *u, const double *exact) {
    double a[36] = {0}, b[6] = {0};
    uint32_t perm[6];
    for (int pass = 0;; pass++) {
        double error = 0, norm = 0;
        for (size_t i = 0; i < m->vertices; i++) {
            const double *x = m->x[i];
            const double mode[6][3] = {{1, 0, 0},        {0, 1, 0},        {0, 0, 1},
                                       {0, -x[2], x[1]}, {x[2], 0, -x[0]}, {-x[1], x[0], 0}};
            double d[3];
            v_sub(u + 3 * i, exact + 3 * i, d);
            for (int p = 0; p < 6; p++) {
                for (int q = 0; q < 6 && pass == 0; q++) a[6 * p + q] += v_dot(mode[p], mode[q]);
                if (pass == 0) b[p] += v_dot(mode[p], d);
                for (int k = 0; k < 3 && pass == 1; k++) d[k] -= b[p] * mode[p][k];
            }
            error += v_dot(d, d);
            norm += v_dot(exact + 3 * i, exact + 3 * i);
        }
        if (pass == 1) return sqrt(error / norm);
        (void)dense_lu(a, 6, 6, perm);
        dense_lu_solve(a, 6, 6, perm, b, 1, 1);
    }
}

/* Prescribes nodal tractions everywhere; six rows of the singular system give way to fixing the
 * rigid motion. */
static void solve_tractions(const mesh *m, double *h, const double *g, const double *p, double *u) {
    size_t order = 3 * (size_t)m->vertices;
    uint32_t *perm = allocate(order + 6, sizeof *perm);
    size_t n = order + 6;
    double *a = allocate(n * n, sizeof *a), *b = allocate(n, sizeof *b);
    for (size_t i = 0; i < order; i++) {
        memcpy(a + i * n, h + i * order, order * sizeof *a);
        for (size_t j = 0; j < order; j++) b[i] += g[i * order + j] * p[j];
        /* bordered with the rigid modes on both sides: nonsingular, and exact for compatible loads
         */
        const double *x = m->x[i / 3];
        const double mode[6][3] = {{1, 0, 0},        {0, 1, 0},        {0, 0, 1},
                                   {0, -x[2], x[1]}, {x[2], 0, -x[0]}, {-x[1], x[0], 0}};
        for (size_t k = 0; k < 6; k++)
            a[i * n + order + k] = a[(order + k) * n + i] = mode[k][i % 3];
    }
    if (dense_lu(a, n, n, perm) < n) CHECK(false, "bordered system is singular");
    dense_lu_solve(a, n, n, perm, b, 1, 1);
    memcpy(u, b, order * sizeof *u);
    free(a);
    free(b);
    free(perm);
}

static void test_sphere(uint32_t levels, double pressure_limit, double uniaxial_limit) {
    mesh m = model_sphere(levels);
    size_t order = 3 * (size_t)m.vertices;
    double *h = allocate(order * order, sizeof *h), *g = allocate(order * order, sizeof *g);
    double *p = allocate(order, sizeof *p), *u = allocate(order, sizeof *u),
           *exact = allocate(order, sizeof *exact);
    bem_material material = {.young_Pa = young, .poisson = poisson, .tolerance = BEM_TOLERANCE};
    bem_assemble(&m, &material, h, order, g, order, NULL);
    /* Unit pressure: u = -(1 - 2 nu) R / E along the radius. */
    for (size_t i = 0; i < order; i++) {
        p[i] = -m.x[i / 3][i % 3];
        exact[i] = -(1 - 2 * poisson) / young * m.x[i / 3][i % 3];
    }
    solve_tractions(&m, h, g, p, u);
    AT_MOST(error_up_to_rigid(&m, u, exact), 1.3 * pressure_limit,
            "sphere of %u nodes under pressure", m.vertices);
    /* Unit tension along z: t = n_z e_z. */
    for (size_t i = 0; i < order; i++) {
        p[i] = i % 3 == 2 ? m.x[i / 3][2] : 0;
        exact[i] = m.x[i / 3][i % 3] / young * (i % 3 == 2 ? 1 : -poisson);
    }
    solve_tractions(&m, h, g, p, u);
    AT_MOST(error_up_to_rigid(&m, u, exact), 1.3 * uniaxial_limit,
            "sphere of %u nodes in uniaxial tension", m.vertices);
    free(h);
    free(g);
    free(p);
    free(u);
    free(exact);
    mesh_free(&m);
}

/* Gravity on a body hanging from its fixed nodes: the reactions carry its weight, and the sag of a
 * column agrees. */
static void test_gravity(void) {
    baked b = model_bake(model_box(1.0, 6), 1e-9, 0, true, false);
    double reaction[3] = {0}, top = 0;
    for (size_t i = 0; i < b.g.nodes; i++) {
        for (size_t k = 0; k < 3; k++) {
            double v = greens_row(&b.g, i, k)[3 * b.g.nodes + 2];
            if (b.fixed[i] != 0) reaction[k] += v;
            if (k == 2 && b.m.x[i][2] > 1 - 1e-9 && fabs(b.m.x[i][0] - 0.5) < 1e-9 &&
                fabs(b.m.x[i][1] - 0.5) < 1e-9)
                top = v;
        }
    }
    double weight = 1000.0; /* density times volume times unit acceleration along +z */
    AT_MOST(fabs(reaction[2] + weight) / weight, 0.03,
            "cube in gravity: reactions carry the weight");
    AT_MOST(fabs(reaction[0]) / weight, 0.01, "cube in gravity: no lateral reaction");
    /* A free-sliding column sags rho g L^2 / 2E; a glued base stiffens it by a good part. */
    double column = 1000.0 / (2 * b.material.young_Pa);
    CHECK(top > 0.5 * column && top < column,
          "cube in gravity: sag %.4g below the sliding column's %.4g", top, column);
}

int main(void) {
    progress_quiet(1);
    test_quadrature();
    test_patch(model_sphere(1), "sphere of 42 nodes", 1e-14, 1e-12);
    test_patch(model_box(1.0, 3), "cube of 56 nodes", 1e-14, 1e-12);
    test_patch(model_sphere(2), "sphere of 162 nodes", 1e-14, 1e-12);
    test_patch(model_sphere(2), "sphere of 162 nodes", BEM_TOLERANCE, 1e-6);
    test_sphere(2, 4.4e-3, 5.9e-3);
    test_sphere(3, 1.5e-3, 1.7e-3);
    test_sphere(4, 4.6e-4, 4.6e-4);
    test_gravity();
    return tap_done();
}
