/* SPDX-License-Identifier: MIT */
#include "tools/mesh/refine.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

#define FLAT 1e-5   /* over the diagonal */
#define PASSES 40   /* of halving, each with turning */
#define TURNS 60    /* of turning after each */
#define MARGIN 1e-9 /* by which the cotangents must ask for it */

/* Cotangent of the angle at c that faces a-b; large for a needle. */
static double cotangent(const mesh *m, uint32_t a, uint32_t b, uint32_t c) {
    double p[3], q[3], n[3];
    v_sub(m->x[a], m->x[c], p);
    v_sub(m->x[b], m->x[c], q);
    v_cross(p, q, n);
    return v_dot(p, q) / fmax(v_norm(n), 1e-12 * (v_dot(p, p) + v_dot(q, q)));
}

/* Whether a-b between the triangles that face c and d should be c-d: all four in one plane, convex,
 * and better so. */
static bool should_turn(const mesh *m, uint32_t a, uint32_t b, uint32_t c, uint32_t d,
                        double flat) {
    double n[2][3], r[3], across[2][3];
    if (cotangent(m, a, b, c) + cotangent(m, a, b, d) > -MARGIN) return false;
    triangle_normal(m->x[a], m->x[b], m->x[c], n[0]);
    triangle_normal(m->x[b], m->x[a], m->x[d], n[1]);
    const int larger = v_norm(n[1]) > v_norm(n[0]);
    v_sub(m->x[larger ? c : d], m->x[a], r);
    if (!(v_norm(n[larger]) > 0) || fabs(v_dot(r, n[larger])) > flat * v_norm(n[larger]))
        return false;
    triangle_normal(m->x[c], m->x[d], m->x[b], across[0]);
    triangle_normal(m->x[d], m->x[c], m->x[a], across[1]);
    const double least = 1e-6 * v_dot(n[larger], n[larger]);
    return v_dot(across[0], n[larger]) > least && v_dot(across[1], n[larger]) > least;
}

static uint32_t turn_edges(mesh *m, double flat) {
    const size_t total = 3 * (size_t)m->triangles;
    half_edge *h = mesh_half_edges(m);
    bool *changed = allocate(m->triangles, sizeof *changed);
    uint32_t turned = 0;
    for (size_t i = 0; i + 1 < total; i += 2) {
        const uint32_t one = h[i].triangle, other = h[i + 1].triangle;
        if (changed[one] || changed[other]) continue;
        const half_edge *forward = h[i].forward ? &h[i] : &h[i + 1];
        const uint32_t a = h[i].low, b = h[i].high, c = half_edge_facing(m, forward),
                       d = half_edge_facing(m, h[i].forward ? &h[i + 1] : &h[i]);
        if (c == d || !should_turn(m, a, b, c, d, flat) || half_edge_exists(h, total, c, d))
            continue;
        const uint32_t first[3] = {c, d, b}, second[3] = {d, c, a};
        memcpy(m->t[one], first, sizeof first);
        memcpy(m->t[other], second, sizeof second);
        changed[one] = changed[other] = true;
        turned++;
    }
    free(h);
    free(changed);
    return turned;
}

static int compare_lengths(const void *a, const void *b) {
    const double *p = a, *q = b;
    if (p[0] > q[0] || p[0] < q[0]) return p[0] > q[0] ? -1 : 1;
    return p[1] < q[1] ? -1 : 1;
}

/* The longest edges first, one of each triangle; returns how many were halved. */
static uint32_t halve_edges(mesh *m, double longest) {
    const size_t total = 3 * (size_t)m->triangles;
    half_edge *h = mesh_half_edges(m);
    double(*order)[2] = allocate(total / 2 + 1, sizeof *order); /* length, place in h */
    bool *changed = allocate(m->triangles, sizeof *changed);
    size_t count = 0, room = m->triangles, vertex_room = m->vertices;
    uint32_t halved = 0;
    for (size_t i = 0; i + 1 < total; i += 2) {
        const double length = v_distance(m->x[h[i].low], m->x[h[i].high]);
        if (length <= longest) continue;
        order[count][0] = length;
        order[count++][1] = (double)i;
    }
    qsort(order, count, sizeof *order, compare_lengths);
    for (size_t k = 0; k < count; k++) {
        const half_edge *side = &h[(size_t)order[k][1]];
        if (changed[side[0].triangle] || changed[side[1].triangle]) continue;
        const uint32_t middle = mesh_add_middle(m, &vertex_room, side);
        for (int s = 0; s < 2; s++) {
            mesh_cut_side(m, &room, &side[s], middle);
            changed[side[s].triangle] = true;
        }
        halved++;
    }
    free(h);
    free(order);
    free(changed);
    return halved;
}

static bool is_closed(const mesh *m) {
    const size_t total = 3 * (size_t)m->triangles;
    half_edge *h = mesh_half_edges(m);
    bool closed = true;
    for (size_t i = 0; i < total && closed;) {
        const size_t j = half_edge_run_end(h, i, total);
        closed = j == i + 2;
        i = j;
    }
    free(h);
    return closed;
}

mesh mesh_refined(const mesh *m, double longest) {
    mesh r = mesh_copy(m);
    const double flat = FLAT * mesh_diagonal(m);
    for (int pass = 0; pass < PASSES; pass++) {
        for (int turn = 0; turn < TURNS; turn++) {
            if (turn_edges(&r, flat) == 0) break;
        }
        if (halve_edges(&r, longest) == 0) break;
    }
    if (is_closed(&r)) return r;
    mesh_free(&r); /* two edges came to lie on each other */
    return mesh_copy(m);
}
