/* SPDX-License-Identifier: MIT */
#include "tools/tet/stuffing.h"
#include "tools/tet/tetsmooth.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* How near to a lattice point a cut may be, of the length of its edge, before the point is moved
 * onto it: thresholds of the paper for safe angles. */
#define NEAR_LONG 0.24999
#define NEAR_SHORT 0.41189
#define CLOSE_ENOUGH 0.04 /* to the number of nodes asked for */
#define MOST_POINTS 2e7   /* of a lattice */
#define NOWHERE UINT32_MAX

/*
 * Lattice points in doubled coordinates: (i, j, k) all even or all odd. Cells of the array hold
 * one of each kind: index = 2 * (cell) + odd.
 */
typedef struct {
    const mesh *surface;
    const bvh *on;
    double pitch, origin[3];
    int cells[3];
    size_t points;
    float *level;     /* signed distance, above 0 inside */
    double (*x)[3];   /* where each point is */
    uint32_t *number; /* in the mesh, NOWHERE */
    tetmesh m;
    size_t node_room, tet_room;
    struct cut {
        uint64_t edge;
        uint32_t node;
    } * cut; /* hash table of cut edges */
    size_t cut_room, cuts;
} lattice;

static size_t point_index(const lattice *l, const int p[3]) {
    size_t cell = 0;
    for (int k = 2; k >= 0; k--) cell = cell * (size_t)l->cells[k] + (size_t)(p[k] >> 1);
    return 2 * cell + (size_t)(p[0] & 1);
}

static void point_place(const lattice *l, size_t index, int p[3]) {
    size_t cell = index / 2;
    for (int k = 0; k < 3; k++) {
        p[k] = 2 * (int)(cell % (size_t)l->cells[k]) + (int)(index & 1);
        cell /= (size_t)l->cells[k];
    }
}

/* ---- inside or outside: crossings of the vertical line through a column of points ---- */

/* Twice the signed area of (a, b, p) seen along z; the sign of a zero is that of p moved by
 * infinitely little, so that each column meets an edge's triangles consistently. */
static int side_of(const double a[3], const double b[3], double x, double y, double *area) {
    *area = (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]);
    if (*area > 0) return 1;
    if (*area < 0) return -1;
    double dy = b[1] - a[1], dx = b[0] - a[0]; /* p + (e, e^2) */
    if (dy < 0 || (!(dy > 0) && dx > 0)) return 1;
    return -1;
}

/* The sum of the areas is computed from the same edges in the same direction by both neighbours. */
static bool crossing(const mesh *m, uint32_t t, double x, double y, double *z) {
    double area[3];
    int side[3];
    for (int k = 0; k < 3; k++) {
        uint32_t i = m->t[t][k], j = m->t[t][(k + 1) % 3];
        int turn = i < j ? 1 : -1;
        side[k] = turn * side_of(m->x[i < j ? i : j], m->x[i < j ? j : i], x, y, &area[k]);
        area[k] *= turn;
    }
    if (side[0] != side[1] || side[1] != side[2]) return false;
    double sum = area[0] + area[1] + area[2];
    const double *a = m->x[m->t[t][0]], *b = m->x[m->t[t][1]], *c = m->x[m->t[t][2]];
    *z = fabs(sum) > 0 ? (area[1] * a[2] + area[2] * b[2] + area[0] * c[2]) / sum
                       : (a[2] + b[2] + c[2]) / 3;
    return true;
}

static void mark_inside(lattice *l) {
    const mesh *m = l->surface;
    for (uint32_t t = 0; t < m->triangles; t++) {
        double low[2], high[2];
        for (int k = 0; k < 2; k++) {
            low[k] = fmin(m->x[m->t[t][0]][k], fmin(m->x[m->t[t][1]][k], m->x[m->t[t][2]][k]));
            high[k] = fmax(m->x[m->t[t][0]][k], fmax(m->x[m->t[t][1]][k], m->x[m->t[t][2]][k]));
        }
        for (int odd = 0; odd < 2; odd++) {
            int first[2], last[2];
            for (int k = 0; k < 2; k++) {
                double a = (low[k] - l->origin[k]) / l->pitch - 0.5 * odd;
                double b = (high[k] - l->origin[k]) / l->pitch - 0.5 * odd;
                first[k] = (int)fmax(0, floor(a));
                last[k] = (int)fmin(l->cells[k] - 1, ceil(b));
            }
            for (int j = first[1]; j <= last[1]; j++) {
                for (int i = first[0]; i <= last[0]; i++) {
                    double z, x = l->origin[0] + (i + 0.5 * odd) * l->pitch;
                    double y = l->origin[1] + (j + 0.5 * odd) * l->pitch;
                    if (!crossing(m, t, x, y, &z)) continue;
                    for (int k = l->cells[2] - 1; k >= 0; k--) {
                        const int p[3] = {2 * i + odd, 2 * j + odd, 2 * k + odd};
                        if (l->origin[2] + (k + 0.5 * odd) * l->pitch <= z) break;
                        size_t n = point_index(l, p);
                        l->level[n] = -l->level[n];
                    }
                }
            }
        }
    }
}

/* ---- neighbours and cuts ---- */

/* The six long and eight short edges of a point, in doubled coordinates. */
static const int step_of[14][3] = {{2, 0, 0},  {-2, 0, 0},  {0, 2, 0},   {0, -2, 0},  {0, 0, 2},
                                   {0, 0, -2}, {1, 1, 1},   {1, 1, -1},  {1, -1, 1},  {1, -1, -1},
                                   {-1, 1, 1}, {-1, 1, -1}, {-1, -1, 1}, {-1, -1, -1}};

static size_t neighbour(const lattice *l, size_t i, int e) {
    int p[3];
    point_place(l, i, p);
    for (int k = 0; k < 3; k++) {
        p[k] += step_of[e][k];
        if (p[k] < 0 || (p[k] >> 1) >= l->cells[k]) return SIZE_MAX;
    }
    return point_index(l, p);
}

static bool crossed(const lattice *l, size_t a, size_t b) {
    return (l->level[a] > 0 && l->level[b] < 0) || (l->level[a] < 0 && l->level[b] > 0);
}

/* Share of the edge from a at which the surface crosses it. */
static double cut_share(const lattice *l, size_t a, size_t b) {
    return (double)l->level[a] / ((double)l->level[a] - (double)l->level[b]);
}

/* Distances, where the surface passes between a point and a neighbour. */
static void measure(lattice *l) {
    for (size_t i = 0; i < l->points; i++) {
        int p[3];
        point_place(l, i, p);
        for (int k = 0; k < 3; k++) l->x[i][k] = l->origin[k] + 0.5 * l->pitch * p[k];
    }
    bool *near = allocate(l->points, 1);
    for (size_t i = 0; i < l->points; i++) {
        for (int e = 0; e < 14 && !near[i]; e++) {
            size_t j = neighbour(l, i, e);
            near[i] = j != SIZE_MAX && crossed(l, i, j);
        }
    }
    for (size_t i = 0; i < l->points; i++) {
        if (!near[i]) continue;
        double point[3], d = bvh_closest(l->on, l->x[i], NULL, 0, point, NULL);
        if (d < 1e-7 * l->pitch) {
            l->level[i] = 0;
            memcpy(l->x[i], point, sizeof point);
        } else {
            l->level[i] = l->level[i] > 0 ? (float)d : -(float)d;
        }
    }
    free(near);
}

static void warp(lattice *l) {
    for (size_t i = 0; i < l->points; i++) {
        double best = 1;
        int found = -1;
        for (int e = 0; e < 14 && fabsf(l->level[i]) > 0; e++) {
            size_t j = neighbour(l, i, e);
            if (j == SIZE_MAX || !crossed(l, i, j)) continue;
            double share = cut_share(l, i, j);
            if (share < (e < 6 ? NEAR_LONG : NEAR_SHORT) && share < best) {
                best = share;
                found = e;
            }
        }
        if (found < 0) continue;
        size_t j = neighbour(l, i, found);
        for (int k = 0; k < 3; k++) l->x[i][k] += best * (l->x[j][k] - l->x[i][k]);
        l->level[i] = 0;
    }
}

static uint32_t add_node(lattice *l, const double x[3]) {
    l->m.x = grow(l->m.x, &l->node_room, (size_t)l->m.nodes + 1, sizeof *l->m.x);
    memcpy(l->m.x[l->m.nodes], x, 3 * sizeof(double));
    return l->m.nodes++;
}

static uint32_t point_node(lattice *l, size_t i) {
    if (l->number[i] == NOWHERE) l->number[i] = add_node(l, l->x[i]);
    return l->number[i];
}

static struct cut *find_cut(lattice *l, uint64_t edge) {
    size_t at = (size_t)(edge * 0x9e3779b97f4a7c15u) % l->cut_room;
    while (l->cut[at].node != NOWHERE && l->cut[at].edge != edge) at = (at + 1) % l->cut_room;
    return &l->cut[at];
}

static void grow_cuts(lattice *l) {
    struct cut *old = l->cut;
    size_t room = l->cut_room;
    l->cut_room = room > 0 ? 2 * room : 4096;
    l->cut = allocate(l->cut_room, sizeof *l->cut);
    for (size_t i = 0; i < l->cut_room; i++) l->cut[i].node = NOWHERE;
    for (size_t i = 0; i < room; i++) {
        if (old[i].node != NOWHERE) *find_cut(l, old[i].edge) = old[i];
    }
    free(old);
}

static uint32_t cut_node(lattice *l, size_t a, size_t b) {
    if (2 * l->cuts + 2 > l->cut_room) grow_cuts(l);
    size_t low = a < b ? a : b, high = a < b ? b : a;
    struct cut *c = find_cut(l, (uint64_t)low * l->points + high);
    if (c->node != NOWHERE) return c->node;
    double x[3], share = cut_share(l, low, high);
    for (int k = 0; k < 3; k++) x[k] = l->x[low][k] + share * (l->x[high][k] - l->x[low][k]);
    *c = (struct cut){(uint64_t)low * l->points + high, add_node(l, x)};
    l->cuts++;
    return c->node;
}

/* ---- stencils ---- */

static void add_tet(lattice *l, uint32_t a, uint32_t b, uint32_t c, uint32_t d) {
    l->m.t = grow(l->m.t, &l->tet_room, (size_t)l->m.tets + 1, sizeof *l->m.t);
    const uint32_t t[4] = {a, b, c, d};
    memcpy(l->m.t[l->m.tets++], t, sizeof t);
    double volume = tet_volume(&l->m, l->m.tets - 1);
    if (volume < 0) {
        l->m.t[l->m.tets - 1][2] = d;
        l->m.t[l->m.tets - 1][3] = c;
    } else if (!(volume > 0)) {
        l->m.tets--;
    }
}

static bool is_long(size_t a, size_t b) { return ((a ^ b) & 1) == 0; }

/*
 * Of a face with a and b inside and c outside: whether the diagonal of its quadrilateral a, b,
 * cut(b c), cut(a c) ends at b. It ends at the cut of the long edge; of two short ones at that of
 * the point that comes first, so that both tetrahedra at the face agree.
 */
static bool diagonal_at_second(const lattice *l, size_t a, size_t b, size_t c) {
    (void)l;
    if (is_long(a, c)) return true; /* from cut(a c) to b */
    if (is_long(b, c)) return false;
    return a < b;
}

/* A prism between the triangles (a0 b0 c0) and (a1 b1 c1); second[k]: the diagonal of the side
 * between columns k and k + 1 ends at the lower corner of k + 1. */
static void add_prism(lattice *l, const uint32_t low[3], const uint32_t high[3],
                      const bool second[3]) {
    for (int k = 0; k < 3; k++) { /* a column whose upper corner ends both of its diagonals */
        int n = (k + 1) % 3, p = (k + 2) % 3;
        if (second[k] && !second[p]) {
            add_tet(l, low[0], low[1], low[2], high[k]);
            if (second[n]) { /* from the upper corner of n to the lower of p */
                add_tet(l, high[k], low[n], low[p], high[n]);
                add_tet(l, high[k], low[p], high[n], high[p]);
            } else {
                add_tet(l, high[k], low[n], low[p], high[p]);
                add_tet(l, high[k], low[n], high[n], high[p]);
            }
            return;
        }
    }
}

/* Two points inside, two outside: a wedge from the edge (a, b) to the quadrilateral of the cuts. */
static void add_wedge(lattice *l, size_t a, size_t b, size_t c, size_t d) {
    uint32_t na = point_node(l, a), nb = point_node(l, b);
    uint32_t ac = cut_node(l, a, c), ad = cut_node(l, a, d), bc = cut_node(l, b, c),
             bd = cut_node(l, b, d);
    bool c_at_b = diagonal_at_second(l, a, b, c), d_at_b = diagonal_at_second(l, a, b, d);
    /* columns: (a, b), (ac, bc), (ad, bd); the side of the cuts goes with the others */
    const uint32_t low[3] = {nb, bc, bd}, high[3] = {na, ac, ad};
    /* side (a b)-(ac bc): diagonal ends at b (low of column 0) or at a (high of column 0) */
    const bool second[3] = {!c_at_b, c_at_b, d_at_b};
    add_prism(l, low, high, second);
}

static void add_corner(lattice *l, size_t a, const uint32_t other[3]) {
    add_tet(l, point_node(l, a), other[0], other[1], other[2]);
}

/* Three points inside, d outside: a prism. */
static void add_truncated(lattice *l, const size_t in[3], size_t d) {
    uint32_t low[3], high[3];
    bool second[3];
    for (int k = 0; k < 3; k++) {
        low[k] = point_node(l, in[k]);
        high[k] = cut_node(l, in[k], d);
        second[k] = diagonal_at_second(l, in[k], in[(k + 1) % 3], d);
    }
    add_prism(l, low, high, second);
}

/* Two inside, one on the surface, one outside: a pyramid. */
static void add_pyramid(lattice *l, size_t a, size_t b, size_t zero, size_t d) {
    uint32_t na = point_node(l, a), nb = point_node(l, b), z = point_node(l, zero);
    uint32_t ad = cut_node(l, a, d), bd = cut_node(l, b, d);
    if (diagonal_at_second(l, a, b, d)) {
        add_tet(l, na, nb, ad, z);
        add_tet(l, nb, bd, ad, z);
    } else {
        add_tet(l, na, nb, bd, z);
        add_tet(l, na, bd, ad, z);
    }
}

static void fill_tet(lattice *l, const size_t p[4]) {
    size_t in[4], zero[4], out[4];
    int ins = 0, zeros = 0, outs = 0;
    for (int k = 0; k < 4; k++) {
        if (l->level[p[k]] > 0) {
            in[ins++] = p[k];
        } else if (l->level[p[k]] < 0) {
            out[outs++] = p[k];
        } else {
            zero[zeros++] = p[k];
        }
    }
    if (ins == 0) return;
    if (outs == 0) {
        add_tet(l, point_node(l, p[0]), point_node(l, p[1]), point_node(l, p[2]),
                point_node(l, p[3]));
    } else if (ins == 1) {
        uint32_t other[3];
        for (int k = 0; k < 3; k++)
            other[k] = k < zeros ? point_node(l, zero[k]) : cut_node(l, in[0], out[k - zeros]);
        add_corner(l, in[0], other);
    } else if (ins == 2 && outs == 2) {
        add_wedge(l, in[0], in[1], out[0], out[1]);
    } else if (ins == 2) {
        add_pyramid(l, in[0], in[1], zero[0], out[0]);
    } else {
        add_truncated(l, in, out[0]);
    }
}

static void fill(lattice *l) {
    for (size_t i = 0; i < l->points;
         i += 2) { /* even points: each tetrahedron has one edge of two */
        int p[3];
        point_place(l, i, p);
        for (int axis = 0; axis < 3; axis++) {
            static const int ring[4][2] = {{1, 1}, {1, -1}, {-1, -1}, {-1, 1}};
            size_t corner[4] = {i, neighbour(l, i, 2 * axis)}, around[4];
            if (corner[1] == SIZE_MAX) continue;
            for (int r = 0; r < 4; r++) {
                int q[3];
                memcpy(q, p, sizeof q);
                q[axis] += 1;
                q[(axis + 1) % 3] += ring[r][0];
                q[(axis + 2) % 3] += ring[r][1];
                bool there = true;
                for (int k = 0; k < 3; k++) there = there && q[k] >= 0 && (q[k] >> 1) < l->cells[k];
                around[r] = there ? point_index(l, q) : SIZE_MAX;
            }
            for (int r = 0; r < 4; r++) {
                corner[2] = around[r];
                corner[3] = around[(r + 1) % 4];
                if (corner[2] != SIZE_MAX && corner[3] != SIZE_MAX) fill_tet(l, corner);
            }
        }
    }
}

/* ---- the largest part ---- */

static uint32_t root_of(uint32_t *parent, uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
}

/* Keeps the tetrahedra that hang together by faces with the largest volume; returns what share of
 * the volume went. */
static double keep_largest(tetmesh *m) {
    uint32_t *parent = allocate((size_t)m->tets + 1, sizeof *parent);
    for (uint32_t i = 0; i < m->tets; i++) parent[i] = i;
    tet_face *f = tetmesh_faces(m);
    for (uint32_t i = 1; i < 4 * m->tets; i++) {
        if (tet_face_same(&f[i], &f[i - 1]))
            parent[root_of(parent, f[i].tet)] = root_of(parent, f[i - 1].tet);
    }
    double *volume = allocate((size_t)m->tets + 1, sizeof *volume), whole = 0;
    uint32_t best = 0;
    for (uint32_t i = 0; i < m->tets; i++) {
        volume[root_of(parent, i)] += tet_volume(m, i);
        whole += tet_volume(m, i);
    }
    for (uint32_t i = 0; i < m->tets; i++) best = volume[i] > volume[best] ? i : best;
    double dropped = whole > 0 ? 1 - volume[best] / whole : 0;
    uint32_t kept = 0;
    for (uint32_t i = 0; i < m->tets; i++) {
        if (root_of(parent, i) == best) memmove(m->t[kept++], m->t[i], sizeof m->t[i]);
    }
    m->tets = kept;
    free(volume);
    free(f);
    free(parent);
    return dropped;
}

/* Nodes in the order of their names in the tetrahedra, without those that none names. */
static void number_anew(tetmesh *m) {
    uint32_t *place = allocate((size_t)m->nodes + 1, sizeof *place), next = 0;
    double(*x)[3] = allocate((size_t)m->nodes + 1, sizeof *x);
    memset(place, 0xff, m->nodes * sizeof *place);
    for (uint32_t i = 0; i < 4 * m->tets; i++) {
        uint32_t *node = &m->t[i / 4][i % 4];
        if (place[*node] == NOWHERE) {
            memcpy(x[next], m->x[*node], sizeof *x);
            place[*node] = next++;
        }
        *node = place[*node];
    }
    free(m->x);
    free(place);
    m->x = x;
    m->nodes = next;
}

/* ---- all together ---- */

tetmesh stuff(const mesh *surface, const bvh *on, double pitch, const double phase[3],
              double *dropped) {
    lattice l = {.surface = surface, .on = on, .pitch = pitch};
    *dropped = 0;
    double points = 2;
    for (int k = 0; k < 3; k++) {
        double low = HUGE_VAL, high = -HUGE_VAL;
        for (uint32_t i = 0; i < surface->vertices; i++) {
            low = fmin(low, surface->x[i][k]);
            high = fmax(high, surface->x[i][k]);
        }
        double middle = 0.5 * (low + high) + phase[k] * pitch;
        points *= (high - low) / pitch + 5;
        if (points > MOST_POINTS) return l.m;
        int below = (int)ceil((middle - low) / pitch) + 1;
        l.origin[k] = middle - below * pitch;
        l.cells[k] = below + (int)ceil((high - middle) / pitch) + 2;
    }
    l.points = 2 * (size_t)l.cells[0] * (size_t)l.cells[1] * (size_t)l.cells[2];
    l.level = allocate(l.points, sizeof *l.level);
    l.x = allocate(l.points, sizeof *l.x);
    l.number = allocate(l.points, sizeof *l.number);
    for (size_t i = 0; i < l.points; i++) {
        l.level[i] = -1;
        l.number[i] = NOWHERE;
    }
    mark_inside(&l);
    measure(&l);
    warp(&l);
    fill(&l);
    free(l.level);
    free(l.x);
    free(l.number);
    free(l.cut);
    *dropped = keep_largest(&l.m);
    number_anew(&l.m);
    if (l.m.tets > 0) tetmesh_smooth(&l.m, on);
    return l.m;
}

tetmesh stuff_level(const mesh *surface, const bvh *on, uint32_t nodes, uint32_t level,
                    double *pitch, double *dropped) {
    static const double phases[TET_LEVELS][3] = {
        {0, 0, 0}, {0.21, 0.13, 0.37}, {0.07, 0.41, 0.19}, {0.33, 0.29, 0.11}, {0.15, 0.05, 0.45}};
    double guess = cbrt(3.4 * fabs(mesh_volume(surface)) / nodes), best = HUGE_VAL;
    tetmesh kept = {.nodes = 0};
    for (int i = 0; i < 8 && best > CLOSE_ENOUGH; i++) {
        double lost;
        tetmesh m = stuff(surface, on, guess, phases[level], &lost);
        double off = fabs((double)m.nodes - nodes) / nodes;
        double next = guess * fmax(0.6, fmin(1.5, cbrt(fmax(m.nodes, 1) / nodes)));
        if (off < best && m.tets > 0) {
            best = off;
            tetmesh_free(&kept);
            kept = m;
            *pitch = guess;
            *dropped = lost;
        } else {
            tetmesh_free(&m);
        }
        guess = next;
    }
    if (kept.tets == 0)
        die(EXIT_WORK,
            "no tetrahedra: %" PRIu32 " nodes are too few for this body, or it is too thin", nodes);
    return kept;
}
