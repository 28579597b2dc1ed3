/* SPDX-License-Identifier: MIT */
/* The display surface: on the finer mesh at rest, moving rigidly with the body, and felt through
 * its normals. */
#include "core/green/detail.h"
#include "tests/models.h"
#include "tests/tap.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

/* A sphere with ripples too fine for the model. */
static mesh rippled(uint32_t levels) {
    mesh m = model_sphere(levels);
    for (uint32_t i = 0; i < m.vertices; i++) {
        double *x = m.x[i];
        double r = 1 + 0.01 * sin(9 * x[0]) * cos(8 * x[1]) * sin(7 * x[2] + 1);
        for (int k = 0; k < 3; k++) x[k] *= r;
    }
    return m;
}

int main(void) {
    progress_quiet(1);
    mesh coarse = model_sphere(2), fine = rippled(5);
    detail_data detail = detail_build(&coarse, 2, &fine);
    AT_MOST(detail.mean, 5e-4,
            "%u displaced vertices lie on the finer mesh, mean distance over the radius",
            detail.vertices);
    uint32_t n = coarse.vertices;
    double *area = allocate(n, sizeof *area), (*normal)[3] = allocate(n, sizeof *normal);
    uint8_t *fixed = allocate(n, 1);
    mesh_nodal(&coarse, area, normal);
    for (uint32_t i = 0; i < n; i++) fixed[i] = coarse.x[i][2] < -0.7;
    const wavelet w = {WAVELET_LINEAR, true};
    domains d = domains_build(&coarse, fixed, area, w);
    bem_material material = {.young_Pa = 1e4, .poisson = 0.4, .tolerance = BEM_TOLERANCE};
    greens g = greens_from_bem(&coarse, fixed, &material, 1000);
    greens_reciprocity(&g, &coarse, true);
    build_options o = {
        .wavelet = w, .compress = {.epsilon = 0.05}, .constraint_level = 2, .detail = &detail};
    built made = blob_build(&coarse, &g, &d, area, normal, (palp_meta){.young_Pa = 1e4f}, &o);
    palp_blob b;
    CHECK(palp_blob_open(&b, made.bytes, made.size) == PALP_OK &&
              b.detail.vertices == detail.vertices,
          "the blob carries it");
    size_t count = 3 * (size_t)detail.vertices;
    float *x = allocate(count, sizeof *x), *nx = allocate(count, sizeof *nx);
    float *y = allocate(count, sizeof *y), *ny = allocate(count, sizeof *ny);
    palp_detail_surface(&b, b.rest_m, x, nx);
    double off = 0, lean = 0;
    for (uint32_t v = 0; v < detail.vertices; v++) {
        double p[3] = {(double)x[3 * v], (double)x[3 * v + 1], (double)x[3 * v + 2]};
        double r = v_norm(p), u[3] = {p[0] / r, p[1] / r, p[2] / r};
        double surface = 1 + 0.01 * sin(9 * u[0]) * cos(8 * u[1]) * sin(7 * u[2] + 1);
        off += fabs(r - surface) / detail.vertices;
        lean = fmax(lean, 1 - (double)palp_dot(palp_vec3_at(nx + 3 * v),
                                               (palp_vec3){(float)u[0], (float)u[1], (float)u[2]}));
    }
    AT_MOST(off, 1e-3, "at rest the surface is the rippled sphere, mean error");
    CHECK(lean > 5e-4, "its normals show the ripples: they lean by up to %.2g degrees",
          acos(1 - lean) * 57.3);
    /* A rigid motion of the nodes moves the detail rigidly. */
    float *moved = allocate(3 * n, sizeof *moved);
    const float c = 0.8f, s = 0.6f;
    for (uint32_t i = 0; i < n; i++) {
        const float *p = b.rest_m + 3 * i;
        moved[3 * i] = c * p[0] - s * p[1] + 0.3f;
        moved[3 * i + 1] = s * p[0] + c * p[1] - 0.2f;
        moved[3 * i + 2] = p[2] + 0.1f;
    }
    palp_detail_surface(&b, moved, y, ny);
    double worst = 0;
    for (uint32_t v = 0; v < detail.vertices; v++) {
        const float *p = x + 3 * v;
        palp_vec3 want = {c * p[0] - s * p[1] + 0.3f, s * p[0] + c * p[1] - 0.2f, p[2] + 0.1f};
        worst = fmax(worst, (double)palp_norm(palp_sub(want, palp_vec3_at(y + 3 * v))));
    }
    AT_MOST(worst, 2e-6, "a rigid motion of the nodes moves it rigidly");
    uint32_t node = b.domain[PALP_FREE].node[0];
    palp_vec3 at = palp_vec3_at(x + 3 * node);
    palp_vec3 felt = palp_detail_normal(&b, x, nx, node, at, 0.05f);
    AT_MOST((double)palp_norm(palp_sub(felt, palp_vec3_at(nx + 3 * node))), 0.05,
            "the normal felt at a vertex is the detail's own");
    felt = palp_detail_normal(&b, x, nx, node, palp_madd(at, 9, at), 0.05f);
    AT_MOST((double)palp_norm(palp_sub(felt, palp_vec3_at(b.normal + 3 * node))), 0,
            "far from all detail it is the node's");
    return tap_done();
}
