/* SPDX-License-Identifier: MIT */
#include "tools/mesh/meshmend.h"
#include "port/host/util.h"
#include "tools/mesh/meshsplit.h"
#include "tools/mesh/union_find.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SAME 1e-6       /* of the diagonal */
#define MOST_OPEN 20000 /* open edges among which junctions are searched */
#define NONE UINT32_MAX

/* ---- edges ---- */

/* Those of one triangle only; returns how many. */
static size_t open_sides(const mesh *m, half_edge **open) {
    half_edge *s = mesh_half_edges(m);
    const size_t all = 3 * (size_t)m->triangles;
    size_t n = 0;
    for (size_t i = 0; i < all;) {
        const size_t j = half_edge_run_end(s, i, all);
        if (j == i + 1) s[n++] = s[i];
        i = j;
    }
    *open = s;
    return n;
}

/* ---- weld ---- */

typedef struct {
    int64_t cell[3];
    uint32_t vertex;
} celled;

static int compare_cells(const void *a, const void *b) {
    const celled *p = a, *q = b;
    for (int k = 0; k < 3; k++) {
        if (p->cell[k] != q->cell[k]) return p->cell[k] < q->cell[k] ? -1 : 1;
    }
    return p->vertex < q->vertex ? -1 : p->vertex > q->vertex;
}

/* First of the cells that is not before `key`. */
static size_t find_cell(const celled *c, size_t n, const celled *key) {
    size_t low = 0, high = n;
    while (low < high) {
        const size_t mid = (low + high) / 2;
        if (compare_cells(&c[mid], key) < 0)
            low = mid + 1;
        else
            high = mid;
    }
    return low;
}

/* The first vertex within reach of vertex `c[i]`, itself if there is none before it. */
static uint32_t first_near(const mesh *m, const celled *c, size_t n, size_t i, double within) {
    uint32_t first = c[i].vertex;
    for (int64_t dx = -1; dx <= 1; dx++) {
        for (int64_t dy = -1; dy <= 1; dy++) {
            const celled from = {{c[i].cell[0] + dx, c[i].cell[1] + dy, c[i].cell[2] - 1}, 0};
            for (size_t k = find_cell(c, n, &from); k < n; k++) {
                if (c[k].cell[0] != from.cell[0] || c[k].cell[1] != from.cell[1] ||
                    c[k].cell[2] > c[i].cell[2] + 1)
                    break;
                double d[3];
                v_sub(m->x[c[k].vertex], m->x[c[i].vertex], d);
                if (c[k].vertex < first && v_norm(d) <= within) first = c[k].vertex;
            }
        }
    }
    return first;
}

/* Triangles by the vertices that theirs have become; those that vanish go. */
static void rename_corners(mesh *m, const uint32_t *now) {
    uint32_t kept = 0;
    for (uint32_t i = 0; i < m->triangles; i++) {
        uint32_t t[3];
        for (int k = 0; k < 3; k++) t[k] = now[m->t[i][k]];
        if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) continue;
        memcpy(m->t[kept++], t, sizeof t);
    }
    m->triangles = kept;
}

static uint32_t weld(mesh *m, double within) {
    half_edge *open;
    const size_t sides = open_sides(m, &open);
    uint8_t *at_edge = allocate(m->vertices, 1);
    for (size_t i = 0; i < sides; i++) at_edge[open[i].low] = at_edge[open[i].high] = 1;
    free(open);
    celled *c = allocate(m->vertices, sizeof *c);
    size_t n = 0;
    for (uint32_t i = 0; i < m->vertices; i++) {
        if (at_edge[i] == 0) continue;
        c[n].vertex = i;
        for (int k = 0; k < 3; k++)
            c[n].cell[k] = (int64_t)fmin(9e18, fmax(-9e18, floor(m->x[i][k] / within)));
        n++;
    }
    free(at_edge);
    qsort(c, n, sizeof *c, compare_cells);
    uint32_t *now = allocate(m->vertices, sizeof *now), welded = 0;
    for (uint32_t i = 0; i < m->vertices; i++) now[i] = i;
    for (size_t i = 0; i < n; i++) {
        now[c[i].vertex] = first_near(m, c, n, i, within);
        welded += now[c[i].vertex] != c[i].vertex;
    }
    for (uint32_t i = 0; i < m->vertices; i++) now[i] = now[now[i]]; /* chains: first come first */
    if (welded > 0) {
        rename_corners(m, now);
        (void)mesh_drop_unused(m);
    }
    free(now);
    free(c);
    return welded;
}

/* ---- edges without length ---- */

/* The ends of an edge become one, the first; a triangle there goes. */
static uint32_t collapse_short(mesh *m, double within) {
    uint32_t *parent = allocate(m->vertices, sizeof *parent), collapsed = 0;
    for (uint32_t i = 0; i < m->vertices; i++) parent[i] = i;
    for (size_t side = 0; side < 3 * (size_t)m->triangles; side++) {
        const uint32_t *t = m->t[side / 3];
        const uint32_t a = set_of(parent, t[side % 3]), b = set_of(parent, t[(side + 1) % 3]);
        if (a == b || v_distance(m->x[a], m->x[b]) > within) continue;
        set_join(parent, a, b);
        collapsed++;
    }
    if (collapsed > 0) {
        for (uint32_t i = 0; i < m->vertices; i++) parent[i] = set_of(parent, i);
        rename_corners(m, parent);
        (void)mesh_drop_unused(m);
    }
    free(parent);
    return collapsed;
}

/* ---- pairs of triangles that face each other ---- */

typedef struct {
    uint32_t corner[3]; /* ascending */
    bool turned;        /* against them */
    uint32_t triangle;
} named_triangle;

static int compare_names(const void *a, const void *b) {
    const named_triangle *p = a, *q = b;
    for (int k = 0; k < 3; k++) {
        if (p->corner[k] != q->corner[k]) return p->corner[k] < q->corner[k] ? -1 : 1;
    }
    return p->triangle < q->triangle ? -1 : p->triangle > q->triangle;
}

static named_triangle name_triangle(const mesh *m, uint32_t triangle) {
    named_triangle n = {.triangle = triangle};
    memcpy(n.corner, m->t[triangle], sizeof n.corner);
    for (int pass = 0; pass < 3; pass++) {
        const int k = pass % 2;
        const uint32_t first = n.corner[k];
        if (first <= n.corner[k + 1]) continue;
        n.corner[k] = n.corner[k + 1];
        n.corner[k + 1] = first;
        n.turned = !n.turned;
    }
    return n;
}

/* Triangles over the same three vertices that face each other enclose nothing: both go. A surface
 * that is doubled stays, all over or by triangles that run the same way, to be refused. */
static uint32_t drop_facing(mesh *m, bool *doubled) {
    named_triangle *name = allocate(m->triangles, sizeof *name);
    uint8_t *goes = allocate(m->triangles, 1);
    uint32_t pairs = 0;
    for (uint32_t i = 0; i < m->triangles; i++) name[i] = name_triangle(m, i);
    qsort(name, m->triangles, sizeof *name, compare_names);
    for (uint32_t i = 0; i < m->triangles;) {
        uint32_t j = i, count[2] = {0, 0};
        while (j < m->triangles &&
               memcmp(name[j].corner, name[i].corner, sizeof name[i].corner) == 0)
            count[name[j++].turned]++;
        const uint32_t both = count[0] < count[1] ? count[0] : count[1];
        uint32_t left[2] = {both, both};
        for (; i < j; i++) {
            if (left[name[i].turned] == 0) continue;
            left[name[i].turned]--;
            goes[name[i].triangle] = 1;
        }
        pairs += both;
        *doubled = *doubled || count[0] > both + 1 || count[1] > both + 1;
    }
    *doubled = *doubled || 4 * (uint64_t)pairs > m->triangles;
    if (*doubled) pairs = 0;
    uint32_t kept = 0;
    for (uint32_t i = 0; i < m->triangles && pairs > 0; i++) {
        if (goes[i] == 0) memcpy(m->t[kept++], m->t[i], sizeof *m->t);
    }
    if (pairs > 0) {
        m->triangles = kept;
        (void)mesh_drop_unused(m);
    }
    free(name);
    free(goes);
    return pairs;
}

/* ---- slivers ---- */

/* The corner from which a triangle's longest edge goes, if the third lies on it. */
static bool is_sliver(const mesh *m, uint32_t triangle, double within, uint32_t *corner) {
    const uint32_t *t = m->t[triangle];
    double longest = 0, n[3];
    *corner = 0;
    for (uint32_t k = 0; k < 3; k++) {
        double d[3];
        v_sub(m->x[t[(k + 1) % 3]], m->x[t[k]], d);
        if (v_norm(d) <= longest) continue;
        longest = v_norm(d);
        *corner = k;
    }
    triangle_normal(m->x[t[0]], m->x[t[1]], m->x[t[2]], n);
    return v_norm(n) <= within * longest; /* twice the area over the edge: its height */
}

/* The triangle on the other side of an edge, and the corner that the edge faces; NONE. */
static uint32_t across(const mesh *m, uint32_t triangle, uint32_t a, uint32_t b, uint32_t *facing) {
    for (uint32_t i = 0; i < m->triangles; i++) {
        if (i == triangle) continue;
        for (uint32_t k = 0; k < 3; k++) {
            const uint32_t p = m->t[i][k], q = m->t[i][(k + 1) % 3];
            if ((p != a || q != b) && (p != b || q != a)) continue;
            *facing = m->t[i][(k + 2) % 3];
            return i;
        }
    }
    return NONE;
}

static uint32_t turn_once(mesh *m, double within) {
    uint32_t turned = 0;
    for (uint32_t i = 0; i < m->triangles; i++) {
        uint32_t k, facing;
        if (turned > m->triangles || !is_sliver(m, i, within, &k)) continue;
        const uint32_t a = m->t[i][k], b = m->t[i][(k + 1) % 3], on = m->t[i][(k + 2) % 3];
        const uint32_t other = across(m, i, a, b, &facing);
        turned++;
        if (other == NONE || facing == on) { /* nothing beyond: it goes, and its double with it */
            const uint32_t last = m->triangles - 1;
            if (other != NONE) {
                memmove(m->t[other], m->t[other + 1], (last - other) * sizeof m->t[0]);
                m->triangles--;
            }
            const uint32_t at = other != NONE && other < i ? i - 1 : i;
            memmove(m->t[at], m->t[at + 1], (m->triangles - 1 - at) * sizeof m->t[0]);
            m->triangles--;
            i = at - 1; /* what has come in its place is next */
            continue;
        }
        const uint32_t one[3] = {on, a, facing}, two[3] = {b, on, facing};
        memcpy(m->t[i], one, sizeof one);
        memcpy(m->t[other], two, sizeof two);
    }
    return turned;
}

/* All of them; or none, where some would be left. */
static uint32_t turn_slivers(mesh *m, double within) {
    mesh before = mesh_copy(m);
    uint32_t turned = turn_once(m, within), corner;
    for (uint32_t i = 0; i < m->triangles; i++) {
        if (!is_sliver(m, i, within, &corner)) continue;
        memcpy(m->t, before.t, before.triangles * sizeof *m->t);
        m->triangles = before.triangles;
        turned = 0;
        break;
    }
    mesh_free(&before);
    return turned;
}

/* ---- junctions ---- */

/* A vertex of an open edge that lies within another; NONE. */
static uint32_t vertex_on(const mesh *m, const half_edge *open, size_t sides, const half_edge *edge,
                          double within) {
    double along[3], best = INFINITY;
    uint32_t found = NONE;
    v_sub(m->x[edge->high], m->x[edge->low], along);
    const double length = v_norm(along);
    for (size_t i = 0; i < 2 * sides; i++) {
        const uint32_t v = i % 2 == 0 ? open[i / 2].low : open[i / 2].high;
        double d[3], off[3];
        if (v == edge->low || v == edge->high) continue;
        v_sub(m->x[v], m->x[edge->low], d);
        const double t = v_dot(d, along) / length;
        if (t <= within || t >= length - within) continue;
        for (int k = 0; k < 3; k++) off[k] = d[k] - t * along[k] / length;
        if (v_norm(off) > within || t >= best) continue;
        best = t;
        found = v;
    }
    return found;
}

/* Cuts the triangle of each open edge that a vertex lies on; returns how many were cut. */
static uint32_t cut_once(mesh *m, double within) {
    half_edge *open;
    const size_t sides = open_sides(m, &open);
    uint32_t cut = 0;
    uint8_t *changed = allocate(m->triangles, 1);
    size_t room = m->triangles;
    for (size_t i = 0; i < sides && sides <= MOST_OPEN; i++) {
        if (changed[open[i].triangle] != 0) continue;
        const uint32_t v = vertex_on(m, open, sides, &open[i], within);
        if (v == NONE) continue;
        mesh_cut_side(m, &room, &open[i], v);
        changed[open[i].triangle] = 1;
        cut++;
    }
    free(changed);
    free(open);
    return cut;
}

/* ---- */

void mesh_mend(mesh *m, mesh_mended *mended) {
    const double within = SAME * mesh_diagonal(m);
    bool doubled = false;
    mended->within_m = within;
    if (!(within > 0)) return;
    mended->welded += weld(m, within);
    if (!mesh_is_far(m)) mended->collapsed += collapse_short(m, within);
    mended->facing += drop_facing(m, &doubled);
    mended->slivers += turn_slivers(m, within);
    for (uint32_t cut = 1; cut > 0;) {
        cut = cut_once(m, within);
        mended->junctions += cut;
    }
    if (mended->junctions > 0) mended->facing += drop_facing(m, &doubled);
    if (!doubled) mended->split += mesh_split_touching(m);
    (void)mesh_drop_unused(m); /* what only a sliver had */
}

uint32_t mesh_turn_slivers(mesh *m) {
    const double within = SAME * mesh_diagonal(m);
    return within > 0 ? turn_slivers(m, within) : 0;
}

static void add(char *text, size_t size, uint32_t count, const char *what) {
    const size_t used = strlen(text);
    if (count == 0) return;
    snprintf(text + used, size - used, "%s%" PRIu32 " %s", used > 0 ? ", " : "", count, what);
}

void mesh_report_mended(const char *path, const mesh_mended *mended) {
    char text[512] = "";
    add(text, sizeof text, mended->corners, "repeated corners left out");
    add(text, sizeof text, mended->wires, "faces of fewer than three corners left out");
    add(text, sizeof text, mended->unused, "unused vertices left out");
    add(text, sizeof text, mended->welded, "vertices welded to others at the same place");
    add(text, sizeof text, mended->collapsed, "edges without length collapsed");
    add(text, sizeof text, mended->facing, "pairs of triangles that face each other left out");
    add(text, sizeof text, mended->slivers, "triangles without area turned");
    add(text, sizeof text, mended->junctions, "triangles cut at a vertex on their edge");
    add(text, sizeof text, mended->split, "vertices added where the surface touches itself");
    if (text[0] != '\0')
        warn("%s: mended: %s (the same place: within %.2g)", path, text, mended->within_m);
}
