/* SPDX-License-Identifier: MIT */
#include "tools/zone/seam.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define AFFINE_RANK 1e-7 /* share of a function that must be new for it to count */
#define SMOOTH_RANK 1e-3

/* ---- matching ---- */

static void listed(const seam_spec *s, const zone_model *z, const mesh *const side[2],
                   seam_list *l) {
    uint32_t count[2], *list[2];
    for (int k = 0; k < 2; k++) list[k] = body_node_list(s->list[k], side[k]->vertices, &count[k]);
    if (count[0] != count[1]) {
        die(EXIT_USAGE,
            "%s: the lists have different lengths, %" PRIu32 " nodes of '%s' and %" PRIu32
            " of '%s'",
            s->where, count[0], z->zone[s->zone[0]].name, count[1], z->zone[s->zone[1]].name);
    }
    l->nodes = count[0];
    l->node = allocate(l->nodes + 1u, sizeof *l->node);
    for (uint32_t i = 0; i < l->nodes; i++) {
        for (int k = 0; k < 2; k++) l->node[i][k] = list[k][i];
    }
    for (int k = 0; k < 2; k++) free(list[k]);
}

/* Nodes at the same place, in the order of the first mesh. */
static void coincident(const mesh *const side[2], double tolerance, seam_list *l) {
    size_t room = 0;
    for (uint32_t i = 0; i < side[0]->vertices; i++) {
        for (uint32_t j = 0; j < side[1]->vertices; j++) {
            if (v_distance(side[0]->x[i], side[1]->x[j]) > tolerance) continue;
            l->node = grow(l->node, &room, l->nodes + 1u, sizeof *l->node);
            l->node[l->nodes][0] = i;
            l->node[l->nodes++][1] = j;
            break;
        }
    }
}

static void check_places(const seam_spec *s, const zone_model *z, const mesh *const side[2],
                         const seam_list *l, double tolerance) {
    for (uint32_t i = 0; i < l->nodes; i++) {
        const double *a = side[0]->x[l->node[i][0]], *b = side[1]->x[l->node[i][1]];
        double apart = v_distance(a, b);
        if (apart <= tolerance) continue;
        die(EXIT_USAGE,
            "%s: node %" PRIu32 " of '%s' and node %" PRIu32 " of '%s', number %" PRIu32
            " of the lists, lie %.3g m apart: the lists must have the same order",
            s->where, l->node[i][0], z->zone[s->zone[0]].name, l->node[i][1],
            z->zone[s->zone[1]].name, i, apart);
    }
}

#define NOBODY 0xffffffffu

/* Place in the seam of each node of one side. */
static uint32_t *places(const seam_spec *s, const zone_model *z, const mesh *m, const seam_list *l,
                        int side) {
    uint32_t *place = allocate(m->vertices, sizeof *place);
    memset(place, 0xff, m->vertices * sizeof *place);
    for (uint32_t i = 0; i < l->nodes; i++) {
        uint32_t node = l->node[i][side];
        if (place[node] != NOBODY) {
            die(EXIT_USAGE, "%s: node %" PRIu32 " of '%s' is listed twice", s->where, node,
                z->zone[s->zone[side]].name);
        }
        place[node] = i;
    }
    return place;
}

static int by_three(const void *p, const void *q) {
    const uint32_t *a = p, *b = q;
    for (int k = 0; k < 3; k++) {
        if (a[k] != b[k]) return a[k] < b[k] ? -1 : 1;
    }
    return 0;
}

/* The seam's triangles of one side in places of the seam, each turned to begin with its least. */
static uint32_t (*seam_triangles(const mesh *m, const uint32_t *place, bool turned,
                                 uint32_t *count))[3] {
    uint32_t(*list)[3] = allocate(m->triangles + 1u, sizeof *list);
    *count = 0;
    for (uint32_t i = 0; i < m->triangles; i++) {
        uint32_t t[3];
        for (int k = 0; k < 3; k++) t[k] = place[m->t[i][turned ? 2 - k : k]];
        if (t[0] == NOBODY || t[1] == NOBODY || t[2] == NOBODY) continue;
        int least = t[0] < t[1] ? (t[0] < t[2] ? 0 : 2) : (t[1] < t[2] ? 1 : 2);
        for (int k = 0; k < 3; k++) list[*count][k] = t[(least + k) % 3];
        (*count)++;
    }
    qsort(list, *count, sizeof *list, by_three);
    return list;
}

static void check_triangles(const seam_spec *s, const zone_model *z, const mesh *const side[2],
                            const seam_list *l) {
    uint32_t *place[2], count[2], (*list[2])[3];
    for (int k = 0; k < 2; k++) {
        place[k] = places(s, z, side[k], l, k);
        list[k] = seam_triangles(side[k], place[k], k == 1, &count[k]);
    }
    for (int k = 0; k < 2; k++) {
        for (uint32_t i = 0; i < count[k]; i++) {
            uint32_t(*own)[3] = list[k];
            const uint32_t *t = own[i];
            if (bsearch(t, list[1 - k], count[1 - k], sizeof *list[0], by_three) != NULL) continue;
            die(EXIT_USAGE,
                "%s: zone '%s' has the triangle %" PRIu32 " %" PRIu32 " %" PRIu32
                " on the seam, zone '%s' has not: both sides need the same triangles",
                s->where, z->zone[s->zone[k]].name, l->node[t[0]][k], l->node[t[1]][k],
                l->node[t[2]][k], z->zone[s->zone[1 - k]].name);
        }
    }
    if (count[0] == 0) {
        die(EXIT_USAGE, "%s: zones '%s' and '%s' share no triangle", s->where,
            z->zone[s->zone[0]].name, z->zone[s->zone[1]].name);
    }
    for (int k = 0; k < 2; k++) {
        free(place[k]);
        free(list[k]);
    }
}

seam_list seam_match(const seam_spec *s, const zone_model *z, const mesh *zone, double diagonal) {
    const mesh *const side[2] = {&zone[s->zone[0]], &zone[s->zone[1]]};
    seam_list l = {.zone = {s->zone[0], s->zone[1]}};
    double tolerance = SEAM_TOLERANCE * diagonal;
    if (s->list[0] != NULL) {
        listed(s, z, side, &l);
    } else {
        coincident(side, tolerance, &l);
    }
    if (l.nodes < 3) {
        die(EXIT_USAGE, "%s: zones '%s' and '%s' have %" PRIu32 " node(s) in common: need 3",
            s->where, z->zone[s->zone[0]].name, z->zone[s->zone[1]].name, l.nodes);
    }
    check_places(s, z, side, &l, tolerance);
    check_triangles(s, z, side, &l);
    return l;
}

/* ---- modes ---- */

typedef struct {
    uint32_t nodes, modes, limit;
    double *mode; /* [limit][nodes] */
    double *work;
} basis;

/* Takes `work` into the basis if more than `rank` of it is new. Gram and Schmidt, twice. */
static bool take_in(basis *b, double rank) {
    uint32_t n = b->nodes;
    double before = 0, after = 0;
    if (b->modes == b->limit) return false;
    for (uint32_t i = 0; i < n; i++) before += b->work[i] * b->work[i];
    for (uint32_t k = 0; k < 2 * b->modes; k++) {
        const double *q = b->mode + (size_t)(k % b->modes) * n;
        double along = 0;
        for (uint32_t i = 0; i < n; i++) along += q[i] * b->work[i];
        for (uint32_t i = 0; i < n; i++) b->work[i] -= along * q[i];
    }
    for (uint32_t i = 0; i < n; i++) after += b->work[i] * b->work[i];
    if (!(after > rank * rank * before)) return false;
    for (uint32_t i = 0; i < n; i++) b->mode[(size_t)b->modes * n + i] = b->work[i] / sqrt(after);
    b->modes++;
    return true;
}

static void add_degree(basis *b, double (*x)[3], int degree) {
    for (int p = degree; p >= 0; p--) {
        for (int q = degree - p; q >= 0; q--) {
            int powers[3] = {p, q, degree - p - q};
            for (uint32_t i = 0; i < b->nodes; i++) {
                b->work[i] = 1;
                for (int k = 0; k < 3; k++) b->work[i] *= pow(x[i][k], powers[k]);
            }
            (void)take_in(b, degree <= 1 ? AFFINE_RANK : SMOOTH_RANK);
        }
    }
}

/* The nodal vectors that are newest first, until nothing is left. */
static void complete(basis *b) {
    double *left = allocate(b->nodes, sizeof *left);
    for (uint32_t i = 0; i < b->nodes; i++) {
        left[i] = 1;
        for (uint32_t k = 0; k < b->modes; k++)
            left[i] -= b->mode[(size_t)k * b->nodes + i] * b->mode[(size_t)k * b->nodes + i];
    }
    while (b->modes < b->limit) {
        uint32_t best = 0;
        for (uint32_t i = 1; i < b->nodes; i++) {
            if (left[i] > left[best]) best = i;
        }
        memset(b->work, 0, b->nodes * sizeof *b->work);
        b->work[best] = 1;
        if (!take_in(b, 1e-6)) break;
        const double *q = b->mode + (size_t)(b->modes - 1) * b->nodes;
        for (uint32_t i = 0; i < b->nodes; i++) left[i] -= q[i] * q[i];
    }
    free(left);
}

/* Places about their mean, over half the box's diagonal. */
static double (*scaled_places(const seam_list *s, const mesh *m, double *length))[3] {
    double(*x)[3] = allocate(s->nodes, sizeof *x), mean[3] = {0}, low[3], high[3];
    for (uint32_t i = 0; i < s->nodes; i++) {
        memcpy(x[i], m->x[s->node[i][0]], sizeof x[i]);
        for (int k = 0; k < 3; k++) {
            mean[k] += x[i][k] / s->nodes;
            low[k] = i == 0 ? x[i][k] : fmin(low[k], x[i][k]);
            high[k] = i == 0 ? x[i][k] : fmax(high[k], x[i][k]);
        }
    }
    *length = v_distance(low, high);
    for (uint32_t i = 0; i < s->nodes; i++) {
        for (int k = 0; k < 3; k++) x[i][k] = (x[i][k] - mean[k]) / (0.5 * *length);
    }
    return x;
}

double *seam_modes(const seam_list *s, const mesh *first, uint32_t limit, palp_seam_entry *entry) {
    static const int degree[PALP_SEAM_LEVELS - 1] = {1, 2, 3, 4, 6};
    uint32_t n = s->nodes, at = 0;
    double length;
    double(*x)[3] = scaled_places(s, first, &length);
    basis b = {.nodes = n, .limit = limit > 0 && limit < n ? limit : n};
    b.mode = allocate((size_t)b.limit * n, sizeof *b.mode);
    b.work = allocate(n, sizeof *b.work);
    for (int d = 0; d <= degree[PALP_SEAM_LEVELS - 2]; d++) {
        add_degree(&b, x, d);
        if (d == degree[at]) entry->level_modes[at++] = b.modes;
    }
    complete(&b);
    entry->nodes = n;
    entry->modes = b.modes;
    entry->level_modes[PALP_SEAM_LEVELS - 1] = b.modes;
    entry->length_m = (float)length;
    for (uint32_t k = 0; k < PALP_AFFINE_MODES && k < b.modes; k++) {
        double one = 0, place[3] = {0};
        for (uint32_t i = 0; i < n; i++) {
            double q = b.mode[(size_t)k * n + i];
            one += q;
            for (int a = 0; a < 3; a++) place[a] += q * first->x[s->node[i][0]][a];
        }
        entry->ones[k] = (float)one;
        for (int a = 0; a < 3; a++) entry->position_m[k][a] = (float)place[a];
    }
    double *mode = allocate((size_t)n * b.modes, sizeof *mode);
    for (uint32_t i = 0; i < n; i++) {
        for (uint32_t k = 0; k < b.modes; k++)
            mode[(size_t)i * b.modes + k] = b.mode[(size_t)k * n + i];
    }
    free(b.mode);
    free(b.work);
    free(x);
    return mode;
}
