/* SPDX-License-Identifier: MIT */
/* palp check: what a mesh is, what was mended in it, and what bake will do with it. */
#include "tools/cli/commands.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include "tools/mesh/choose.h"
#include "tools/mesh/components.h"
#include "tools/mesh/crossing.h"
#include "tools/mesh/meshmend.h"
#include "tools/mesh/remesh.h"
#include "tools/mesh/semireg.h"
#include "tools/mesh/thickness.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#define RAY_TESTS 2e8 /* about a second */

static const char help[] =
    "usage: palp check MESH.(obj|stl|ply) [OPTIONS]\n"
    "\n"
    "Says in a few lines what a mesh is (size, components, edges, thinnest wall), what was mended "
    "in\n"
    "it, and what palp bake will make of it. Exits 1 with the reason where bake would refuse it.\n"
    "\n" MESH_HELP "  --levels N              of remeshing, as palp bake has them (default 3)\n"
    "  --base-faces N          triangles of its base\n";

static const option options[] = {MESH_OPTIONS, {"--levels", 1}, {"--base-faces", 1}, {NULL, 0}};

typedef struct {
    const char *input;
    mesh_choice choice;
    uint32_t levels, base_faces;
} check_spec;

static void set_option(void *context, const argument *a) {
    check_spec *s = context;
    if (a->option == NULL) {
        if (s->input != NULL) die(EXIT_USAGE, "one mesh, not also '%s'", a->value[0]);
        s->input = a->value[0];
    } else if (strcmp(a->option, "--base-faces") == 0) {
        s->base_faces = arg_u32(a, 0, 4, 1000000);
    } else if (!mesh_option(&s->choice, a)) {
        s->levels = arg_u32(a, 0, 0, 8);
    }
}

/* Shortest, mean and longest edge. */
static void edge_lengths(const mesh *m, double edge[3]) {
    edge[0] = HUGE_VAL;
    edge[1] = mesh_mean_edge(m);
    edge[2] = 0;
    for (uint32_t t = 0; t < m->triangles; t++) {
        for (int k = 0; k < 3; k++) {
            double length = v_distance(m->x[m->t[t][k]], m->x[m->t[t][(k + 1) % 3]]);
            edge[0] = fmin(edge[0], length);
            edge[2] = fmax(edge[2], length);
        }
    }
}

static void print_surface(const char *title, const mesh *m) {
    double size[3], edge[3];
    mesh_extent(m, size);
    edge_lengths(m, edge);
    printf("%-10s size        %.3g x %.3g x %.3g cm, volume %.3g cm^3\n", title, 100 * size[0],
           100 * size[1], 100 * size[2], 1e6 * mesh_volume(m));
    printf("%-10s surface     closed, %" PRIu32 " vertices, %" PRIu32 " triangles, genus %d\n", "",
           m->vertices, m->triangles, 1 - ((int)m->vertices - (int)m->triangles / 2) / 2);
    printf("%-10s edges       %.3g mm, %.3g to %.3g mm; smallest angle %.1f degrees\n", "",
           1e3 * edge[1], 1e3 * edge[0], 1e3 * edge[2], mesh_smallest_angle_deg(m));
    uint32_t step = (uint32_t)((double)m->triangles * m->triangles / RAY_TESTS) + 1, thin = 0;
    double *thickness = mesh_thickness(m, step);
    for (uint32_t i = 1; i < (m->triangles + step - 1) / step; i++) {
        if (thickness[i] < thickness[thin]) thin = i;
    }
    const double *at = m->x[m->t[thin * step][0]];
    printf("%-10s wall        %.3g mm at the thinnest, %.2g mean edges, near (%.4g, %.4g, %.4g)\n",
           "", 1e3 * thickness[thin], thickness[thin] / edge[1], at[0], at[1], at[2]);
    free(thickness);
}

int command_check(int argc, char **argv) {
    check_spec s = {.levels = 3};
    args_parse(argc, argv, options, help, set_option, &s);
    if (s.input == NULL) die(EXIT_USAGE, "no mesh (--help shows the usage)");
    mesh m = mesh_load_as(s.input, &s.choice, HOLES_REMESHED);
    mesh_components c = mesh_find_components(&m);
    printf("%-10s file        %" PRIu32 " vertices, %" PRIu32 " triangles, %" PRIu32
           " component(s)\n",
           "as given", m.vertices, m.triangles, c.count);
    for (uint32_t i = 0; i < c.count && c.count > 1 && i < 8; i++)
        printf("%-10s component   %" PRIu32 ": %" PRIu32 " triangles\n", "", i, c.triangles[i]);
    mesh_components_free(&c);
    fflush(stdout);
    mesh_require_closed(&m, s.input);
    mesh_warn_of_size(&m, s.input);
    print_surface("", &m);
    uint32_t crossing = mesh_self_intersection(&m);
    if (crossing != UINT32_MAX) {
        const double *x = m.x[m.t[crossing][0]];
        printf("%-10s crosses     itself near (%.4g, %.4g, %.4g), triangle %" PRIu32
               " (0-based): repair it there\n",
               "", x[0], x[1], x[2], crossing);
    }
    semireg given = semireg_detect(&m);
    printf("%-10s bake        %" PRIu32 " nodes, %" PRIu32 " level(s) with --as-is\n", "",
           m.vertices, given.levels);
    semireg_free(&given);
    fflush(stdout);
    remesh_report r;
    mesh used = remesh(&m, s.input, s.levels, s.base_faces, &r);
    remesh_warn(&r, s.input);
    print_surface("remeshed", &used);
    printf("%-10s distance    %.3f %% of the diagonal in the mean, %.3f %% at most\n", "",
           100 * r.mean, 100 * r.max);
    printf("%-10s bake        %" PRIu32 " nodes, %" PRIu32 " levels with --levels %" PRIu32 "\n",
           "", used.vertices, s.levels + 1, s.levels);
    mesh_free(&used);
    mesh_free(&m);
    return EXIT_SUCCESS;
}
