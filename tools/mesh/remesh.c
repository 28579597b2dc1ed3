/* SPDX-License-Identifier: MIT */
#include "tools/mesh/remesh.h"
#include "tools/mesh/choose.h"
#include "tools/mesh/crossing.h"
#include "tools/mesh/fit.h"
#include "tools/mesh/meshmend.h"
#include "port/host/args.h"
#include "tools/mesh/bvh.h"
#include "tools/mesh/creases.h"
#include "tools/mesh/order.h"
#include "tools/mesh/reach.h"
#include "tools/mesh/refine.h"
#include "tools/mesh/semireg.h"
#include "tools/mesh/simplify.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define RELAX_STEPS 12
#define BAD_ANGLE_DEG 9.0
#define NEEDLE_DEG 5.0 /* triangles of a file that are made even first, and up to which edge: */
#define EVEN_EDGE 0.04 /* over the diagonal */

static void barycentric(const double x[3], const double a[3], const double b[3], const double c[3],
                        double weight[3]) {
    double whole[3], part[3];
    triangle_normal(a, b, c, whole);
    double area2 = v_dot(whole, whole);
    triangle_normal(x, b, c, part);
    weight[0] = v_dot(part, whole) / area2;
    triangle_normal(a, x, c, part);
    weight[1] = v_dot(part, whole) / area2;
    weight[2] = 1 - weight[0] - weight[1];
}

/* The points of the base that the vertices of its `levels`-fold midpoint refinement stand for. */
static surface_point *refined_points(const mesh *base, uint32_t levels, mesh *refined) {
    *refined = mesh_copy(base);
    uint32_t *parent =
        allocate(base->triangles, sizeof *parent); /* base triangle of each triangle */
    for (uint32_t i = 0; i < base->triangles; i++) parent[i] = i;
    for (uint32_t l = 0; l < levels; l++) {
        mesh finer = subdivide_midpoint(refined);
        uint32_t *finer_parent = allocate(finer.triangles, sizeof *finer_parent);
        for (uint32_t i = 0; i < finer.triangles; i++) finer_parent[i] = parent[i / 4];
        mesh_free(refined);
        free(parent);
        *refined = finer;
        parent = finer_parent;
    }
    surface_point *point = allocate(refined->vertices, sizeof *point);
    for (uint32_t i = 0; i < refined->triangles; i++) {
        const uint32_t *b = base->t[parent[i]];
        for (int k = 0; k < 3; k++) {
            surface_point *p = &point[refined->t[i][k]];
            p->triangle = parent[i];
            barycentric(refined->x[refined->t[i][k]], base->x[b[0]], base->x[b[1]], base->x[b[2]],
                        p->weight);
        }
    }
    free(parent);
    return point;
}

/* Every vertex through the one-to-one map from the triangles of `original`, whose tree is `facing`;
 * then evened out along the surface; base vertices stay. */
static mesh draw_levels(const simplified *s, const mesh *original, const bvh *facing,
                        const bvh *surface, uint32_t levels, int relax_steps) {
    mesh m;
    surface_point *point = refined_points(&s->base, levels, &m);
    simplified_map(s, point, m.vertices);
    fit f = {.m = &m, .surface = surface, .facing = allocate(m.vertices, sizeof *f.facing)};
    for (uint32_t v = 0; v < m.vertices; v++) {
        const uint32_t *t = original->t[point[v].triangle];
        for (int k = 0; k < 3; k++) {
            m.x[v][k] = 0;
            for (int c = 0; c < 3; c++) m.x[v][k] += point[v].weight[c] * original->x[t[c]][k];
        }
        memcpy(f.facing[v], bvh_facing(facing, point[v].triangle), sizeof f.facing[v]);
    }
    free(point);
    mesh_rings(&m, &f.offset, &f.ring);
    uint32_t *across = mesh_across(&m);
    f.across = across;
    f.pinned = allocate(m.vertices, sizeof *f.pinned);
    for (uint32_t v = 0; v < s->base.vertices; v++) f.pinned[v] = true;
    for (int step = 0; step < relax_steps; step++) fit_relax_all(&f);
    if (relax_steps > 0) fit_reach_features(&f, original);
    fit_repair(&f, relax_steps > 0 ? BAD_ANGLE_DEG : 0);
    reach r = reach_begin(&f, original);
    reach_creases(&r);
    reach_rims(&r);
    reach_end(&r);
    free(across);
    free(f.pinned);
    free(f.offset);
    free(f.ring);
    free(f.facing);
    return m;
}

/* Halves the longest edge, and the two triangles beside it, until there are `triangles`. */
static mesh split_longest(const mesh *m, uint32_t triangles) {
    mesh r = {.vertices = m->vertices, .triangles = m->triangles};
    r.x = allocate(m->vertices + triangles, sizeof *r.x);
    r.t = allocate(m->triangles + triangles + 2, sizeof *r.t);
    memcpy(r.x, m->x, m->vertices * sizeof *r.x);
    memcpy(r.t, m->t, m->triangles * sizeof *r.t);
    while (r.triangles < triangles) {
        uint32_t a = 0, b = 0;
        for (uint32_t i = 0; i < r.triangles; i++) {
            for (int k = 0; k < 3; k++) {
                uint32_t p = r.t[i][k], q = r.t[i][(k + 1) % 3];
                bool longer = v_distance(r.x[p], r.x[q]) > v_distance(r.x[a], r.x[b]) * (1 + 1e-12);
                if (!longer) continue;
                a = p;
                b = q;
            }
        }
        for (int k = 0; k < 3; k++) r.x[r.vertices][k] = 0.5 * (r.x[a][k] + r.x[b][k]);
        for (uint32_t i = 0, old = r.triangles; i < old; i++) {
            for (int k = 0; k < 3; k++) {
                uint32_t p = r.t[i][k], q = r.t[i][(k + 1) % 3];
                if (!((p == a && q == b) || (p == b && q == a))) continue;
                memcpy(r.t[r.triangles], r.t[i], sizeof r.t[i]);
                r.t[i][(k + 1) % 3] = r.vertices;
                r.t[r.triangles++][k] = r.vertices;
                break;
            }
        }
        r.vertices++;
    }
    return r;
}

/* ---- checks ---- */

/* Distances from the vertices, edge midpoints and centroids of `m` to the surface, weighted by
 * area. */
static void one_way(const mesh *m, const bvh *surface, double *sum, double *weight, double *worst) {
    static const double sample[7][3] = {{1, 0, 0},
                                        {0, 1, 0},
                                        {0, 0, 1},
                                        {0.5, 0.5, 0},
                                        {0, 0.5, 0.5},
                                        {0.5, 0, 0.5},
                                        {1 / 3.0, 1 / 3.0, 1 / 3.0}};
    for (uint32_t i = 0; i < m->triangles; i++) {
        const uint32_t *t = m->t[i];
        double n[3];
        triangle_normal(m->x[t[0]], m->x[t[1]], m->x[t[2]], n);
        for (int s = 0; s < 7; s++) {
            double x[3], p[3];
            for (int k = 0; k < 3; k++) {
                x[k] = sample[s][0] * m->x[t[0]][k] + sample[s][1] * m->x[t[1]][k] +
                       sample[s][2] * m->x[t[2]][k];
            }
            double d = bvh_closest(surface, x, NULL, 0, p, NULL);
            *sum += d * v_norm(n);
            *weight += v_norm(n);
            *worst = fmax(*worst, d);
        }
    }
}

static void measure(const mesh *m, const mesh *original, const bvh *surface, remesh_report *r) {
    double diagonal = mesh_diagonal(original);
    double sum = 0, weight = 0, worst = 0;
    bvh *result = bvh_build(m);
    one_way(m, surface, &sum, &weight, &worst);
    r->mean = sum / weight / diagonal;
    sum = weight = 0;
    one_way(original, result, &sum, &weight, &worst);
    r->mean = fmax(r->mean, sum / weight / diagonal);
    r->max = worst / diagonal;
    r->flipped = mesh_flipped(m);
    r->smallest_angle_deg = mesh_smallest_angle_deg(m);
    const uint32_t crossing = mesh_self_intersection(m);
    r->crosses = crossing != UINT32_MAX;
    if (r->crosses) memcpy(r->crossing, m->x[m->t[crossing][0]], sizeof r->crossing);
    bvh_free(result);
}

static bool good_enough(const remesh_report *r) {
    return r->flipped == 0 && r->mean <= 0.9 * REMESH_MEAN && r->max <= 0.97 * REMESH_MAX &&
           r->smallest_angle_deg > REMESH_ANGLE_DEG && !r->crosses;
}

#define CROSSING 3.0 /* as bad as that many times the distance */

/* 1 where all goals are met. */
static double miss_of_goals(const remesh_report *r) {
    const double angle = fmax(r->smallest_angle_deg, 1e-3);
    return fmax(1, r->mean / REMESH_MEAN) * fmax(1, r->max / REMESH_MAX) *
           sqrt(fmax(1, REMESH_ANGLE_DEG / angle)) * (r->crosses ? CROSSING : 1);
}

static bool better(const remesh_report *a, const remesh_report *b) {
    if (good_enough(a) != good_enough(b)) return good_enough(a);
    if (a->flipped != b->flipped) return a->flipped < b->flipped;
    const double one = miss_of_goals(a), other = miss_of_goals(b);
    if (one < other || one > other) return one < other;
    return a->max + 8 * a->mean < b->max + 8 * b->mean;
}

mesh remesh(mesh *in, const char *path, uint32_t levels, uint32_t base_triangles,
            remesh_report *report) {
    static const uint32_t targets[] = {64, 80, 96, 128, 160, 220, 300, 420, 640, 960, 1400};
    enum { USUAL = 8 }; /* more only where all of these leave triangles flipped */
    size_t tries = base_triangles > 0 ? 1 : sizeof targets / sizeof targets[0];
    remesh_report r = {0}, best_report = {.flipped = UINT32_MAX, .max = HUGE_VAL};
    mesh best = {0};
    r.dropped = mesh_drop_unused(in);
    mesh_require_closed(in, path);
    mesh_sort(in); /* one result, whatever the order in the file */
    mesh even = mesh_smallest_angle_deg(in) < NEEDLE_DEG
                    ? mesh_refined(in, EVEN_EDGE * mesh_diagonal(in))
                    : mesh_copy(in);
    bvh *surface = bvh_build(&even); /* searched faster than one of needles */
    for (size_t i = 0; i < tries && !good_enough(&best_report); i++) {
        if (i >= USUAL && best_report.flipped == 0) break;
        uint32_t target = base_triangles > 0 ? base_triangles : targets[i];
        const double nodes = 0.5 * target * pow(4, levels) + 2;
        if (tries > 1 && nodes > REMESH_NODES && best_report.flipped == 0 &&
            best_report.max <= REMESH_MAX_LARGE)
            break;
        mesh dense = split_longest(&even, target);
        bvh *facing = bvh_build(&dense);
        simplified s = simplify(&dense, target);
        uint32_t crossing = mesh_self_intersection(&s.base);
        r.base_triangles = s.base.triangles;
        /* Evened out, and as the map gave it, which keeps flat facets and their edges. */
        for (int relaxed = 1; relaxed >= 0 && crossing == UINT32_MAX; relaxed--) {
            mesh m = draw_levels(&s, &dense, facing, surface, levels, relaxed * RELAX_STEPS);
            measure(&m, in, surface, &r);
            if (best.x == NULL || better(&r, &best_report)) {
                mesh_free(&best);
                best = m;
                best_report = r;
            } else {
                mesh_free(&m);
            }
        }
        simplified_free(&s);
        bvh_free(facing);
        mesh_free(&dense);
    }
    bvh_free(surface);
    mesh_free(&even);
    if (best.x == NULL) {
        uint32_t own = mesh_self_intersection(in);
        if (own != UINT32_MAX) {
            const double *x = in->x[in->t[own][0]];
            die(EXIT_WORK,
                "%s: the surface crosses itself near (%.4g, %.4g, %.4g): repair it there", path,
                x[0], x[1], x[2]);
        }
        die(EXIT_WORK,
            "%s: every base mesh of up to %" PRIu32
            " triangles intersects itself: the shape has walls too thin or holes too small for "
            "remeshing; "
            "bake the mesh with --as-is, or try --base-faces with more",
            path, r.base_triangles);
    }
    if (report != NULL) *report = best_report;
    return best;
}

void remesh_warn(const remesh_report *r, const char *path) {
    if (r->mean > REMESH_MEAN || r->max > REMESH_MAX)
        warn("%s: remeshed with %.2g %% (mean) and %.2g %% (largest) of the diagonal between the "
             "surfaces, more than %g and %g %%: thin or pointed parts may be lost: more "
             "--base-faces than %" PRIu32 ", with --levels if the mesh grows too large",
             path, 100 * r->mean, 100 * r->max, 100 * REMESH_MEAN, 100 * REMESH_MAX,
             r->base_triangles);
    if (r->crosses)
        warn("%s: remeshed, the surface crosses itself near (%.4g, %.4g, %.4g), where walls are "
             "thin: "
             "more --base-faces than %" PRIu32 ", or bake the mesh --as-is",
             path, r->crossing[0], r->crossing[1], r->crossing[2], r->base_triangles);
    if (r->smallest_angle_deg < REMESH_ANGLE_DEG)
        warn("%s: remeshed with a smallest angle of %.2g degrees, less than %g: more --base-faces "
             "than %" PRIu32 ", or bake the mesh --as-is",
             path, r->smallest_angle_deg, REMESH_ANGLE_DEG, r->base_triangles);
}

/* ---- commands ---- */

static const char remesh_help[] =
    "usage: palp remesh IN.(obj|stl|ply) -o OUT.obj [--levels 3] [--base-faces N]\n"
    "\n"
    "Turns a closed triangle mesh into one with subdivision connectivity: a coarse base, every "
    "triangle split\n"
    "in four `--levels` times, vertices in coarse-to-fine order. Unused vertices are dropped and "
    "small holes\n"
    "closed. Without --base-faces the base is the coarsest that stays within 0.3 % (mean) and 2.5 "
    "% "
    "(max) of the\n"
    "bounding box diagonal.\n" MESH_HELP;

static const char subdivide_help[] =
    "usage: palp subdivide IN.(obj|stl|ply) -o OUT.obj [--levels 3]\n"
    "\n"
    "Refines a closed control mesh by Loop's scheme; vertices stay in coarse-to-fine "
    "order.\n" MESH_HELP;

static const option remesh_options[] = {
    {"-o", 1}, {"--levels", 1}, {"--base-faces", 1}, MESH_OPTIONS, {NULL, 0}};

typedef struct {
    const char *input, *output;
    uint32_t levels, base_faces;
    mesh_choice choice;
} remesh_spec;

static void set_option(void *context, const argument *a) {
    remesh_spec *s = context;
    if (a->option == NULL) {
        if (s->input != NULL) die(EXIT_USAGE, "one input mesh, not also '%s'", a->value[0]);
        s->input = a->value[0];
    } else if (strcmp(a->option, "-o") == 0) {
        s->output = a->value[0];
    } else if (strcmp(a->option, "--levels") == 0) {
        s->levels = arg_u32(a, 0, 0, 8);
    } else if (!mesh_option(&s->choice, a)) {
        s->base_faces = arg_u32(a, 0, 4, 1000000);
    }
}

static remesh_spec parse(int argc, char **argv, const option *table, const char *help) {
    remesh_spec s = {.levels = 3};
    args_parse(argc, argv, table, help, set_option, &s);
    if (s.input == NULL) die(EXIT_USAGE, "no input mesh (--help shows the usage)");
    if (s.output == NULL) die(EXIT_USAGE, "no output: add -o OUT.obj");
    if (strcmp(s.output, "-") != 0 && !has_extension(s.output, ".obj"))
        die(EXIT_USAGE, "-o %s: meshes are written as OBJ: name it .obj", s.output);
    return s;
}

int command_remesh(int argc, char **argv) {
    remesh_spec s = parse(argc, argv, remesh_options, remesh_help);
    mesh in = mesh_load_as(s.input, &s.choice, HOLES_REMESHED);
    remesh_report r;
    mesh m = remesh(&in, s.input, s.levels, s.base_faces, &r);
    if (r.flipped > 0) {
        die(EXIT_WORK, "%s: %" PRIu32 " triangle(s) stay flipped: try --base-faces %" PRIu32,
            s.input, r.flipped, 2 * r.base_triangles);
    }
    mesh_warn_of_size(&m, s.input);
    FILE *say = strcmp(s.output, "-") == 0 ? stderr : stdout;
    mesh_save_obj(&m, s.output);
    fprintf(say, "input                 %" PRIu32 " vertices, %" PRIu32 " triangles", in.vertices,
            in.triangles);
    if (r.dropped > 0) fprintf(say, ", %" PRIu32 " unused vertices dropped", r.dropped);
    double size[3];
    mesh_extent(&m, size);
    fprintf(say, "\nsize                  %.3g x %.3g x %.3g cm", 100 * size[0], 100 * size[1],
            100 * size[2]);
    fprintf(say, "\nbase                  %" PRIu32 " triangles, %" PRIu32 " refinement(s)\n",
            r.base_triangles, s.levels);
    fprintf(say, "result                %" PRIu32 " vertices, %" PRIu32 " triangles\n", m.vertices,
            m.triangles);
    fprintf(say, "distance              mean %.3f %%, max %.3f %% of the diagonal\n", 100 * r.mean,
            100 * r.max);
    fprintf(say, "flipped triangles     %" PRIu32 "\n", r.flipped);
    fprintf(say, "smallest angle        %.2f degrees\n", r.smallest_angle_deg);
    remesh_warn(&r, s.input);
    return EXIT_SUCCESS;
}

int command_subdivide(int argc, char **argv) {
    static const option table[] = {{"-o", 1}, {"--levels", 1}, MESH_OPTIONS, {NULL, 0}};
    remesh_spec s = parse(argc, argv, table, subdivide_help);
    mesh m = mesh_load_as(s.input, &s.choice, HOLES_AS_IS);
    mesh_require_closed(&m, s.input);
    mesh_warn_of_size(&m, s.input);
    for (uint32_t l = 0; l < s.levels; l++) {
        mesh finer = subdivide_loop(&m);
        mesh_free(&m);
        m = finer;
    }
    mesh_save_obj(&m, s.output);
    fprintf(strcmp(s.output, "-") == 0 ? stderr : stdout,
            "result                %" PRIu32 " vertices, %" PRIu32 " triangles\n", m.vertices,
            m.triangles);
    return EXIT_SUCCESS;
}
