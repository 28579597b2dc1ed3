/* SPDX-License-Identifier: MIT */
#include "tools/zone/zonerest.h"
#include "tools/solver/dense.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

bool rest_is_inner(const rest_zone *zone, uint32_t triangle) {
    const uint32_t *t = zone->m->t[triangle];
    const uint32_t s = zone->seam_of[t[0]];
    return s != PALP_NONE && zone->seam_of[t[1]] == s && zone->seam_of[t[2]] == s;
}

/* ---- the surface ---- */

/* Numbers the vertices that the outer triangles have, those on a seam once for both zones. */
static uint32_t number_vertices(const rest_model *r, rest_surface *s) {
    uint32_t count = 0;
    for (uint32_t z = 0; z < r->zones; z++) {
        const mesh *m = r->zone[z].m;
        s->vertex[z] = allocate(m->vertices, sizeof *s->vertex[z]);
        for (uint32_t v = 0; v < m->vertices; v++) s->vertex[z][v] = PALP_NONE;
    }
    for (uint32_t z = 0; z < r->zones; z++) {
        const rest_zone *zone = &r->zone[z];
        for (uint32_t t = 0; t < zone->m->triangles; t++) {
            if (rest_is_inner(zone, t)) continue;
            for (int k = 0; k < 3; k++) {
                uint32_t *id = &s->vertex[z][zone->m->t[t][k]];
                if (*id == PALP_NONE) *id = count++;
            }
        }
        for (uint32_t q = 0; q < r->seams; q++) { /* hands its numbers on to later zones */
            const seam_list *l = &r->seam[q];
            for (int side = 0; side < 2; side++) {
                const uint32_t other = l->zone[1 - side];
                if (l->zone[side] != z || other <= z) continue;
                for (uint32_t i = 0; i < l->nodes; i++)
                    s->vertex[other][l->node[i][1 - side]] = s->vertex[z][l->node[i][side]];
            }
        }
    }
    return count;
}

rest_surface rest_surface_build(const rest_model *model) {
    const rest_model *r = model;
    rest_surface s = {.area = NULL};
    uint32_t triangles = 0;
    s.m.vertices = number_vertices(r, &s);
    for (uint32_t z = 0; z < r->zones; z++) triangles += r->zone[z].m->triangles;
    s.m.x = allocate(s.m.vertices, sizeof *s.m.x);
    s.m.t = allocate(triangles, sizeof *s.m.t);
    for (uint32_t z = 0; z < r->zones; z++) {
        const mesh *m = r->zone[z].m;
        for (uint32_t v = 0; v < m->vertices; v++) {
            if (s.vertex[z][v] != PALP_NONE) memcpy(s.m.x[s.vertex[z][v]], m->x[v], sizeof *s.m.x);
        }
        for (uint32_t t = 0; t < m->triangles; t++) {
            if (rest_is_inner(&r->zone[z], t)) continue;
            for (int k = 0; k < 3; k++) s.m.t[s.m.triangles][k] = s.vertex[z][m->t[t][k]];
            s.m.triangles++;
        }
    }
    s.area = allocate(s.m.vertices, sizeof *s.area);
    s.normal = allocate(s.m.vertices, sizeof *s.normal);
    mesh_nodal(&s.m, s.area, s.normal);
    return s;
}

void rest_surface_free(rest_surface *surface, uint32_t zones) {
    for (uint32_t z = 0; z < zones; z++) free(surface->vertex[z]);
    mesh_free(&surface->m);
    free(surface->area);
    free(surface->normal);
}

/* ---- the seams ---- */

static uint32_t first_mode(const rest_model *r, uint32_t seam) {
    uint32_t sum = 0;
    for (uint32_t s = 0; s < seam; s++) sum += r->entry[s].modes;
    return sum;
}

/* Where each mode of a zone is among those of all seams. To be freed. */
static uint32_t *modes_of(const rest_model *r, const rest_zone *zone) {
    uint32_t *at = allocate(zone->modes + 1u, sizeof *at);
    for (uint32_t k = 0; k < zone->seams; k++) {
        for (uint32_t i = 0; i < r->entry[zone->list[k]].modes; i++)
            at[zone->first[k] + i] = first_mode(r, zone->list[k]) + i;
    }
    return at;
}

/* A^-1, [n][n] for the n = 3 modes of all seams, seam after seam. To be freed. */
static double *answer_of(const rest_model *r) {
    const size_t n = 3 * (size_t)first_mode(r, r->seams);
    double *a = allocate_aligned(n * n + 1, sizeof *a);
    double *inverse = allocate_aligned(n * n + 1, sizeof *inverse);
    for (uint32_t z = 0; z < r->zones; z++) {
        uint32_t *at = modes_of(r, &r->zone[z]);
        const float *k = r->zone[z].stiffness;
        for (uint32_t p = 0; p < r->zone[z].modes; p++) {
            for (uint32_t q = 0; q <= p; q++, k += 9) {
                for (size_t e = 0; e < 9; e++) {
                    size_t i = 3 * (size_t)at[p] + e / 3, j = 3 * (size_t)at[q] + e % 3;
                    a[i * n + j] += (double)k[e];
                    if (p != q) a[j * n + i] += (double)k[e];
                }
            }
        }
        free(at);
    }
    for (size_t i = 0; i < n; i++) inverse[i * n + i] = 1;
    if (dense_cholesky(a, n, n) < n)
        die(EXIT_WORK, "the seams' stiffness is not positive definite: use a finer mesh");
    dense_lower_solve(a, n, n, inverse, n, n);
    dense_lower_solve_transposed(a, n, n, inverse, n, n);
    free(a);
    return inverse;
}

/* ---- the compliance ---- */

/* A vertex of the surface whose compliance is known well: a zone's free node. On a seam's nodes the
 * balance of the seams stands for far too much (a force there acts on half a node). */
typedef struct {
    uint32_t vertex, zone, node, slot;
} felt_vertex;

/* To be freed. */
static felt_vertex *felt_vertices(const rest_model *r, const rest_surface *s, uint32_t *count) {
    felt_vertex *felt = allocate(s->m.vertices, sizeof *felt);
    *count = 0;
    for (uint32_t z = 0; z < r->zones; z++) {
        const domain_data *d = &r->zone[z].dom->domain[PALP_FREE];
        for (uint32_t k = 0; k < d->view.slots; k++)
            felt[(*count)++] = (felt_vertex){s->vertex[z][d->node[k]], z, d->node[k], k};
    }
    return felt;
}

/* How the felt vertices respond to all seams: [3 count][3 modes of all seams]. To be freed. */
static double *response_rows(const rest_model *r, const felt_vertex *felt, uint32_t count) {
    const size_t width = 3 * (size_t)first_mode(r, r->seams);
    double *p = allocate_aligned(3 * (size_t)count * width + 1, sizeof *p);
    uint32_t *at[PALP_MAX_ZONES];
    for (uint32_t z = 0; z < r->zones; z++) at[z] = modes_of(r, &r->zone[z]);
    for (size_t i = 0; i < count; i++) {
        const felt_vertex *f = &felt[i];
        const rest_zone *zone = &r->zone[f->zone];
        const float *block = zone->response + 9 * (size_t)f->slot * zone->modes;
        for (size_t e = 0; e < 9 * (size_t)zone->modes; e++)
            p[(3 * i + e % 9 / 3) * width + 3 * (size_t)at[f->zone][e / 9] + e % 3] =
                (double)block[e];
    }
    for (uint32_t z = 0; z < r->zones; z++) free(at[z]);
    return p;
}

/* G + P A^-1 P^T of the felt vertices, [3 count][3 count]. To be freed. */
static double *compliance(const rest_model *r, const felt_vertex *felt, uint32_t count) {
    const size_t n = 3 * (size_t)count, width = 3 * (size_t)first_mode(r, r->seams);
    double *g = allocate_aligned(n * n, sizeof *g);
    double *p = response_rows(r, felt, count), *answer = answer_of(r);
    double *turned = allocate_aligned(width * n + 1, sizeof *turned);
    double *half = allocate_aligned(n * width + 1, sizeof *half);
    for (size_t i = 0; i < n; i++) {
        for (size_t k = 0; k < width; k++) turned[k * n + i] = p[i * width + k];
    }
    dense_subtract_product(half, width, p, width, answer, width, n, width, width); /* - P A^-1 */
    dense_subtract_product(g, n, half, width, turned, n, n, n, width);
    for (size_t i = 0; i < n; i++) {
        const felt_vertex *a = &felt[i / 3];
        const greens *own = r->zone[a->zone].g;
        const double *row = greens_row(own, a->node, i % 3);
        for (size_t j = 0; j < n; j++) {
            const felt_vertex *b = &felt[j / 3];
            if (b->zone != a->zone) continue;
            g[i * n + j] += 0.5 * (row[3 * (size_t)b->node + j % 3] +
                                   greens_row(own, b->node, j % 3)[3 * (size_t)a->node + i % 3]);
        }
    }
    void *owned[] = {p, answer, turned, half};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    return g;
}

/* ---- the regular part ---- */

/* H is smooth: on a seam's vertices it is the mean of those around them that are felt. */
static void bridge_seams(const rest_model *r, const rest_surface *s, const felt_vertex *felt,
                         uint32_t count, regular_data *regular) {
    uint32_t *offset, *ring;
    uint8_t *known = allocate(s->m.vertices, 1);
    const size_t row = 3 * (size_t)regular->modes;
    for (uint32_t i = 0; i < count; i++) known[felt[i].vertex] = 1;
    mesh_rings(&s->m, &offset, &ring);
    for (uint32_t q = 0; q < r->seams; q++) {
        for (uint32_t i = 0; i < r->seam[q].nodes; i++) {
            const uint32_t v = s->vertex[r->seam[q].zone[0]][r->seam[q].node[i][0]];
            int around = 0;
            if (v == PALP_NONE) continue;
            for (uint32_t k = offset[v]; k < offset[v + 1]; k++) around += known[ring[k]];
            for (size_t a = 0; a < row && around > 0; a++) {
                double sum = 0;
                for (uint32_t k = offset[v]; k < offset[v + 1]; k++)
                    sum += known[ring[k]] != 0 ? regular->vector[row * ring[k] + a] : 0;
                regular->vector[row * v + a] = (int16_t)lrint(sum / around);
            }
        }
    }
    void *owned[] = {offset, ring, known};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
}

regular_data rest_regular(const rest_model *model, const rest_surface *surface, uint32_t modes) {
    uint32_t count;
    felt_vertex *felt = felt_vertices(model, surface, &count);
    uint32_t *node = allocate(count, sizeof *node);
    half_space_material *material = allocate(count, sizeof *material);
    for (uint32_t i = 0; i < count; i++) {
        node[i] = felt[i].vertex;
        material[i] = model->zone[felt[i].zone].material;
    }
    const regular_body body = {.m = &surface->m, .area = surface->area, .normal = surface->normal};
    const regular_nodes nodes = {.node = node, .nodes = count, .material = material};
    double *g = compliance(model, felt, count);
    regular_data r = regular_build_nodes(&body, &nodes, g, modes);
    bridge_seams(model, surface, felt, count, &r);
    void *owned[] = {felt, node, material, g};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
    return r;
}

regular_data rest_share(const rest_model *model, const rest_surface *surface,
                        const regular_data *common, uint32_t zone) {
    const rest_zone *z = &model->zone[zone];
    const size_t row = 3 * (size_t)common->modes;
    regular_data r = {.modes = common->modes, .left_over = common->left_over};
    if (r.modes == 0) return r;
    uint8_t *inner = allocate(z->m->triangles, 1);
    for (uint32_t t = 0; t < z->m->triangles; t++) inner[t] = rest_is_inner(z, t) ? 1 : 0;
    regular_close_borders(&r, z->m, inner);
    free(inner);
    r.value = allocate(r.modes, sizeof *r.value);
    memcpy(r.value, common->value, r.modes * sizeof *r.value);
    r.vector = allocate(row * z->m->vertices, sizeof *r.vector);
    for (uint32_t v = 0; v < z->m->vertices; v++) {
        const uint32_t at = surface->vertex[zone][v];
        if (at != PALP_NONE)
            memcpy(r.vector + row * v, common->vector + row * at, row * sizeof *r.vector);
    }
    return r;
}
