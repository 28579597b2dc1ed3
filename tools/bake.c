/* SPDX-License-Identifier: MIT */
#include "args.h"
#include "build.h"
#include "commands.h"
#include "parallel.h"
#include "remesh.h"
#include "sha256.h"
#include "util.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

static const char help[] =
    "usage: palp bake IN.(obj|stl|ply|model) -o OUT.palp --young PA --poisson NU --fix-... "
    "[OPTIONS]\n"
    "\n"
    "Computes the Green's functions of an elastic body held at its fixed nodes and writes them,\n"
    "wavelet-compressed, as a blob.\n"
    "\n"
    "  -o OUT.palp             the blob\n"
    "  --levels N              remesh to N refinements of a coarse base first (default 3)\n"
    "  --as-is                 use the mesh exactly as given\n"
    "  --loop N                refine a control mesh by N steps of Loop's scheme instead of "
    "remeshing\n"
    "  --young PA              Young's modulus\n"
    "  --poisson NU            Poisson's ratio, -1 < NU < 0.5\n"
    "  --density KG/M3         default 1000\n"
    "  --fix-below AXIS VALUE  fix the nodes with a coordinate at most VALUE   (repeatable)\n"
    "  --fix-above AXIS VALUE  fix the nodes with a coordinate at least VALUE  (repeatable)\n"
    "  --fix-box X0 Y0 Z0 X1 Y1 Z1                                             (repeatable)\n"
    "  --fix-nodes FILE        one 0-based node per line, numbers of the mesh that is baked\n"
    "  --epsilon E             relative threshold, 0 <= E < 1 (default 0.05; 0 keeps everything)\n"
    "  --threshold column|global   relative to the largest block of each column (the paper's "
    "rule),\n"
    "                          or of all columns: fewer blocks at the same RMS error\n"
    "  --wavelet linear|butterfly  --unlifted: without the lifting step\n"
    "  --constraint-level C    Green's functions of constraint levels 0 to C only: for large "
    "models\n"
    "  --table-mb M            most megabytes of dense compliance tables, coarse levels first "
    "(default 8)\n"
    "  --storage f32|f16       how columns are stored (default f32)\n"
    "  --reciprocity enforce|raw   raw keeps the unsymmetric collocation result (study only)\n"
    "  --compliance FILE.npy   use this compliance matrix (m/N) in place of the solver\n"
    "  --save-mesh OUT.obj     write the mesh that is baked\n"
    "  --threads N             default: all processors\n"
    "\n"
    "IN.model holds the same keys, one per line without dashes, and 'mesh FILE' relative to "
    "itself.\n";

static const option options[] = {
    {"-o", 1},          {"--mesh", 1},        {"--levels", 1},
    {"--as-is", 0},     {"--loop", 1},        {"--young", 1},
    {"--poisson", 1},   {"--density", 1},     {"--fix-below", 2},
    {"--fix-above", 2}, {"--fix-box", 6},     {"--fix-nodes", 1},
    {"--wavelet", 1},   {"--unlifted", 0},    {"--epsilon", 1},
    {"--threshold", 1}, {"--table-mb", 1},    {"--constraint-level", 1},
    {"--storage", 1},   {"--reciprocity", 1}, {"--compliance", 1},
    {"--save-mesh", 1}, {"--threads", 1},     {NULL, 0},
};

#define MAX_FIXES 64

typedef enum { FIX_BELOW, FIX_ABOVE, FIX_BOX, FIX_NODES } fix_kind;
typedef struct {
    fix_kind kind;
    int axis;
    double value[6];
    const char *file;
} fix;

typedef struct {
    const char *input, *mesh_path, *output, *save_mesh, *compliance;
    const char *folder; /* of the model file, for relative paths */
    bool as_is, half, raw, levels_given, level_chosen;
    uint32_t levels, loop, constraint_level;
    double young_Pa, poisson, density, epsilon, table_mb;
    wavelet wavelet;
    threshold_rule rule;
    fix fixes[MAX_FIXES];
    int fix_count;
} bake_spec;

static const char *in_folder(const bake_spec *s, const char *path) {
    if (s->folder == NULL || path[0] == '/') return path;
    size_t n = strlen(s->folder) + strlen(path) + 2;
    char *joined = allocate(n, 1);
    snprintf(joined, n, "%s%s", s->folder, path);
    return joined;
}

static void add_fix(bake_spec *s, const argument *a, fix_kind kind) {
    if (s->fix_count == MAX_FIXES) die(EXIT_USAGE, "more than %d --fix options", MAX_FIXES);
    fix *f = &s->fixes[s->fix_count++];
    f->kind = kind;
    if (kind == FIX_NODES) {
        f->file = in_folder(s, a->value[0]);
    } else if (kind == FIX_BOX) {
        for (int k = 0; k < 6; k++) f->value[k] = arg_double(a, k);
    } else {
        f->axis = arg_axis(a, 0);
        f->value[0] = arg_double(a, 1);
    }
}

static void set_option(void *context, const argument *a) {
    static const char *const wavelets[] = {"linear", "butterfly", NULL};
    static const char *const rules[] = {"column", "global", NULL};
    static const char *const storages[] = {"f32", "f16", NULL};
    static const char *const reciprocities[] = {"enforce", "raw", NULL};
    bake_spec *s = context;
    const char *o = a->option;
    if (o == NULL) {
        if (s->input != NULL) die(EXIT_USAGE, "one input mesh, not also '%s'", a->value[0]);
        s->input = a->value[0];
    } else if (strcmp(o, "-o") == 0) {
        s->output = a->value[0];
    } else if (strcmp(o, "--mesh") == 0) {
        s->mesh_path = in_folder(s, a->value[0]);
    } else if (strcmp(o, "--levels") == 0) {
        s->levels = arg_u32(a, 0, 0, 8);
        s->levels_given = true;
    } else if (strcmp(o, "--as-is") == 0) {
        s->as_is = true;
    } else if (strcmp(o, "--loop") == 0) {
        s->loop = arg_u32(a, 0, 1, 8);
        s->as_is = true;
    } else if (strcmp(o, "--young") == 0) {
        s->young_Pa = arg_between(a, 0, 1e15);
    } else if (strcmp(o, "--poisson") == 0) {
        s->poisson = arg_between(a, -1, 0.5);
    } else if (strcmp(o, "--density") == 0) {
        s->density = arg_between(a, 0, 1e6);
    } else if (strcmp(o, "--fix-below") == 0) {
        add_fix(s, a, FIX_BELOW);
    } else if (strcmp(o, "--fix-above") == 0) {
        add_fix(s, a, FIX_ABOVE);
    } else if (strcmp(o, "--fix-box") == 0) {
        add_fix(s, a, FIX_BOX);
    } else if (strcmp(o, "--fix-nodes") == 0) {
        add_fix(s, a, FIX_NODES);
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
    } else if (strcmp(o, "--constraint-level") == 0) {
        s->constraint_level = arg_u32(a, 0, 0, PALP_MAX_LEVELS - 1);
        s->level_chosen = true;
    } else if (strcmp(o, "--epsilon") == 0) {
        s->epsilon = arg_double(a, 0);
        if (!(s->epsilon >= 0 && s->epsilon < 1)) {
            die(EXIT_USAGE, "%s: %s is out of range: need 0 <= value < 1", a->where, a->value[0]);
        }
    } else if (strcmp(o, "--storage") == 0) {
        s->half = arg_word(a, storages) == 1;
    } else if (strcmp(o, "--reciprocity") == 0) {
        s->raw = arg_word(a, reciprocities) == 1;
    } else if (strcmp(o, "--compliance") == 0) {
        s->compliance = in_folder(s, a->value[0]);
    } else if (strcmp(o, "--save-mesh") == 0) {
        s->save_mesh = in_folder(s, a->value[0]);
    } else if (strcmp(o, "--threads") == 0) {
        set_threads(arg_u32(a, 0, 1, 64));
    }
}

/* The command line; when it names a model file, that file first and the command line over it. */
static bake_spec read_spec(int argc, char **argv) {
    const bake_spec defaults = {.levels = 3,
                                .poisson = (double)NAN,
                                .density = 1000,
                                .epsilon = 0.05,
                                .table_mb = 8,
                                .wavelet = {.kind = WAVELET_LINEAR, .lifted = true}};
    bake_spec s = defaults;
    args_parse(argc, argv, options, help, set_option, &s);
    const char *input = s.input;
    const char *dot = input != NULL ? strrchr(input, '.') : NULL;
    if (dot == NULL || strcmp(dot, ".model") != 0) {
        if (input != NULL) s.mesh_path = input;
        return s;
    }
    s = defaults;
    char *folder = copy_string(input);
    char *slash = strrchr(folder, '/');
    if (slash != NULL) slash[1] = '\0';
    s.folder = slash != NULL ? folder : NULL;
    args_parse_file(input, options, set_option, &s);
    s.folder = NULL;
    args_parse(argc, argv, options, help, set_option, &s);
    if (s.mesh_path == NULL) die(EXIT_USAGE, "%s: no 'mesh FILE' line", input);
    return s;
}

static void require_complete(const bake_spec *s) {
    if (s->input == NULL) die(EXIT_USAGE, "no input mesh (--help shows the usage)");
    if (s->output == NULL) die(EXIT_USAGE, "no output: add -o OUT.palp");
    if (!(s->young_Pa > 0)) die(EXIT_USAGE, "no stiffness: add --young PA");
    if (isnan(s->poisson)) die(EXIT_USAGE, "no Poisson's ratio: add --poisson NU");
    if (s->fix_count == 0)
        die(EXIT_USAGE, "no fixed node: add --fix-below, --fix-above, --fix-box or --fix-nodes");
    if (s->as_is && s->levels_given)
        die(EXIT_USAGE, "--levels remeshes: leave it out with --as-is or --loop");
}

/* ---- fixed nodes ---- */

static void fix_listed(const fix *f, uint32_t nodes, uint8_t *fixed) {
    size_t bytes;
    char *text = read_file(f->file, &bytes);
    size_t line = 0;
    for (char *p = text; p != NULL;) {
        char *next = strchr(p, '\n');
        if (next != NULL) *next++ = '\0';
        line++;
        p[strcspn(p, "#\r")] = '\0';
        p += strspn(p, " \t");
        size_t length = strlen(p);
        while (length > 0 && (p[length - 1] == ' ' || p[length - 1] == '\t')) p[--length] = '\0';
        uint32_t node;
        if (*p != '\0') {
            if (!parse_u32(p, &node) || node >= nodes) {
                die(EXIT_USAGE, "%s:%zu: '%s' is not a node from 0 to %" PRIu32, f->file, line, p,
                    nodes - 1);
            }
            fixed[node] = 1;
        }
        p = next;
    }
    free(text);
}

static bool selects(const fix *f, const double x[3]) {
    if (f->kind == FIX_BELOW) return x[f->axis] <= f->value[0];
    if (f->kind == FIX_ABOVE) return x[f->axis] >= f->value[0];
    for (int k = 0; k < 3; k++) {
        if (x[k] < fmin(f->value[k], f->value[k + 3]) || x[k] > fmax(f->value[k], f->value[k + 3]))
            return false;
    }
    return true;
}

/* Whether the fixed nodes lie on one line, about which the body could turn freely. */
static bool collinear(const mesh *m, const uint8_t *fixed) {
    const double *a = NULL, *b = NULL;
    double reach = 0, off = 0;
    for (int pass = 0; pass < 2; pass++) {
        for (uint32_t i = 0; i < m->vertices; i++) {
            if (fixed[i] == 0) continue;
            if (a == NULL) a = m->x[i];
            if (pass == 0 && v_distance(a, m->x[i]) > reach) {
                reach = v_distance(a, m->x[i]);
                b = m->x[i];
            }
            if (pass == 1 && b != NULL) {
                double n[3];
                triangle_normal(a, b, m->x[i], n);
                off = fmax(off, v_norm(n) / reach);
            }
        }
    }
    return b == NULL || off < 1e-6 * mesh_diagonal(m);
}

static uint8_t *choose_fixed(const bake_spec *s, const mesh *m) {
    uint8_t *fixed = allocate(m->vertices, 1);
    for (int k = 0; k < s->fix_count; k++) {
        const fix *f = &s->fixes[k];
        if (f->kind == FIX_NODES) {
            fix_listed(f, m->vertices, fixed);
            continue;
        }
        for (uint32_t i = 0; i < m->vertices; i++) fixed[i] |= selects(f, m->x[i]) ? 1 : 0;
    }
    uint32_t count = 0;
    for (uint32_t i = 0; i < m->vertices; i++) count += fixed[i];
    double lo[3] = {HUGE_VAL, HUGE_VAL, HUGE_VAL}, hi[3] = {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
    for (uint32_t i = 0; i < m->vertices; i++) {
        for (int k = 0; k < 3; k++) {
            lo[k] = fmin(lo[k], m->x[i][k]);
            hi[k] = fmax(hi[k], m->x[i][k]);
        }
    }
    if (count == 0) {
        die(EXIT_WORK, "no node is fixed: the mesh spans x %g..%g, y %g..%g, z %g..%g", lo[0],
            hi[0], lo[1], hi[1], lo[2], hi[2]);
    }
    if (count == m->vertices)
        die(EXIT_WORK, "all %" PRIu32 " nodes are fixed: nothing is left to touch", count);
    if (collinear(m, fixed)) {
        die(EXIT_WORK,
            "the %" PRIu32 " fixed node(s) lie on one line, so the body could turn: fix more nodes",
            count);
    }
    return fixed;
}

/* ---- the work ---- */

static mesh prepare_mesh(const bake_spec *s) {
    mesh m = mesh_load(s->mesh_path);
    if (!s->as_is) {
        mesh r = remesh(&m, s->mesh_path, s->levels, 0, NULL);
        mesh_free(&m);
        m = r;
    }
    mesh_require_closed(&m, s->mesh_path);
    for (uint32_t l = 0; l < s->loop; l++) {
        mesh finer = subdivide_loop(&m);
        mesh_free(&m);
        m = finer;
    }
    if (m.vertices > PALP_MAX_NODES) {
        die(EXIT_WORK, "%s: %" PRIu32 " vertices; a blob holds at most %u: use --levels",
            s->mesh_path, m.vertices, PALP_MAX_NODES);
    }
    return m;
}

/* Bytes that the dense matrices of a bake with that many load columns take. */
static double memory_need(const mesh *m, double columns) {
    double n = m->vertices;
    return columns < n ? 72 * n * (n + 2 * columns) * 1.05 : 3 * 72 * n * n * 1.05;
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
    double have = (double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE);
    if (memory_need(m, columns) > have) {
        die(EXIT_WORK,
            "%s: %" PRIu32
            " vertices need %.1f GB of memory, this machine has %.1f GB: use --levels%s",
            s->mesh_path, m->vertices, memory_need(m, columns) * 1e-9, have * 1e-9,
            f->levels > 1 ? ", or --constraint-level for Green's functions of coarse levels only"
                          : "");
    }
    return level;
}

static greens compute_greens(const bake_spec *s, const mesh *m, const uint8_t *fixed,
                             const domains *d, uint32_t level) {
    bool coarse = level + 1 < d->domain[PALP_FREE].view.levels;
    if (s->compliance != NULL && coarse)
        die(EXIT_USAGE, "--constraint-level is for the solver, not for --compliance");
    if (s->compliance != NULL) return greens_from_npy(s->compliance, m, fixed);
    bem_material material = {
        .young_Pa = s->young_Pa, .poisson = s->poisson, .tolerance = BEM_TOLERANCE};
    if (coarse) return greens_coarse_from_bem(m, fixed, &material, s->density, &d->h, level);
    return greens_from_bem(m, fixed, &material, s->density);
}

static void report_softening(const built *b, double epsilon) {
    if (!(b->softened > 0)) return;
    fprintf(stderr,
            "contact softened by up to %.2g of a node's own compliance, to "
            "stay passive on thin parts at epsilon %g%s\n",
            b->softened, epsilon, b->softened > 0.5 ? ": a smaller --epsilon lowers it" : "");
}

/* Most memory that the process has had, in bytes. */
static double peak_memory(void) {
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    return 1024.0 * (double)usage.ru_maxrss;
}

static void report(FILE *f, const built *b, double seconds) {
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
    fprintf(f, "compression           %.2f at epsilon %g: RMS %.5f, MAX %.5f\n",
            rows * columns / (double)m->free_blocks, (double)m->epsilon, (double)m->rms_error,
            (double)m->max_error);
    fprintf(f, "node stiffness        %.4g to %.4g N/m\n", (double)m->stiffness_min_N_per_m,
            (double)m->stiffness_max_N_per_m);
    fprintf(f, "constraint levels    ");
    for (uint32_t l = 0; l <= m->constraint_level; l++) {
        fprintf(f, " %" PRIu32 ": %" PRIu32 " nodes%s", l, blob.level[l].nodes,
                blob.level[l].table != NULL ? " (table)" : "");
    }
    fprintf(f, "\nblob                  %zu bytes\n", b->size);
    fprintf(f, "time                  %.1f s on %" PRIu32 " thread(s), peak memory %.2f GB\n",
            seconds, thread_count(), peak_memory() * 1e-9);
}

/* Scalars that the mesh file and the options give the blob. */
static palp_meta describe(const bake_spec *s) {
    palp_meta meta = {.young_Pa = (float)s->young_Pa,
                      .poisson = (float)s->poisson,
                      .density_kg_m3 = (float)s->density};
    size_t bytes;
    char *file = read_file(s->mesh_path, &bytes);
    sha256(file, bytes, meta.mesh_sha256);
    free(file);
    return meta;
}

int command_bake(int argc, char **argv) {
    double start = now_s();
    bake_spec s = read_spec(argc, argv);
    require_complete(&s);
    output out = open_output(s.output);

    mesh m = prepare_mesh(&s);
    if (s.save_mesh != NULL) mesh_save_obj(&m, s.save_mesh);
    uint8_t *fixed = choose_fixed(&s, &m);
    double *area = allocate(m.vertices, sizeof *area);
    double(*normal)[3] = allocate(m.vertices, sizeof *normal);
    mesh_nodal(&m, area, normal);
    build_options build = {.wavelet = s.wavelet,
                           .compress = {.epsilon = s.epsilon, .rule = s.rule, .half = s.half},
                           .table_bytes = s.table_mb * 1e6,
                           .raw = s.raw};
    domains d = domains_build(&m, fixed, area, build.wavelet);
    build.constraint_level = choose_constraint_level(&s, &m, &d);
    greens g = compute_greens(&s, &m, fixed, &d, build.constraint_level);
    if (g.basis_count == 0) greens_reciprocity(&g, &m, !s.raw);
    built b = blob_build(&m, &g, &d, area, normal, describe(&s), &build);
    report_softening(&b, s.epsilon);
    if (fwrite(b.bytes, 1, b.size, out.file) != b.size) die(EXIT_WORK, "cannot write %s", s.output);
    commit_output(&out);
    report(strcmp(s.output, "-") == 0 ? stderr : stdout, &b, now_s() - start);
    return EXIT_SUCCESS;
}
