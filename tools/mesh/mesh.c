/* SPDX-License-Identifier: MIT */
#include "tools/mesh/mesh.h"
#include "port/host/util.h"
#include "tools/mesh/components.h"
#include "tools/mesh/holes.h"
#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

mesh mesh_copy(const mesh *m) {
    mesh c = *m;
    c.x = allocate(m->vertices, sizeof *c.x);
    c.t = allocate(m->triangles, sizeof *c.t);
    memcpy(c.x, m->x, m->vertices * sizeof *c.x);
    memcpy(c.t, m->t, m->triangles * sizeof *c.t);
    return c;
}

void mesh_free(mesh *m) {
    free(m->x);
    free(m->t);
    *m = (mesh){0};
}

void mesh_save_obj(const mesh *m, const char *path) {
    output out = open_output(path);
    for (uint32_t i = 0; i < m->vertices; i++) {
        fprintf(out.file, "v %.17g %.17g %.17g\n", m->x[i][0], m->x[i][1], m->x[i][2]);
    }
    for (uint32_t i = 0; i < m->triangles; i++) {
        fprintf(out.file, "f %" PRIu32 " %" PRIu32 " %" PRIu32 "\n", m->t[i][0] + 1, m->t[i][1] + 1,
                m->t[i][2] + 1);
    }
    commit_output(&out);
}

uint32_t mesh_drop_unused(mesh *m) {
    uint32_t *map = allocate(m->vertices, sizeof *map);
    for (uint32_t i = 0; i < m->triangles; i++) {
        for (int k = 0; k < 3; k++) map[m->t[i][k]] = 1;
    }
    uint32_t kept = 0;
    for (uint32_t i = 0; i < m->vertices; i++) {
        if (map[i] == 0) continue;
        memcpy(m->x[kept], m->x[i], sizeof m->x[i]);
        map[i] = kept++;
    }
    for (uint32_t i = 0; i < m->triangles; i++) {
        for (int k = 0; k < 3; k++) m->t[i][k] = map[m->t[i][k]];
    }
    uint32_t dropped = m->vertices - kept;
    m->vertices = kept;
    free(map);
    return dropped;
}

#define NONE UINT32_MAX

static int compare_half_edges(const void *a, const void *b) {
    const half_edge *p = a;
    const half_edge *q = b;
    if (p->low != q->low) return p->low < q->low ? -1 : 1;
    if (p->high != q->high) return p->high < q->high ? -1 : 1;
    return p->triangle < q->triangle ? -1 : p->triangle > q->triangle;
}

half_edge *mesh_half_edges(const mesh *m) {
    half_edge *h = allocate(3 * (size_t)m->triangles, sizeof *h);
    for (uint32_t i = 0; i < m->triangles; i++) {
        for (uint32_t k = 0; k < 3; k++) {
            uint32_t a = m->t[i][k];
            uint32_t b = m->t[i][(k + 1) % 3];
            h[3 * (size_t)i + k] =
                a < b ? (half_edge){a, b, i, k, true} : (half_edge){b, a, i, k, false};
        }
    }
    qsort(h, 3 * (size_t)m->triangles, sizeof *h, compare_half_edges);
    return h;
}

size_t half_edge_run_end(const half_edge *h, size_t i, size_t count) {
    size_t j = i + 1;
    while (j < count && h[j].low == h[i].low && h[j].high == h[i].high) j++;
    return j;
}

bool half_edge_exists(const half_edge *h, size_t count, uint32_t a, uint32_t b) {
    const uint32_t low = a < b ? a : b, high = a < b ? b : a;
    size_t from = 0, to = count;
    while (from < to) {
        const size_t mid = (from + to) / 2;
        if (h[mid].low < low || (h[mid].low == low && h[mid].high < high))
            from = mid + 1;
        else
            to = mid;
    }
    return from < count && h[from].low == low && h[from].high == high;
}

uint32_t half_edge_facing(const mesh *m, const half_edge *side) {
    return m->t[side->triangle][(side->corner + 2) % 3];
}

uint32_t mesh_add_middle(mesh *m, size_t *room, const half_edge *side) {
    m->x = grow(m->x, room, m->vertices + 1u, sizeof *m->x);
    for (int k = 0; k < 3; k++)
        m->x[m->vertices][k] = 0.5 * (m->x[side->low][k] + m->x[side->high][k]);
    return m->vertices++;
}

void mesh_cut_side(mesh *m, size_t *room, const half_edge *side, uint32_t at) {
    m->t = grow(m->t, room, m->triangles + 1u, sizeof *m->t);
    uint32_t *t = m->t[side->triangle], *second = m->t[m->triangles++];
    memcpy(second, t, 3 * sizeof *t);
    second[side->corner] = at;
    t[(side->corner + 1) % 3] = at;
}

mesh_edge *mesh_edges(const mesh *m, uint32_t *count) {
    size_t total = 3 * (size_t)m->triangles;
    half_edge *h = mesh_half_edges(m);
    mesh_edge *e = allocate(total / 2 + 1, sizeof *e);
    uint32_t n = 0;
    for (size_t i = 0; i + 1 < total; i += 2) {
        e[n++] = (mesh_edge){h[i].low, h[i].high, {h[i].triangle, h[i + 1].triangle}};
    }
    free(h);
    *count = n;
    return e;
}

static void flip(uint32_t t[3]) {
    uint32_t swap = t[1];
    t[1] = t[2];
    t[2] = swap;
}

/* An edge with one triangle: what is missing there. */
static _Noreturn void die_open(const mesh *m, const char *path, const half_edge *side) {
    mesh copy = mesh_copy(m);
    mesh_hole longest, left;
    (void)mesh_close_holes(&copy, 0, &longest, &left);
    if (left.edges == 0)
        die(EXIT_WORK,
            "%s: the surface is open at edge %" PRIu32 "-%" PRIu32 " of triangle %" PRIu32
            " (0-based), and its open edges make no ring: close it there",
            path, side->low, side->high, side->triangle);
    die(EXIT_WORK,
        "%s: the surface is open at edge %" PRIu32 "-%" PRIu32 " of triangle %" PRIu32
        " (0-based); the longest rim has %" PRIu32
        " edges, %.3g cm, around (%.4g, %.4g, %.4g): close it there, or add --holes %.3g",
        path, side->low, side->high, side->triangle, left.edges, 100 * left.rim_m, left.middle[0],
        left.middle[1], left.middle[2], 1.02 * left.rim_m);
}

/* An edge with more than two triangles. */
static _Noreturn void die_shared(const mesh *m, const char *path, const half_edge *side,
                                 size_t count) {
    const double *x = m->x[side->low];
    bool twice = false; /* two of the triangles have the same third vertex */
    for (size_t i = 0; i < count; i++) {
        for (size_t k = 0; k < i; k++)
            twice = twice || half_edge_facing(m, &side[i]) == half_edge_facing(m, &side[k]);
    }
    die(EXIT_WORK,
        "%s: edge %" PRIu32 "-%" PRIu32 " (0-based), at (%.4g, %.4g, %.4g), belongs to %zu "
        "triangles (non-manifold): %s",
        path, side->low, side->high, x[0], x[1], x[2], count,
        twice ? "the surface lies there twice: leave one of the two out"
              : "split the surface there");
}

/* neighbour[t][k] = the triangle across the edge that starts at corner k; exits on a bad edge. */
static void pair_triangles(const mesh *m, const char *path, uint32_t (*neighbour)[3]) {
    size_t total = 3 * (size_t)m->triangles;
    half_edge *h = mesh_half_edges(m);
    for (size_t i = 0; i < total;) {
        size_t j = half_edge_run_end(h, i, total);
        if (j - i == 1) die_open(m, path, &h[i]);
        if (j - i > 2) die_shared(m, path, &h[i], j - i);
        for (size_t k = i; k < j; k++) {
            const half_edge *e = &h[k];
            const uint32_t *t = m->t[e->triangle];
            uint32_t from = e->forward ? e->low : e->high;
            for (int c = 0; c < 3; c++) {
                if (t[c] == from) neighbour[e->triangle][c] = h[k == i ? i + 1 : i].triangle;
            }
        }
        i = j;
    }
    free(h);
}

uint32_t mesh_orient(mesh *m) {
    const size_t total = 3 * (size_t)m->triangles;
    half_edge *h = mesh_half_edges(m);
    uint32_t *beside = allocate(total, sizeof *beside),
             *queue = allocate(m->triangles, sizeof *queue), parts = 0;
    bool *alike = allocate(total, sizeof *alike); /* the two run along the edge in one direction */
    bool *seen = allocate(m->triangles, sizeof *seen),
         *turned = allocate(m->triangles, sizeof *turned);
    memset(beside, 0xff, total * sizeof *beside);
    for (size_t i = 0, j; i < total; i = j) {
        j = half_edge_run_end(h, i, total);
        for (size_t s = i; s < j && j == i + 2; s++) {
            const size_t side = 3 * (size_t)h[s].triangle + h[s].corner;
            beside[side] = h[s == i ? i + 1 : i].triangle;
            alike[side] = h[i].forward == h[i + 1].forward;
        }
    }
    for (uint32_t first = 0; first < m->triangles; first++) {
        uint32_t head = 0, tail = 0;
        if (seen[first]) continue;
        parts++;
        seen[queue[tail++] = first] = true;
        while (head < tail) {
            const uint32_t t = queue[head++];
            for (size_t side = 3 * (size_t)t; side < 3 * (size_t)t + 3; side++) {
                const uint32_t next = beside[side];
                if (next == NONE || seen[next]) continue;
                turned[next] = turned[t] != alike[side];
                seen[queue[tail++] = next] = true;
            }
        }
    }
    for (uint32_t t = 0; t < m->triangles; t++) {
        if (turned[t]) flip(m->t[t]);
    }
    void *owned[] = {h, beside, queue, alike, seen, turned};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    return parts;
}

static _Noreturn void die_of_parts(const mesh *m, const char *path) {
    mesh_components c = mesh_find_components(m);
    if (c.count > 1) {
        mesh_refuse_cavities(m, &c, path);
        die(EXIT_WORK,
            "%s: the mesh has several components: %" PRIu32 ", of %" PRIu32 " and %" PRIu32
            " triangles%s: keep one by --largest or --component N, or bake --each",
            path, c.count, c.triangles[0], c.triangles[1], c.count > 2 ? ", .." : "");
    }
    die(EXIT_WORK, "%s: the mesh has several components that touch in a vertex: split it there",
        path);
}

static void require_oriented(const mesh *m, const char *path) {
    size_t total = 3 * (size_t)m->triangles;
    half_edge *h = mesh_half_edges(m);
    for (size_t i = 0; i + 1 < total; i += 2) {
        if (h[i].forward == h[i + 1].forward) {
            die(EXIT_WORK, "%s: the surface is one-sided at edge %" PRIu32 "-%" PRIu32 " (0-based)",
                path, h[i].low, h[i].high);
        }
    }
    free(h);
}

/* Each vertex must be surrounded by one fan: as many neighbours met by walking as triangles hold
 * it. */
static void require_manifold_vertices(const mesh *m, const char *path) {
    uint32_t *valence = allocate(m->vertices, sizeof *valence);
    uint32_t *any = allocate(m->vertices, sizeof *any);
    for (uint32_t i = 0; i < m->triangles; i++) {
        for (int k = 0; k < 3; k++) {
            valence[m->t[i][k]]++;
            any[m->t[i][k]] = i;
        }
    }
    uint32_t(*across)[3] = allocate(m->triangles, sizeof *across);
    pair_triangles(m, path, across);
    for (uint32_t v = 0; v < m->vertices; v++) {
        if (valence[v] == 0) {
            die(EXIT_WORK, "%s: vertex %" PRIu32 " (0-based) belongs to no triangle: remove it",
                path, v);
        }
        uint32_t t = any[v], steps = 0;
        do {
            int k = 0;
            while (m->t[t][k] != v) k++;
            t = across[t][k];
            steps++;
        } while (t != any[v] && steps <= valence[v]);
        if (steps != valence[v]) {
            die(EXIT_WORK,
                "%s: vertex %" PRIu32
                " (0-based) joins separate parts of the surface (non-manifold): "
                "duplicate it",
                path, v);
        }
    }
    free(across);
    free(any);
    free(valence);
}

#define FAR_SIZES 1e3 /* distance over size beyond which a file's digits run out */

bool mesh_is_far(const mesh *m) {
    return m->vertices > 0 && v_norm(m->x[0]) > FAR_SIZES * mesh_diagonal(m);
}

static void require_sound_triangles(const mesh *m, const char *path) {
    double scale = mesh_diagonal(m);
    for (uint32_t i = 0; i < m->triangles; i++) {
        const uint32_t *t = m->t[i];
        double n[3];
        triangle_normal(m->x[t[0]], m->x[t[1]], m->x[t[2]], n);
        bool repeated = t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
        if (repeated || !(v_norm(n) > 1e-14 * scale * scale)) {
            die(EXIT_WORK, "%s: triangle %" PRIu32 " (0-based) has no area: %s", path, i,
                mesh_is_far(m) ? "the body lies so far from the origin that its vertices have lost "
                                 "their digits: export it at the origin"
                               : "collapse it");
        }
    }
}

static double volume_from(const mesh *m, const double from[3]) {
    double sum = 0;
    for (uint32_t i = 0; i < m->triangles; i++) {
        double r[3][3], c[3];
        for (int k = 0; k < 3; k++) v_sub(m->x[m->t[i][k]], from, r[k]);
        v_cross(r[1], r[2], c);
        sum += v_dot(r[0], c);
    }
    return sum / 6;
}

double mesh_volume(const mesh *m) {
    static const double origin[3];
    return volume_from(m, mesh_is_far(m) ? m->x[0] : origin); /* where it loses no digits */
}

#define FLAT 1e-12 /* volume over the cube of the diagonal of what is no body */

void mesh_require_closed(mesh *m, const char *path) {
    if (m->triangles < 4)
        die(EXIT_WORK, "%s: %" PRIu32 " triangles make no closed surface", path, m->triangles);
    require_sound_triangles(m, path);
    uint32_t(*neighbour)[3] = allocate(m->triangles, sizeof *neighbour);
    pair_triangles(m, path, neighbour);
    free(neighbour);
    if (mesh_orient(m) > 1) die_of_parts(m, path);
    require_oriented(m, path);
    require_manifold_vertices(m, path);
    const double volume = volume_from(m, m->x[0]), size = mesh_diagonal(m);
    if (!(fabs(volume) > FLAT * size * size * size))
        die(EXIT_WORK, "%s: the mesh is flat: it encloses %.2g of its box' diagonal cubed", path,
            volume / (size * size * size));
    if (volume < 0) {
        for (uint32_t i = 0; i < m->triangles; i++) flip(m->t[i]);
    }
}

static int compare_pairs(const void *a, const void *b) {
    const uint32_t *p = a;
    const uint32_t *q = b;
    if (p[0] != q[0]) return p[0] < q[0] ? -1 : 1;
    return p[1] < q[1] ? -1 : p[1] > q[1];
}

void mesh_rings(const mesh *m, uint32_t **offset, uint32_t **ring) {
    size_t total = 3 * (size_t)m->triangles;
    uint32_t(*pair)[2] = allocate(total, sizeof *pair);
    for (uint32_t i = 0; i < m->triangles; i++) {
        for (uint32_t k = 0; k < 3; k++) {
            /* On a closed oriented surface every undirected edge gives both directed ones. */
            pair[3 * i + k][0] = m->t[i][k];
            pair[3 * i + k][1] = m->t[i][(k + 1) % 3];
        }
    }
    qsort(pair, total, sizeof *pair, compare_pairs);
    *offset = allocate(m->vertices + 1u, sizeof **offset);
    *ring = allocate(total, sizeof **ring);
    for (size_t i = 0; i < total; i++) {
        (*ring)[i] = pair[i][1];
        (*offset)[pair[i][0] + 1]++;
    }
    for (uint32_t i = 0; i < m->vertices; i++) (*offset)[i + 1] += (*offset)[i];
    free(pair);
}

uint32_t *mesh_across(const mesh *m) {
    uint32_t count;
    mesh_edge *edge = mesh_edges(m, &count);
    uint32_t *across = allocate(3 * (size_t)m->triangles, sizeof *across);
    for (uint32_t e = 0; e < count; e++) {
        for (int side = 0; side < 2; side++) {
            const uint32_t *t = m->t[edge[e].triangle[side]];
            for (size_t k = 0; k < 3; k++) {
                if (t[k] == edge[e].a || t[k] == edge[e].b) continue;
                across[3 * (size_t)edge[e].triangle[side] + k] = edge[e].triangle[1 - side];
            }
        }
    }
    free(edge);
    return across;
}

void mesh_stars(const mesh *m, uint32_t **offset, uint32_t **triangle) {
    *offset = allocate(m->vertices + 1u, sizeof **offset);
    *triangle = allocate(3 * (size_t)m->triangles, sizeof **triangle);
    uint32_t *next = allocate(m->vertices, sizeof *next);
    for (size_t i = 0; i < 3 * (size_t)m->triangles; i++) (*offset)[m->t[i / 3][i % 3] + 1]++;
    for (uint32_t v = 0; v < m->vertices; v++) (*offset)[v + 1] += (*offset)[v];
    for (size_t i = 0; i < 3 * (size_t)m->triangles; i++) {
        uint32_t v = m->t[i / 3][i % 3];
        (*triangle)[(*offset)[v] + next[v]++] = (uint32_t)(i / 3);
    }
    free(next);
}

static void bounds_of(double (*x)[3], uint32_t count, double low[3], double high[3]) {
    for (int k = 0; k < 3; k++) {
        low[k] = high[k] = x[0][k];
        for (uint32_t i = 1; i < count; i++) {
            low[k] = fmin(low[k], x[i][k]);
            high[k] = fmax(high[k], x[i][k]);
        }
    }
}

static double diagonal_of(double (*x)[3], uint32_t count) {
    double low[3], high[3];
    bounds_of(x, count, low, high);
    return v_distance(low, high);
}

void mesh_bounds(const mesh *m, double low[3], double high[3]) {
    bounds_of(m->x, m->vertices, low, high);
}

void mesh_extent(const mesh *m, double size[3]) {
    double low[3];
    bounds_of(m->x, m->vertices, low, size);
    v_sub(size, low, size);
}

double mesh_diagonal(const mesh *m) { return diagonal_of(m->x, m->vertices); }

void require_near_origin(double (*x)[3], uint32_t count, const char *path) {
    if (count == 0) return;
    double farthest = 0, extent = diagonal_of(x, count);
    for (uint32_t i = 0; i < count; i++)
        for (int k = 0; k < 3; k++) farthest = fmax(farthest, fabs(x[i][k]));
    double rounding = farthest * (double)FLT_EPSILON / 2;
    if (rounding > 1e-4 * extent)
        die(EXIT_WORK,
            "%s: far from the origin: the body is %.3g m large and lies %.3g m away, where single "
            "precision moves its vertices by up to %.2g m: move it to the origin",
            path, extent, farthest, rounding);
    if (rounding > 1e-5 * extent)
        warn("%s: the body is %.3g m large and lies %.3g m from the origin: single precision moves "
             "its vertices by up to %.2g m",
             path, extent, farthest, rounding);
}

double mesh_longest_edge(const mesh *m, uint32_t triangle) {
    const uint32_t *t = m->t[triangle];
    double longest = 0;
    for (int k = 0; k < 3; k++)
        longest = fmax(longest, v_distance(m->x[t[k]], m->x[t[(k + 1) % 3]]));
    return longest;
}

double mesh_mean_edge(const mesh *m) {
    double sum = 0;
    for (uint32_t i = 0; i < m->triangles; i++) {
        for (int k = 0; k < 3; k++) sum += v_distance(m->x[m->t[i][k]], m->x[m->t[i][(k + 1) % 3]]);
    }
    return sum / (3.0 * m->triangles);
}

static double corner_angle(const mesh *m, uint32_t triangle, int corner) {
    const uint32_t *t = m->t[triangle];
    double u[3], v[3], c[3];
    v_sub(m->x[t[(corner + 1) % 3]], m->x[t[corner]], u);
    v_sub(m->x[t[(corner + 2) % 3]], m->x[t[corner]], v);
    v_cross(u, v, c);
    return atan2(v_norm(c), v_dot(u, v));
}

void mesh_nodal(const mesh *m, double *area, double (*normal)[3]) {
    memset(area, 0, m->vertices * sizeof *area);
    memset(normal, 0, m->vertices * sizeof *normal);
    for (uint32_t i = 0; i < m->triangles; i++) {
        const uint32_t *t = m->t[i];
        double n[3];
        triangle_normal(m->x[t[0]], m->x[t[1]], m->x[t[2]], n);
        double twice = v_norm(n);
        for (int k = 0; k < 3; k++) {
            double angle = corner_angle(m, i, k);
            area[t[k]] += twice / 6;
            for (int c = 0; c < 3; c++) normal[t[k]][c] += angle * n[c] / twice;
        }
    }
    for (uint32_t i = 0; i < m->vertices; i++) v_normalize(normal[i]);
}

void mesh_unit_normal(const mesh *m, uint32_t triangle, double n[3]) {
    const uint32_t *t = m->t[triangle];
    triangle_normal(m->x[t[0]], m->x[t[1]], m->x[t[2]], n);
    v_normalize(n);
}

double mesh_triangle_angle_deg(const mesh *m, uint32_t triangle) {
    double smallest = 180;
    for (int k = 0; k < 3; k++)
        smallest = fmin(smallest, corner_angle(m, triangle, k) * 57.29577951308232);
    return smallest;
}

double mesh_smallest_angle_deg(const mesh *m) {
    double smallest = 180;
    for (uint32_t i = 0; i < m->triangles; i++)
        smallest = fmin(smallest, mesh_triangle_angle_deg(m, i));
    return smallest;
}
