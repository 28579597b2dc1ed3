/* SPDX-License-Identifier: MIT */
#include "tools/bake/body.h"
#include "port/host/parallel.h"
#include "tools/mesh/crossing.h"
#include "tools/mesh/remesh.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define SOFTEST_PA 100.0
#define STIFFEST_PA 1e12

const body_spec body_defaults = {.levels = 3, .poisson = (double)NAN, .density = 1000};

const char *body_path(const body_spec *s, const char *path) {
    if (s->folder == NULL || path[0] == '/') return path;
    size_t n = strlen(s->folder) + strlen(path) + 2;
    char *joined = allocate(n, 1);
    snprintf(joined, n, "%s%s", s->folder, path);
    return joined;
}

static void add_fix(body_spec *s, const argument *a, fix_kind kind) {
    if (s->fix_count == MAX_FIXES) die(EXIT_USAGE, "more than %d --fix options", MAX_FIXES);
    fix *f = &s->fixes[s->fix_count++];
    f->kind = kind;
    if (kind == FIX_NODES) {
        f->file = body_path(s, a->value[0]);
    } else if (kind == FIX_BOX) {
        for (int k = 0; k < 6; k++) f->value[k] = arg_double(a, k);
    } else {
        f->axis = arg_axis(a, 0);
        f->value[0] = arg_double(a, 1);
    }
}

const char *body_folder(const char *path) {
    char *folder = copy_string(path);
    char *slash = strrchr(folder, '/');
    if (slash == NULL) return NULL;
    slash[1] = '\0';
    return folder;
}

/* "20 kPa": what the second word makes of the first. */
static double pressure_unit(const argument *a) {
    static const char *const units[] = {"Pa", "kPa", "MPa", "GPa", NULL};
    static const double pascals[] = {1, 1e3, 1e6, 1e9};
    if (a->count < 2) return 1;
    argument unit = *a;
    unit.value[0] = a->value[1];
    return pascals[arg_word(&unit, units)];
}

bool body_option(body_spec *s, const argument *a) {
    const char *o = a->option;
    if (o == NULL) return false;
    if (mesh_option(&s->choice, a)) return true;
    if (strcmp(o, "--mesh") == 0) {
        s->mesh_path = body_path(s, a->value[0]);
    } else if (strcmp(o, "--levels") == 0) {
        s->levels = arg_u32(a, 0, 0, 8);
        s->levels_given = true;
    } else if (strcmp(o, "--base-faces") == 0) {
        s->base_faces = arg_u32(a, 0, 4, 1000000);
    } else if (strcmp(o, "--as-is") == 0) {
        s->as_is = true;
    } else if (strcmp(o, "--loop") == 0) {
        s->loop = arg_u32(a, 0, 1, 8);
        s->as_is = true;
    } else if (strcmp(o, "--young") == 0) {
        s->young_Pa = arg_between(a, 0, 1e15) * pressure_unit(a);
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
    } else if (strcmp(o, "--crisp") == 0) {
        s->crisp = true;
    } else if (strcmp(o, "--method") == 0) {
        static const char *const methods[] = {"galerkin", "collocation", NULL};
        s->collocation = arg_word(a, methods) == 1;
    } else if (strcmp(o, "--compliance") == 0) {
        s->compliance = body_path(s, a->value[0]);
    } else if (strcmp(o, "--threads") == 0) {
        set_threads(arg_u32(a, 0, 1, 64));
    } else {
        return false;
    }
    return true;
}

void body_require_material(const body_spec *s) {
    if (!(s->young_Pa > 0)) die(EXIT_USAGE, "no stiffness: add --young PA");
    if (isnan(s->poisson)) die(EXIT_USAGE, "no Poisson's ratio: add --poisson NU");
}

void body_warn_of_material(const body_spec *s) {
    if (s->young_Pa < SOFTEST_PA || s->young_Pa > STIFFEST_PA)
        warn("Young's modulus is %.3g Pa; gels have 1e3, rubber 1e6, steel 2e11: is it in pascals?",
             s->young_Pa);
}

void body_require(const body_spec *s) {
    body_require_material(s);
    if (s->fix_count == 0)
        die(EXIT_USAGE, "no fixed node: add --fix-below, --fix-above, --fix-box or --fix-nodes");
    if (s->as_is && s->levels_given)
        die(EXIT_USAGE, "--levels remeshes: leave it out with --as-is or --loop");
}

/* ---- fixed nodes ---- */

uint32_t *body_node_list(const char *path, uint32_t nodes, uint32_t *count) {
    size_t bytes, number = 0, room = 0;
    char *text = read_file(path, &bytes), *cursor = text;
    uint32_t *list = NULL;
    *count = 0;
    for (char *line; (line = next_line(&cursor, &number)) != NULL;) {
        if (*line == '\0') continue;
        list = grow(list, &room, *count + 1u, sizeof *list);
        if (!parse_u32(line, &list[*count]) || list[*count] >= nodes) {
            die(EXIT_USAGE, "%s:%zu: '%s' is not a node from 0 to %" PRIu32, path, number, line,
                nodes - 1);
        }
        (*count)++;
    }
    free(text);
    return list;
}

static void fix_listed(const fix *f, uint32_t nodes, uint8_t *fixed) {
    uint32_t count, *list = body_node_list(f->file, nodes, &count);
    for (uint32_t i = 0; i < count; i++) fixed[list[i]] = 1;
    free(list);
}

static bool selects(const body_spec *s, const fix *f, const double place[3]) {
    double x[3];
    for (int k = 0; k < 3; k++) x[k] = place[k] + s->origin[k];
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

bool body_may_hold(const body_spec *s, const mesh *m) {
    double low[3], high[3];
    mesh_bounds(m, low, high);
    for (int i = 0; i < s->fix_count; i++) {
        const fix *f = &s->fixes[i];
        bool reaches = true;
        if (f->kind == FIX_BELOW) reaches = low[f->axis] <= f->value[0];
        if (f->kind == FIX_ABOVE) reaches = high[f->axis] >= f->value[0];
        for (int k = 0; k < 3 && f->kind == FIX_BOX; k++)
            reaches = reaches && low[k] <= fmax(f->value[k], f->value[k + 3]) &&
                      high[k] >= fmin(f->value[k], f->value[k + 3]);
        if (reaches) return true;
    }
    return false;
}

uint8_t *body_bones(const body_spec *s, const mesh *m) {
    uint8_t *fixed = allocate(m->vertices, 1);
    for (int k = 0; k < s->fix_count; k++) {
        const fix *f = &s->fixes[k];
        if (f->kind == FIX_NODES) {
            fix_listed(f, m->vertices, fixed);
            continue;
        }
        for (uint32_t i = 0; i < m->vertices; i++) fixed[i] |= selects(s, f, m->x[i]) ? 1 : 0;
    }
    return fixed;
}

uint8_t *body_fixed(const body_spec *s, const mesh *m) {
    uint8_t *fixed = body_bones(s, m);
    uint32_t count = 0;
    for (uint32_t i = 0; i < m->vertices; i++) count += fixed[i];
    double lo[3], hi[3];
    mesh_bounds(m, lo, hi);
    for (int k = 0; k < 3; k++) {
        lo[k] += s->origin[k];
        hi[k] += s->origin[k];
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

mesh body_mesh(const body_spec *s) {
    mesh m = mesh_load_as(s->mesh_path, &s->choice, s->as_is ? HOLES_AS_IS : HOLES_REMESHED);
    if (!s->anywhere) require_near_origin(m.x, m.vertices, s->mesh_path);
    if (!s->as_is) {
        remesh_report report;
        mesh r = remesh(&m, s->mesh_path, s->levels, s->base_faces, &report);
        remesh_warn(&report, s->mesh_path);
        mesh_free(&m);
        m = r;
    }
    mesh_require_closed(&m, s->mesh_path);
    mesh_warn_of_size(&m, s->mesh_path);
    uint32_t crossing = s->as_is ? mesh_self_intersection(&m) : UINT32_MAX;
    if (crossing != UINT32_MAX)
        warn("%s: the surface crosses itself near (%.4g, %.4g, %.4g), triangle %" PRIu32
             " (0-based): what is felt there is not a body",
             s->mesh_path, m.x[m.t[crossing][0]][0], m.x[m.t[crossing][0]][1],
             m.x[m.t[crossing][0]][2], crossing);
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

#define FAR_SIZES 16.0 /* single precision has 2^-24 of the distance */

void body_recentre(body_spec *s, mesh *m) {
    double low[3], high[3], farthest = 0;
    mesh_bounds(m, low, high);
    for (int k = 0; k < 3; k++) farthest = fmax(farthest, fmax(fabs(low[k]), fabs(high[k])));
    if (farthest <= FAR_SIZES * mesh_diagonal(m)) return;
    for (int k = 0; k < 3; k++) s->origin[k] = 0.5 * (low[k] + high[k]);
    for (uint32_t i = 0; i < m->vertices; i++) v_sub(m->x[i], s->origin, m->x[i]);
    warn("%s: the body lies %.3g m from the origin: the blob has its own at (%.9g, %.9g, %.9g) of "
         "the "
         "file, the middle of the body",
         s->mesh_path, farthest, s->origin[0], s->origin[1], s->origin[2]);
}

void body_require_memory(const body_spec *s, const mesh *m, double columns, bool has_levels) {
    double n = m->vertices;
    double need = 1.05 * (columns < n ? 72 * n * (n + 2 * columns) : 4 * 72 * n * n);
    double have = (double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE);
    if (need <= have) return;
    die(EXIT_WORK,
        "%s: %" PRIu32 " vertices need %.1f GB of memory, this machine has %.1f GB: use --levels%s",
        s->mesh_path, m->vertices, need * 1e-9, have * 1e-9,
        has_levels ? ", or --constraint-level for Green's functions of coarse levels only" : "");
}

greens body_greens(const body_spec *s, const mesh *m, const uint8_t *fixed, const domains *d,
                   uint32_t level, bool raw) {
    bool coarse = level + 1 < d->domain[PALP_FREE].view.levels;
    greens g;
    body_warn_of_material(s);
    if (s->compliance != NULL && coarse)
        die(EXIT_USAGE, "--constraint-level is for the solver, not for --compliance");
    bem_material material = {.young_Pa = s->young_Pa,
                             .poisson = s->poisson,
                             .tolerance = BEM_TOLERANCE,
                             .crisp = s->crisp};
    if (s->compliance != NULL) {
        g = greens_from_npy(s->compliance, m, fixed);
    } else if (coarse) {
        return greens_coarse_from_bem(m, fixed, &material, s->density, &d->h, level);
    } else if (s->collocation || raw) {
        g = greens_from_bem(m, fixed, &material, s->density);
    } else {
        g = greens_from_galerkin(m, fixed, &material, s->density);
    }
    greens_reciprocity(&g, m, !raw);
    return g;
}
