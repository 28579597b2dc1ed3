/* SPDX-License-Identifier: MIT */
#include "tools/mesh/cut_mesh.h"
#include "tools/mesh/cap_surface.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SNAP 0.25 /* of an edge */

cutting cut_begin(mesh m) {
    cutting c = {.m = m, .vertex_room = m.vertices, .triangle_room = m.triangles};
    c.label = allocate(m.triangles, sizeof *c.label);
    c.label_room = m.triangles;
    return c;
}

static uint32_t add_vertex(cutting *c, const double x[3]) {
    c->m.x = grow(c->m.x, &c->vertex_room, c->m.vertices + 1u, sizeof *c->m.x);
    memcpy(c->m.x[c->m.vertices], x, sizeof *c->m.x);
    return c->m.vertices++;
}

static void add_triangle(cutting *c, uint32_t a, uint32_t b, uint32_t d, uint32_t label) {
    c->m.t = grow(c->m.t, &c->triangle_room, c->m.triangles + 1u, sizeof *c->m.t);
    c->label = grow(c->label, &c->label_room, c->m.triangles + 1u, sizeof *c->label);
    uint32_t *t = c->m.t[c->m.triangles];
    t[0] = a;
    t[1] = b;
    t[2] = d;
    c->label[c->m.triangles++] = label;
}

/* ---- planes ---- */

typedef struct {
    double *height;   /* over the plane */
    uint32_t *around; /* label of each vertex, MIXED where two meet */
} knife;

#define NOBODY 0xffffffffu
#define MIXED 0xfffffffeu

static double height_of(const double x[3], const double point[3], const double normal[3]) {
    double off[3];
    v_sub(x, point, off);
    return v_dot(off, normal);
}

static knife prepare(const cutting *c, const double point[3], const double normal[3]) {
    knife k = {.height = allocate(c->m.vertices, sizeof *k.height),
               .around = allocate(c->m.vertices, sizeof *k.around)};
    for (uint32_t i = 0; i < c->m.vertices; i++) {
        k.height[i] = height_of(c->m.x[i], point, normal);
        k.around[i] = NOBODY;
    }
    for (uint32_t i = 0; i < c->m.triangles; i++) {
        for (int e = 0; e < 3; e++) {
            uint32_t *around = &k.around[c->m.t[i][e]];
            *around = *around == NOBODY || *around == c->label[i] ? c->label[i] : MIXED;
        }
    }
    return k;
}

/* Moves vertices near the plane onto it, along the edge that crosses nearest to them. */
static void snap(cutting *c, knife *k, uint32_t from) {
    double(*moved)[3] = allocate(c->m.vertices, sizeof *moved);
    double *share = allocate(c->m.vertices, sizeof *share);
    for (uint32_t i = 0; i < c->m.vertices; i++) share[i] = SNAP;
    for (uint32_t i = 0; i < c->m.triangles; i++) {
        for (int e = 0; e < 6 && c->label[i] == from; e++) {
            uint32_t a = c->m.t[i][e % 3], b = c->m.t[i][(e % 3 + 1 + e / 3) % 3];
            if (k->around[a] != from || !(k->height[a] * k->height[b] < 0)) continue;
            double t = k->height[a] / (k->height[a] - k->height[b]);
            if (t >= share[a]) continue;
            share[a] = t;
            for (int d = 0; d < 3; d++)
                moved[a][d] = c->m.x[a][d] + t * (c->m.x[b][d] - c->m.x[a][d]);
        }
    }
    for (uint32_t i = 0; i < c->m.vertices; i++) {
        if (!(share[i] < SNAP)) continue;
        c->snapped_m = fmax(c->snapped_m, v_distance(c->m.x[i], moved[i]));
        memcpy(c->m.x[i], moved[i], sizeof moved[i]);
        k->height[i] = 0;
    }
    free(moved);
    free(share);
}

/* Vertices where edges of one zone cross the plane, found again by their ends. */
typedef struct {
    uint32_t a, b, vertex;
} crossing;

static int by_ends(const void *p, const void *q) {
    const crossing *x = p, *y = q;
    if (x->a != y->a) return x->a < y->a ? -1 : 1;
    return (x->b > y->b) - (x->b < y->b);
}

static uint32_t on_edge(const crossing *list, size_t count, uint32_t a, uint32_t b) {
    if (count == 0) return NOBODY;
    crossing key = {.a = a < b ? a : b, .b = a < b ? b : a};
    const crossing *found = bsearch(&key, list, count, sizeof *list, by_ends);
    return found != NULL ? found->vertex : NOBODY;
}

static crossing *split_edges(cutting *c, const knife *k, uint32_t from, const char *where,
                             size_t *count) {
    crossing *list = NULL;
    size_t room = 0, n = 0;
    for (uint32_t i = 0; i < c->m.triangles; i++) {
        for (int e = 0; e < 3 && c->label[i] == from; e++) {
            uint32_t a = c->m.t[i][e], b = c->m.t[i][(e + 1) % 3];
            if (!(k->height[a] * k->height[b] < 0)) continue;
            if (k->around[a] == MIXED && k->around[b] == MIXED) {
                die(EXIT_WORK,
                    "%s: the cut meets another one near (%g, %g, %g): cuts must not touch", where,
                    c->m.x[a][0], c->m.x[a][1], c->m.x[a][2]);
            }
            list = grow(list, &room, n + 1, sizeof *list);
            list[n++] = (crossing){.a = a < b ? a : b, .b = a < b ? b : a, .vertex = NOBODY};
        }
    }
    if (n > 0) qsort(list, n, sizeof *list, by_ends);
    *count = 0;
    for (size_t i = 0; i < n; i++) {
        if (*count > 0 && by_ends(&list[*count - 1], &list[i]) == 0) continue;
        crossing *x = &list[*count];
        *x = list[i];
        (*count)++;
        double p[3], t = k->height[x->a] / (k->height[x->a] - k->height[x->b]);
        for (int d = 0; d < 3; d++)
            p[d] = c->m.x[x->a][d] + t * (c->m.x[x->b][d] - c->m.x[x->a][d]);
        x->vertex = add_vertex(c, p);
    }
    return list;
}

/* Cuts triangle i, whose corners are turned so that the lone one, or the one on the plane, comes
 * first. */
static void split_triangle(cutting *c, const knife *k, const crossing *list, size_t count,
                           uint32_t i, uint32_t from, uint32_t to) {
    uint32_t t[3], cut[3];
    int crossed = 0;
    memcpy(t, c->m.t[i], sizeof t);
    for (int e = 0; e < 3; e++) {
        cut[e] = on_edge(list, count, t[e], t[(e + 1) % 3]);
        crossed += cut[e] != NOBODY;
    }
    if (crossed == 0) {
        double most = 0;
        for (int e = 0; e < 3; e++)
            if (fabs(k->height[t[e]]) > fabs(most)) most = k->height[t[e]];
        c->label[i] = most > 0 ? to : from;
        return;
    }
    int first = 0;
    if (crossed == 1) { /* the edge opposite `first` is cut */
        while (cut[(first + 1) % 3] == NOBODY) first++;
    } else { /* the two edges at `first` are cut */
        while (cut[first] == NOBODY || cut[(first + 2) % 3] == NOBODY) first++;
    }
    uint32_t a = t[first], b = t[(first + 1) % 3], d = t[(first + 2) % 3];
    uint32_t ab = cut[first], bd = cut[(first + 1) % 3], da = cut[(first + 2) % 3];
    uint32_t *own = c->m.t[i];
    if (crossed == 1) {
        uint32_t kept[3] = {a, b, bd};
        memcpy(own, kept, sizeof kept);
        c->label[i] = k->height[b] > 0 ? to : from;
        add_triangle(c, a, bd, d, k->height[d] > 0 ? to : from);
        return;
    }
    uint32_t kept[3] = {a, ab, da}, far = k->height[b] > 0 ? to : from;
    memcpy(own, kept, sizeof kept);
    c->label[i] = k->height[a] > 0 ? to : from;
    if (v_distance(c->m.x[ab], c->m.x[d]) < v_distance(c->m.x[b], c->m.x[da])) {
        add_triangle(c, ab, b, d, far);
        add_triangle(c, ab, d, da, far);
    } else {
        add_triangle(c, ab, b, da, far);
        add_triangle(c, b, d, da, far);
    }
}

void cut_plane(cutting *c, uint32_t from, uint32_t to, const double point[3],
               const double normal[3], const char *where) {
    double n[3] = {normal[0], normal[1], normal[2]};
    v_normalize(n);
    double tiny = 1e-9 * mesh_diagonal(&c->m);
    knife k = prepare(c, point, n);
    for (uint32_t i = 0; i < c->m.vertices; i++) {
        if (fabs(k.height[i]) < tiny) k.height[i] = 0;
    }
    uint32_t below = 0, beyond = 0, triangles = c->m.triangles;
    for (uint32_t i = 0; i < triangles; i++) {
        for (int e = 0; e < 3 && c->label[i] == from; e++) {
            below += k.height[c->m.t[i][e]] < 0;
            beyond += k.height[c->m.t[i][e]] > 0;
        }
    }
    if (below == 0 || beyond == 0) {
        die(EXIT_WORK, "%s: all of the zone lies %s the plane: move the cut", where,
            beyond == 0 ? "behind" : "beyond");
    }
    snap(c, &k, from);
    size_t count;
    crossing *list = split_edges(c, &k, from, where, &count);
    for (uint32_t i = 0; i < triangles; i++) {
        if (c->label[i] == from) split_triangle(c, &k, list, count, i, from, to);
    }
    free(list);
    free(k.height);
    free(k.around);
}

/* ---- labels ---- */

void cut_labels(cutting *c, const char *path, uint32_t (*find)(const void *context, const char *),
                const void *context) {
    size_t bytes, number = 0;
    char *text = read_file(path, &bytes), *cursor = text;
    uint32_t filled = 0;
    for (char *line; (line = next_line(&cursor, &number)) != NULL;) {
        if (*line == '\0') continue;
        uint32_t zone = find(context, line);
        if (zone == NOBODY) die(EXIT_USAGE, "%s:%zu: no zone named '%s'", path, number, line);
        if (filled == c->m.triangles) {
            die(EXIT_USAGE, "%s:%zu: more labels than the %" PRIu32 " triangles of the mesh", path,
                number, c->m.triangles);
        }
        c->label[filled++] = zone;
    }
    if (filled < c->m.triangles) {
        die(EXIT_USAGE,
            "%s: %" PRIu32 " labels for %" PRIu32
            " triangles (of the mesh as it is after 'loop' or remeshing: 'as-is' keeps it)",
            path, filled, c->m.triangles);
    }
    free(text);
}

/* ---- closing the zones ---- */

/* A directed edge of zone a's surface where zone b goes on. */
typedef struct {
    uint32_t a, b, from, to;
} rim;

static int by_pair(const void *p, const void *q) {
    const uint32_t *x = p, *y = q;
    for (int k = 0; k < 3; k++) {
        if (x[k] != y[k]) return x[k] < y[k] ? -1 : 1;
    }
    return 0;
}

static uint32_t label_beyond(const cutting *c, const mesh_edge *e, uint32_t triangle) {
    return c->label[e->triangle[e->triangle[0] == triangle ? 1 : 0]];
}

/* Rims between labels, sorted by pair and start; each pair once, from the lower label's side. */
static rim *find_rims(const cutting *c, uint32_t *count) {
    uint32_t edges;
    mesh_edge *edge = mesh_edges(&c->m, &edges);
    rim *list = allocate(edges + 1u, sizeof *list);
    *count = 0;
    for (uint32_t i = 0; i < edges; i++) {
        uint32_t owner = edge[i].triangle[0];
        if (c->label[edge[i].triangle[1]] < c->label[owner]) owner = edge[i].triangle[1];
        uint32_t other = label_beyond(c, &edge[i], owner);
        if (other == c->label[owner]) continue;
        const uint32_t *t = c->m.t[owner];
        for (int k = 0; k < 3; k++) {
            uint32_t from = t[k], to = t[(k + 1) % 3];
            bool match =
                (from == edge[i].a && to == edge[i].b) || (from == edge[i].b && to == edge[i].a);
            if (match) list[(*count)++] = (rim){c->label[owner], other, from, to};
        }
    }
    free(edge);
    qsort(list, *count, sizeof *list, by_pair);
    return list;
}

/* Chains the rims of one pair into loops: vertices in `order`, lengths in `length`; returns how
 * many. */
static uint32_t chain_loops(const cutting *c, const rim *list, uint32_t count, const char *what,
                            uint32_t *order, uint32_t *length) {
    uint8_t *used = allocate(count, 1);
    uint32_t loops = 0, filled = 0;
    for (uint32_t first = 0; first < count; first++) {
        if (used[first] != 0) continue;
        uint32_t at = first, start = filled;
        while (used[at] == 0) {
            used[at] = 1;
            order[filled++] = list[at].from;
            const rim key = {list[0].a, list[0].b, list[at].to, 0};
            const rim *next = bsearch(&key, list, count, sizeof *list, by_pair);
            bool twice =
                next != NULL && ((next > list && by_pair(next - 1, &key) == 0) ||
                                 (next + 1 < list + count && by_pair(next + 1, &key) == 0));
            if (next == NULL || twice) {
                const double *x = c->m.x[list[at].to];
                die(EXIT_WORK,
                    "%s: the cut does not close at vertex (%g, %g, %g): three zones must not meet, "
                    "and each zone must be in one piece",
                    what, x[0], x[1], x[2]);
            }
            at = (uint32_t)(next - list);
        }
        length[loops++] = filled - start;
    }
    free(used);
    return loops;
}

/* Vertices of the whole mesh to those of each zone. */
typedef struct {
    uint32_t *local; /* [vertices] of the zone at hand, NOBODY elsewhere */
    size_t vertex_room, triangle_room;
} zone_map;

static zone_map extract(const cutting *c, uint32_t zone, mesh *m) {
    zone_map z = {.local = allocate(c->m.vertices, sizeof *z.local)};
    memset(z.local, 0xff, c->m.vertices * sizeof *z.local);
    *m = (mesh){.vertices = 0};
    for (uint32_t i = 0; i < c->m.triangles; i++) {
        for (int k = 0; k < 3 && c->label[i] == zone; k++) z.local[c->m.t[i][k]] = 0;
    }
    for (uint32_t i = 0; i < c->m.vertices; i++) {
        if (z.local[i] == NOBODY) continue;
        m->x = grow(m->x, &z.vertex_room, m->vertices + 1u, sizeof *m->x);
        memcpy(m->x[m->vertices], c->m.x[i], sizeof *m->x);
        z.local[i] = m->vertices++;
    }
    for (uint32_t i = 0; i < c->m.triangles; i++) {
        if (c->label[i] != zone) continue;
        m->t = grow(m->t, &z.triangle_room, m->triangles + 1u, sizeof *m->t);
        for (int k = 0; k < 3; k++) m->t[m->triangles][k] = z.local[c->m.t[i][k]];
        m->triangles++;
    }
    return z;
}

/* Adds the cut surface to one of its zones, turned round for the second. */
static void close_zone(const cap *s, const uint32_t *order, zone_map *z, mesh *m, bool second,
                       seam_list *list) {
    uint32_t added = m->vertices;
    for (uint32_t i = 0; i < s->points; i++) {
        uint32_t node = i < s->boundary ? z->local[order[i]] : added + i - s->boundary;
        list->node[i][second ? 1 : 0] = node;
        if (i < s->boundary) continue;
        m->x = grow(m->x, &z->vertex_room, m->vertices + 1u, sizeof *m->x);
        memcpy(m->x[m->vertices++], s->x[i], sizeof *m->x);
    }
    for (uint32_t i = 0; i < s->triangles; i++) {
        m->t = grow(m->t, &z->triangle_room, m->triangles + 1u, sizeof *m->t);
        for (int k = 0; k < 3; k++)
            m->t[m->triangles][second ? 2 - k : k] = list->node[s->t[i][k]][second ? 1 : 0];
        m->triangles++;
    }
}

uint32_t cut_finish(const cutting *c, uint32_t zones, const char *const *name, mesh *zone,
                    seam_list **seams) {
    uint32_t count, found = 0;
    rim *list = find_rims(c, &count);
    zone_map *map = allocate(zones, sizeof *map);
    size_t room = 0;
    *seams = NULL;
    for (uint32_t z = 0; z < zones; z++) {
        map[z] = extract(c, z, &zone[z]);
        if (zone[z].triangles == 0) die(EXIT_WORK, "zone '%s' is empty", name[z]);
    }
    uint32_t *order = allocate(count + 1u, sizeof *order);
    uint32_t *length = allocate(count + 1u, sizeof *length);
    double(*loop)[3] = allocate(count + 1u, sizeof *loop);
    for (uint32_t first = 0, end; first < count; first = end) {
        char what[128];
        uint32_t a = list[first].a, b = list[first].b;
        for (end = first; end < count && list[end].a == a && list[end].b == b; end++) {}
        snprintf(what, sizeof what, "zones '%s' and '%s'", name[a], name[b]);
        uint32_t loops = chain_loops(c, list + first, end - first, what, order, length);
        for (uint32_t i = 0; i < end - first; i++) memcpy(loop[i], c->m.x[order[i]], sizeof *loop);
        cap s = cap_build(loop, length, loops, what);
        *seams = grow(*seams, &room, found + 1u, sizeof **seams);
        seam_list *l = &(*seams)[found++];
        *l = (seam_list){.zone = {a, b}, .nodes = s.points};
        l->node = allocate(s.points, sizeof *l->node);
        close_zone(&s, order, &map[a], &zone[a], false, l);
        close_zone(&s, order, &map[b], &zone[b], true, l);
        cap_free(&s);
    }
    for (uint32_t z = 0; z < zones; z++) free(map[z].local);
    void *owned[] = {map, list, order, length, loop};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    return found;
}
