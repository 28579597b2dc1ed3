/* SPDX-License-Identifier: MIT */
/* palp calibrate: how fast this machine does what the bounds count. */
#include "port/host/calibrate.h"
#include "port/host/blobfile.h"
#include "port/host/args.h"
#include "port/host/util.h"
#include "tools/bake/build.h"
#include "tools/cli/commands.h"
#include "tools/mesh/semireg.h"
#include <stdlib.h>
#include <string.h>

/* A rounded cube of 386 nodes, held below: a body to touch that needs no file. */
static palp_blob sample_blob(void) {
    static const uint32_t quad[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                        {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
    mesh m = {.vertices = 8, .triangles = 12};
    m.x = allocate(8, sizeof *m.x);
    m.t = allocate(12, sizeof *m.t);
    for (uint32_t i = 0; i < 8; i++) {
        for (uint32_t k = 0; k < 3; k++) m.x[i][k] = 0.05 * (double)(i >> k & 1u);
    }
    for (uint32_t i = 0; i < 12; i++) {
        for (uint32_t k = 0; k < 3; k++) m.t[i][k] = quad[i / 2][k == 0 ? 0 : k + i % 2];
    }
    for (uint32_t l = 0; l < 3; l++) {
        mesh finer = subdivide_loop(&m);
        mesh_free(&m);
        m = finer;
    }
    const bem_material material = {.young_Pa = 1e4, .poisson = 0.4, .tolerance = BEM_TOLERANCE};
    uint8_t *fixed = allocate(m.vertices, 1);
    double *area = allocate(m.vertices, sizeof *area);
    double(*normal)[3] = allocate(m.vertices, sizeof *normal);
    for (uint32_t i = 0; i < m.vertices; i++) fixed[i] = m.x[i][2] <= 0.01;
    mesh_nodal(&m, area, normal);
    build_options options = {
        .wavelet = {.lifted = true}, .compress = {.epsilon = 0.05}, .modes = BUILD_MODES};
    domains d = domains_build(&m, fixed, area, options.wavelet);
    options.constraint_level = d.domain[PALP_FREE].view.levels - 1;
    greens g = greens_from_bem(&m, fixed, &material, 1000);
    greens_reciprocity(&g, &m, true);
    palp_meta meta = {.young_Pa = 1e4f, .poisson = 0.4f, .density_kg_m3 = 1000};
    built made = blob_build(&m, &g, &d, area, normal, meta, &options);
    return open_blob("the sample body", made.bytes, made.size);
}

static const char help[] =
    "usage: palp calibrate [-o FILE]\n"
    "\n"
    "Measures how fast this machine does what the cost bounds count, warm and with cold caches, "
    "and\n"
    "writes a cost table for 'palp wcet --target FILE' (default: standard output). Instructions "
    "are\n"
    "those of the target that this program was built for; only the speed is measured.\n";
static const option options[] = {{"-o", 1}, {NULL, 0}};

static void set_option(void *context, const argument *a) {
    const char **path = context;
    if (a->option == NULL) die(EXIT_USAGE, "what is '%s'? (palp calibrate --help)", a->value[0]);
    *path = a->value[0];
}

int command_calibrate(int argc, char **argv) {
    const char *path = "-";
    machine m;
    args_parse(argc, argv, options, help, set_option, &path);
    palp_blob blob = sample_blob();
    palp_tool tool = palp_tool_sphere(6 * blob.meta->mean_edge_m);
    uint32_t node = blob.domain[PALP_FREE].node[blob.domain[PALP_FREE].slots / 2u];
    output out = open_output(path);
    calibrate(&m, &blob, &tool, node, true);
    if (machine_of_this_build() == NULL)
        warn("no instruction counts are shipped for this machine: the table counts operations");
    machine_write(out.file, &m);
    commit_output(&out);
    return EXIT_SUCCESS;
}
