/* SPDX-License-Identifier: MIT */
/* palp fill: a tetrahedral mesh of the inside of a closed surface. */
#include "tools/cli/commands.h"
#include "port/host/args.h"
#include "port/host/parallel.h"
#include "tools/mesh/choose.h"
#include "tools/tet/stuffing.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

static const char help[] =
    "usage: palp fill IN.(obj|stl|ply) --nodes N [N ...] [-o OUT.mesh]\n"
    "\n"
    "Fills a closed surface with tetrahedra by isosurface stuffing and says how good they are.\n"
    "  --nodes N     about that many nodes (repeatable: a mesh for each)\n"
    "  -o OUT.mesh   Medit's text format; of several resolutions OUT-0.mesh, OUT-1.mesh, "
    "..\n" MESH_HELP;

static const option options[] = {{"--nodes", 1}, {"-o", 1}, MESH_OPTIONS, {NULL, 0}};

typedef struct {
    const char *input, *output;
    uint32_t nodes[TET_LEVELS], count;
    mesh_choice choice;
} fill_spec;

static void set_option(void *context, const argument *a) {
    fill_spec *s = context;
    if (a->option == NULL) {
        if (s->input != NULL) die(EXIT_USAGE, "one input mesh, not also '%s'", a->value[0]);
        s->input = a->value[0];
    } else if (strcmp(a->option, "--nodes") == 0) {
        if (s->count == TET_LEVELS)
            die(EXIT_USAGE, "%s: more than %d resolutions", a->where, TET_LEVELS);
        s->nodes[s->count++] = arg_u32(a, 0, 8, 1000000);
    } else if (!mesh_option(&s->choice, a)) {
        s->output = a->value[0];
    }
}

int command_fill(int argc, char **argv) {
    fill_spec s = {.input = NULL};
    args_parse(argc, argv, options, help, set_option, &s);
    if (s.input == NULL) die(EXIT_USAGE, "no input mesh (--help shows the usage)");
    if (s.count == 0) die(EXIT_USAGE, "no resolution: add --nodes N");
    bool piped = s.output != NULL && strcmp(s.output, "-") == 0;
    if (piped && s.count > 1) die(EXIT_USAGE, "-o: several meshes need a name, not '-'");
    FILE *table = piped ? stderr : stdout;
    mesh surface = mesh_load_as(s.input, &s.choice, HOLES_REMESHED);
    mesh_require_closed(&surface, s.input);
    mesh_warn_of_size(&surface, s.input);
    bvh *on = bvh_build(&surface);
    fprintf(table,
            "  nodes  tetrahedra  dihedral angles (deg)  volume    to the surface: mean    largest"
            "  from it: furthest  (%% of the diagonal %.4g m)\n",
            mesh_diagonal(&surface));
    for (uint32_t i = 0; i < s.count; i++) {
        double pitch = 0, dropped = 0;
        tetmesh m = stuff_level(&surface, on, s.nodes[i], i, &pitch, &dropped);
        tet_quality q = tetmesh_quality(&m, &surface, on);
        double percent = 100 / mesh_diagonal(&surface);
        fprintf(table,
                "%7" PRIu32 " %11" PRIu32 "  %8.1f .. %6.1f   %+9.2f %%  %20.3f %10.3f %19.3f\n",
                m.nodes, m.tets, q.low_deg, q.high_deg, 100 * q.volume_error, percent * q.mean_m,
                percent * q.largest_m, percent * q.far_m);
        if (dropped > 1e-3)
            warn("%s: %.1f %% of the volume hangs on by less than one element at %" PRIu32
                 " nodes and is left out",
                 s.input, 100 * dropped, m.nodes);
        if (s.output != NULL) {
            char path[4096];
            numbered_path(s.output, s.count > 1 ? (int)i : -1, path, sizeof path);
            tetmesh_save(&m, path);
        }
        tetmesh_free(&m);
    }
    bvh_free(on);
    mesh_free(&surface);
    return EXIT_SUCCESS;
}
