/* SPDX-License-Identifier: MIT */
#include "models.h"
#include "tools/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static mesh from_arrays(const double (*x)[3], uint32_t vertices, const uint32_t (*t)[3],
                        uint32_t triangles) {
    const mesh borrowed = {.vertices = vertices,
                           .triangles = triangles,
                           .x = (double(*)[3])(uintptr_t)x,
                           .t = (uint32_t(*)[3])(uintptr_t)t};
    return mesh_copy(&borrowed);
}

mesh model_sphere(uint32_t levels) {
    const double g = 1.6180339887498949;
    const double x[12][3] = {{-1, g, 0}, {1, g, 0}, {-1, -g, 0}, {1, -g, 0},
                             {0, -1, g}, {0, 1, g}, {0, -1, -g}, {0, 1, -g},
                             {g, 0, -1}, {g, 0, 1}, {-g, 0, -1}, {-g, 0, 1}};
    const uint32_t t[20][3] = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                               {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                               {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                               {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
    mesh m = from_arrays(x, 12, t, 20);
    for (uint32_t l = 0; l <= levels; l++) {
        if (l > 0) {
            mesh finer = subdivide_midpoint(&m);
            mesh_free(&m);
            m = finer;
        }
        for (uint32_t i = 0; i < m.vertices; i++) v_normalize(m.x[i]);
    }
    return m;
}

/* Number of the lattice point (i, j, k) among those on the surface, by search; boxes in tests are
 * small. */
static uint32_t lattice_vertex(mesh *m, uint32_t *known, uint32_t n, uint32_t i, uint32_t j,
                               uint32_t k, double step) {
    uint32_t *slot = &known[(k * (n + 1) + j) * (n + 1) + i];
    if (*slot == 0) {
        m->x[m->vertices][0] = i * step;
        m->x[m->vertices][1] = j * step;
        m->x[m->vertices][2] = k * step;
        *slot = ++m->vertices;
    }
    return *slot - 1;
}

mesh model_box(double size, uint32_t n) {
    mesh m = {.x = allocate(6 * (n + 1) * (n + 1), sizeof *m.x),
              .t = allocate(12 * n * n, sizeof *m.t)};
    uint32_t *known = allocate((n + 1) * (n + 1) * (n + 1), sizeof *known);
    for (uint32_t side = 0; side < 6; side++) {
        for (uint32_t square = 0; square < n * n; square++) {
            uint32_t corner[4];
            for (uint32_t c = 0; c < 4; c++) {
                uint32_t u = square % n + (c == 1 || c == 2), v = square / n + (c >= 2);
                uint32_t p[3];
                p[side % 3] = side < 3 ? 0 : n;
                p[(side + 1) % 3] = side < 3 ? v : u;
                p[(side + 2) % 3] = side < 3 ? u : v;
                corner[c] = lattice_vertex(&m, known, n, p[0], p[1], p[2], size / n);
            }
            const uint32_t two[2][3] = {{corner[0], corner[1], corner[2]},
                                        {corner[0], corner[2], corner[3]}};
            memcpy(m.t + m.triangles, two, sizeof two);
            m.triangles += 2;
        }
    }
    free(known);
    return m;
}

baked model_bake_tables(mesh m, double below, double epsilon, bool raw, bool half,
                        double table_bytes) {
    baked b = {.m = m, .material = {.young_Pa = 1e4, .poisson = 0.4, .tolerance = BEM_TOLERANCE}};
    mesh_require_closed(&b.m, "model");
    b.fixed = allocate(m.vertices, 1);
    b.area = allocate(m.vertices, sizeof *b.area);
    b.normal = allocate(m.vertices, sizeof *b.normal);
    for (uint32_t i = 0; i < m.vertices; i++) b.fixed[i] = m.x[i][2] <= below;
    mesh_nodal(&b.m, b.area, b.normal);
    build_options options = {
        .wavelet = {.lifted = true}, .compress = {.epsilon = epsilon, .half = half}, .raw = raw};
    b.d = domains_build(&b.m, b.fixed, b.area, options.wavelet);
    options.constraint_level = b.d.domain[PALP_FREE].view.levels - 1;
    options.table_bytes = table_bytes;
    b.g = greens_from_bem(&b.m, b.fixed, &b.material, 1000);
    greens_reciprocity(&b.g, &b.m, !raw);
    palp_meta meta = {.young_Pa = 1e4f, .poisson = 0.4f, .density_kg_m3 = 1000};
    built made = blob_build(&b.m, &b.g, &b.d, b.area, b.normal, meta, &options);
    b.bytes = made.bytes;
    b.size = made.size;
    b.softened = made.softened;
    palp_status status = palp_blob_open(&b.blob, b.bytes, b.size);
    if (status != PALP_OK) die(EXIT_WORK, "test blob: %s", palp_status_text(status));
    return b;
}

baked model_bake(mesh m, double below, double epsilon, bool raw, bool half) {
    return model_bake_tables(m, below, epsilon, raw, half, 0);
}
