/* SPDX-License-Identifier: MIT */
#include "tools/bake/body.h"
#include "tools/cli/commands.h"
#include "port/host/parallel.h"
#include "tools/bake/sha256.h"
#include "tools/mesh/components.h"
#include "tools/tet/tetbake.h"
#include "port/host/util.h"
#include "tools/zone/zonebake.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

static const char help[] =
    "usage: palp bake IN.(obj|stl|ply|model) -o OUT.palp --young PA --poisson NU --fix-... "
    "[OPTIONS]\n"
    "\n"
    "Computes the Green's functions of an elastic body held at its fixed nodes and writes them,\n"
    "wavelet-compressed, as a blob.\n"
    "\n"
    "  -o OUT.palp             the blob\n"
    "  --each                  every component as a body of its own: OUT-0.palp, OUT-1.palp, ..\n"
    "  --levels N              remesh to N refinements of a coarse base first (default 3)\n"
    "  --base-faces N          triangles of that base (default: as few as follow the surface)\n"
    "  --as-is                 use the mesh exactly as given\n" MESH_HELP
    "  --loop N                refine a control mesh by N steps of Loop's scheme instead of "
    "remeshing\n"
    "  --young PA              Young's modulus; also 20 kPa, 2 MPa, 200 GPa\n"
    "  --poisson NU            Poisson's ratio, -1 < NU < 0.5\n"
    "  --density KG/M3         default 1000\n"
    "  --fix-below AXIS VALUE  fix the nodes with a coordinate at most VALUE   (repeatable)\n"
    "  --fix-above AXIS VALUE  fix the nodes with a coordinate at least VALUE  (repeatable)\n"
    "  --fix-box X0 Y0 Z0 X1 Y1 Z1                                             (repeatable)\n"
    "  --fix-nodes FILE        one 0-based node per line, numbers of the mesh that is baked\n"
    "  --crisp                 reactions act on the fixed patch alone, none leak over its rim "
    "(zones: "
    "always)\n"
    "  --method galerkin|collocation   boundary elements: symmetric by construction (default),\n"
    "                          or the paper's, repaired where it is not\n"
    "  --form split|wavelet    how Green's functions are stored: half-space, modes and what they "
    "miss\n"
    "                          (default; the sample rabbit: a tenth of the bytes), or the paper's "
    "columns (with "
    "--wavelet,\n"
    "                          --unlifted, --threshold, --constraint-level, --table-mb, "
    "--reciprocity raw,\n"
    "                          --epsilon 0 or --modes 0; of zones unless split is asked for)\n"
    "  --epsilon E             relative threshold, 0 <= E < 1 (default 0.05; 0 keeps everything)\n"
    "  --threshold column|global   relative to the largest block of each column (the paper's "
    "rule),\n"
    "                          or of all columns: fewer blocks at the same RMS error\n"
    "  --wavelet linear|butterfly  --unlifted: without the lifting step\n"
    "  --constraint-level C    Green's functions of constraint levels 0 to C only: for large "
    "models\n"
    "  --detail MESH           a finer mesh of the same body to show: a displaced subdivision "
    "surface\n"
    "  --detail-levels K       Loop steps of that surface, 1 to 3 (default 1)\n"
    "  --table-mb M            most megabytes of the paper's dense compliance tables, coarse "
    "levels "
    "first (default 0)\n"
    "  --modes N               modes of the regular part that contact uses, 0 to 128 (default "
    "56);\n"
    "                          0: a body that cannot be touched\n"
    "  --storage f32|f16       how columns are stored (default f16 in split form, else f32)\n"
    "  --reciprocity enforce|raw   raw keeps the unsymmetric collocation result (study only)\n"
    "  --compliance FILE.npy   use this compliance matrix (m/N) in place of the solver\n"
    "  --save-mesh OUT.obj     write the mesh that is baked\n"
    "  --threads N             default: all processors\n"
    "\n"
    "IN.model holds the same keys, one per line without dashes, and 'mesh FILE' relative to "
    "itself.\n"
    "For a multizone model also (blobs/MODELS.md): zone NAME, whose keys follow; frame X Y Z RX RY "
    "RZ; cut "
    "A B\n"
    "POINT NORMAL; labels FILE; seam A B [NODES_A NODES_B]; seam-modes N (fewer make smaller "
    "blobs);\n"
    "joint or closure NAME fixed|revolute|prismatic PARENT CHILD, then axis, origin, limits.\n"
    "For a body that moves (blobs/MODELS.md): --tets N [N ..], about the nodes of each resolution "
    "from "
    "coarse "
    "to\n"
    "fine, or --tets-from FILE.mesh [..]; --damping S and --drag 1/S (default 0). Options with "
    "several values "
    "belong\n"
    "into a model file.\n";

#define BAKE_OPTIONS                                                                               \
    BODY_OPTIONS, TET_OPTIONS, {"-o", 1}, {"--each", 0}, {"--wavelet", 1}, {"--unlifted", 0},      \
        {"--form", 1}, {"--epsilon", 1}, {"--threshold", 1}, {"--table-mb", 1},                    \
        {"--constraint-level", 1}, {"--storage", 1}, {"--reciprocity", 1}, {"--save-mesh", 1},     \
        {"--detail", 1}, {"--modes", 1}, {                                                         \
        "--detail-levels", 1                                                                       \
    }

static const option options[] = {BAKE_OPTIONS, {NULL, 0}};
static const option file_options[] = {BAKE_OPTIONS, ZONE_OPTIONS, {NULL, 0}};

typedef struct {
    body_spec body;
    zone_model zones;
    tet_model tets;
    const char *input, *output, *save_mesh, *detail;
    bool each, half, storage_given, raw, level_chosen, in_file;
    enum { FORM_OF_OPTIONS, FORM_SPLIT, FORM_WAVELET } form;
    const char *wavelet_option; /* one that only the paper's columns have; NULL: none was given */
    uint32_t constraint_level, detail_levels, modes;
    double epsilon, table_mb;
    wavelet wavelet;
    threshold_rule rule;
} bake_spec;

/* In a model file the zone above is meant, on the command line all of them. */
static bool take_body_option(bake_spec *s, const argument *a) {
    if (s->in_file) return body_option(zone_body(&s->zones, &s->body), a);
    for (uint32_t i = 0; i < s->zones.zones; i++) (void)body_option(&s->zones.zone[i].body, a);
    return body_option(&s->body, a);
}

/* Options that only the paper's columns have. */
static bool is_of_wavelets(const argument *a) {
    static const char *const names[] = {"--wavelet", "--unlifted", "--threshold",
                                        "--constraint-level", NULL};
    if (a->option == NULL) return false;
    for (size_t i = 0; names[i] != NULL; i++) {
        if (strcmp(a->option, names[i]) == 0) return true;
    }
    return (strcmp(a->option, "--reciprocity") == 0 && strcmp(a->value[0], "raw") == 0) ||
           (strcmp(a->option, "--table-mb") == 0 && strcmp(a->value[0], "0") != 0);
}

static void set_option(void *context, const argument *a) {
    static const char *const forms[] = {"split", "wavelet", NULL};
    static const char *const wavelets[] = {"linear", "butterfly", NULL};
    static const char *const rules[] = {"column", "global", NULL};
    static const char *const storages[] = {"f32", "f16", NULL};
    static const char *const reciprocities[] = {"enforce", "raw", NULL};
    bake_spec *s = context;
    const char *o = a->option;
    if (is_of_wavelets(a)) s->wavelet_option = o;
    if (o == NULL) {
        if (s->input != NULL) die(EXIT_USAGE, "one input mesh, not also '%s'", a->value[0]);
        s->input = a->value[0];
    } else if (zone_option(&s->zones, &s->body, a) || tet_option(&s->tets, &s->body, a) ||
               take_body_option(s, a)) {
        return;
    } else if (strcmp(o, "-o") == 0) {
        s->output = a->value[0];
    } else if (strcmp(o, "--each") == 0) {
        s->each = true;
    } else if (strcmp(o, "--form") == 0) {
        s->form = arg_word(a, forms) == 0 ? FORM_SPLIT : FORM_WAVELET;
    } else if (strcmp(o, "--wavelet") == 0) {
        s->wavelet.kind = arg_word(a, wavelets) == 1 ? WAVELET_BUTTERFLY : WAVELET_LINEAR;
    } else if (strcmp(o, "--unlifted") == 0) {
        s->wavelet.lifted = false;
    } else if (strcmp(o, "--threshold") == 0) {
        s->rule = arg_word(a, rules) == 1 ? THRESHOLD_GLOBAL : THRESHOLD_COLUMN;
    } else if (strcmp(o, "--table-mb") == 0) {
        s->table_mb = arg_double(a, 0);
        if (!(s->table_mb >= 0 && s->table_mb <= 4000)) {
            die(EXIT_USAGE, "%s: %s is out of range: need 0 to 4000", a->where, a->value[0]);
        }
    } else if (strcmp(o, "--detail") == 0) {
        s->detail = body_path(&s->body, a->value[0]);
    } else if (strcmp(o, "--detail-levels") == 0) {
        s->detail_levels = arg_u32(a, 0, 1, 3);
    } else if (strcmp(o, "--constraint-level") == 0) {
        s->constraint_level = arg_u32(a, 0, 0, PALP_MAX_LEVELS - 1);
        s->level_chosen = true;
    } else if (strcmp(o, "--epsilon") == 0) {
        s->epsilon = arg_double(a, 0);
        if (!(s->epsilon >= 0 && s->epsilon < 1)) {
            die(EXIT_USAGE, "%s: %s is out of range: need 0 <= value < 1", a->where, a->value[0]);
        }
    } else if (strcmp(o, "--modes") == 0) {
        s->modes = arg_u32(a, 0, 0, PALP_MAX_MODES);
        s->modes = (s->modes + PALP_MODE_LANES - 1) / PALP_MODE_LANES * PALP_MODE_LANES;
    } else if (strcmp(o, "--storage") == 0) {
        s->half = arg_word(a, storages) == 1;
        s->storage_given = true;
    } else if (strcmp(o, "--reciprocity") == 0) {
        s->raw = arg_word(a, reciprocities) == 1;
    } else if (strcmp(o, "--save-mesh") == 0) {
        s->save_mesh = body_path(&s->body, a->value[0]);
    }
}

/* The command line; when it names a model file, that file first and the command line over it. */
static bake_spec read_spec(int argc, char **argv) {
    const bake_spec defaults = {.body = body_defaults,
                                .epsilon = 0.05,
                                .detail_levels = 1,
                                .modes = BUILD_MODES,
                                .wavelet = {.kind = WAVELET_LINEAR, .lifted = true}};
    bake_spec s = defaults;
    args_parse(argc, argv, options, help, set_option, &s);
    const char *input = s.input;
    const char *dot = input != NULL ? strrchr(input, '.') : NULL;
    if (dot == NULL || strcmp(dot, ".model") != 0) {
        if (input != NULL) s.body.mesh_path = input;
        return s;
    }
    s = defaults;
    s.body.folder = body_folder(input);
    s.in_file = true;
    args_parse_file(input, file_options, set_option, &s);
    s.body.folder = NULL;
    s.in_file = false;
    args_parse(argc, argv, options, help, set_option, &s);
    if (s.body.mesh_path == NULL && s.zones.zones == 0 && s.tets.levels == 0)
        die(EXIT_USAGE, "%s: no 'mesh FILE' line", input);
    return s;
}

static uint32_t choose_constraint_level(const bake_spec *s, const mesh *m, const domains *d) {
    const palp_domain *f = &d->domain[PALP_FREE].view;
    uint32_t level = f->levels - 1;
    if (s->level_chosen) {
        if (s->constraint_level > level) {
            die(EXIT_USAGE, "--constraint-level: the mesh has the levels 0 to %" PRIu32, level);
        }
        level = s->constraint_level;
    }
    double columns = level + 1 < f->levels ? f->level_start[level + 1] : m->vertices;
    body_require_memory(&s->body, m, columns, f->levels > 1);
    return level;
}

/* How a body's Green's functions are stored, when that was left to the other options. */
static void choose_form(bake_spec *s) {
    const char *only = s->wavelet_option;
    if (!(s->epsilon > 0)) only = "--epsilon 0";
    if (s->modes == 0) only = "--modes 0";
    if (s->form == FORM_SPLIT && only != NULL)
        die(EXIT_USAGE,
            "--form split cannot be had with %s, which is for the paper's columns: leave one of "
            "both out",
            only);
    if (s->form == FORM_OF_OPTIONS)
        s->form = only != NULL || s->zones.zones > 0 ? FORM_WAVELET : FORM_SPLIT;
    if (!s->storage_given) s->half = s->form == FORM_SPLIT;
}

/* Most memory that the process has had, in bytes. */
static double peak_memory(void) {
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    return 1024.0 * (double)usage.ru_maxrss;
}

static void report(FILE *f, const built *b, const detail_data *detail, double seconds) {
    const palp_meta *m = &b->meta;
    palp_blob blob;
    if (palp_blob_open(&blob, b->bytes, b->size) != PALP_OK) return;
    double columns = blob.level[m->constraint_level].nodes;
    double rows = m->domain_nodes[PALP_FREE];
    fprintf(f,
            "nodes                 %" PRIu32 " (%" PRIu32 " free, %" PRIu32 " fixed), %" PRIu32
            " level(s)\n",
            m->nodes, m->domain_nodes[PALP_FREE], m->domain_nodes[PALP_FIXED], m->levels);
    fprintf(f, "reciprocity residual  %.4f %%%s\n", 100 * (double)m->reciprocity_residual,
            (m->flags & PALP_META_SYMMETRIC) != 0 ? ", enforced" : ", kept (raw)");
    if ((m->flags & PALP_META_REACTIONS) != 0) {
        fprintf(f, "equilibrium residual  %.4f %%\n", 100 * (double)m->equilibrium_residual);
    }
    fprintf(f, "compression           %.2f at epsilon %g: RMS %.5f, MAX %.5f",
            rows * columns / (double)m->free_blocks, (double)m->epsilon, (double)m->rms_error,
            (double)m->max_error);
    if ((m->flags & PALP_META_SPLIT) != 0)
        fprintf(f, "; worst column %.5f, worst own block %.5f", b->worst_column, b->worst_own);
    fprintf(f, "\n");
    fprintf(f, "node stiffness        %.4g to %.4g N/m\n", (double)m->stiffness_min_N_per_m,
            (double)m->stiffness_max_N_per_m);
    fprintf(f, "constraint levels    ");
    for (uint32_t l = 0; l <= m->constraint_level; l++) {
        fprintf(f, " %" PRIu32 ": %" PRIu32 " nodes%s", l, blob.level[l].nodes,
                blob.level[l].table != NULL ? " (table)" : "");
    }
    fprintf(f, "\n");
    if (m->modes > 0) {
        fprintf(f,
                "contact               %" PRIu32
                " modes, %.2g of the compliance left over; %zu bytes\n",
                m->modes, b->left_over,
                6 * (size_t)m->nodes * m->modes + 12 * (size_t)m->triangles + 4 * (size_t)m->modes);
        fprintf(f, "levels of contact    ");
        for (uint32_t l = 0; l < PALP_CONTACT_LEVELS && b->levels.count > 0; l++)
            fprintf(f, " %" PRIu32 ": %.1f (%.1f)%s", l, 100 * b->levels.mean[l],
                    100 * b->levels.worst[l], l + 1 < PALP_CONTACT_LEVELS ? "," : "");
        fprintf(f, " %% off the finest in the mean (at worst) of %" PRIu32 " presses\n",
                b->levels.count);
    }
    if (detail->vertices > 0) {
        fprintf(f,
                "detail                %" PRIu32
                " vertices, %.3g m from the finer mesh in the mean, "
                "%.3g m at most\n",
                detail->vertices, detail->mean, detail->largest);
    }
    fprintf(f, "blob                  %zu bytes\n", b->size);
    fprintf(f, "time                  %.1f s on %" PRIu32 " thread(s), peak memory %.2f GB\n",
            seconds, thread_count(), peak_memory() * 1e-9);
}

/* Scalars that the mesh file and the options give the blob. */
static palp_meta describe(const bake_spec *s) {
    palp_meta meta = {.young_Pa = (float)s->body.young_Pa,
                      .poisson = (float)s->body.poisson,
                      .density_kg_m3 = (float)s->body.density};
    size_t bytes;
    char *file = read_file(s->body.mesh_path, &bytes);
    sha256(file, bytes, meta.mesh_sha256);
    free(file);
    return meta;
}

static int bake_zones(bake_spec *s, output *out, double start) {
    FILE *f = strcmp(s->output, "-") == 0 ? stderr : stdout;
    choose_form(s);
    build_options build = {.wavelet = s->wavelet,
                           .compress = {.epsilon = s->epsilon, .rule = s->rule, .half = s->half},
                           .table_bytes = s->table_mb * 1e6,
                           .split = s->form == FORM_SPLIT,
                           .modes = s->modes,
                           .presses = BUILD_PRESSES};
    if (s->raw || s->detail != NULL || s->level_chosen)
        die(EXIT_USAGE, "--reciprocity raw, --detail and --constraint-level are for one zone only");
    size_t size;
    uint8_t *bytes = zone_bake(&s->zones, &s->body, &build, s->input, s->save_mesh, f, &size);
    if (fwrite(bytes, 1, size, out->file) != size) die(EXIT_WORK, "cannot write %s", s->output);
    commit_output(out);
    fprintf(f, "time                  %.1f s on %" PRIu32 " thread(s), peak memory %.2f GB\n",
            now_s() - start, thread_count(), peak_memory() * 1e-9);
    return EXIT_SUCCESS;
}

static int bake_tets(const bake_spec *s, output *out, double start) {
    FILE *f = strcmp(s->output, "-") == 0 ? stderr : stdout;
    if (s->zones.zones > 0) die(EXIT_USAGE, "a model has zones or tets, not both");
    if (s->raw || s->detail != NULL || s->level_chosen || s->half || s->body.compliance != NULL)
        die(EXIT_USAGE, "a model with tets has no Green's functions to store, compress or show");
    if (s->save_mesh != NULL && strcmp(s->save_mesh, "-") == 0)
        die(EXIT_USAGE, "--save-mesh: several meshes need a name, not '-'");
    size_t size;
    uint8_t *bytes = tet_bake(&s->tets, &s->body, s->save_mesh, f, &size);
    if (fwrite(bytes, 1, size, out->file) != size) die(EXIT_WORK, "cannot write %s", s->output);
    commit_output(out);
    fprintf(f, "time                  %.1f s on %" PRIu32 " thread(s)\n", now_s() - start,
            thread_count());
    free(bytes);
    return EXIT_SUCCESS;
}

/* One elastostatic body into one blob. */
static void bake_body(bake_spec *s, const char *path, output *out, double start) {
    s->body.anywhere = true;
    mesh m = body_mesh(&s->body);
    if (s->save_mesh != NULL) mesh_save_obj(&m, s->save_mesh);
    body_recentre(&s->body, &m);
    uint8_t *fixed = body_fixed(&s->body, &m);
    double *area = allocate(m.vertices, sizeof *area);
    double(*normal)[3] = allocate(m.vertices, sizeof *normal);
    mesh_nodal(&m, area, normal);
    choose_form(s);
    build_options build = {.wavelet = s->wavelet,
                           .compress = {.epsilon = s->epsilon, .rule = s->rule, .half = s->half},
                           .table_bytes = s->table_mb * 1e6,
                           .raw = s->raw,
                           .split = s->form == FORM_SPLIT,
                           .modes = s->modes,
                           .presses = BUILD_PRESSES};
    domains d = domains_build(&m, fixed, area, build.wavelet);
    build.constraint_level = choose_constraint_level(s, &m, &d);
    detail_data detail = {.vertices = 0};
    if (s->detail != NULL) {
        mesh fine = mesh_load(s->detail);
        mesh_place(&fine, s->body.choice.unit_m, s->body.origin);
        detail = detail_build(&m, s->detail_levels, &fine);
        mesh_free(&fine);
        build.detail = &detail;
    }
    greens g = body_greens(&s->body, &m, fixed, &d, build.constraint_level, s->raw);
    built b = blob_build(&m, &g, &d, area, normal, describe(s), &build);
    if (fwrite(b.bytes, 1, b.size, out->file) != b.size) die(EXIT_WORK, "cannot write %s", path);
    commit_output(out);
    double size[3];
    mesh_extent(&m, size);
    fprintf(strcmp(path, "-") == 0 ? stderr : stdout,
            "size                  %.3g x %.3g x %.3g cm\n", 100 * size[0], 100 * size[1],
            100 * size[2]);
    report(strcmp(path, "-") == 0 ? stderr : stdout, &b, &detail, now_s() - start);
    detail_free(&detail);
    domains_free(&d);
    mesh_free(&m);
    void *owned[] = {fixed, area, normal, g.m, b.bytes};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
}

/* Every component as a body of its own: OUT-0.palp, OUT-1.palp, .. */
static int bake_each(bake_spec *s) {
    if (s->body.choice.one || s->save_mesh != NULL || s->detail != NULL ||
        strcmp(s->output, "-") == 0)
        die(EXIT_USAGE, "--each makes several blobs: without --largest, --component, --save-mesh, "
                        "--detail and -o -");
    for (int k = 0; k < s->body.fix_count; k++) {
        if (s->body.fixes[k].kind == FIX_NODES)
            die(EXIT_USAGE, "--each: bodies have different nodes: use --fix-below, --fix-above or "
                            "--fix-box");
    }
    mesh m = mesh_load_as(s->body.mesh_path, &s->body.choice,
                          s->body.as_is ? HOLES_AS_IS : HOLES_REMESHED);
    mesh_components c = mesh_find_components(&m);
    mesh_refuse_cavities(&m, &c, s->body.mesh_path);
    for (uint32_t i = 0; i < c.count; i++) {
        mesh one = mesh_copy(&m);
        mesh_take_component(&one, &c, i);
        if (!body_may_hold(&s->body, &one))
            die(EXIT_WORK,
                "%s: no node of component %" PRIu32
                " is fixed: fix it, or leave it out (palp check lists them)",
                s->body.mesh_path, i);
        mesh_free(&one);
    }
    for (uint32_t i = 0; i < c.count; i++) {
        char path[4096];
        numbered_path(s->output, (int)i, path, sizeof path);
        s->body.choice.one = true;
        s->body.choice.component = i;
        memset(s->body.origin, 0, sizeof s->body.origin);
        printf("%s%s\n", i > 0 ? "\n" : "", path);
        output out = open_output(path);
        bake_body(s, path, &out, now_s());
    }
    mesh_components_free(&c);
    mesh_free(&m);
    return EXIT_SUCCESS;
}

int command_bake(int argc, char **argv) {
    double start = now_s();
    bake_spec s = read_spec(argc, argv);
    if (s.input == NULL) die(EXIT_USAGE, "no input mesh (--help shows the usage)");
    if (s.output == NULL) die(EXIT_USAGE, "no output: add -o OUT.palp");
    if (s.zones.zones == 0 && s.tets.levels == 0) body_require(&s.body);
    if (s.each && (s.tets.levels > 0 || s.zones.zones > 0))
        die(EXIT_USAGE, "--each is for bodies without zones that do not move");
    if (s.each) return bake_each(&s);
    output out = open_output(s.output);
    if (s.tets.levels > 0) return bake_tets(&s, &out, start);
    if (s.zones.zones > 0) return bake_zones(&s, &out, start);

    bake_body(&s, s.output, &out, start);
    return EXIT_SUCCESS;
}
