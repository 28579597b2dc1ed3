/* SPDX-License-Identifier: MIT */
/* Connectivity, subdivision and remeshing. */
#include "tests/models.h"
#include "tests/tap.h"
#include "port/host/parallel.h"
#include "tools/mesh/crossing.h"
#include "tools/mesh/holes.h"
#include "tools/mesh/remesh.h"
#include "tools/bake/sha256.h"
#include "tools/mesh/simplify.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

/* The same mesh with vertices renumbered by a fixed shuffle. */
static mesh shuffled(const mesh *m, uint32_t *to) {
    mesh r = mesh_copy(m);
    uint64_t seed = 12;
    for (uint32_t i = 0; i < m->vertices; i++) to[i] = i;
    for (uint32_t i = m->vertices - 1; i > 0; i--) {
        uint32_t k = (uint32_t)(fabs(tap_random(&seed)) * (i + 1)) % (i + 1);
        uint32_t t = to[i];
        to[i] = to[k];
        to[k] = t;
    }
    for (uint32_t i = 0; i < m->vertices; i++) memcpy(r.x[to[i]], m->x[i], sizeof m->x[i]);
    for (uint32_t i = 0; i < m->triangles; i++) {
        for (int k = 0; k < 3; k++) r.t[i][k] = to[m->t[i][k]];
    }
    return r;
}

/* A torus of regular valence 6, `n` around the tube and 2n around the ring. */
static mesh torus(uint32_t n) {
    mesh m = {.vertices = 2 * n * n, .triangles = 4 * n * n};
    m.x = allocate(m.vertices, sizeof *m.x);
    m.t = allocate(m.triangles, sizeof *m.t);
    for (uint32_t i = 0; i < m.vertices; i++) {
        double a = 6.283185307179586 * (i % (2 * n)) / (2 * n),
               b = 6.283185307179586 * (i / (2 * n)) / n;
        m.x[i][0] = (2 + cos(b)) * cos(a);
        m.x[i][1] = (2 + cos(b)) * sin(a);
        m.x[i][2] = sin(b);
    }
    for (uint32_t i = 0; i < 2 * n * n; i++) {
        uint32_t a = i % (2 * n), b = i / (2 * n), a1 = (a + 1) % (2 * n), b1 = (b + 1) % n;
        const uint32_t two[2][3] = {{b * 2 * n + a, b * 2 * n + a1, b1 * 2 * n + a1},
                                    {b * 2 * n + a, b1 * 2 * n + a1, b1 * 2 * n + a}};
        memcpy(m.t + 2 * i, two, sizeof two);
    }
    return m;
}

static void test_detection(void) {
    for (uint32_t levels = 0; levels <= 4; levels++) {
        mesh m = model_sphere(levels);
        semireg s = semireg_detect(&m);
        CHECK(s.levels == levels + 1, "icosphere of %u splits: %u levels found", levels, s.levels);
        uint32_t *to = allocate(m.vertices, sizeof *to);
        mesh r = shuffled(&m, to);
        semireg q = semireg_detect(&r);
        bool same = q.levels == s.levels;
        for (uint32_t i = 0; i < m.vertices && same; i++) same = q.level[to[i]] == s.level[i];
        CHECK(same, "the same levels after the vertices are shuffled");
        for (uint32_t i = 0; i < m.vertices && same; i++) {
            for (int k = 0; k < 2 && s.level[i] > 0; k++) {
                uint32_t p = to[s.parent[i][k]];
                same = same && (q.parent[to[i]][0] == p || q.parent[to[i]][1] == p);
            }
        }
        CHECK(same, "and the same parents");
    }
    mesh t = torus(8);
    semireg s = semireg_detect(&t);
    CHECK(s.levels >= 3, "a torus without irregular vertices: %u levels", s.levels);
    mesh box = model_box(1, 3);
    semireg b = semireg_detect(&box);
    CHECK(b.levels == 1, "a mesh without subdivision connectivity has one level");
}

static void test_loop(void) {
    /* Loop's scheme keeps affine images and converges: volumes of successive levels draw together.
     */
    mesh m = model_sphere(1), a = subdivide_loop(&m), b = subdivide_loop(&a),
         c = subdivide_loop(&b);
    double v[4] = {mesh_volume(&m), mesh_volume(&a), mesh_volume(&b), mesh_volume(&c)};
    CHECK(fabs(v[3] - v[2]) < 0.4 * fabs(v[2] - v[1]), "Loop volumes converge: %.4f %.4f %.4f %.4f",
          v[0], v[1], v[2], v[3]);
    CHECK(b.vertices == a.vertices + 3 * a.triangles / 2 && b.triangles == 4 * a.triangles,
          "counts of one split");
}

static void test_map(void) {
    mesh m = model_sphere(4);
    simplified s = simplify(&m, 60);
    uint32_t n = s.base.triangles;
    surface_point *p = allocate(n, sizeof *p);
    double worst = 0;
    bool inside = true;
    for (uint32_t i = 0; i < n; i++) p[i] = (surface_point){i, {0.3, 0.3, 0.4}};
    simplified_map(&s, p, n);
    for (uint32_t i = 0; i < n; i++) {
        double x[3] = {0}, from[3] = {0};
        for (int k = 0; k < 3; k++) {
            inside = inside && p[i].weight[k] >= 0 && p[i].weight[k] <= 1;
            for (int c = 0; c < 3; c++) {
                x[c] += p[i].weight[k] * m.x[m.t[p[i].triangle][k]][c];
                from[c] += (k == 2 ? 0.4 : 0.3) * s.base.x[s.base.t[i][k]][c];
            }
        }
        v_normalize(from);
        v_normalize(x);
        worst = fmax(worst, v_distance(from, x));
    }
    CHECK(n <= 60 && inside, "simplified to %u triangles, mapped points lie in triangles", n);
    AT_MOST(worst, 0.6, "mapped points stay near their base triangle");
}

static void test_remesh(void) {
    remesh_report r;
    mesh t = torus(40);
    mesh out = remesh(&t, "torus", 3, 0, &r);
    semireg s = semireg_detect(&out);
    CHECK(s.levels == 4 && out.triangles == 64 * r.base_triangles,
          "torus: %u base triangles, 4 levels", r.base_triangles);
    CHECK((int)out.vertices - (int)(3 * out.triangles / 2) + (int)out.triangles == 0,
          "torus: the genus is kept");
    CHECK(r.flipped == 0 && r.mean < 0.005 && r.max < 0.04,
          "torus: mean %.3f %%, max %.3f %%, none flipped", 100 * r.mean, 100 * r.max);
    mesh box = model_box(1, 12);
    mesh cube = remesh(&box, "box", 2, 0, &r);
    CHECK(r.flipped == 0 && r.mean < 0.005 && r.max < 0.04,
          "box with sharp edges: mean %.3f %%, max %.3f %%", 100 * r.mean, 100 * r.max);
    AT_MOST(fabs(mesh_volume(&cube) - 1), 0.03, "box: volume");
    mesh sphere = model_sphere(3);
    sphere.triangles -= 6; /* a small hole */
    sphere.x = realloc(sphere.x, (sphere.vertices + 3) * sizeof *sphere.x);
    memset(sphere.x[sphere.vertices], 0, 3 * sizeof *sphere.x);
    sphere.vertices += 3;
    mesh_hole longest, left;
    CHECK(mesh_close_holes(&sphere, 0, &longest, &left) == 0 && left.edges > 3,
          "a hole that is too large stays");
    const double rim = left.rim_m;
    uint32_t holes = mesh_close_holes(&sphere, rim, &longest, &left);
    CHECK(holes == 1 && left.edges == 0 && longest.rim_m >= rim, "and one that is not is closed");
    mesh closed = remesh(&sphere, "sphere", 2, 0, &r);
    CHECK(r.dropped >= 3, "%u unused vertices dropped", r.dropped);
    mesh_require_closed(&closed, "closed sphere");
}

/* A prism over the letter L without its top: the lid is flat, and does not reach over the notch. */
static void test_holes(void) {
    static const double outline[6][2] = {{0, 0}, {3, 0}, {3, 1}, {1, 1}, {1, 3}, {0, 3}};
    mesh m = {.vertices = 12,
              .triangles = 16,
              .x = calloc(12, sizeof *m.x),
              .t = calloc(16, sizeof *m.t)};
    static const uint32_t floor_of[4][3] = {{0, 2, 1}, {0, 3, 2}, {0, 4, 3}, {0, 5, 4}};
    memcpy(m.t, floor_of, sizeof floor_of);
    for (uint32_t i = 0; i < 6; i++) {
        const uint32_t j = (i + 1) % 6;
        for (uint32_t top = 0; top < 2; top++) {
            double *x = m.x[i + 6 * top];
            x[0] = outline[i][0];
            x[1] = outline[i][1];
            x[2] = top;
        }
        const uint32_t wall[2][3] = {{i, j, j + 6}, {i, j + 6, i + 6}};
        memcpy(m.t[4 + 2 * i], wall, sizeof wall);
    }
    mesh_hole longest, left;
    CHECK(mesh_close_holes(&m, 100, &longest, &left) == 1 && longest.edges == 6,
          "an open box is closed");
    mesh_require_closed(&m, "box");
    AT_MOST(fabs(mesh_volume(&m) - 5), 1e-12, "volume of the box over an L");
    CHECK(m.vertices == 12 && mesh_self_intersection(&m) == UINT32_MAX, "its lid crosses nothing");
    mesh_free(&m);
}

static void test_sha(void) {
    static const uint8_t wanted[4] = {0xba, 0x78, 0x16, 0xbf};
    uint8_t digest[32];
    sha256("abc", 3, digest);
    CHECK(memcmp(digest, wanted, 4) == 0 && digest[31] == 0xad, "SHA-256 of abc (FIPS 180-4)");
}

/* Shapes with fewer triangles than a base mesh has: they are split first. */
static void test_few(void) {
    for (uint32_t n = 1; n <= 3; n++) {
        mesh box = model_box(0.1, n);
        remesh_report r;
        mesh out = remesh(&box, "box", 1, 0, &r);
        CHECK(r.flipped == 0 && fabs(mesh_volume(&out) / 1e-3 - 1) < 0.05,
              "a box of %u triangles: %u of them, volume %.3g of 1e-3", 12 * n * n, out.triangles,
              mesh_volume(&out));
        mesh_free(&out);
        mesh_free(&box);
    }
}

int main(void) {
    progress_quiet(1);
    test_few();
    test_detection();
    test_loop();
    test_map();
    test_remesh();
    test_holes();
    test_sha();
    return tap_done();
}
