/* SPDX-License-Identifier: MIT */
#include "tools/mesh/remesh.h"
#include "tools/mesh/choose.h"
#include "tools/mesh/crossing.h"
#include "tools/mesh/meshmend.h"
#include "port/host/args.h"
#include "tools/mesh/bvh.h"
#include "tools/mesh/semireg.h"
#include "tools/mesh/simplify.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define RELAX_STEPS 12
#define REPAIR_STEPS 40
#define FEATURE_ROUNDS 6
#define FEATURE_TOLERANCE 0.015 /* over the diagonal */
#define BAD_ANGLE_DEG 9.0
#define FACING_COSINE                                                                              \
    (-0.2) /* how far a particle may turn in one move: past a right angle, not around */

/*
 * One level being drawn onto the original surface. Each vertex is a particle that lives on that
 * surface and remembers how it faces there: moves are tangential to the surface, not to the mesh,
 * so that folds of the mesh unfold, and a thin part's far side stays out of reach.
 */
typedef struct {
    mesh *m;
    const bvh *surface;
    uint32_t *offset, *ring;
    double (*facing)[3];
    bool *pinned; /* base vertices and those that hold a feature */
} fit;

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

/* To the closest point that does not face away. */
static void draw_onto(const fit *f, uint32_t v) {
    double point[3];
    double d =
        bvh_closest(f->surface, f->m->x[v], f->facing[v], FACING_COSINE, point, f->facing[v]);
    if (!isfinite(d)) (void)bvh_closest(f->surface, f->m->x[v], NULL, 0, point, f->facing[v]);
    memcpy(f->m->x[v], point, sizeof point);
}

/* Moves vertex v along the surface a fraction of the way to the mean of its ring. */
static void relax(const fit *f, uint32_t v, double fraction) {
    double d[3] = {0};
    double n = f->offset[v + 1] - f->offset[v];
    for (uint32_t i = f->offset[v]; i < f->offset[v + 1]; i++) {
        for (int k = 0; k < 3; k++) d[k] += (f->m->x[f->ring[i]][k] - f->m->x[v][k]) / n;
    }
    double out = v_dot(d, f->facing[v]);
    for (int k = 0; k < 3; k++) f->m->x[v][k] += fraction * (d[k] - out * f->facing[v][k]);
    draw_onto(f, v);
}

static void relax_all(const fit *f) {
    for (uint32_t v = 0; v < f->m->vertices; v++) {
        if (!f->pinned[v]) relax(f, v, 0.5);
    }
}

typedef struct {
    double distance;
    uint32_t vertex; /* of the original */
} miss;

static int compare_misses(const void *a, const void *b) {
    const miss *p = a;
    const miss *q = b;
    if (p->distance > q->distance) return -1;
    if (p->distance < q->distance) return 1;
    return p->vertex < q->vertex ? -1 : p->vertex > q->vertex;
}

static uint32_t nearest_vertex(const fit *f, const double x[3], const double facing[3]) {
    uint32_t best = UINT32_MAX;
    double nearest = HUGE_VAL;
    for (uint32_t v = 0; v < f->m->vertices; v++) {
        double d = v_distance(x, f->m->x[v]);
        if (d >= nearest || v_dot(facing, f->facing[v]) < FACING_COSINE) continue;
        nearest = d;
        best = v;
    }
    return best;
}

/*
 * Tips of ears and fingers lie between vertices. The original vertices that are farthest from the
 * mesh get the nearest mesh vertex each, which then stays there while the others even out.
 */
static void reach_features(const fit *f, const mesh *original) {
    double tolerance = FEATURE_TOLERANCE * mesh_diagonal(original);
    double spacing = mesh_mean_edge(f->m);
    miss *list = allocate(original->vertices, sizeof *list);
    for (int round = 0; round < FEATURE_ROUNDS; round++) {
        uint32_t count = 0, taken = 0;
        bvh *b = bvh_build(f->m);
        for (uint32_t v = 0; v < original->vertices; v++) {
            double point[3];
            double d = bvh_closest(b, original->x[v], NULL, 0, point, NULL);
            if (d > tolerance) list[count++] = (miss){d, v};
        }
        bvh_free(b);
        qsort(list, count, sizeof *list, compare_misses);
        for (uint32_t i = 0; i < count; i++) {
            const double *x = original->x[list[i].vertex];
            bool covered = false;
            for (uint32_t k = 0; k < taken && !covered; k++) {
                covered = v_distance(x, original->x[list[k].vertex]) < 3 * spacing;
            }
            if (covered) continue;
            list[taken++] = list[i];
            double point[3], facing[3];
            (void)bvh_closest(f->surface, x, NULL, 0, point, facing);
            uint32_t v = nearest_vertex(f, x, facing);
            if (v == UINT32_MAX) continue;
            memcpy(f->m->x[v], x, sizeof point);
            memcpy(f->facing[v], facing, sizeof facing);
            f->pinned[v] = true;
        }
        if (taken == 0) break;
        for (int step = 0; step < 4; step++) relax_all(f);
    }
    free(list);
}

/* A triangle is flipped when it faces against the sum of its three neighbours. */
static uint32_t find_bad(const mesh *m, double smallest_angle_deg, bool *bad) {
    uint32_t edges, flipped = 0;
    mesh_edge *e = mesh_edges(m, &edges);
    double(*normal)[3] = allocate(m->triangles, sizeof *normal);
    double(*sum)[3] = allocate(m->triangles, sizeof *sum);
    for (uint32_t i = 0; i < m->triangles; i++) {
        const uint32_t *t = m->t[i];
        triangle_normal(m->x[t[0]], m->x[t[1]], m->x[t[2]], normal[i]);
        v_normalize(normal[i]);
    }
    for (uint32_t i = 0; i < edges; i++) {
        uint32_t a = e[i].triangle[0], b = e[i].triangle[1];
        for (int k = 0; k < 3; k++) {
            sum[a][k] += normal[b][k];
            sum[b][k] += normal[a][k];
        }
    }
    for (uint32_t i = 0; i < m->triangles; i++) {
        bool against = v_dot(normal[i], sum[i]) < 0;
        flipped += against ? 1 : 0;
        if (bad == NULL) continue;
        mesh one = {.vertices = m->vertices, .triangles = 1, .x = m->x, .t = m->t + i};
        bad[i] = against || mesh_smallest_angle_deg(&one) < smallest_angle_deg;
    }
    free(sum);
    free(normal);
    free(e);
    return flipped;
}

static void spread(const fit *f, bool *move) {
    bool *old = allocate(f->m->vertices, sizeof *old);
    memcpy(old, move, f->m->vertices * sizeof *old);
    for (uint32_t v = 0; v < f->m->vertices; v++) {
        for (uint32_t i = f->offset[v]; old[v] && i < f->offset[v + 1]; i++)
            move[f->ring[i]] = true;
    }
    free(old);
}

/* A last resort where the surface itself is folded: smoothing in space, off the surface. */
static void unfold(const fit *f, const bool *bad) {
    for (uint32_t i = 0; i < f->m->triangles; i++) {
        for (int k = 0; k < 3 && bad[i]; k++) {
            uint32_t v = f->m->t[i][k];
            double mean[3] = {0};
            double n = f->offset[v + 1] - f->offset[v];
            for (uint32_t r = f->offset[v]; r < f->offset[v + 1]; r++) {
                for (int c = 0; c < 3; c++) mean[c] += f->m->x[f->ring[r]][c] / n;
            }
            memcpy(f->m->x[v], mean, sizeof mean);
        }
    }
}

/* Relaxes around flipped and needle triangles, base vertices included, in growing neighbourhoods.
 */
static void repair(const fit *f, double smallest_angle_deg) {
    const mesh *m = f->m;
    bool *bad = allocate(m->triangles, sizeof *bad);
    bool *move = allocate(m->vertices, sizeof *move);
    double(*best)[3] = allocate(m->vertices, sizeof *best);
    uint32_t fewest = UINT32_MAX;
    for (int step = 0; step < REPAIR_STEPS; step++) {
        uint32_t count = 0;
        (void)find_bad(m, smallest_angle_deg, bad);
        memset(move, 0, m->vertices * sizeof *move);
        for (uint32_t i = 0; i < m->triangles; i++) {
            for (int k = 0; k < 3 && bad[i]; k++) move[m->t[i][k]] = true;
            count += bad[i] ? 1 : 0;
        }
        if (count < fewest) {
            fewest = count;
            memcpy(best, m->x, m->vertices * sizeof *best);
        }
        if (count == 0) break;
        for (int ring = 0; ring < step / 8; ring++) spread(f, move);
        for (int sweep = 0; sweep < 4; sweep++) {
            for (uint32_t v = 0; v < m->vertices; v++) {
                if (move[v] && !(f->pinned[v] && step < REPAIR_STEPS / 2)) relax(f, v, 0.6);
            }
        }
    }
    memcpy(m->x, best, m->vertices * sizeof *best);
    for (int step = 0; step < REPAIR_STEPS && find_bad(m, 0, bad) > 0; step++) unfold(f, bad);
    free(best);
    free(move);
    free(bad);
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
    f.pinned = allocate(m.vertices, sizeof *f.pinned);
    for (uint32_t v = 0; v < s->base.vertices; v++) f.pinned[v] = true;
    for (int step = 0; step < relax_steps; step++) relax_all(&f);
    if (relax_steps > 0) reach_features(&f, original);
    repair(&f, relax_steps > 0 ? BAD_ANGLE_DEG : 0);
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
    r->flipped = find_bad(m, 0, NULL);
    r->smallest_angle_deg = mesh_smallest_angle_deg(m);
    bvh_free(result);
}

static bool good_enough(const remesh_report *r) {
    return r->flipped == 0 && r->mean <= 0.9 * REMESH_MEAN && r->max <= 0.97 * REMESH_MAX &&
           r->smallest_angle_deg > 2;
}

static bool better(const remesh_report *a, const remesh_report *b) {
    if (good_enough(a) != good_enough(b)) return good_enough(a);
    if (a->flipped != b->flipped) return a->flipped < b->flipped;
    return a->max + 8 * a->mean < b->max + 8 * b->mean;
}

mesh remesh(mesh *in, const char *path, uint32_t levels, uint32_t base_triangles,
            remesh_report *report) {
    static const uint32_t targets[] = {64, 80, 96, 128, 160, 220, 300, 420, 640, 960, 1400};
    enum { USUAL = 8 }; /* more only where none of these gave a mesh */
    size_t tries = base_triangles > 0 ? 1 : sizeof targets / sizeof targets[0];
    remesh_report r = {0}, best_report = {.flipped = UINT32_MAX, .max = HUGE_VAL};
    mesh best = {0};
    uint32_t cut = UINT32_MAX;
    r.dropped = mesh_drop_unused(in);
    mesh_require_closed(in, path);
    bvh *surface = bvh_build(in);
    for (size_t i = 0; i < tries && !good_enough(&best_report); i++) {
        if (i >= USUAL && best.x != NULL) break;
        uint32_t target = base_triangles > 0 ? base_triangles : targets[i];
        mesh dense = split_longest(in, target);
        bvh *facing = bvh_build(&dense);
        simplified s = simplify(&dense, target);
        uint32_t crossing = mesh_self_intersection(&s.base);
        if (crossing != UINT32_MAX) cut = crossing;
        r.base_triangles = s.base.triangles;
        /* Evened out first; as the map gave it where that rounds off sharp edges. */
        for (int relaxed = 1; relaxed >= 0 && crossing == UINT32_MAX && !good_enough(&best_report);
             relaxed--) {
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
    if (best.x == NULL) {
        uint32_t own = mesh_self_intersection(in);
        if (own != UINT32_MAX) {
            const double *x = in->x[in->t[own][0]];
            die(EXIT_WORK,
                "%s: the surface crosses itself near (%.4g, %.4g, %.4g), triangle %" PRIu32
                " (0-based): repair it there",
                path, x[0], x[1], x[2], own);
        }
        die(EXIT_WORK,
            "%s: every base mesh of up to %" PRIu32 " triangles intersects itself, the last at its "
            "triangle %" PRIu32 ": the shape has walls too thin or holes too small for remeshing; "
            "bake the mesh with --as-is, or try --base-faces with more",
            path, r.base_triangles, cut);
    }
    if (report != NULL) *report = best_report;
    return best;
}

/* ---- commands ---- */

static const char remesh_help[] =
    "usage: palp remesh IN.(obj|stl|ply) -o OUT.obj [--levels 3] [--base-faces N]\n"
    "\n"
    "Turns a closed triangle mesh into one with subdivision connectivity: a coarse base, every "
    "triangle split\n"
    "in four `--levels` times, vertices in coarse-to-fine order. Unused vertices are dropped and "
    "small holes\n"
    "closed. Without --base-faces the base is the coarsest that stays within 0.5 % (mean) and 4 % "
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
    if (r.mean > REMESH_MEAN || r.max > REMESH_MAX) {
        warn("warning: %s: the result is farther from the surface than %g %% (mean) or %g %% "
             "(max): try "
             "--base-faces %" PRIu32,
             s.input, 100 * REMESH_MEAN, 100 * REMESH_MAX, 2 * r.base_triangles);
    }
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
