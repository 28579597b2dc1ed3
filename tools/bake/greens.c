/* SPDX-License-Identifier: MIT */
#include "tools/bake/greens.h"
#include "tools/bake/rbvp.h"
#include "tools/solver/dense.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/*
 * The RBVP as A y = R: unknown tractions p / E on U (so that both kinds of unknown have the size of
 * displacements) and displacements on F. Swapping columns of H and G in place turns them into A and
 * R.
 */
typedef struct {
    const mesh *m;
    const uint8_t *fixed;
    const bem_material *material;
    const double *area;
    double *h, *g;
    size_t h_stride, g_stride;
    size_t gravity; /* first of the three gravity columns of g */
} rbvp;

static void swap_columns(void *context, size_t row) {
    const rbvp *p = context;
    for (uint32_t j = 0; j < p->m->vertices; j++) {
        for (size_t axis = 0; axis < 3; axis++) {
            double *h = p->h + row * p->h_stride + 3 * j + axis;
            double *g = p->g + row * p->g_stride + 3 * j + axis;
            if (p->fixed[j] != 0) {
                double t = *h;
                *h = -*g * p->material->young_Pa;
                *g = -t;
            } else {
                *g /= p->area[j];
            }
        }
    }
}

/* What balances the particular stress -(b . y) I on the surface, for b = e_x, e_y, e_z: t = (b . y)
 * n. */
static void hydrostatic_traction(const void *context, const double y[3], const double normal[3],
                                 double *t) {
    const double *origin = context;
    for (size_t i = 0; i < 3; i++) {
        for (size_t axis = 0; axis < 3; axis++)
            t[3 * i + axis] = normal[i] * (y[axis] - origin[axis]);
    }
}

/* Right-hand sides of gravity: known tractions on F from `body`, known displacements on U. */
static void gravity_columns(const rbvp *p, const double *body, const double origin[3],
                            double density) {
    size_t n = p->m->vertices;
    for (size_t row = 0; row < 3 * n; row++) {
        for (size_t axis = 0; axis < 3; axis++) {
            double sum = body[3 * row + axis];
            for (size_t j = 0; j < n; j++) {
                if (p->fixed[j] == 0) continue;
                double y[3], u[3];
                v_sub(p->m->x[j], origin, y);
                particular_displacement(p->material, y, axis, u);
                /* columns of U in R hold -H already, and u^h = -u^p there */
                for (size_t k = 0; k < 3; k++) sum -= p->g[row * p->g_stride + 3 * j + k] * u[k];
            }
            p->g[row * p->g_stride + p->gravity + axis] = density * sum;
        }
    }
}

/* Adds the particular solution back: displacement on F, consistent nodal force on U. */
static void add_particular(const rbvp *p, const uint8_t *known, const double origin[3],
                           double density) {
    size_t n = p->m->vertices;
    for (size_t i = 0; i < n; i++) {
        for (size_t axis = 0; axis < 3 && p->fixed[i] == 0; axis++) {
            double y[3], u[3];
            v_sub(p->m->x[i], origin, y);
            particular_displacement(p->material, y, axis, u);
            for (size_t k = 0; k < 3; k++)
                p->g[(3 * i + k) * p->g_stride + p->gravity + axis] += density * u[k];
        }
    }
    for (uint32_t t = 0; t < p->m->triangles; t++) {
        const uint32_t *v = p->m->t[t];
        double normal[3];
        triangle_normal(p->m->x[v[0]], p->m->x[v[1]], p->m->x[v[2]], normal);
        for (size_t c = 0; c < 3; c++) {
            if (known[3 * (size_t)t + c] != 0) continue;
            for (size_t axis = 0; axis < 3; axis++) {
                double sum = 0; /* 12 times the mean of phi_c (y . e_axis) over the triangle */
                for (size_t k = 0; k < 3; k++) {
                    sum += (k == c ? 2 : 1) * (p->m->x[v[k]][axis] - origin[axis]);
                }
                for (size_t k = 0; k < 3; k++) {
                    p->g[(3 * v[c] + k) * p->g_stride + p->gravity + axis] -=
                        density * 0.5 * normal[k] * sum / 12;
                }
            }
        }
    }
}

/* Tractions become reaction forces: f = a E (p / E). */
static void forces_from_tractions(const rbvp *p) {
    for (size_t i = 0; i < p->m->vertices; i++) {
        if (p->fixed[i] == 0) continue;
        double factor = p->area[i] * p->material->young_Pa;
        for (size_t k = 0; k < 3 * p->g_stride; k++) p->g[3 * i * p->g_stride + k] *= factor;
    }
}

/*
 * The same, work-conjugate to the displacements: f_i = int phi_i t over the patches. Lumping by
 * areas would get the moment of tractions wrong, and with it reciprocity.
 */
static void consistent_forces(const rbvp *p, const uint8_t *known) {
    const mesh *m = p->m;
    size_t row = 3 * p->g_stride;
    double *t = allocate(row * m->vertices, sizeof *t);
    for (size_t i = 0; i < m->vertices; i++) {
        if (p->fixed[i] == 0) continue;
        memcpy(t + row * i, p->g + row * i, row * sizeof *t);
        memset(p->g + row * i, 0, row * sizeof *t);
    }
    for (uint32_t e = 0; e < m->triangles; e++) {
        const uint32_t *v = m->t[e];
        double n[3];
        triangle_normal(m->x[v[0]], m->x[v[1]], m->x[v[2]], n);
        for (size_t a = 0; a < 9; a++) {
            size_t i = a / 3, j = a % 3;
            if (known[3 * (size_t)e + i] != 0 || known[3 * (size_t)e + j] != 0) continue;
            double weight = (i == j ? 2 : 1) * v_norm(n) / 24 * p->material->young_Pa;
            double *to = p->g + row * v[i];
            const double *from = t + row * v[j];
            for (size_t k = 0; k < row; k++) to[k] += weight * from[k];
        }
    }
    free(t);
}

/* Largest |load + reactions| over unit nodal loads: what collocation leaves of global equilibrium.
 */
static double equilibrium_residual(const greens *g) {
    double worst = 0;
    size_t columns = g->basis_count > 0 ? g->basis_count : g->nodes;
    for (size_t j = 0; j < columns; j++) {
        if (g->basis_count == 0 && g->fixed[j] != 0) continue;
        for (size_t c = 0; c < 3; c++) {
            double sum[3] = {0};
            sum[c] = 1;
            for (size_t i = 0; i < g->nodes; i++) {
                for (size_t k = 0; k < 3 && g->fixed[i] != 0; k++)
                    sum[k] += greens_row(g, i, k)[3 * j + c];
            }
            worst = fmax(worst, v_norm(sum));
        }
    }
    return worst;
}

static void find_center(const mesh *m, double origin[3]) {
    memset(origin, 0, 3 * sizeof *origin);
    for (size_t i = 0; i < m->vertices; i++) {
        for (int k = 0; k < 3; k++) origin[k] += m->x[i][k] / (double)m->vertices;
    }
}

/* Factors p->h and solves for every column of p->g. */
static void solve_columns(const rbvp *p) {
    size_t order = p->h_stride;
    uint32_t *perm = allocate(order, sizeof *perm);
    progress_begin("LU factorisation", (double)order * (double)order * (double)order / 3);
    size_t bad = dense_lu(p->h, order, order, perm);
    progress_end();
    if (bad < order) {
        die(EXIT_WORK,
            "the boundary value problem is singular at vertex %zu (0-based): the fixed nodes must "
            "hold the "
            "body against every translation and rotation",
            bad / 3);
    }
    progress_begin("Green's functions", 0);
    dense_lu_solve(p->h, order, order, perm, p->g, p->g_stride, p->g_stride);
    progress_end();
    free(perm);
}

/* Corners of triangles, 3 triangle + corner: where the traction is known, and of those the ones of
 * fixed nodes, whose hats carry no unknown there (NULL when there are none). */
typedef struct {
    uint8_t *known, *dropped;
} corners;

static corners find_corners(const mesh *m, const uint8_t *fixed, bool crisp) {
    corners c = {.known = allocate(3 * (size_t)m->triangles, 1)};
    uint8_t *inside = allocate(m->vertices, 1); /* has a triangle with all corners fixed */
    for (uint32_t i = 0; i < m->triangles; i++) {
        for (int k = 0; k < 3 && all_fixed(m, fixed, i); k++) inside[m->t[i][k]] = 1;
    }
    if (crisp) c.dropped = allocate(3 * (size_t)m->triangles, 1);
    for (uint32_t i = 0; i < m->triangles; i++) {
        for (size_t k = 0; k < 3; k++) {
            uint32_t v = m->t[i][k];
            bool drop = crisp && fixed[v] != 0 && inside[v] != 0 && !all_fixed(m, fixed, i);
            if (drop) c.dropped[3 * (size_t)i + k] = 1;
            c.known[3 * (size_t)i + k] = fixed[v] == 0 || drop;
        }
    }
    free(inside);
    return c;
}

/* Assembles with `traction` bound to the free nodes' part of the particular solution. */
static bem_traction particular_load(const double *origin, const corners *c, double *body) {
    return (bem_traction){.columns = 3,
                          .at = hydrostatic_traction,
                          .context = origin,
                          .known = c->known,
                          .dropped = c->dropped,
                          .result = body};
}

static double *nodal_area(const mesh *m) {
    double *area = allocate(m->vertices, sizeof *area);
    double(*normal)[3] = allocate(m->vertices, sizeof *normal);
    mesh_nodal(m, area, normal);
    free(normal);
    return area;
}

/* ---- coarse loads only ---- */

typedef struct {
    const rbvp *p;
    const hierarchy *h;
    uint32_t level;
    const double *origin, *body;
    double density;
} coarse_rows;

/* Rows of A, and of the right-hand sides: forces on the nodes of F, gathered down to the level. */
static void take_rows(void *context, size_t node, const double *h, const double *g) {
    const coarse_rows *c = context;
    const rbvp *p = c->p;
    size_t n = p->m->vertices, order = 3 * n;
    const palp_domain *d = &c->h->domain;
    double *force = allocate(3 * (size_t)d->slots, sizeof *force);
    for (size_t axis = 0; axis < 3; axis++) {
        double *a = p->h + (3 * node + axis) * p->h_stride;
        double *r = p->g + (3 * node + axis) * p->g_stride;
        double known[3] = {0}; /* H of U times the particular displacement there */
        for (size_t j = 0; j < order; j++) {
            bool held = p->fixed[j / 3] != 0;
            a[j] = held ? -g[axis * order + j] * p->material->young_Pa : h[axis * order + j];
        }
        for (size_t j = 0; j < n; j++) {
            for (size_t b = 0; b < 3 && p->fixed[j] != 0; b++) {
                double y[3], u[3];
                v_sub(p->m->x[j], c->origin, y);
                particular_displacement(p->material, y, b, u);
                known[b] += v_dot(h + axis * order + 3 * j, u);
            }
        }
        for (uint32_t i = 0; i < d->slots; i++) {
            for (size_t k = 0; k < 3; k++)
                force[3 * i + k] = g[axis * order + 3 * d->node[i] + k] / p->area[d->node[i]];
        }
        hierarchy_gather(c->h, d->levels - 1, c->level, force);
        memcpy(r, force, p->gravity * sizeof *r);
        for (size_t b = 0; b < 3; b++)
            r[p->gravity + b] = c->density * (c->body[(3 * node + axis) * 3 + b] + known[b]);
    }
    free(force);
}

/* ---- both ---- */

/* Loads on every node, or with a hierarchy on the basis functions of `level`. */
static greens solve_rbvp(const mesh *m, const uint8_t *fixed, const bem_material *material,
                         double density, const hierarchy *h, uint32_t level) {
    size_t order = 3 * (size_t)m->vertices;
    uint32_t count = h != NULL ? h->domain.level_start[level + 1] : 0;
    size_t loads = h != NULL ? 3 * (size_t)count : order;
    double origin[3], *area = nodal_area(m), *body = allocate(3 * order, sizeof *body);
    corners c = find_corners(m, fixed, material->crisp);
    rbvp p = {.m = m,
              .fixed = fixed,
              .material = material,
              .area = area,
              .h_stride = order,
              .g_stride = loads + 3,
              .gravity = loads};
    find_center(m, origin);
    p.h = allocate_aligned(order * order, sizeof *p.h);
    p.g = allocate_aligned(order * p.g_stride, sizeof *p.g);
    bem_traction traction = particular_load(origin, &c, body);
    if (h != NULL) {
        coarse_rows rows = {
            .p = &p, .h = h, .level = level, .origin = origin, .body = body, .density = density};
        bem_stream(m, material, take_rows, &rows, &traction);
    } else {
        bem_assemble(m, material, p.h, order, p.g, p.g_stride, &traction);
        parallel_for(order, swap_columns, &p);
        gravity_columns(&p, body, origin, density);
    }
    free(body);
    solve_columns(&p);
    free(p.h);
    if (material->crisp) {
        consistent_forces(&p, c.known);
    } else {
        forces_from_tractions(&p);
    }
    add_particular(&p, c.known, origin, density);
    free(area);
    free(c.known);
    free(c.dropped);
    greens g = {.nodes = m->vertices,
                .width = p.g_stride,
                .m = p.g,
                .fixed = fixed,
                .gravity = true,
                .reactions = true,
                .basis_count = count};
    g.equilibrium_residual = equilibrium_residual(&g);
    return g;
}

greens greens_from_bem(const mesh *m, const uint8_t *fixed, const bem_material *material,
                       double density_kg_m3) {
    return solve_rbvp(m, fixed, material, density_kg_m3, NULL, 0);
}

greens greens_coarse_from_bem(const mesh *m, const uint8_t *fixed, const bem_material *material,
                              double density_kg_m3, const hierarchy *h, uint32_t level) {
    return solve_rbvp(m, fixed, material, density_kg_m3, h, level);
}

/* ---- compliance from elsewhere ---- */

void npy_write(FILE *f, const double *x, size_t n) {
    char header[119];
    int length = snprintf(header, sizeof header,
                          "{'descr': '<f8', 'fortran_order': False, 'shape': (%zu, %zu), }", n, n);
    memset(header + length, ' ', sizeof header - (size_t)length);
    header[117] = '\n';
    fwrite("\x93NUMPY\x01\x00\x76\x00", 1, 10, f);
    fwrite(header, 1, 118, f);
    if (fwrite(x, sizeof *x, n * n, f) != n * n) die(EXIT_WORK, "cannot write a matrix");
}

static size_t npy_number(const char *path, const char *header, const char *key) {
    const char *at = strstr(header, key);
    if (at == NULL) die(EXIT_WORK, "%s: malformed .npy header", path);
    return strtoul(at + strlen(key), NULL, 10);
}

greens greens_from_npy(const char *path, const mesh *m, const uint8_t *fixed) {
    size_t bytes;
    char *data = read_file(path, &bytes);
    if (bytes < 12 || memcmp(data, "\x93NUMPY", 6) != 0)
        die(EXIT_WORK, "%s: not a .npy file", path);
    bool short_header = data[6] == 1;
    uint32_t length = 0;
    memcpy(&length, data + 8, short_header ? 2 : 4);
    size_t start = (short_header ? (size_t)10 : 12) + length;
    if (length == 0 || start > bytes)
        die(EXIT_WORK, "%s: the .npy header says %" PRIu32 " bytes, the file has %zu", path, length,
            bytes);
    data[start - 1] = '\0';
    const char *header = data + (short_header ? 10 : 12);
    bool wide = strstr(header, "'<f8'") != NULL;
    if (!wide && strstr(header, "'<f4'") == NULL) {
        die(EXIT_WORK, "%s: need little-endian f4 or f8 numbers", path);
    }
    bool fortran = strstr(header, "'fortran_order': True") != NULL;
    size_t rows = npy_number(path, header, "'shape': (");
    size_t size = wide ? 8 : 4;
    uint32_t free_nodes = 0;
    for (uint32_t i = 0; i < m->vertices; i++) free_nodes += fixed[i] == 0;
    bool scalar = rows == m->vertices || rows == free_nodes;
    size_t axes = scalar ? 1 : 3;
    bool full = rows == axes * (size_t)m->vertices;
    if (!full && rows != axes * (size_t)free_nodes) {
        die(EXIT_WORK,
            "%s: %zu rows; need %zu (free nodes) or %zu (all nodes), or a third of that for a "
            "scalar "
            "problem",
            path, rows, 3 * (size_t)free_nodes, 3 * (size_t)m->vertices);
    }
    if (bytes - start != rows * rows * size)
        die(EXIT_WORK, "%s: not a square matrix of %zu rows", path, rows);
    greens g = {
        .nodes = m->vertices, .width = 3 * (size_t)m->vertices, .fixed = fixed, .scalar = scalar};
    g.m = allocate_aligned(g.width * g.width, sizeof *g.m);
    for (size_t i = 0, r = 0; i < m->vertices; i++) {
        if (fixed[i] != 0) continue;
        size_t row = full ? i : r++;
        for (size_t j = 0, c = 0; j < m->vertices; j++) {
            if (fixed[j] != 0) continue;
            size_t column = full ? j : c++;
            for (size_t k = 0; k < axes * axes; k++) {
                size_t a = axes * row + k / axes, b = axes * column + k % axes;
                const char *at = data + start + size * (fortran ? b * rows + a : a * rows + b);
                float narrow;
                double value;
                memcpy(wide ? (void *)&value : (void *)&narrow, at, size);
                value = wide ? value : (double)narrow;
                if (!isfinite(value))
                    die(EXIT_WORK, "%s: entry (%zu, %zu) is not finite", path, a, b);
                for (size_t d = 0; d < (scalar ? 3u : 1u); d++)
                    greens_row(&g, i, k / axes + d)[3 * j + k % axes + d] = value;
            }
        }
    }
    free(data);
    return g;
}

/* ---- reciprocity ---- */

static bool both_free(const greens *g, size_t i, size_t j) {
    return g->fixed[i] == 0 && g->fixed[j] == 0;
}

static double asymmetry(const greens *g) {
    double difference = 0, norm = 0;
    for (size_t i = 0; i < g->nodes; i++) {
        for (size_t j = 0; j < g->nodes; j++) {
            if (!both_free(g, i, j)) continue;
            for (size_t k = 0; k < 9; k++) {
                double a = greens_row(g, i, k / 3)[3 * j + k % 3];
                double b = greens_row(g, j, k % 3)[3 * i + k / 3];
                difference += (a - b) * (a - b);
                norm += a * a;
            }
        }
    }
    return sqrt(difference / norm);
}

static void average_pair(const greens *g, size_t i, size_t j) {
    double sign = (g->fixed[i] != 0) == (g->fixed[j] != 0) ? 1 : -1;
    for (size_t k = 0; k < 9; k++) {
        double *a = &greens_row(g, i, k / 3)[3 * j + k % 3];
        double *b = &greens_row(g, j, k % 3)[3 * i + k / 3];
        double mean = 0.5 * (*a + sign * *b);
        *a = mean;
        *b = sign * mean;
    }
}

/* Copies the free-free block out of g, or back into it. */
static void copy_free_block(const greens *g, const uint32_t *node, size_t order, double *a,
                            bool back) {
    for (size_t i = 0; i < 3 * order; i++) {
        for (size_t j = 0; j < order; j++) {
            double *in_g = greens_row(g, node[i / 3], i % 3) + 3 * node[j];
            double *in_a = a + i * 3 * order + 3 * j;
            memcpy(back ? in_g : in_a, back ? in_a : in_g, 3 * sizeof *a);
        }
    }
}

static void enforce_definiteness(greens *g) {
    size_t order = 0;
    uint32_t *node = allocate(g->nodes, sizeof *node);
    for (uint32_t i = 0; i < g->nodes; i++) {
        if (g->fixed[i] == 0) node[order++] = i;
    }
    double *a = allocate_aligned(9 * order * order, sizeof *a);
    copy_free_block(g, node, order, a, false);
    g->definite = make_definite(a, 3 * order, 3 * order);
    if (!g->definite.definite || g->definite.change > GREENS_CHANGE_MAX) {
        die(EXIT_WORK,
            "the symmetrised compliance is not positive definite, worst near node %" PRIu32
            " (0-based): collocation carries no thin walls: bake without --method collocation (a "
            "matrix from --compliance: it is no elastic body's)",
            node[g->definite.worst / 3]);
    }
    if (g->definite.raised > 0) {
        warn("%" PRIu32 " mode(s) of the compliance near node %" PRIu32
             " were raised to keep it positive definite (a change of %.2g %%): the mesh is coarse "
             "for a thin part there",
             g->definite.raised, node[g->definite.worst / 3], 100 * g->definite.change);
        copy_free_block(g, node, order, a, true);
    }
    free(a);
    free(node);
}

/* (R_U^T R_U)^-1 R_U^T as w[6][3 nodes], zero at free nodes. */
static double *rigid_weights(const greens *g, const mesh *m) {
    double gram[36] = {0};
    uint32_t perm[6];
    double *w = allocate(18 * (size_t)g->nodes, sizeof *w);
    for (size_t i = 0; i < g->nodes; i++) {
        for (size_t k = 0; k < 36 && g->fixed[i] != 0; k++) {
            double a[3], b[3];
            rigid_mode(m->x[i], k / 6, a);
            rigid_mode(m->x[i], k % 6, b);
            gram[k] += v_dot(a, b);
            if (k % 6 == 0) memcpy(w + (k / 6 * g->nodes + i) * 3, a, sizeof a);
        }
    }
    if (dense_lu(gram, 6, 6, perm) < 6) die(EXIT_WORK, "the fixed nodes lie on one line");
    dense_lu_solve(gram, 6, 6, perm, w, 3 * (size_t)g->nodes, 3 * (size_t)g->nodes);
    return w;
}

/*
 * Averaging leaves rigid motions of the fixed nodes slightly wrong. The smallest change of each row
 * that makes them exact, u_F = R_F for u_U = R_U and f_U = 0, is added; with the skew blocks it
 * makes the reactions of every load balance it in force and moment.
 */
static void restore_rigid_motion(const greens *g, const mesh *m) {
    double *w = rigid_weights(g, m);
    for (int side = 0; side < 2; side++) { /* rows of G_FU and K_UU, then the columns of K_UU */
        for (size_t row = 0; row < 3 * (size_t)g->nodes; row++) {
            bool free_row = g->fixed[row / 3] == 0;
            if (side == 1 && free_row) continue;
            for (size_t mode = 0; mode < 6; mode++) {
                double missing = 0, u[3];
                rigid_mode(m->x[row / 3], mode, u);
                if (free_row) missing = u[row % 3];
                for (size_t j = 0; j < g->nodes; j++) {
                    if (g->fixed[j] == 0) continue;
                    rigid_mode(m->x[j], mode, u);
                    for (size_t k = 0; k < 3; k++) {
                        double *entry = side == 0 ? &greens_row(g, row / 3, row % 3)[3 * j + k]
                                                  : &greens_row(g, j, k)[row];
                        missing -= *entry * u[k];
                    }
                }
                for (size_t j = 0; j < g->nodes; j++) {
                    for (size_t k = 0; k < 3 && g->fixed[j] != 0; k++) {
                        double *entry = side == 0 ? &greens_row(g, row / 3, row % 3)[3 * j + k]
                                                  : &greens_row(g, j, k)[row];
                        *entry += missing * w[(mode * g->nodes + j) * 3 + k];
                    }
                }
            }
        }
    }
    for (size_t i = 0; i < g->nodes; i++) {
        for (size_t j = 0; j < g->nodes; j++) {
            if (g->fixed[i] == 0 || g->fixed[j] != 0) continue;
            for (size_t k = 0; k < 9; k++) {
                greens_row(g, i, k / 3)[3 * j + k % 3] = -greens_row(g, j, k % 3)[3 * i + k / 3];
            }
        }
    }
    free(w);
}

void greens_reciprocity(greens *g, const mesh *m, bool enforce) {
    g->reciprocity_residual = asymmetry(g);
    if (!enforce) return;
    for (size_t i = 0; i < g->nodes; i++) {
        for (size_t j = 0; j <= i; j++) {
            if (both_free(g, i, j) || g->reactions) average_pair(g, i, j);
        }
    }
    if (!g->averaged) enforce_definiteness(g); /* Galerkin's is definite by construction */
    if (!g->reactions) return;
    restore_rigid_motion(g, m);
    g->equilibrium_residual = equilibrium_residual(g);
}
