/* SPDX-License-Identifier: MIT */
/*
 * The capacitance matrix algorithm against a direct re-solve of each boundary value problem with
 * the boundary element matrices, by Gauss elimination written here, in double.
 */
#include "tests/models.h"
#include "tests/tap.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

static baked raw;
static double *h_matrix, *g_matrix;

/* For each scalar of the problem: e . u = value, or e . f = value, with an orthonormal frame e per
 * node. */
typedef struct {
    double frame[3][3];
    bool displacement[3];
    double value[3];
} node_condition;

static void gauss(double *a, double *b, size_t n) {
    for (size_t j = 0; j < n; j++) {
        size_t best = j;
        for (size_t i = j + 1; i < n; i++) {
            if (fabs(a[i * n + j]) > fabs(a[best * n + j])) best = i;
        }
        for (size_t k = 0; k < n; k++) {
            double t = a[j * n + k];
            a[j * n + k] = a[best * n + k];
            a[best * n + k] = t;
        }
        double t = b[j];
        b[j] = b[best];
        b[best] = t;
        for (size_t i = j + 1; i < n; i++) {
            double f = a[i * n + j] / a[j * n + j];
            for (size_t k = j; k < n; k++) a[i * n + k] -= f * a[j * n + k];
            b[i] -= f * b[j];
        }
    }
    for (size_t i = n; i-- > 0;) {
        for (size_t k = i + 1; k < n; k++) b[i] -= a[i * n + k] * b[k];
        b[i] /= a[i * n + i];
    }
}

/* H u = G diag(1/a) f in the frames of the nodes, knowns to the right. */
static void direct_solve(const node_condition *c, double *u, double *f) {
    size_t nodes = raw.m.vertices, n = 3 * nodes;
    double *a = allocate(n * n, sizeof *a), *b = allocate(n, sizeof *b);
    double scale = raw.material.young_Pa;
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < nodes; j++) {
            for (size_t e = 0; e < 3; e++) {
                const double *dir = c[j].frame[e];
                double h = v_dot(h_matrix + i * n + 3 * j, dir);
                double g = v_dot(g_matrix + i * n + 3 * j, dir) / raw.area[j];
                a[i * n + 3 * j + e] = c[j].displacement[e] ? -g * scale : h;
                b[i] += c[j].displacement[e] ? -h * c[j].value[e] : g * c[j].value[e];
            }
        }
    }
    gauss(a, b, n);
    memset(u, 0, n * sizeof *u);
    memset(f, 0, n * sizeof *f);
    for (size_t j = 0; j < nodes; j++) {
        for (size_t e = 0; e < 3; e++) {
            bool given_u = c[j].displacement[e];
            for (size_t k = 0; k < 3; k++) {
                u[3 * j + k] += c[j].frame[e][k] * (given_u ? c[j].value[e] : b[3 * j + e]);
                f[3 * j + k] += c[j].frame[e][k] * (given_u ? b[3 * j + e] * scale : c[j].value[e]);
            }
        }
    }
    free(a);
    free(b);
}

static node_condition *reference_conditions(void) {
    node_condition *c = allocate(raw.m.vertices, sizeof *c);
    for (uint32_t i = 0; i < raw.m.vertices; i++) {
        for (int e = 0; e < 3; e++) {
            c[i].frame[e][e] = 1;
            c[i].displacement[e] = raw.fixed[i] != 0;
        }
    }
    return c;
}

/* The node's first axis along its normal. */
static void turn_to_normal(node_condition *c, uint32_t node) {
    const double *n = raw.normal[node];
    double other[3] = {0, 0, 0};
    other[fabs(n[0]) < 0.6 ? 0 : 1] = 1;
    memcpy(c[node].frame[0], n, sizeof c[node].frame[0]);
    v_cross(n, other, c[node].frame[1]);
    v_normalize(c[node].frame[1]);
    v_cross(n, c[node].frame[1], c[node].frame[2]);
}

static double difference(const float *x, const double *exact, size_t n) {
    double error = 0, norm = 0;
    for (size_t i = 0; i < n; i++) {
        error += ((double)x[i] - exact[i]) * ((double)x[i] - exact[i]);
        norm += exact[i] * exact[i];
    }
    return sqrt(error / norm);
}

typedef struct {
    uint32_t node;
    palp_condition condition;
    palp_vec3 value;
} given;

static void apply_direct(node_condition *c, const given *g) {
    const double v[3] = {(double)g->value.x, (double)g->value.y, (double)g->value.z};
    if (g->condition == PALP_PRESCRIBE_NORMAL) turn_to_normal(c, g->node);
    for (int e = 0; e < 3; e++) {
        bool displaced = g->condition == PALP_PRESCRIBE_DISPLACEMENT ||
                         (g->condition == PALP_PRESCRIBE_NORMAL && e == 0);
        double factor = g->condition == PALP_PRESCRIBE_TRACTION ? raw.area[g->node] : 1;
        c[g->node].displacement[e] = displaced;
        c[g->node].value[e] = g->condition == PALP_PRESCRIBE_NORMAL && e > 0 ? 0 : factor * v[e];
    }
}

static void compare(const palp_blob *blob, const char *name, const given *g, uint32_t count,
                    double limit) {
    size_t n = 3 * (size_t)raw.m.vertices;
    palp_cma cma;
    size_t bytes = palp_cma_memsize(blob, 3 * count);
    void *memory = allocate_aligned(bytes, 1);
    float *u = allocate(n, sizeof *u), *f = allocate(n, sizeof *f);
    double *u_exact = allocate(n, sizeof *u_exact), *f_exact = allocate(n, sizeof *f_exact);
    node_condition *c = reference_conditions();
    (void)palp_cma_init(&cma, blob, 3 * count, memory, bytes);
    for (uint32_t i = 0; i < count; i++) {
        apply_direct(c, &g[i]);
        palp_status status = palp_cma_prescribe(&cma, g[i].node, g[i].condition, g[i].value);
        if (status != PALP_OK)
            CHECK(false, "%s: condition %u: %s", name, i, palp_status_text(status));
    }
    palp_status status = palp_cma_solve(&cma, u, f);
    direct_solve(c, u_exact, f_exact);
    if (status != PALP_OK) CHECK(false, "%s: %s", name, palp_status_text(status));
    AT_MOST(difference(u, u_exact, n), limit, "%s: displacements against the direct solution",
            name);
    AT_MOST(difference(f, f_exact, n), limit, "%s: forces against the direct solution", name);
    double exact = 0;
    for (uint32_t i = 0; i < count; i++) {
        if (g[i].condition != PALP_PRESCRIBE_DISPLACEMENT) continue;
        const float *x = u + 3 * g[i].node;
        exact =
            fmax(exact, fabs((double)(x[0] - g[i].value.x)) + fabs((double)(x[1] - g[i].value.y)) +
                            fabs((double)(x[2] - g[i].value.z)));
    }
    AT_MOST(exact, 1e-9, "%s: prescribed displacements are met", name);
    free(c);
    free(u);
    free(f);
    free(u_exact);
    free(f_exact);
    free(memory);
}

/* The `count` nodes with the largest z (or smallest, for fixed ones). */
static uint32_t nth_node(bool fixed, uint32_t skip) {
    for (uint32_t i = 0; i < raw.m.vertices; i++) {
        if ((raw.fixed[i] != 0) == fixed && (fixed || raw.m.x[i][2] > 0.6) && skip-- == 0) return i;
    }
    return 0;
}

static void test_kinds(const palp_blob *blob, const char *kind, double limit) {
    char name[80];
    given one[24];
    uint32_t n = 0;
    for (; n < 20; n++)
        one[n] = (given){
            nth_node(false, n), PALP_PRESCRIBE_DISPLACEMENT, {0.01f * (float)n, -0.02f, -0.05f}};
    snprintf(name, sizeof name, "%s: 20 prescribed displacements", kind);
    compare(blob, name, one, n, limit);
    for (n = 0; n < 20; n++)
        one[n] =
            (given){nth_node(false, n), PALP_PRESCRIBE_NORMAL, {-0.05f - 0.001f * (float)n, 0, 0}};
    snprintf(name, sizeof name, "%s: 20 normal-only constraints", kind);
    compare(blob, name, one, n, limit);
    one[0] = (given){nth_node(false, 3), PALP_PRESCRIBE_FORCE, {10, -20, 30}};
    snprintf(name, sizeof name, "%s: a nodal force", kind);
    compare(blob, name, one, 1, limit);
    one[0] = (given){nth_node(false, 4), PALP_PRESCRIBE_TRACTION, {100, 50, -200}};
    snprintf(name, sizeof name, "%s: a traction", kind);
    compare(blob, name, one, 1, limit);
    one[0] = (given){nth_node(true, 2), PALP_RELEASE, {0, 0, 0}};
    one[1] = (given){nth_node(false, 3), PALP_PRESCRIBE_FORCE, {10, -20, 30}};
    snprintf(name, sizeof name, "%s: a released fixed node under load", kind);
    compare(blob, name, one, 2, limit);
    one[0] = (given){nth_node(true, 1), PALP_PRESCRIBE_DISPLACEMENT, {0.01f, 0.02f, -0.01f}};
    one[1] = (given){nth_node(true, 4), PALP_PRESCRIBE_NORMAL, {0.03f, 0, 0}};
    one[2] = (given){nth_node(true, 5), PALP_PRESCRIBE_FORCE, {3, 2, 1}};
    one[3] = (given){nth_node(false, 5), PALP_PRESCRIBE_NORMAL, {-0.03f, 0, 0}};
    one[4] = (given){nth_node(false, 8), PALP_PRESCRIBE_DISPLACEMENT, {0.03f, 0.01f, 0}};
    one[5] = (given){nth_node(false, 11), PALP_PRESCRIBE_TRACTION, {30, 0, 10}};
    snprintf(name, sizeof name, "%s: all kinds at once", kind);
    compare(blob, name, one, 6, limit);
}

static void test_refusals(void) {
    palp_cma cma;
    size_t bytes = palp_cma_memsize(&raw.blob, 4);
    void *memory = allocate_aligned(bytes, 1);
    uint32_t node = nth_node(false, 0), held = nth_node(true, 0);
    CHECK(palp_cma_init(&cma, &raw.blob, 4, memory, bytes - 1) == PALP_ERR_MEMORY,
          "one byte too few is refused");
    CHECK(palp_cma_init(&cma, &raw.blob, 4, (char *)memory + 8, bytes) == PALP_ERR_ALIGNMENT,
          "misaligned memory is refused");
    CHECK(palp_cma_init(&cma, &raw.blob, 4, memory, bytes) == PALP_OK, "the solver opens");
    CHECK(palp_cma_prescribe(&cma, node, PALP_PRESCRIBE_DISPLACEMENT, (palp_vec3){NAN, 0, 0}) ==
              PALP_ERR_NOT_FINITE,
          "NaN is refused");
    CHECK(palp_cma_prescribe(&cma, 99999, PALP_PRESCRIBE_FORCE, (palp_vec3){0}) ==
              PALP_ERR_ARGUMENT,
          "a node out of range is refused");
    CHECK(palp_cma_prescribe(&cma, node, PALP_RELEASE, (palp_vec3){0}) == PALP_ERR_ARGUMENT,
          "releasing a free node is refused");
    CHECK(palp_cma_prescribe(&cma, node, PALP_PRESCRIBE_DISPLACEMENT, (palp_vec3){0}) == PALP_OK,
          "a displacement is taken");
    CHECK(palp_cma_prescribe(&cma, node, PALP_PRESCRIBE_FORCE, (palp_vec3){0}) == PALP_ERR_ARGUMENT,
          "a second condition is refused");
    CHECK(palp_cma_prescribe(&cma, held, PALP_RELEASE, (palp_vec3){0}) == PALP_ERR_CAPACITY,
          "an unknown too many is refused");
    free(memory);
}

/* Moving every fixed node rigidly moves the body rigidly, without force; loads are balanced in
 * force and moment. */
static void test_rigid(const baked *b) {
    size_t n = 3 * (size_t)b->m.vertices;
    palp_cma cma;
    size_t bytes = palp_cma_memsize(&b->blob, 3);
    void *memory = allocate_aligned(bytes, 1);
    float *u = allocate(n, sizeof *u), *f = allocate(n, sizeof *f);
    double motion = 0, force = 0, sum[6] = {0};
    (void)palp_cma_init(&cma, &b->blob, 3, memory, bytes);
    for (uint32_t i = 0; i < b->m.vertices; i++) {
        const double *x = b->m.x[i];
        palp_vec3 v = {0.1f - 0.3f * (float)x[1], 0.2f + 0.3f * (float)x[0], -0.3f};
        if (b->fixed[i] != 0) (void)palp_cma_prescribe(&cma, i, PALP_PRESCRIBE_DISPLACEMENT, v);
    }
    (void)palp_cma_solve(&cma, u, f);
    for (uint32_t i = 0; i < b->m.vertices; i++) {
        const double *x = b->m.x[i];
        const double exact[3] = {0.1 - 0.3 * x[1], 0.2 + 0.3 * x[0], -0.3};
        for (int k = 0; k < 3; k++) {
            motion = fmax(motion, fabs((double)u[3 * i + (uint32_t)k] - exact[k]));
            force = fmax(force, fabs((double)f[3 * i + (uint32_t)k]));
        }
    }
    AT_MOST(motion, 2e-6, "rigid motion of the fixed nodes moves the body rigidly, m");
    AT_MOST(force / b->material.young_Pa, 1e-6, "and without force, over Young's modulus");
    palp_cma_clear(&cma);
    (void)palp_cma_prescribe(&cma, nth_node(false, 6), PALP_PRESCRIBE_FORCE, (palp_vec3){3, -2, 5});
    (void)palp_cma_solve(&cma, u, f);
    for (uint32_t i = 0; i < b->m.vertices; i++) {
        const double g[3] = {(double)f[3 * i], (double)f[3 * i + 1], (double)f[3 * i + 2]};
        double moment[3];
        v_cross(b->m.x[i], g, moment);
        for (int k = 0; k < 3; k++) {
            sum[k] += g[k];
            sum[3 + k] += moment[k];
        }
    }
    AT_MOST(sqrt(v_dot(sum, sum) + v_dot(sum + 3, sum + 3)), 2e-5,
            "load and reactions balance in force and moment, N and Nm");
    palp_cma_clear(&cma);
    (void)palp_cma_prescribe(&cma, nth_node(false, 6), PALP_PRESCRIBE_FORCE, (palp_vec3){3, -2, 5});
    free(memory);
    bytes = palp_cma_memsize(&b->blob, (uint32_t)n);
    memory = allocate_aligned(bytes, 1);
    (void)palp_cma_init(&cma, &b->blob, (uint32_t)n, memory, bytes);
    for (uint32_t i = 0, kept = 0; i < b->m.vertices; i++) {
        if (b->fixed[i] != 0 && kept++ >= 2)
            (void)palp_cma_prescribe(&cma, i, PALP_RELEASE, (palp_vec3){0, 0, 0});
    }
    CHECK(palp_cma_solve(&cma, u, f) == PALP_ERR_SINGULAR,
          "a body held at two nodes only is refused");
    free(memory);
}

/* Every fixed node let go, and one more condition: is the body held? */
static palp_status let_go(const baked *b, const uint32_t *node, palp_condition condition,
                          uint32_t count) {
    const size_t n = 3 * (size_t)b->m.vertices;
    palp_cma cma;
    const size_t bytes = palp_cma_memsize(&b->blob, (uint32_t)n);
    void *memory = allocate_aligned(bytes, 1);
    float *u = allocate(n, sizeof *u), *f = allocate(n, sizeof *f);
    (void)palp_cma_init(&cma, &b->blob, (uint32_t)n, memory, bytes);
    for (uint32_t i = 0; i < b->m.vertices; i++) {
        bool named = false;
        for (uint32_t k = 0; k < count; k++) named = named || node[k] == i;
        if (b->fixed[i] != 0 && !named)
            (void)palp_cma_prescribe(&cma, i, PALP_RELEASE, (palp_vec3){0, 0, 0});
    }
    for (uint32_t k = 0; k < count; k++)
        (void)palp_cma_prescribe(&cma, node[k], condition, (palp_vec3){0, 0, 0});
    const palp_status status = palp_cma_solve(&cma, u, f);
    free(memory);
    free(u);
    free(f);
    return status;
}

static void test_loose(const baked *b) {
    uint32_t node[40];
    for (uint32_t k = 0; k < 40; k++) node[k] = nth_node(false, 3 * k);
    CHECK(let_go(b, node, PALP_PRESCRIBE_NORMAL, 1) == PALP_ERR_SINGULAR,
          "all fixed nodes let go and one held along its normal: loose");
    CHECK(let_go(b, node, PALP_PRESCRIBE_NORMAL, 5) == PALP_ERR_SINGULAR,
          "nor do five normals hold a body");
    CHECK(let_go(b, node, PALP_PRESCRIBE_DISPLACEMENT, 1) == PALP_ERR_SINGULAR,
          "one node held wholly: it turns");
    CHECK(let_go(b, node, PALP_PRESCRIBE_DISPLACEMENT, 3) == PALP_OK, "three nodes hold it");
}

/* A solve that fails leaves the conditions as they were. */
static void test_failed_solve(const baked *b) {
    palp_meta meta = *b->blob.meta;
    palp_blob coarser = b->blob; /* as if columns were stored for coarse hats only */
    const palp_blob *blob = &coarser;
    meta.constraint_level = meta.levels - 2;
    coarser.meta = &meta;
    const uint32_t n = 3 * b->m.vertices;
    palp_cma cma;
    const size_t bytes = palp_cma_memsize(blob, n);
    void *memory = allocate_aligned(bytes, 1);
    float *u = allocate(n, sizeof *u), *f = allocate(n, sizeof *f);
    (void)palp_cma_init(&cma, blob, n, memory, bytes);
    uint32_t absent = 0, coarse = 0; /* a node of a coarse hat, and one of a fine one far from it */
    const uint32_t stored = blob->level[meta.constraint_level].nodes;
    for (uint32_t i = 0; i < b->m.vertices; i++)
        if (b->fixed[i] == 0 && palp_node_slot(blob, i) < blob->level[0].nodes) coarse = i;
    for (uint32_t i = 0; i < b->m.vertices; i++) {
        const bool farther =
            v_distance(b->m.x[i], b->m.x[coarse]) > v_distance(b->m.x[absent], b->m.x[coarse]);
        if (b->fixed[i] == 0 && palp_node_slot(blob, i) >= stored && farther) absent = i;
    }
    (void)palp_cma_level(&cma, 0, PALP_ENERGETIC);
    (void)palp_cma_prescribe(&cma, coarse, PALP_PRESCRIBE_DISPLACEMENT, (palp_vec3){0.01f, 0, 0});
    for (uint32_t i = 0; i < b->m.vertices; i++) {
        const uint32_t slot = palp_node_slot(blob, i);
        if (b->fixed[i] == 0 && slot >= blob->level[0].nodes && slot < stored)
            (void)palp_cma_prescribe(&cma, i, PALP_PRESCRIBE_DISPLACEMENT,
                                     (palp_vec3){0.01f, 0, 0});
    }
    (void)palp_cma_prescribe(&cma, absent, PALP_PRESCRIBE_DISPLACEMENT, (palp_vec3){0.01f, 0, 0});
    const uint32_t asked = cma.count;
    palp_switched_unknown *before = allocate(asked, sizeof *before);
    memcpy(before, cma.switches, asked * sizeof *before);
    const palp_status status = palp_cma_solve(&cma, u, f);
    bool same = cma.count == asked;
    for (uint32_t k = 0; k < asked; k++) same = same && before[k].node == cma.switches[k].node;
    CHECK(status == PALP_ERR_ABSENT && same && asked > 6,
          "a node that no stored column can hold: ABSENT, and the %u unknowns are as given", asked);
    free(before);
    free(memory);
    free(u);
    free(f);
}

int main(void) {
    progress_quiet(1);
    raw = model_bake(model_sphere(2), -0.7, 0, true, false);
    size_t n = 3 * (size_t)raw.m.vertices;
    h_matrix = allocate(n * n, sizeof *h_matrix);
    g_matrix = allocate(n * n, sizeof *g_matrix);
    bem_assemble(&raw.m, &raw.material, h_matrix, n, g_matrix, n, NULL);
    test_kinds(&raw.blob, "raw", 1e-5);
    test_refusals();
    /* With reciprocity enforced the answer differs by no more than collocation's own asymmetry. */
    baked enforced = model_bake(model_sphere(2), -0.7, 0, false, false);
    test_kinds(&enforced.blob, "enforced", 0.08);
    test_rigid(&enforced);
    test_loose(&enforced);
    test_failed_solve(&enforced);
    /* Half-space and modes, every pair of nodes corrected; then as it is stored. */
    baked split = model_bake_split(model_sphere(2), -0.7, 1e-9, false);
    test_kinds(&split.blob, "split", 0.08);
    test_rigid(&split);
    test_loose(&split);
    baked small = model_bake_split(model_sphere(2), -0.7, 0.05, true);
    test_kinds(&small.blob, "split at epsilon 0.05", 0.08);
    return tap_done();
}
