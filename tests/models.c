/* SPDX-License-Identifier: MIT */
#include "tests/models.h"
#include "core/base/crc32c.h"
#include "port/host/args.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static mesh from_arrays(const double (*x)[3], uint32_t vertices, const uint32_t (*t)[3],
                        uint32_t triangles) {
    const mesh borrowed = {.vertices = vertices,
                           .triangles = triangles,
                           .x = (double(*)[3])(uintptr_t)x,
                           .t = (uint32_t(*)[3])(uintptr_t)t};
    return mesh_copy(&borrowed);
}

mesh model_sphere(uint32_t levels) {
    const double g = 1.6180339887498949;
    const double x[12][3] = {{-1, g, 0}, {1, g, 0}, {-1, -g, 0}, {1, -g, 0},
                             {0, -1, g}, {0, 1, g}, {0, -1, -g}, {0, 1, -g},
                             {g, 0, -1}, {g, 0, 1}, {-g, 0, -1}, {-g, 0, 1}};
    const uint32_t t[20][3] = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                               {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                               {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                               {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
    mesh m = from_arrays(x, 12, t, 20);
    for (uint32_t l = 0; l <= levels; l++) {
        if (l > 0) {
            mesh finer = subdivide_midpoint(&m);
            mesh_free(&m);
            m = finer;
        }
        for (uint32_t i = 0; i < m.vertices; i++) v_normalize(m.x[i]);
    }
    return m;
}

/* Number of the lattice point (i, j, k) among those on the surface, by search; boxes in tests are
 * small. */
static uint32_t lattice_vertex(mesh *m, uint32_t *known, uint32_t n, uint32_t i, uint32_t j,
                               uint32_t k, double step) {
    uint32_t *slot = &known[(k * (n + 1) + j) * (n + 1) + i];
    if (*slot == 0) {
        m->x[m->vertices][0] = i * step;
        m->x[m->vertices][1] = j * step;
        m->x[m->vertices][2] = k * step;
        *slot = ++m->vertices;
    }
    return *slot - 1;
}

mesh model_box(double size, uint32_t n) {
    mesh m = {.x = allocate(6 * (n + 1) * (n + 1), sizeof *m.x),
              .t = allocate(12 * n * n, sizeof *m.t)};
    uint32_t *known = allocate((n + 1) * (n + 1) * (n + 1), sizeof *known);
    for (uint32_t side = 0; side < 6; side++) {
        for (uint32_t square = 0; square < n * n; square++) {
            uint32_t corner[4];
            for (uint32_t c = 0; c < 4; c++) {
                uint32_t u = square % n + (c == 1 || c == 2), v = square / n + (c >= 2);
                uint32_t p[3];
                p[side % 3] = side < 3 ? 0 : n;
                p[(side + 1) % 3] = side < 3 ? v : u;
                p[(side + 2) % 3] = side < 3 ? u : v;
                corner[c] = lattice_vertex(&m, known, n, p[0], p[1], p[2], size / n);
            }
            const uint32_t two[2][3] = {{corner[0], corner[1], corner[2]},
                                        {corner[0], corner[2], corner[3]}};
            memcpy(m.t + m.triangles, two, sizeof two);
            m.triangles += 2;
        }
    }
    free(known);
    return m;
}

/* Vertex of the lattice point p, by search among those there are. */
static uint32_t voxel_vertex(mesh *m, size_t *room, const int p[3], double step) {
    const double x[3] = {p[0] * step, p[1] * step, p[2] * step};
    for (uint32_t i = m->vertices; i-- > 0;) {
        if (v_distance(m->x[i], x) < 0.1 * step) return i;
    }
    m->x = grow(m->x, room, m->vertices + 1u, sizeof *m->x);
    memcpy(m->x[m->vertices], x, sizeof x);
    return m->vertices++;
}

static bool has_cube(const int (*cube)[3], uint32_t count, const int at[3]) {
    for (uint32_t i = 0; i < count; i++) {
        if (memcmp(cube[i], at, sizeof cube[i]) == 0) return true;
    }
    return false;
}

mesh model_voxels(const int (*cube)[3], uint32_t count, double size, uint32_t n, uint32_t **cell) {
    mesh m = {.vertices = 0};
    size_t vertex_room = 0, triangle_room = 0, cell_room = 0;
    *cell = NULL;
    for (uint32_t c = 0; c < count * 6; c++) {
        uint32_t a = c % 6 / 2;
        bool high = c % 2 == 1;
        int beyond[3] = {cube[c / 6][0], cube[c / 6][1], cube[c / 6][2]};
        beyond[a] += high ? 1 : -1;
        if (has_cube(cube, count, beyond)) continue;
        for (uint32_t q = 0; q < n * n; q++) {
            uint32_t v[4];
            for (uint32_t k = 0; k < 4; k++) {
                int p[3], u = (int)(q % n) + (k == 1 || k == 2), w = (int)(q / n) + (k >= 2);
                for (int d = 0; d < 3; d++) p[d] = cube[c / 6][d] * (int)n;
                p[a] += high ? (int)n : 0;
                p[(a + 1) % 3] += high ? u : w;
                p[(a + 2) % 3] += high ? w : u;
                v[k] = voxel_vertex(&m, &vertex_room, p, size / n);
            }
            uint32_t turn = (q % n + q / n) % 2;
            const uint32_t two[2][3] = {{v[turn], v[turn + 1], v[turn + 2]},
                                        {v[turn], v[turn + 2], v[(turn + 3) % 4]}};
            m.t = grow(m.t, &triangle_room, m.triangles + 2u, sizeof *m.t);
            *cell = grow(*cell, &cell_room, m.triangles + 2u, sizeof **cell);
            memcpy(m.t + m.triangles, two, sizeof two);
            (*cell)[m.triangles] = (*cell)[m.triangles + 1] = c / 6;
            m.triangles += 2;
        }
    }
    return m;
}

typedef struct {
    body_spec body;
    zone_model z;
} zoned_spec;

static void take_line(void *context, const argument *a) {
    zoned_spec *s = context;
    if (zone_option(&s->z, &s->body, a)) return;
    (void)body_option(zone_body(&s->z, &s->body), a);
}

zoned model_zones(const mesh *body, const char *lines, double epsilon) {
    static const option options[] = {BODY_OPTIONS, ZONE_OPTIONS, {NULL, 0}};
    zoned_spec s = {.body = body_defaults};
    char folder[] = "/tmp/palp-zones-XXXXXX", path[64], command[64];
    zoned r = {.zones = allocate(1, sizeof *r.zones)};
    if (mkdtemp(folder) == NULL) die(EXIT_WORK, "no temporary folder");
    if (body != NULL) {
        snprintf(path, sizeof path, "%s/body.obj", folder);
        mesh_save_obj(body, path);
        s.body.mesh_path = copy_string(path);
        s.body.as_is = true;
    }
    progress_quiet(1);
    args_parse_text("model", lines, options, take_line, &s);
    build_options build = {.wavelet = {.kind = WAVELET_LINEAR, .lifted = true},
                           .compress = {.epsilon = epsilon},
                           .table_bytes = 64e6, /* for entries that tests look up */
                           .modes = BUILD_MODES};
    snprintf(path, sizeof path, "%s/zone.obj", folder);
    r.bytes = zone_bake(&s.z, &s.body, &build, "model", path, NULL, &r.size);
    if (palp_zones_open(r.zones, r.bytes, r.size) != PALP_OK) die(EXIT_WORK, "zones do not open");
    for (uint32_t i = 0; i < r.zones->meta->zones; i++) {
        snprintf(path, sizeof path, "%s/zone-%s.obj", folder, r.zones->zone[i].name);
        r.part[i] = mesh_load(path);
    }
    snprintf(command, sizeof command, "rm -r %s", folder);
    if (system(command) != 0) warn("%s stays", folder);
    return r;
}

palp_assembly *model_assembly(const palp_zones *zones, uint32_t finest) {
    palp_assembly *a = allocate(1, sizeof *a);
    size_t bytes = palp_assembly_memsize(zones, finest);
    palp_status status = palp_assembly_init(a, zones, finest, allocate_aligned(bytes, 1), bytes);
    if (status != PALP_OK) die(EXIT_WORK, "assembly: %s", palp_status_text(status));
    return a;
}

char *model_labels(const uint32_t *cell, uint32_t triangles, const char *const *name) {
    static char path[32];
    snprintf(path, sizeof path, "/tmp/palp-labels-XXXXXX");
    FILE *f = fdopen(mkstemp(path), "w");
    if (f == NULL) die(EXIT_WORK, "no temporary file");
    for (uint32_t i = 0; i < triangles; i++) fprintf(f, "%s\n", name[cell[i]]);
    fclose(f);
    return path;
}

static baked bake_of(mesh m, double below, build_options options, double young_Pa) {
    const bool raw = options.raw;
    baked b = {.m = m,
               .material = {.young_Pa = young_Pa, .poisson = 0.4, .tolerance = BEM_TOLERANCE}};
    mesh_require_closed(&b.m, "model");
    b.fixed = allocate(m.vertices, 1);
    b.area = allocate(m.vertices, sizeof *b.area);
    b.normal = allocate(m.vertices, sizeof *b.normal);
    for (uint32_t i = 0; i < m.vertices; i++) b.fixed[i] = m.x[i][2] <= below;
    mesh_nodal(&b.m, b.area, b.normal);
    options.wavelet = (wavelet){.lifted = true};
    options.modes = BUILD_MODES;
    b.d = domains_build(&b.m, b.fixed, b.area, options.wavelet);
    options.constraint_level = b.d.domain[PALP_FREE].view.levels - 1;
    b.g = greens_from_bem(&b.m, b.fixed, &b.material, 1000);
    greens_reciprocity(&b.g, &b.m, !raw);
    palp_meta meta = {.young_Pa = (float)young_Pa, .poisson = 0.4f, .density_kg_m3 = 1000};
    built made = blob_build(&b.m, &b.g, &b.d, b.area, b.normal, meta, &options);
    b.bytes = made.bytes;
    b.size = made.size;
    palp_status status = palp_blob_open(&b.blob, b.bytes, b.size);
    if (status != PALP_OK) die(EXIT_WORK, "test blob: %s", palp_status_text(status));
    return b;
}

baked model_bake_tables(mesh m, double below, double epsilon, bool raw, bool half,
                        double table_bytes) {
    const build_options o = {
        .compress = {.epsilon = epsilon, .half = half}, .raw = raw, .table_bytes = table_bytes};
    return bake_of(m, below, o, 1e4);
}

baked model_bake_young(mesh m, double below, double young_Pa) {
    return bake_of(m, below, (build_options){.compress = {.epsilon = 0.05}}, young_Pa);
}

baked model_bake(mesh m, double below, double epsilon, bool raw, bool half) {
    return model_bake_tables(m, below, epsilon, raw, half, 0);
}

baked model_bake_split(mesh m, double below, double epsilon, bool half) {
    const build_options o = {.compress = {.epsilon = epsilon, .half = half}, .split = true};
    return bake_of(m, below, o, 1e4);
}

dynamic_body model_dynamic_body(const tetmesh *level, uint32_t levels, double below, double young,
                                double poisson, double damping_s) {
    static const uint8_t sha[32] = {0};
    dynamic_body b = {.levels = levels};
    uint8_t *pinned[TET_LEVELS] = {NULL};
    uint32_t joined;
    body_spec body = body_defaults;
    const tet_model model = {.levels = levels, .damping_s = damping_s};
    body.young_Pa = young;
    body.poisson = poisson;
    body.density = 1000;
    for (uint32_t l = 0; l < levels; l++) {
        b.level[l] = level[l];
        pinned[l] = allocate(level[l].nodes, 1);
        for (uint32_t i = 0; i < level[l].nodes; i++) pinned[l][i] = level[l].x[i][0] <= below;
    }
    b.bytes = tet_assemble(level, pinned, levels, &body, &model, sha, &joined, &b.size);
    for (uint32_t l = 0; l < levels; l++) free(pinned[l]);
    if (palp_tets_open(&b.tets, b.bytes, b.size) != PALP_OK) die(EXIT_WORK, "a body does not open");
    return b;
}

palp_dyna *model_dyna(const palp_tets *tets, palp_material material, float tick_s,
                      palp_vec3 gravity) {
    palp_dyna_config c = {.material = material,
                          .gravity_m_s2 = gravity,
                          .tick_s = tick_s,
                          .most_class = PALP_STEP_CLASSES - 1};
    palp_dyna *d = allocate(1, sizeof *d);
    size_t bytes = palp_dyna_memsize(tets);
    if (palp_dyna_init(d, tets, &c, allocate_aligned(bytes, 1), bytes) != PALP_OK)
        die(EXIT_WORK, "a body does not move");
    return d;
}

void model_refine(palp_dyna *dyna, uint32_t level) {
    const palp_tets_meta *m = dyna->tets->meta;
    for (uint32_t l = 0; l < level && l + 1 < m->levels; l++) {
        for (uint32_t f = m->first_family[l]; f < m->first_family[l + 1]; f++) {
            const palp_tets *t = dyna->tets;
            for (uint32_t k = t->child_offset[f]; k < t->child_offset[f + 1]; k++)
                palp_dyna_embed(dyna, t->child[k]);
            dyna->split[f] = 1;
        }
        palp_dyna_relist(dyna);
    }
}

void model_seal(uint8_t *bytes) {
    palp_blob_header *h = (palp_blob_header *)(void *)bytes;
    palp_blob_entry *e = (palp_blob_entry *)(void *)(bytes + sizeof *h);
    for (uint32_t i = 0; i < h->section_count; i++)
        e[i].crc = palp_crc32c(0, bytes + e[i].offset,
                               (size_t)((e[i].count * e[i].element_bytes + 63) / 64 * 64));
    h->header_crc = 0;
    uint32_t crc = palp_crc32c(0, h, sizeof *h);
    h->header_crc = palp_crc32c(crc, e, h->section_count * sizeof *e);
}
