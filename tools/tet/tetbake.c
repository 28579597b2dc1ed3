/* SPDX-License-Identifier: MIT */
#include "tools/tet/tetbake.h"
#include "tools/bake/blobwrite.h"
#include "port/host/parallel.h"
#include "tools/bake/sha256.h"
#include "tools/tet/tethierarchy.h"
#include "tools/tet/tetstiff.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

bool tet_option(tet_model *t, const body_spec *body, const argument *a) {
    if (a->option == NULL) return false;
    bool counts = strcmp(a->option, "--tets") == 0;
    if (counts || strcmp(a->option, "--tets-from") == 0) {
        *t = (tet_model){
            .levels = (uint32_t)a->count, .damping_s = t->damping_s, .drag_per_s = t->drag_per_s};
        for (int k = 0; k < a->count; k++) {
            if (counts)
                t->nodes[k] = arg_u32(a, k, 8, PALP_MAX_NODES);
            else
                t->from[k] = body_path(body, a->value[k]);
            if (counts && k > 0 && t->nodes[k] < 2 * t->nodes[k - 1])
                die(EXIT_USAGE,
                    "%s: levels go from coarse to fine, each with at least twice the "
                    "nodes: %s is not twice %s",
                    a->where, a->value[k], a->value[k - 1]);
        }
    } else if (strcmp(a->option, "--damping") == 0) {
        t->damping_s = arg_upto(a, 100);
    } else if (strcmp(a->option, "--drag") == 0) {
        t->drag_per_s = arg_upto(a, 1000);
    } else {
        return false;
    }
    return true;
}

/* ---- sections ---- */

typedef struct {
    palp_tets_meta meta;
    float (*rest)[3];
    palp_tet_node *node;
    palp_tet *tet;
    uint32_t *around_offset, *around, *container;
    float (*container_weight)[4];
    uint32_t (*family)[2];
    uint32_t *child_offset, *child, *parent_offset, *parent, *mean_offset, *mean;
    float *mean_weight;
    uint32_t *skin_node, (*skin_triangle)[3], *skin_tet;
    float (*skin_normal)[3], (*skin_weight)[4];
} sections;

static void make_room(sections *s) {
    size_t n = s->meta.nodes, t = s->meta.tets;
    s->rest = allocate(n, sizeof *s->rest);
    s->node = allocate(n, sizeof *s->node);
    s->tet = allocate(t, sizeof *s->tet);
    s->around_offset = allocate(n + 1, sizeof *s->around_offset);
    s->around = allocate(4 * t, sizeof *s->around);
    s->container = allocate(n, sizeof *s->container);
    s->container_weight = allocate(n, sizeof *s->container_weight);
    s->family = allocate(n, sizeof *s->family);
    s->child_offset = allocate(n + 2, sizeof *s->child_offset);
    s->parent_offset = allocate(n + 2, sizeof *s->parent_offset);
    s->child = allocate(n, sizeof *s->child);
    s->parent = allocate(n, sizeof *s->parent);
    s->mean_offset = allocate(n + 1, sizeof *s->mean_offset);
    memset(s->family, 0xff, n * sizeof *s->family);
}

static void add_element(sections *s, const tetmesh *m, uint32_t i, uint32_t first_node) {
    palp_tet *e = &s->tet[s->meta.first_tet[s->meta.levels] + i];
    double b[4][3], volume = tet_volume(m, i);
    tet_gradients(m, i, b + 1);
    for (int a = 0; a < 3; a++) b[0][a] = -b[1][a] - b[2][a] - b[3][a];
    for (int k = 0; k < 9; k++) e->b[k] = (float)b[1 + k / 3][k % 3];
    e->volume_m3 = (float)volume;
    for (int k = 0; k < 4; k++) {
        uint32_t n = first_node + m->t[i][k];
        e->node[k] = n;
        s->node[n].volume_m3 += (float)(volume / 4);
        static const int pair[6][2] = {{0, 0}, {1, 1}, {2, 2}, {1, 2}, {2, 0}, {0, 1}};
        for (int p = 0; p < 6; p++)
            s->node[n].gradient_sum[p] += (float)(volume * b[k][pair[p][0]] * b[k][pair[p][1]]);
        for (int j = 0; j < 4; j++) {
            float d = (float)v_distance(m->x[m->t[i][k]], m->x[m->t[i][j]]);
            bool nearer = d < s->node[n].near_m || !(s->node[n].near_m > 0);
            if (j != k && nearer) s->node[n].near_m = d;
        }
    }
}

static void add_level(sections *s, const tetmesh *m, const uint8_t *pinned) {
    palp_tets_meta *meta = &s->meta;
    uint32_t first = meta->first_node[meta->levels], *offset, *list;
    uint32_t first_tet = meta->first_tet[meta->levels];
    tetmesh_around(m, &offset, &list);
    for (uint32_t i = 0; i < m->nodes; i++) {
        for (int k = 0; k < 3; k++) s->rest[first + i][k] = (float)m->x[i][k];
        s->node[first + i].flags = pinned[i] ? PALP_TET_PINNED : 0;
        s->around_offset[first + i + 1] = 4 * first_tet + offset[i + 1];
    }
    for (uint32_t i = 0; i < 4 * m->tets; i++) s->around[4 * first_tet + i] = first_tet + list[i];
    for (uint32_t i = 0; i < m->tets; i++) add_element(s, m, i, first);
    free(offset);
    free(list);
    meta->levels++;
    meta->first_node[meta->levels] = first + m->nodes;
    meta->first_tet[meta->levels] = first_tet + m->tets;
}

/* Members of each family in ascending order. */
static void list_members(const uint32_t *family, uint32_t count, uint32_t families,
                         uint32_t first_family, uint32_t first_node, uint32_t *offset,
                         uint32_t *list) {
    for (uint32_t f = 0; f < families; f++) {
        uint32_t at = offset[first_family + f];
        for (uint32_t i = 0; i < count; i++) {
            if (family[i] == f) list[at++] = first_node + i;
        }
        offset[first_family + f + 1] = at;
    }
}

/* Families between the levels l and l + 1, means, and containers of l + 1. */
static uint32_t join_levels(sections *s, const tetmesh *level, uint32_t l, size_t *room,
                            size_t *weight_room) {
    const tetmesh *coarse = &level[l], *fine = &level[l + 1];
    palp_tets_meta *m = &s->meta;
    uint32_t first = m->first_node[l], next = m->first_node[l + 1], family = m->first_family[l];
    tet_families f = tet_families_build(coarse, fine);
    m->first_family[l + 1] = family + f.families;
    for (uint32_t i = 0; i < coarse->nodes; i++) s->family[first + i][1] = family + f.of_parent[i];
    for (uint32_t i = 0; i < fine->nodes; i++) s->family[next + i][0] = family + f.of_child[i];
    list_members(f.of_parent, coarse->nodes, f.families, family, first, s->parent_offset,
                 s->parent);
    list_members(f.of_child, fine->nodes, f.families, family, next, s->child_offset, s->child);
    uint32_t base = s->mean_offset[first], count = f.mean_offset[coarse->nodes];
    s->mean = grow(s->mean, room, (size_t)base + count + 1, sizeof *s->mean);
    s->mean_weight =
        grow(s->mean_weight, weight_room, (size_t)base + count + 1, sizeof *s->mean_weight);
    for (uint32_t k = 0; k < count; k++) {
        s->mean[base + k] = next + f.mean[k];
        s->mean_weight[base + k] = (float)f.mean_weight[k];
    }
    for (uint32_t i = 0; i < coarse->nodes; i++)
        s->mean_offset[first + i + 1] = base + f.mean_offset[i + 1];
    tet_place *place = tet_places(coarse, fine->x, fine->nodes);
    for (uint32_t i = 0; i < fine->nodes; i++) {
        s->container[next + i] = m->first_tet[l] + place[i].tet;
        for (int k = 0; k < 4; k++) s->container_weight[next + i][k] = (float)place[i].weight[k];
    }
    uint32_t joined = f.joined;
    free(place);
    tet_families_free(&f);
    return joined;
}

static void add_skin(sections *s, const tetmesh *level) {
    palp_tets_meta *m = &s->meta;
    uint32_t last = m->levels - 1, triangles;
    const tetmesh *fine = &level[last];
    uint32_t(*t)[3] = tetmesh_boundary(fine, &triangles);
    uint32_t *number = allocate((size_t)fine->nodes + 1, sizeof *number);
    s->skin_node = allocate(fine->nodes, sizeof *s->skin_node);
    for (uint32_t i = 0; i < 3 * triangles; i++) number[t[i / 3][i % 3]] = 1;
    for (uint32_t i = 0; i < fine->nodes; i++) {
        if (number[i] == 0) continue;
        number[i] = m->skin;
        s->skin_node[m->skin++] = m->first_node[last] + i;
    }
    double(*x)[3] = allocate(m->skin, sizeof *x), (*n)[3] = allocate(m->skin, sizeof *n);
    for (uint32_t i = 0; i < m->skin; i++)
        memcpy(x[i], fine->x[s->skin_node[i] - m->first_node[last]], sizeof *x);
    for (uint32_t i = 0; i < triangles; i++) {
        double normal[3];
        triangle_normal(fine->x[t[i][0]], fine->x[t[i][1]], fine->x[t[i][2]], normal);
        for (int k = 0; k < 3; k++) {
            t[i][k] = number[t[i][k]];
            for (int a = 0; a < 3; a++) n[t[i][k]][a] += normal[a];
        }
    }
    m->skin_triangles = triangles;
    s->skin_triangle = t;
    s->skin_normal = allocate(m->skin, sizeof *s->skin_normal);
    s->skin_tet = allocate((size_t)m->skin * m->levels, sizeof *s->skin_tet);
    s->skin_weight = allocate((size_t)m->skin * m->levels, sizeof *s->skin_weight);
    for (uint32_t i = 0; i < m->skin; i++) {
        if (!(v_norm(n[i]) > 0)) n[i][2] = 1; /* two sheets back to back */
        v_normalize(n[i]);
        for (int a = 0; a < 3; a++) s->skin_normal[i][a] = (float)n[i][a];
    }
    for (uint32_t l = 0; l < m->levels; l++) {
        tet_place *place = tet_places(&level[l], x, m->skin);
        for (uint32_t i = 0; i < m->skin; i++) {
            s->skin_tet[i * m->levels + l] = m->first_tet[l] + place[i].tet;
            for (int k = 0; k < 4; k++)
                s->skin_weight[i * m->levels + l][k] = (float)place[i].weight[k];
        }
        free(place);
    }
    free(number);
    free(x);
    free(n);
}

static uint8_t *write_sections(sections *s, size_t *bytes) {
    const palp_tets_meta *m = &s->meta;
    static section_list l;
    uint64_t n = m->nodes;
    uint32_t parents = m->first_node[m->levels - 1], children = m->nodes - m->first_node[1];
    uint32_t means = s->mean_offset[n];
    l.count = 0;
    section_add(&l, PALP_SEC_TETS, m, 1, sizeof *m);
    section_add(&l, PALP_SEC_TET_REST, s->rest, n, sizeof *s->rest);
    section_add(&l, PALP_SEC_TET_NODE, s->node, n, sizeof *s->node);
    section_add(&l, PALP_SEC_TET, s->tet, m->tets, sizeof *s->tet);
    section_add(&l, PALP_SEC_TET_AROUND_OFFSET, s->around_offset, n + 1, 4);
    section_add(&l, PALP_SEC_TET_AROUND, s->around, 4 * (uint64_t)m->tets, 4);
    section_add(&l, PALP_SEC_TET_CONTAINER, s->container, n, 4);
    section_add(&l, PALP_SEC_TET_CONTAINER_WEIGHT, s->container_weight, n, 16);
    section_add(&l, PALP_SEC_TET_FAMILY, s->family, n, 8);
    section_add(&l, PALP_SEC_TET_CHILD_OFFSET, s->child_offset, m->families + 1u, 4);
    section_add(&l, PALP_SEC_TET_CHILD, s->child, children, 4);
    section_add(&l, PALP_SEC_TET_PARENT_OFFSET, s->parent_offset, m->families + 1u, 4);
    section_add(&l, PALP_SEC_TET_PARENT, s->parent, parents, 4);
    section_add(&l, PALP_SEC_TET_MEAN_OFFSET, s->mean_offset, n + 1, 4);
    section_add(&l, PALP_SEC_TET_MEAN, s->mean, means, 4);
    section_add(&l, PALP_SEC_TET_MEAN_WEIGHT, s->mean_weight, means, 4);
    section_add(&l, PALP_SEC_SKIN_NODE, s->skin_node, m->skin, 4);
    section_add(&l, PALP_SEC_SKIN_TRIANGLE, s->skin_triangle, m->skin_triangles, 12);
    section_add(&l, PALP_SEC_SKIN_NORMAL, s->skin_normal, m->skin, 12);
    section_add(&l, PALP_SEC_SKIN_TET, s->skin_tet, m->skin, 4 * (size_t)m->levels);
    section_add(&l, PALP_SEC_SKIN_WEIGHT, s->skin_weight, (uint64_t)m->skin * m->levels, 16);
    return blob_assemble(l.entry, l.data, l.count, bytes);
}

static double diagonal_of(const tetmesh *m) {
    double low[3] = {HUGE_VAL, HUGE_VAL, HUGE_VAL}, high[3] = {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
    for (uint32_t i = 0; i < 3 * m->nodes; i++) {
        low[i % 3] = fmin(low[i % 3], m->x[i / 3][i % 3]);
        high[i % 3] = fmax(high[i % 3], m->x[i / 3][i % 3]);
    }
    return v_distance(low, high);
}

uint8_t *tet_assemble(const tetmesh *level, uint8_t *const *pinned, uint32_t levels,
                      const body_spec *body, const tet_model *t, const uint8_t sha[32],
                      uint32_t *joined, size_t *bytes) {
    sections s = {.meta = {.young_Pa = (float)body->young_Pa,
                           .poisson = (float)body->poisson,
                           .density_kg_m3 = (float)body->density,
                           .damping_s = (float)t->damping_s,
                           .drag_per_s = (float)t->drag_per_s,
                           .diagonal_m = (float)diagonal_of(&level[levels - 1])}};
    size_t room = 0, weight_room = 0;
    memcpy(s.meta.mesh_sha256, sha, sizeof s.meta.mesh_sha256);
    for (uint32_t l = 0; l < levels; l++) {
        s.meta.nodes += level[l].nodes;
        s.meta.tets += level[l].tets;
    }
    if (s.meta.nodes > PALP_MAX_NODES)
        die(EXIT_WORK, "%" PRIu32 " nodes on all levels together; a blob holds at most %u",
            s.meta.nodes, PALP_MAX_NODES);
    make_room(&s);
    for (uint32_t l = 0; l < levels; l++) {
        add_level(&s, &level[l], pinned[l]);
        s.meta.theta[l] = (float)tet_coupling(&level[l], s.node + s.meta.first_node[l]);
    }
    *joined = 0;
    for (uint32_t l = 0; l + 1 < levels; l++)
        *joined += join_levels(&s, level, l, &room, &weight_room);
    s.meta.families = s.meta.first_family[levels - 1];
    for (uint32_t i = s.meta.first_node[levels - 1]; i < s.meta.nodes; i++)
        s.mean_offset[i + 1] = s.mean_offset[i];
    add_skin(&s, level);
    uint8_t *out = write_sections(&s, bytes);
    palp_tets check;
    palp_status status = palp_tets_open(&check, out, *bytes);
    if (status != PALP_OK) {
        bool odd = !(s.meta.diagonal_m > 1e-6f && s.meta.diagonal_m < 1e6f);
        die(EXIT_WORK, "the finished blob does not open: %s%s", palp_status_text(status),
            odd ? " (are the units metres and pascals?)" : "");
    }
    void *owned[] = {s.rest,          s.node,         s.tet,
                     s.around_offset, s.around,       s.container,
                     s.family,        s.child_offset, s.parent_offset,
                     s.child,         s.parent,       s.mean_offset,
                     s.mean,          s.mean_weight,  s.skin_node,
                     s.skin_triangle, s.skin_tet,     s.container_weight,
                     s.skin_normal,   s.skin_weight};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    return out;
}

/* ---- from a model ---- */

static uint8_t *pins(const body_spec *body, const tetmesh *m, uint32_t level) {
    const mesh points = {.vertices = m->nodes, .x = m->x};
    uint8_t *pinned = body_bones(body, &points);
    uint32_t count = 0;
    for (uint32_t i = 0; i < m->nodes; i++) count += pinned[i];
    if (body->fix_count > 0 && count < 3) {
        die(EXIT_WORK,
            "level %" PRIu32 " has %" PRIu32 " of its %" PRIu32
            " nodes in the fixed region and needs three: use more nodes or a larger region",
            level, count, m->nodes);
    }
    if (count == m->nodes)
        die(EXIT_WORK, "all nodes of level %" PRIu32 " are fixed: nothing is left to move", level);
    return pinned;
}

static void print_level(FILE *f, uint32_t l, const tetmesh *m, const uint8_t *pinned,
                        const tet_quality *q, double diagonal) {
    uint32_t count = 0;
    for (uint32_t i = 0; i < m->nodes; i++) count += pinned[i];
    fprintf(f,
            "level %" PRIu32 "               %" PRIu32 " nodes (%" PRIu32 " fixed), %" PRIu32
            " tetrahedra, dihedral angles %.1f to %.1f deg",
            l, m->nodes, count, m->tets, q->low_deg, q->high_deg);
    if (diagonal > 0)
        fprintf(f, ", volume %+.2f %%, to the surface %.3f mean %.3f largest (%% of the diagonal)",
                100 * q->volume_error, 100 * q->mean_m / diagonal, 100 * q->largest_m / diagonal);
    fputc('\n', f);
}

uint8_t *tet_bake(const tet_model *t, const body_spec *body, const char *save_mesh, FILE *f,
                  size_t *bytes) {
    tetmesh level[TET_LEVELS];
    uint8_t *pinned[TET_LEVELS], sha[32];
    const char *source = t->from[0] != NULL ? t->from[0] : body->mesh_path;
    body_require_material(body);
    for (int k = 0; k < body->fix_count; k++) {
        if (body->fixes[k].kind == FIX_NODES && (t->levels > 1 || t->from[0] == NULL))
            die(EXIT_USAGE, "fix-nodes: levels have different nodes: use fix-below, fix-above or "
                            "fix-box");
    }
    if (source == NULL) die(EXIT_USAGE, "no mesh: a 'mesh FILE' line or 'tets-from FILE ...'");
    size_t file_bytes;
    char *file = read_file(source, &file_bytes);
    sha256(file, file_bytes, sha);
    free(file);
    mesh surface = {.vertices = 0};
    bvh *on = NULL;
    if (t->from[0] == NULL) {
        surface =
            body->as_is ? body_mesh(body) : mesh_load_as(source, &body->choice, HOLES_REMESHED);
        if (!body->as_is) require_near_origin(surface.x, surface.vertices, source);
        mesh_require_closed(&surface, source);
        if (!body->as_is) mesh_warn_of_size(&surface, source);
        on = bvh_build(&surface);
    }
    body_warn_of_material(body);
    progress_begin("tetrahedra", t->levels);
    for (uint32_t l = 0; l < t->levels; l++) {
        double pitch, dropped = 0;
        level[l] = on != NULL ? stuff_level(&surface, on, t->nodes[l], l, &pitch, &dropped)
                              : tetmesh_load(t->from[l]);
        if (on == NULL) require_near_origin(level[l].x, level[l].nodes, t->from[l]);
        if (dropped > 1e-3)
            warn("level %" PRIu32
                 ": %.1f %% of the volume hangs on by less than one element and is "
                 "left out",
                 l, 100 * dropped);
        pinned[l] = pins(body, &level[l], l);
        progress_add(1);
    }
    progress_end();
    uint32_t joined;
    uint8_t *out = tet_assemble(level, pinned, t->levels, body, t, sha, &joined, bytes);
    for (uint32_t l = 0; l < t->levels; l++) {
        tet_quality q = {.low_deg = 0};
        double diagonal = on != NULL ? mesh_diagonal(&surface) : 0;
        const mesh none = {.vertices = 0};
        q = tetmesh_quality(&level[l], on != NULL ? &surface : &none, on);
        print_level(f, l, &level[l], pinned[l], &q, diagonal);
        if (q.volume_error < -0.3)
            warn("level %" PRIu32 " misses %.0f %% of the volume, parts that are thinner than its "
                 "elements: use more nodes",
                 l, -100 * q.volume_error);
        if (save_mesh != NULL) {
            char path[4096];
            numbered_path(save_mesh, (int)l, path, sizeof path);
            tetmesh_save(&level[l], path);
        }
        tetmesh_free(&level[l]);
        free(pinned[l]);
    }
    if (joined > 0) fprintf(f, "families              %" PRIu32 " parents share one\n", joined);
    fprintf(f, "blob                  %zu bytes\n", *bytes);
    if (on != NULL) bvh_free(on);
    mesh_free(&surface);
    return out;
}
