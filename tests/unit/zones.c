/* SPDX-License-Identifier: MIT */
/* Multizone models: seams, configurations, levels, cost, contact, against double precision. */
#include "core/zone/assembly.h"
#include "core/contact/contact.h"
#include "tests/models.h"
#include "tests/tap.h"
#include "tools/solver/dense.h"
#include "tools/study/plot.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#ifdef TRIALS /* under sanitizers */
#define HOSTILE 60
#else
#define HOSTILE 400 /* changes of each section */
#endif
#define EDGE 0.02
#define YOUNG 1e5
#define POISSON 0.3
#define COMMON "young 1e5\npoisson 0.3\n"

static const int bar3[3][3] = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};

static const char chain3[] =
    COMMON "zone a\nfix-below x 1e-6\nzone b\nzone c\n"
           "cut a b 0.02 0 0 1 0 0\ncut b c 0.04 0 0 1 0 0\n"
           "joint ab revolute a b\naxis 0 0 1\norigin 0.02 0.01 0.01\n"
           "joint bc revolute b c\naxis 0 0.6 0.8\norigin 0.04 0.01 0.01\n";

/* Poses it and makes the factor for that configuration. */
static void pose(palp_assembly *a, const float *value, uint32_t level) {
    const palp_frame rest = PALP_FRAME_IDENTITY;
    palp_assembly_pose(a, value, &rest);
    (void)palp_seams_refresh(&a->seams, a->configuration, level);
    palp_assembly_settle(a);
}

/* ---- an oracle in double: every seam node an unknown, one dense matrix ---- */

typedef struct {
    double r[9], t[3];
} motion;

static void turn(const double r[9], const double x[3], double y[3]) {
    for (int i = 0; i < 3; i++) y[i] = r[3 * i] * x[0] + r[3 * i + 1] * x[1] + r[3 * i + 2] * x[2];
}

static void turn_back(const double r[9], const double x[3], double y[3]) {
    for (int i = 0; i < 3; i++) y[i] = r[i] * x[0] + r[3 + i] * x[1] + r[6 + i] * x[2];
}

/* Motion of each zone in the model's coordinates by its joints' values. */
static void forward(const palp_zones *z, const float *value, motion *m) {
    for (uint32_t i = 0; i < z->meta->zones; i++) {
        m[i] = (motion){{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0}};
        if (i == 0) continue;
        const palp_joint_entry *j = &z->joint[z->zone[i].joint];
        const motion *p = &m[j->parent];
        double q = (double)value[z->zone[i].joint], r[9], a[3], o[3], t[3], moved[3];
        for (int k = 0; k < 3; k++) a[k] = (double)j->axis[k];
        for (int k = 0; k < 3; k++) o[k] = (double)j->origin_m[k];
        v_normalize(a);
        bool turns = j->kind == PALP_REVOLUTE;
        for (int k = 0; k < 9; k++) { /* columns by Rodrigues on unit vectors */
            double e[3] = {k % 3 == 0, k % 3 == 1, k % 3 == 2}, c[3];
            v_cross(a, e, c);
            double angle = turns ? q : 0;
            r[k] = e[k / 3] * cos(angle) + c[k / 3] * sin(angle) +
                   a[k / 3] * v_dot(a, e) * (1 - cos(angle));
        }
        turn(r, o, moved);
        for (int k = 0; k < 3; k++) t[k] = turns ? o[k] - moved[k] : q * a[k];
        if (j->kind == PALP_FIXED_JOINT) memset(t, 0, sizeof t);
        for (int k = 0; k < 9; k++) {
            m[i].r[k] = 0;
            for (int e = 0; e < 3; e++) m[i].r[k] += p->r[k / 3 * 3 + e] * r[3 * e + k % 3];
        }
        turn(p->r, t, m[i].t);
        for (int k = 0; k < 3; k++) m[i].t[k] += p->t[k];
    }
}

typedef struct {
    const zoned *model;
    greens g[PALP_MAX_ZONES];
    uint32_t first[PALP_MAX_SEAMS], unknowns; /* of each seam's nodes, in world coordinates */
    motion m[PALP_MAX_ZONES];
    double *x; /* world displacement off the posed first zone's rest shape */
    const double *pull[PALP_MAX_ZONES]; /* world acceleration; NULL: none */
} oracle;

static oracle make_oracle(const zoned *model) {
    oracle o = {.model = model};
    bem_material material = {.young_Pa = YOUNG, .poisson = POISSON, .crisp = true};
    for (uint32_t i = 0; i < model->zones->meta->zones; i++) {
        const mesh *m = &model->part[i];
        uint8_t *fixed = allocate(m->vertices, 1);
        for (uint32_t k = 0; k < m->vertices; k++)
            fixed[k] = palp_node_is_fixed(&model->zones->blob[i], k);
        o.g[i] = greens_from_galerkin(m, fixed, &material, 1000);
        greens_reciprocity(&o.g[i], m, true);
    }
    for (uint32_t s = 0; s < model->zones->meta->seams; s++) {
        o.first[s] = o.unknowns;
        o.unknowns += 3 * model->zones->seam[s].nodes;
    }
    o.x = allocate(o.unknowns, sizeof *o.x);
    return o;
}

/* What zone z has of seam s: gap of the posed rest shapes at node i, its own frame. */
static void oracle_gap(const oracle *o, uint32_t z, uint32_t s, uint32_t i, double gap[3]) {
    const palp_zones *zones = o->model->zones;
    uint32_t first = zones->seam[s].zone[0];
    const motion *a = &o->m[first], *b = &o->m[z];
    uint32_t side = first == z ? 0 : 1;
    const double *xa = o->model->part[first].x[zones->seam_node[s][2 * i]];
    const double *xb = o->model->part[z].x[zones->seam_node[s][2 * i + side]];
    double world[3], off[3];
    turn(a->r, xa, world);
    for (int k = 0; k < 3; k++) off[k] = world[k] + a->t[k] - b->t[k];
    turn_back(b->r, off, gap);
    for (int k = 0; k < 3; k++) gap[k] -= xb[k];
}

/* Solves for a force (zone's frame) on one node of one zone. */
static void oracle_solve(oracle *o, const float *value, uint32_t zone, uint32_t node,
                         const double force[3]) {
    const palp_zones *zones = o->model->zones;
    size_t n = o->unknowns;
    double *a = allocate_aligned(n * n, sizeof *a);
    uint32_t *perm = allocate(n, sizeof *perm);
    memset(o->x, 0, n * sizeof *o->x);
    forward(zones, value, o->m);
    for (uint32_t z = 0; z < zones->meta->zones; z++) {
        const palp_zone_part *part = &zones->part[z];
        const double *r = o->m[z].r;
        for (uint32_t p = 0; p < part->seams; p++) {
            uint32_t s = part->seam[p], side = zones->seam[s].zone[0] == z ? 0 : 1;
            for (uint32_t i = 0; i < zones->seam[s].nodes; i++) {
                uint32_t ni = zones->seam_node[s][2 * i + side];
                double f[3] = {0}, world[3];
                for (uint32_t q = 0; q < part->seams; q++) {
                    uint32_t t = part->seam[q], other = zones->seam[t].zone[0] == z ? 0 : 1;
                    for (uint32_t j = 0; j < zones->seam[t].nodes; j++) {
                        uint32_t nj = zones->seam_node[t][2 * j + other];
                        double gap[3], k[9], kr[9];
                        oracle_gap(o, z, t, j, gap);
                        for (size_t e = 0; e < 9; e++) {
                            k[e] = 0.5 * (greens_row(&o->g[z], ni, e / 3)[3 * nj + e % 3] +
                                          greens_row(&o->g[z], nj, e % 3)[3 * ni + e / 3]);
                            f[e / 3] += k[e] * gap[e % 3];
                        }
                        for (size_t e = 0; e < 9; e++) { /* r k r^T */
                            kr[e] = 0;
                            for (size_t c = 0; c < 3; c++)
                                kr[e] += r[e / 3 * 3 + c] * k[3 * c + e % 3];
                        }
                        for (size_t e = 0; e < 9; e++) {
                            double sum = 0;
                            for (size_t c = 0; c < 3; c++)
                                sum += kr[e / 3 * 3 + c] * r[e % 3 * 3 + c];
                            a[(o->first[s] + 3 * i + e / 3) * n + o->first[t] + 3 * j + e % 3] +=
                                sum;
                        }
                    }
                }
                for (size_t e = 0; e < 9 && z == zone; e++)
                    f[e / 3] += greens_row(&o->g[z], ni, e / 3)[3 * node + e % 3] * force[e % 3];
                double pull[3] = {0};
                if (o->pull[z] != NULL) turn_back(r, o->pull[z], pull);
                for (size_t e = 0; e < 9; e++)
                    f[e / 3] += greens_row(&o->g[z], ni, e / 3)[3 * (size_t)o->g[z].nodes + e % 3] *
                                pull[e % 3];
                turn(r, f, world);
                for (int k = 0; k < 3; k++) o->x[o->first[s] + 3 * i + (uint32_t)k] -= world[k];
            }
        }
    }
    (void)dense_lu(a, n, n, perm);
    dense_lu_solve(a, n, n, perm, o->x, 1, 1);
    free(a);
    free(perm);
}

/* Displacement of a free node (zone's frame), its own zone's answer to the force included. */
static void oracle_node(const oracle *o, uint32_t z, uint32_t node, uint32_t zone, uint32_t loaded,
                        const double force[3], double u[3]) {
    const palp_zones *zones = o->model->zones;
    const palp_zone_part *part = &zones->part[z];
    memset(u, 0, 3 * sizeof *u);
    for (size_t e = 0; e < 9 && z == zone; e++)
        u[e / 3] += greens_row(&o->g[z], node, e / 3)[3 * loaded + e % 3] * force[e % 3];
    for (uint32_t p = 0; p < part->seams; p++) {
        uint32_t s = part->seam[p], side = zones->seam[s].zone[0] == z ? 0 : 1;
        for (uint32_t i = 0; i < zones->seam[s].nodes; i++) {
            double gap[3], w[3];
            oracle_gap(o, z, s, i, gap);
            turn_back(o->m[z].r, o->x + o->first[s] + 3 * i, w);
            for (size_t e = 0; e < 9; e++)
                u[e / 3] += greens_row(&o->g[z], node,
                                       e / 3)[3 * zones->seam_node[s][2 * i + side] + e % 3] *
                            (w[e % 3] + gap[e % 3]);
        }
    }
}

/* ---- chain, tree, loop ---- */

static uint32_t some_free_node(const palp_blob *b, uint32_t seed) {
    const palp_domain *d = &b->domain[PALP_FREE];
    return d->node[seed % d->slots];
}

/* A force (zone's frame) at one node. */
static void load_node(palp_assembly *a, uint32_t zone, uint32_t node, palp_vec3 force_N) {
    float *felt = allocate(3 * (size_t)a->zones->zone[zone].modes + 1, sizeof *felt);
    palp_zone_modal_load(a->zones, PALP_SEAM_LEVELS - 1, zone, node, force_N, felt);
    palp_assembly_load(a, zone, felt);
    free(felt);
}

/* Largest error over the largest displacement, all free nodes, seams on `level`. */
static double against_oracle(palp_assembly *a, oracle *o, const float *value, uint32_t level) {
    const palp_zones *z = a->zones;
    uint32_t zone = z->meta->zones - 1, loaded = some_free_node(&z->blob[zone], 7);
    const double force[3] = {0.02, -0.05, 0.04};
    const palp_vec3 f = {0.02f, -0.05f, 0.04f};
    double worst = 0, most = 0;
    pose(a, value, level);
    palp_assembly_unload(a);
    load_node(a, zone, loaded, f);
    const float *total = palp_assembly_total(a);
    oracle_solve(o, value, zone, loaded, force);
    for (uint32_t i = 0; i < z->meta->zones; i++) {
        float *modes = allocate(3 * (size_t)z->zone[i].modes, sizeof *modes);
        palp_seams_zone(&a->seams, a->configuration, a->seams.finest, i, total, modes);
        for (uint32_t n = 0; n < z->blob[i].meta->nodes; n++) {
            if (palp_node_is_fixed(&z->blob[i], n)) continue;
            palp_vec3 u = palp_zone_modal_displacement(z, a->seams.finest, i, n, modes);
            double exact[3], own[3] = {0};
            for (size_t e = 0; e < 9 && i == zone; e++)
                own[e / 3] += greens_row(&o->g[i], n, e / 3)[3 * loaded + e % 3] * force[e % 3];
            oracle_node(o, i, n, zone, loaded, force, exact);
            const double off[3] = {(double)u.x + own[0] - exact[0], (double)u.y + own[1] - exact[1],
                                   (double)u.z + own[2] - exact[2]};
            worst = fmax(worst, v_norm(off));
            most = fmax(most, v_norm(exact));
        }
        free(modes);
    }
    return worst / most;
}

static void test_levels(palp_assembly *a, oracle *o, const float *value, const char *name) {
    printf("# %s, bent and loaded: error of the seams' levels against the dense solution:", name);
    for (uint32_t l = 0; l < PALP_SEAM_LEVELS; l++)
        printf(" %u: %.2g", l, against_oracle(a, o, value, l));
    printf(", block diagonal: %.2g\n", against_oracle(a, o, value, PALP_DIAGONAL));
}

/* How near iterations come with the factor of a configuration some way off. */
static double iterate_from(palp_assembly *a, const float *value, float off, uint32_t iterations) {
    const palp_frame rest = PALP_FRAME_IDENTITY;
    size_t n = 3 * (size_t)a->seams.modes;
    float other[PALP_MAX_JOINTS];
    float *w = allocate(n, sizeof *w), *r = allocate(n, sizeof *r), *x = allocate(n, sizeof *x);
    for (uint32_t j = 0; j < PALP_MAX_JOINTS; j++) other[j] = value[j] * (1 - off);
    double wrong = 0, all = 0;
    pose(a, value, a->seams.finest);
    memcpy(w, a->w, n * sizeof *w);
    pose(a, other, a->seams.finest);
    palp_assembly_pose(a, value, &rest);
    palp_seams_mismatch(&a->seams, a->configuration, a->seams.finest, r);
    (void)palp_seams_iterate(&a->seams, a->configuration, r, iterations, x);
    for (size_t i = 0; i < n; i++) {
        wrong += ((double)x[i] - (double)w[i]) * ((double)x[i] - (double)w[i]);
        all += (double)w[i] * (double)w[i];
    }
    free(w);
    free(r);
    free(x);
    return sqrt(wrong / all);
}

static void test_iterations(palp_assembly *a, const float *value, const char *name) {
    for (float off = 0.05f; off < 0.5f; off *= 3) {
        printf("# %s: factor of a configuration %.0f %% off, iterations 1 2 3 4 8: %.2g %.2g %.2g "
               "%.2g "
               "%.2g\n",
               name, (double)off * 100, iterate_from(a, value, off, 1),
               iterate_from(a, value, off, 2), iterate_from(a, value, off, 3),
               iterate_from(a, value, off, 4), iterate_from(a, value, off, 8));
    }
    AT_MOST(iterate_from(a, value, 0.05f, PALP_ASSEMBLY_ITERATIONS), 1e-3,
            "%s: %u iterations with the factor of a configuration 5 %% off", name,
            PALP_ASSEMBLY_ITERATIONS);
}

static void test_graph(const zoned *model, const float *value, const char *name) {
    oracle o = make_oracle(model);
    palp_assembly *a = model_assembly(model->zones, PALP_SEAM_LEVELS - 1);
    AT_MOST(against_oracle(a, &o, value, PALP_SEAM_LEVELS - 1), 1e-5,
            "%s of %u zones, %u seams, posed and loaded: all levels of seams against a dense "
            "assembly in double",
            name, model->zones->meta->zones, model->zones->meta->seams);
    test_levels(a, &o, value, name);
    test_iterations(a, value, name);
}

static zoned make_chain(uint32_t n) {
    uint32_t *cell;
    mesh m = model_voxels(bar3, 3, EDGE, n, &cell);
    return model_zones(&m, chain3, 0);
}

static void test_tree_and_loop(void) {
    static const int plus[9][3] = {{2, 2, 0}, {1, 2, 0}, {3, 2, 0}, {2, 1, 0}, {2, 3, 0},
                                   {0, 2, 0}, {4, 2, 0}, {2, 0, 0}, {2, 4, 0}};
    static const char *const arms[] = {"hub", "hub", "hub", "hub", "hub", "w", "e", "s", "n"};
    static const int ring[8][3] = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {2, 1, 0},
                                   {2, 2, 0}, {1, 2, 0}, {0, 2, 0}, {0, 1, 0}};
    static const char *const quarters[] = {"a", "a", "b", "b", "c", "c", "d", "d"};
    uint32_t *cell;
    char lines[1024];
    mesh m = model_voxels(plus, 9, EDGE, 2, &cell);
    char *labels = model_labels(cell, m.triangles, arms);
    snprintf(lines, sizeof lines,
             COMMON
             "zone hub\nfix-below z 1e-6\nzone w\nzone e\nzone s\nzone n\nlabels %s\n"
             "joint jw revolute hub w\norigin 0.02 0.05 0.01\njoint je revolute hub e\naxis 0 1 0\n"
             "origin 0.08 0.05 0.01\njoint js prismatic hub s\naxis 0 1 0\nlimits -0.01 0.01\n"
             "joint jn fixed hub n\n",
             labels);
    zoned tree = model_zones(&m, lines, 0);
    remove(labels);
    const float posed[PALP_MAX_JOINTS] = {0.3f, -0.4f, 0.003f};
    test_graph(&tree, posed, "tree");
    mesh_free(&m);
    m = model_voxels(ring, 8, EDGE, 2, &cell);
    labels = model_labels(cell, m.triangles, quarters);
    snprintf(lines, sizeof lines,
             COMMON "zone a\nfix-below y 1e-6\nzone b\nzone c\nzone d\nlabels %s\n"
                    "joint ab revolute a b\norigin 0.04 0.01 0.01\njoint bc revolute b c\n"
                    "origin 0.05 0.04 0.01\njoint cd revolute c d\norigin 0.02 0.05 0.01\n",
             labels);
    zoned loop = model_zones(&m, lines, 0);
    remove(labels);
    const float bent[PALP_MAX_JOINTS] = {0.10f, -0.15f, 0.12f};
    test_graph(&loop, bent, "loop");
}

/* ---- rest, rigid motion, frames ---- */

static void test_rest(const zoned *model) {
    palp_assembly *a = model_assembly(model->zones, PALP_SEAM_LEVELS - 1);
    float zero[PALP_MAX_JOINTS] = {0}, value[PALP_MAX_JOINTS] = {0.7f, -0.3f};
    double most = 0;
    pose(a, zero, PALP_SEAM_LEVELS - 1);
    for (uint32_t i = 0; i < 3 * a->seams.modes; i++) most = fmax(most, fabs((double)a->w[i]));
    AT_MOST(most, 0, "a straight chain without load does not move, to the last bit");
    size_t bytes = 3 * a->seams.modes * sizeof(float);
    float *w = allocate(3 * a->seams.modes, sizeof *w);
    pose(a, value, PALP_SEAM_LEVELS - 1);
    memcpy(w, a->w, bytes);
    palp_frame far = palp_frame_turn((palp_vec3){0.6f, 0.0f, 0.8f}, (palp_vec3){1, 2, 3}, 2.0f);
    far.t.x += 100.0f;
    palp_assembly_pose(a, value, &far);
    palp_assembly_settle(a);
    CHECK(memcmp(w, a->w, bytes) == 0, "moving the whole changes no bit of the bending");
}

/* The same body, but each zone's mesh in a frame of its own. */
static void test_frames(const zoned *model) {
    char lines[2048], path[3][64], folder[] = "/tmp/palp-frames-XXXXXX";
    static const double place[3][6] = {
        {0.1, 0.2, -0.3, 0.4, -0.2, 0.7}, {-1, 0.5, 0.2, 1.2, 0.3, -0.4}, {0, 0, 0, -0.9, 0.1, 2}};
    if (mkdtemp(folder) == NULL) return;
    for (int z = 0; z < 3; z++) {
        mesh m = mesh_copy(&model->part[z]);
        double angle = v_norm(place[z] + 3), axis[3];
        for (int k = 0; k < 3; k++) axis[k] = place[z][3 + k] / angle;
        for (uint32_t i = 0; i < m.vertices; i++) { /* R^T (x - t) */
            double x[3], c[3];
            v_sub(m.x[i], place[z], x);
            v_cross(axis, x, c);
            for (int k = 0; k < 3; k++)
                m.x[i][k] = x[k] * cos(angle) - c[k] * sin(angle) +
                            axis[k] * v_dot(axis, x) * (1 - cos(angle));
        }
        snprintf(path[z], sizeof path[z], "%s/%d.obj", folder, z);
        mesh_save_obj(&m, path[z]);
        mesh_free(&m);
    }
    size_t used = (size_t)snprintf(lines, sizeof lines, COMMON);
    for (int z = 0; z < 3; z++) {
        used += (size_t)snprintf(lines + used, sizeof lines - used,
                                 "zone %c\nmesh %s\nframe %.17g %.17g %.17g %.17g %.17g %.17g\n",
                                 "abc"[z], path[z], place[z][0], place[z][1], place[z][2],
                                 place[z][3], place[z][4], place[z][5]);
        if (z == 0)
            used += (size_t)snprintf(lines + used, sizeof lines - used, "fix-below x 1e-6\n");
    }
    snprintf(lines + used, sizeof lines - used,
             "joint ab revolute a b\naxis 0 0 1\norigin 0.02 0.01 0.01\n"
             "joint bc revolute b c\naxis 0 0.6 0.8\norigin 0.04 0.01 0.01\nseam a b\nseam b c\n");
    zoned other = model_zones(NULL, lines, 0);
    palp_assembly *a = model_assembly(model->zones, 5), *b = model_assembly(other.zones, 5);
    float value[PALP_MAX_JOINTS] = {0.5f, -0.8f};
    pose(a, value, 5);
    pose(b, value, 5);
    double worst = 0, most = 0;
    for (uint32_t n = 0; n < model->zones->blob[1].meta->nodes; n++) {
        palp_vec3 off = palp_sub(palp_assembly_position(a, 1, n), palp_assembly_position(b, 1, n));
        worst = fmax(worst, (double)palp_norm(off));
        most = fmax(most, (double)palp_norm(palp_assembly_position(a, 1, n)));
    }
    /* Which quadrature a pair of triangles gets can change with rounding: within its tolerance. */
    AT_MOST(worst / most, 2e-5, "meshes in rotated frames give the same posed shape");
}

/* ---- gravity ---- */

/* A bent chain under gravity: free nodes against the dense solution, each zone's own
 * gravity_response included.
 */
static void test_gravity(const zoned *model) {
    const palp_zones *z = model->zones;
    palp_assembly *a = model_assembly(z, 5);
    oracle o = make_oracle(model);
    const float value[PALP_MAX_JOINTS] = {0.4f, -0.6f};
    const double g[3] = {3.0, -200.0, -900.0};
    (void)palp_assembly_gravity(a, (palp_vec3){3.0f, -200.0f, -900.0f});
    pose(a, value, 5);
    forward(z, value, o.m);
    double worst = 0, most = 0;
    for (uint32_t i = 0; i < z->meta->zones; i++) o.pull[i] = g;
    const double none[3] = {0};
    oracle_solve(&o, value, 0, 0, none);
    for (uint32_t i = 0; i < z->meta->zones; i++) {
        double local[3];
        turn_back(o.m[i].r, g, local);
        for (uint32_t n = 0; n < z->blob[i].meta->nodes; n++) {
            if (palp_node_is_fixed(&z->blob[i], n)) continue;
            double u[3], x[3], own[3];
            oracle_node(&o, i, n, z->meta->zones, 0, none, u);
            for (size_t e = 0; e < 9; e++)
                u[e / 3] +=
                    greens_row(&o.g[i], n, e / 3)[3 * (size_t)o.g[i].nodes + e % 3] * local[e % 3];
            for (int k = 0; k < 3; k++) own[k] = model->part[i].x[n][k] + u[k];
            turn(o.m[i].r, own, x);
            palp_vec3 p = palp_assembly_position(a, i, n);
            const double off[3] = {(double)p.x - x[0] - o.m[i].t[0],
                                   (double)p.y - x[1] - o.m[i].t[1],
                                   (double)p.z - x[2] - o.m[i].t[2]};
            worst = fmax(worst, v_norm(off));
            most = fmax(most, v_norm(u));
        }
    }
    AT_MOST(worst / most, 2e-5, "a bent chain under gravity against the dense solution");
}

/* ---- against one body ---- */

static double bar_error(uint32_t n, const char *lines) {
    uint32_t *cell;
    mesh m = model_voxels(bar3, 3, EDGE, n, &cell);
    zoned cut = model_zones(&m, lines, 0);
    bem_material material = {.young_Pa = YOUNG, .poisson = POISSON, .crisp = true};
    uint8_t *fixed = allocate(m.vertices, 1);
    for (uint32_t i = 0; i < m.vertices; i++) fixed[i] = m.x[i][0] < 1e-6;
    greens g = greens_from_galerkin(&m, fixed, &material, 1000);
    greens_reciprocity(&g, &m, true);
    palp_assembly *a = model_assembly(cut.zones, 5);
    uint32_t last = cut.zones->meta->zones - 1;
    double worst = 0, norm = 0;
    for (int direction = 0; direction < 3; direction++) { /* a pull and two bendings at the end */
        double *load = allocate(m.vertices, sizeof *load);
        palp_assembly_unload(a);
        for (uint32_t i = 0; i < m.vertices; i++) {
            if (m.x[i][0] < 3 * EDGE - 1e-6) continue;
            uint32_t twin = 0;
            while (v_distance(cut.part[last].x[twin], m.x[i]) > 1e-9) twin++;
            load[i] = 1;
            palp_vec3 f = {direction == 0 ? 1.0f : 0.0f, direction == 1 ? 1.0f : 0.0f,
                           direction == 2 ? 1.0f : 0.0f};
            load_node(a, last, twin, f);
        }
        const float *total = palp_assembly_total(a);
        double off2 = 0, all2 = 0;
        for (uint32_t z = 0; z < last; z++) { /* zones that no force acts on: all of it by seams */
            float *modes = allocate(3 * (size_t)cut.zones->zone[z].modes, sizeof *modes);
            palp_seams_zone(&a->seams, a->configuration, 5, z, total, modes);
            for (uint32_t k = 0; k < cut.part[z].vertices; k++) {
                if (palp_node_is_fixed(&cut.zones->blob[z], k)) continue;
                uint32_t i = 0;
                while (v_distance(cut.part[z].x[k], m.x[i]) > 1e-9) i++;
                double u[3] = {0};
                for (uint32_t j = 0; j < m.vertices; j++) {
                    for (size_t c = 0; c < 3 && load[j] > 0; c++)
                        u[c] += greens_row(&g, i, c)[3 * j + (size_t)direction];
                }
                palp_vec3 got = palp_zone_modal_displacement(cut.zones, 5, z, k, modes);
                const double off[3] = {(double)got.x - u[0], (double)got.y - u[1],
                                       (double)got.z - u[2]};
                off2 += v_dot(off, off);
                all2 += v_dot(u, u);
            }
            free(modes);
        }
        worst = fmax(worst, sqrt(off2 / all2));
        norm = fmax(norm, all2);
        free(load);
    }
    return norm > 0 ? worst : HUGE_VAL;
}

static void test_one_body(void) {
    static const uint32_t n[3] = {2, 4, 6};
    static const double limit[3] = {0.11, 0.041, 0.020};
    double two[3];
    for (int i = 0; i < 3; i++)
        AT_MOST(bar_error(n[i], chain3), limit[i],
                "three cubes bonded against one body, %u elements per edge, worst of pull and two "
                "bendings, RMS",
                n[i]);
    for (int i = 0; i < 3; i++) {
        two[i] = bar_error(n[i], COMMON "zone a\nfix-below x 1e-6\nzone b\ncut a b 0.02 0 0 1 0 0\n"
                                        "joint ab fixed a b\n");
        printf("# one cut, %u elements per edge: %.4f\n", n[i], two[i]);
    }
    CHECK(two[0] > two[1] && two[1] > two[2] && two[2] < 0.02,
          "one cut of one body converges to it: %.4f, %.4f, %.4f", two[0], two[1], two[2]);
}

/* ---- cost ---- */

static void test_cost(void) {
    static const uint32_t zones[5] = {2, 4, 8, 16, 32};
    double per_seam[5];
    for (int i = 0; i < 5; i++) {
        static int cube[32][3];
        uint32_t *cell;
        char lines[16384];
        size_t used = (size_t)snprintf(lines, sizeof lines, COMMON "zone z0\nfix-below x 1e-6\n");
        for (uint32_t z = 0; z < zones[i]; z++) {
            cube[z][0] = (int)z;
            if (z > 0)
                used +=
                    (size_t)snprintf(lines + used, sizeof lines - used,
                                     "zone z%u\njoint j%u revolute z%u z%u\norigin %g 0.01 0.01\n",
                                     z, z, z - 1, z, EDGE * z);
        }
        for (uint32_t z = 1; z < zones[i]; z++)
            used += (size_t)snprintf(lines + used, sizeof lines - used,
                                     "cut z%u z%u %g 0 0 1 0 0\n", z - 1, z, EDGE * z);
        mesh m = model_voxels((const int(*)[3])cube, zones[i], EDGE, 2, &cell);
        zoned model = model_zones(&m, lines, 0);
        palp_assembly *a = model_assembly(model.zones, 5);
        float value[PALP_MAX_JOINTS];
        for (int j = 0; j < (int)PALP_MAX_JOINTS; j++) value[j] = 0.05f;
        uint64_t before = a->seams.work_done;
        pose(a, value, 5);
        double work = (double)(a->seams.work_done - before);
        per_seam[i] = work / (zones[i] - 1);
        float bound = palp_seams_cost_factor(&a->seams, &palp_target_counted.instructions, 5) +
                      palp_assembly_cost_settle(a, &palp_target_counted.instructions, 5);
        printf(
            "# %2u zones: %.0f multiply-adds for a new configuration, %.0f per seam, bound %.0f\n",
            zones[i], work, per_seam[i], (double)bound);
        CHECK(work <= (double)bound, "within the bound for %u zones", zones[i]);
        mesh_free(&m);
    }
    AT_MOST(per_seam[4] / per_seam[2] - 1, 0.1, "work per seam from 8 to 32 zones grows by");
}

/* ---- bending ---- */

static void test_bending(const zoned *model) {
    enum { STEPS = 181 };
    static double angle[STEPS], force[STEPS], seam[STEPS];
    palp_assembly *a = model_assembly(model->zones, 5);
    for (int i = 0; i < STEPS; i++) {
        float value[PALP_MAX_JOINTS] = {(float)(i * 0.5 * 3.14159265358979 / 180)};
        palp_vec3 f, moment;
        pose(a, value, 5);
        palp_assembly_unload(a);
        (void)palp_assembly_total(a);
        palp_assembly_wrench(a, 1, &f, &moment);
        double sum = 0;
        for (uint32_t k = 0; k < 3 * a->seams.modes; k++) sum += (double)a->w[k] * (double)a->w[k];
        angle[i] = i * 0.5;
        seam[i] = 1e3 * sqrt(sum / model->zones->seam[0].nodes);
        force[i] = (double)palp_norm(moment);
    }
    double step_f = 0, step_u = 0, kink_f = 0, kink_u = 0;
    for (int i = 1; i < STEPS; i++) {
        step_f = fmax(step_f, fabs(force[i] - force[i - 1]));
        step_u = fmax(step_u, fabs(seam[i] - seam[i - 1]));
        if (i + 1 == STEPS) break;
        kink_f = fmax(kink_f, fabs(force[i + 1] - 2 * force[i] + force[i - 1]));
        kink_u = fmax(kink_u, fabs(seam[i + 1] - 2 * seam[i] + seam[i - 1]));
    }
    AT_MOST(step_f / force[STEPS - 1], 0.02,
            "0 to 90 degrees at one joint: largest change of the moment per half degree");
    AT_MOST(step_u / seam[STEPS - 1], 0.02, "and of the seam's displacement");
    AT_MOST(kink_f / step_f, 0.05, "change of slope of the moment per half degree");
    AT_MOST(kink_u / step_u, 0.05, "and of the displacement");
    const char *build = getenv("BUILD");
    char path[256];
    snprintf(path, sizeof path, "%s/zones", build != NULL ? build : "build");
    (void)mkdir(path, 0777);
    snprintf(path, sizeof path, "%s/zones/bending.html", build != NULL ? build : "build");
    FILE *out = fopen(path, "w");
    if (out == NULL) return;
    const plot_series moment = {
        .name = "moment on the link", .count = STEPS, .x = angle, .y = force};
    const plot_series moved = {.name = "seam, RMS", .count = STEPS, .x = angle, .y = seam};
    plot_svg(out, &(plot_chart){.title = "Bending one joint of three cubes",
                                .x_label = "joint (degrees)",
                                .y_label = "Nm",
                                .series = &moment,
                                .count = 1});
    plot_svg(out, &(plot_chart){.title = "Displacement of its seam",
                                .x_label = "joint (degrees)",
                                .y_label = "mm",
                                .series = &moved,
                                .count = 1});
    fclose(out);
    printf("# plotted in %s\n", path);
}

/* ---- hostile models ---- */

/* Contact with whatever the model is. */
static void touch(palp_assembly *a) {
    const palp_tool tool = palp_tool_sphere(0.01f);
    const palp_frame at = palp_frame_at((palp_vec3){0.045f, 0.01f, 0.025f});
    const palp_contact_spring spring = {.held = at, .stiffness_N_per_m = 100.0f};
    const palp_contact_config config = {
        .assembly = a, .pairs = true, .tools = &tool, .tool_count = 1, .finest = 0};
    size_t room = palp_contact_memsize(&config);
    void *memory = allocate_aligned(room + 1, 1);
    palp_contact *c = allocate(1, sizeof *c);
    if (palp_contact_init(c, &config, memory, room) == PALP_OK) {
        for (int i = 0; i < 3; i++) palp_contact_solve(c, &at, &spring);
    }
    free(memory);
    free(c);
}

/* Words of the describing sections take hostile values: either refused, or used without harm. */
static void test_hostile(const zoned *model) {
    static const uint32_t words[] = {0,   1,     2,          3,          31,         47,
                                     255, 65535, 0x7fffffff, 0x80000000, 0xffffffff, 0x7fc00000};
    uint64_t seed = 1;
    uint32_t refused = 0, used = 0, tries = 0;
    uint8_t *bytes = allocate_aligned(model->size, 1);
    palp_zones *z = allocate(1, sizeof *z);
    for (uint32_t section = PALP_SEC_ZONES; section <= PALP_SEC_SEAM_NODE; section++) {
        const palp_blob_header *h = (const palp_blob_header *)(const void *)model->bytes;
        const palp_blob_entry *e =
            (const palp_blob_entry *)(const void *)(model->bytes + sizeof *h);
        while (e->type != section) e++;
        for (uint32_t k = 0; k < HOSTILE; k++, tries++) {
            memcpy(bytes, model->bytes, model->size);
            size_t all = (size_t)(e->count * e->element_bytes / 4);
            size_t at = (size_t)((tap_random(&seed) + 1) / 2 * (double)all);
            uint32_t word = words[(size_t)((tap_random(&seed) + 1) / 2 * 12)];
            memcpy(bytes + e->offset + 4 * at, &word, 4);
            model_seal(bytes);
            if (palp_zones_open(z, bytes, model->size) != PALP_OK) {
                refused++;
                continue;
            }
            used++;
            for (uint32_t finest = 0; finest < PALP_SEAM_LEVELS; finest += 5) {
                palp_assembly *a = allocate(1, sizeof *a);
                size_t room = palp_assembly_memsize(z, finest);
                void *memory = allocate_aligned(room + 1, 1);
                float value[PALP_MAX_JOINTS] = {0.3f, -0.2f};
                if (room > 0 && palp_assembly_init(a, z, finest, memory, room) == PALP_OK) {
                    pose(a, value, finest);
                    for (uint32_t zone = 0; zone < z->meta->zones; zone++)
                        (void)palp_assembly_position(a, zone, 0);
                    touch(a);
                }
                free(memory);
                free(a);
            }
        }
    }
    CHECK(refused > 0 && used > 0, "%u hostile models: %u refused, %u used without harm", tries,
          refused, used);
    free(bytes);
    free(z);
}

int main(void) {
    zoned chain = make_chain(2);
    const float posed[PALP_MAX_JOINTS] = {0.6f, -0.9f};
    test_rest(&chain);
    test_frames(&chain);
    test_graph(&chain, posed, "chain");
    test_gravity(&chain);
    test_tree_and_loop();
    test_one_body();
    test_cost();
    test_bending(&chain);
    test_hostile(&chain);
    return tap_done();
}
