/* SPDX-License-Identifier: MIT */
#include "args.h"
#include "blobwrite.h"
#include "commands.h"
#include "parallel.h"
#include "remesh.h"
#include "sha256.h"
#include "soften.h"
#include "util.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
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
    "  --wavelet linear        --unlifted: without the lifting step\n"
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
    bool as_is, unlifted, half, raw, levels_given;
    uint32_t levels, loop;
    double young_Pa, poisson, density, epsilon;
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
    static const char *const wavelets[] = {"linear", NULL};
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
        (void)arg_word(a, wavelets);
    } else if (strcmp(o, "--unlifted") == 0) {
        s->unlifted = true;
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
    const bake_spec defaults = {
        .levels = 3, .poisson = (double)NAN, .density = 1000, .epsilon = 0.05};
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
    double need = 3 * 72.0 * m.vertices * m.vertices * 1.05;
    double have = (double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE);
    if (need > have) {
        die(EXIT_WORK,
            "%s: %" PRIu32
            " vertices need %.1f GB of memory, this machine has %.1f GB: use --levels",
            s->mesh_path, m.vertices, need * 1e-9, have * 1e-9);
    }
    return m;
}

static void stiffness_range(const greens *g, double (*normal)[3], palp_meta *meta) {
    double low = HUGE_VAL, high = 0;
    for (uint32_t i = 0; i < g->nodes; i++) {
        if (g->fixed[i] != 0) continue;
        double compliance = 0;
        for (size_t a = 0; a < 3; a++) {
            for (size_t b = 0; b < 3; b++)
                compliance += normal[i][a] * greens_row(g, i, a)[3 * i + b] * normal[i][b];
        }
        low = fmin(low, 1 / compliance);
        high = fmax(high, 1 / compliance);
    }
    meta->stiffness_min_N_per_m = (float)low;
    meta->stiffness_max_N_per_m = (float)high;
}

/* The blob without softening is opened to measure how much it needs, then written again with it. */
static uint8_t *serialize_softened(blob_content *content, size_t *bytes) {
    palp_blob opened;
    uint8_t *blob = blob_serialize(content, bytes);
    palp_status status = palp_blob_open(&opened, blob, *bytes);
    if (status != PALP_OK) {
        die(EXIT_WORK, "the finished blob does not open: %s (are the units metres and pascals?)",
            palp_status_text(status));
    }
    float *softening = allocate(content->m->vertices, sizeof *softening);
    soften_report r = soften(&opened, softening);
    if (!(r.mu > 0)) return blob;
    fprintf(stderr,
            "contact softened by up to %.2g of a node's own compliance, to stay passive on thin "
            "parts at epsilon "
            "%g%s\n",
            r.largest, (double)content->meta.epsilon,
            r.largest > 0.5 ? ": a smaller --epsilon lowers it" : "");
    free(blob);
    content->softening = softening;
    return blob_serialize(content, bytes);
}

static greens compute_greens(const bake_spec *s, const mesh *m, const uint8_t *fixed) {
    if (s->compliance != NULL) return greens_from_npy(s->compliance, m, fixed);
    bem_material material = {
        .young_Pa = s->young_Pa, .poisson = s->poisson, .tolerance = BEM_TOLERANCE};
    return greens_from_bem(m, fixed, &material, s->density);
}

static void report(FILE *f, const palp_meta *m, size_t bytes, double seconds) {
    double free_nodes = m->domain_nodes[PALP_FREE];
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
            free_nodes * free_nodes / (double)m->free_blocks, (double)m->epsilon,
            (double)m->rms_error, (double)m->max_error);
    fprintf(f, "node stiffness        %.4g to %.4g N/m\n", (double)m->stiffness_min_N_per_m,
            (double)m->stiffness_max_N_per_m);
    fprintf(f, "blob                  %zu bytes\n", bytes);
    fprintf(f, "time                  %.1f s on %" PRIu32 " thread(s)\n", seconds, thread_count());
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
    semireg levels = semireg_detect(&m);
    greens g = compute_greens(&s, &m, fixed);
    greens_reciprocity(&g, &m, !s.raw);

    blob_content content = {.m = &m, .fixed = fixed, .area = area, .normal = normal};
    domain_data domain[PALP_DOMAINS];
    columns_data columns[PALP_DOMAINS][PALP_DOMAINS];
    for (uint32_t d = 0; d < PALP_DOMAINS; d++) {
        domain[d] = domain_build(&m, &levels, fixed, d, area, !s.unlifted);
        content.domain[d] = &domain[d];
    }
    for (uint32_t r = 0; r < PALP_DOMAINS; r++) {
        for (uint32_t c = 0; c < PALP_DOMAINS; c++) {
            if ((r != PALP_FREE || c != PALP_FREE) && !g.reactions) continue;
            columns[r][c] =
                columns_build(&g, &domain[r], &domain[c], r, c, area, s.epsilon, s.half);
            content.columns[r][c] = &columns[r][c];
        }
    }
    const columns_data *main_block = &columns[PALP_FREE][PALP_FREE];
    content.meta = (palp_meta){
        .flags = (s.unlifted ? 0 : PALP_META_LIFTED) | (s.raw ? 0 : PALP_META_SYMMETRIC) |
                 (g.gravity ? PALP_META_GRAVITY : 0) | (s.half ? PALP_META_HALF : 0) |
                 (g.reactions ? PALP_META_FIXED_COLUMNS | PALP_META_REACTIONS : 0),
        .free_blocks = main_block->blocks,
        .max_groups = main_block->max_groups,
        .young_Pa = (float)s.young_Pa,
        .poisson = (float)s.poisson,
        .density_kg_m3 = (float)s.density,
        .epsilon = (float)s.epsilon,
        .rms_error = (float)main_block->rms,
        .max_error = (float)main_block->max,
        .reciprocity_residual = (float)g.reciprocity_residual,
        .equilibrium_residual = (float)g.equilibrium_residual};
    stiffness_range(&g, normal, &content.meta);
    size_t bytes;
    char *file = read_file(s.mesh_path, &bytes);
    sha256(file, bytes, content.meta.mesh_sha256);
    free(file);
    uint8_t *blob = serialize_softened(&content, &bytes);
    if (fwrite(blob, 1, bytes, out.file) != bytes) die(EXIT_WORK, "cannot write %s", s.output);
    commit_output(&out);
    report(strcmp(s.output, "-") == 0 ? stderr : stdout, &content.meta, bytes, now_s() - start);
    return EXIT_SUCCESS;
}
