/* SPDX-License-Identifier: MIT */
/* palp tool: a rigid tool of any closed shape. */
#include "core/contact/tool_field.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include "tools/bake/sha256.h"
#include "tools/cli/commands.h"
#include "tools/mesh/choose.h"
#include "tools/mesh/components.h"
#include "tools/tool/toolbake.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const char help[] =
    "usage: palp tool MESH.(obj|stl|ply) -o OUT.tool [OPTIONS]\n"
    "\n"
    "Makes a rigid tool of a closed mesh: a signed distance field that a controller reads in "
    "place.\n"
    "Components may touch and cross; what lies in any of them is the tool.\n"
    "\n"
    "  -o OUT.tool             the tool\n"
    "  --cells N               of the field along the longest side, 8 to 1000 (default: as many "
    "as\n"
    "                          1 MB holds)\n"
    "  --radius M              make it larger all around, and round its edges and tips\n"
    "                          (default: 0, or what sharp and thin parts need to be felt)\n"
    "  --reference X Y Z       the point of the mesh that the device holds, m (default 0 0 0)\n"
    "  --threads N             default: all processors\n" MESH_HELP;

static const option options[] = {MESH_OPTIONS,    {"-o", 1},          {"--cells", 1},
                                 {"--radius", 1}, {"--reference", 3}, {"--threads", 1},
                                 {NULL, 0}};

typedef struct {
    const char *input, *output;
    mesh_choice choice;
    tool_options tool;
} tool_spec;

static void set_option(void *context, const argument *a) {
    tool_spec *s = context;
    const char *o = a->option;
    if (o == NULL) {
        if (s->input != NULL) die(EXIT_USAGE, "one mesh, not also '%s'", a->value[0]);
        s->input = a->value[0];
    } else if (mesh_option(&s->choice, a)) {
        return;
    } else if (strcmp(o, "-o") == 0) {
        s->output = a->value[0];
    } else if (strcmp(o, "--cells") == 0) {
        s->tool.cells = arg_u32(a, 0, TOOL_LEAST_CELLS, TOOL_MOST_CELLS);
    } else if (strcmp(o, "--radius") == 0) {
        s->tool.radius_given = true;
        s->tool.radius_m = arg_between(a, -1e-12, 10);
        s->tool.radius_m = fmax(s->tool.radius_m, 0);
    } else if (strcmp(o, "--reference") == 0) {
        for (int k = 0; k < 3; k++) s->tool.reference[k] = arg_double(a, k);
    } else {
        set_threads(arg_u32(a, 0, 1, 1024));
    }
}

/* Each component closed and outward by itself, all in one mesh. */
static mesh close_components(mesh *m, const char *path) {
    mesh_components c = mesh_find_components(m);
    mesh all = {.x = allocate(m->vertices + 1, sizeof *all.x),
                .t = allocate(m->triangles, sizeof *all.t)};
    for (uint32_t i = 0; i < c.count; i++) {
        mesh part = mesh_copy(m);
        mesh_take_component(&part, &c, i);
        mesh_require_closed(&part, path);
        memcpy(all.x + all.vertices, part.x, part.vertices * sizeof *part.x);
        for (uint32_t t = 0; t < part.triangles; t++) {
            for (int k = 0; k < 3; k++) all.t[all.triangles][k] = part.t[t][k] + all.vertices;
            all.triangles++;
        }
        all.vertices += part.vertices;
        mesh_free(&part);
    }
    if (c.count > 1)
        fprintf(stderr, "%s: %" PRIu32 " components, all of them the tool\n", path, c.count);
    mesh_components_free(&c);
    mesh_free(m);
    return all;
}

/* How far the reference point lies beside the mesh's box. */
static double beside_box(const mesh *m, const double x[3]) {
    double low[3], high[3], sum = 0;
    mesh_bounds(m, low, high);
    for (int k = 0; k < 3; k++) {
        const double off = fmax(fmax(low[k] - x[k], x[k] - high[k]), 0);
        sum += off * off;
    }
    return sqrt(sum);
}

static void tell(const tool_spec *s, const tool_report *r, size_t bytes) {
    printf("tool                  %.3g x %.3g x %.3g cm\n", 100 * r->size[0], 100 * r->size[1],
           100 * r->size[2]);
    printf("field                 %" PRIu32 " x %" PRIu32 " x %" PRIu32
           " samples %.3g mm apart, %zu bytes\n",
           r->count[0], r->count[1], r->count[2], 1e3 * r->step_m, bytes);
    printf("radius                %.3g mm, largest ball inside %.3g mm\n", 1e3 * r->radius_m,
           1e3 * r->size_m);
    printf("distance              off by %.3g mm in the mean, %.3g mm at most (%.2g %% of the "
           "diagonal)\n",
           1e3 * r->error_mean_m, 1e3 * r->error_max_m, 100 * r->error_max_m / r->diagonal_m);
    if (r->radius_m > 0 && !s->tool.radius_given)
        warn("%s: sharp or thin parts need a radius to be felt: the tool is %.3g mm larger all "
             "around (--cells for a finer field, --radius to choose it)",
             s->input, 1e3 * r->radius_m);
    if (r->error_max_m > TOOL_ERROR * r->diagonal_m)
        warn("%s: off by %.2g %% of the diagonal near (%.4g, %.4g, %.4g): sharp or thin there: a "
             "larger --radius or more --cells helps",
             s->input, 100 * r->error_max_m / r->diagonal_m, r->worst[0], r->worst[1], r->worst[2]);
    if (r->thin > TOOL_BLIND)
        warn("%s: %.2g %% of the surface lies over parts thinner than the field can see: a larger "
             "--radius or more --cells helps",
             s->input, 100 * r->thin);
}

int command_tool(int argc, char **argv) {
    tool_spec s = {.input = NULL};
    args_parse(argc, argv, options, help, set_option, &s);
    if (s.input == NULL) die(EXIT_USAGE, "no mesh (--help shows the usage)");
    if (s.output == NULL) die(EXIT_USAGE, "no output: add -o OUT.tool");
    mesh raw = mesh_load_as(s.input, &s.choice, HOLES_REMESHED);
    mesh m = close_components(&raw, s.input);
    mesh_warn_of_size(&m, s.input);
    const double beside = beside_box(&m, s.tool.reference);
    if (beside > mesh_diagonal(&m))
        warn("%s: the reference point lies %.3g m beside the mesh: --reference X Y Z says which "
             "point the device holds",
             s.input, beside);
    size_t file_bytes, bytes;
    uint8_t sha[32];
    char *file = read_file(s.input, &file_bytes);
    sha256(file, file_bytes, sha);
    free(file);
    tool_report r;
    uint8_t *data = tool_bake(&m, &s.tool, sha, &r, &bytes);
    palp_tool_field field;
    const palp_status status = palp_tool_field_open(&field, data, bytes);
    if (status != PALP_OK)
        die(EXIT_WORK, "%s: makes no tool: %s", s.input, palp_status_text(status));
    output out = open_output(s.output);
    if (fwrite(data, 1, bytes, out.file) != bytes)
        die(EXIT_WORK, "%s: cannot be written", s.output);
    commit_output(&out);
    tell(&s, &r, bytes);
    free(data);
    mesh_free(&m);
    return EXIT_SUCCESS;
}
