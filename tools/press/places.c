/* SPDX-License-Identifier: MIT */
#include "tools/press/places.h"
#include "tools/press/press.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>

#define TIP 0.12         /* depth of the surroundings of a tip, over the radius */
#define VALLEY 0.03      /* height of those of a valley */
#define LEAST_PIECE 3u   /* nodes of a region */
#define CLEAR_OF_FIXED 2 /* radii */

typedef struct {
    double height; /* of the surroundings along the normal, over the radius: below 0 a tip */
    place at;
    bool usable;
    uint32_t regions;
} candidate;

typedef struct {
    const palp_blob *blob;
    double radius;
    uint32_t *mark; /* [nodes] region of each node within the ball, 0: outside, 1: not yet seen */
    uint32_t *stack;
} search;

static double distance(palp_vec3 a, palp_vec3 b) { return (double)palp_norm(palp_sub(a, b)); }

/* Mean height of the nodes within a radius; false near fixed ones. */
static bool survey(const search *s, uint32_t node, double *height) {
    const palp_blob *b = s->blob;
    palp_vec3 x = at_node(b->rest_m, node), n = at_node(b->normal, node);
    double sum = 0;
    uint32_t count = 0;
    for (uint32_t j = 0; j < b->meta->nodes; j++) {
        palp_vec3 y = at_node(b->rest_m, j);
        double r = distance(x, y);
        if (palp_node_is_fixed(b, j) && r < CLEAR_OF_FIXED * s->radius) return false;
        if (r >= s->radius || palp_dot(n, at_node(b->normal, j)) < -0.5f) continue;
        sum += (double)palp_dot(n, palp_sub(y, x)) / s->radius;
        count++;
    }
    *height = sum / count;
    return true;
}

/* How far along its normal from a node a ball lies that just touches. */
static double first_touch(const search *s, uint32_t node) {
    const palp_blob *b = s->blob;
    palp_vec3 x = at_node(b->rest_m, node), n = at_node(b->normal, node);
    double most = s->radius;
    for (uint32_t j = 0; j < b->meta->nodes; j++) {
        palp_vec3 r = palp_sub(at_node(b->rest_m, j), x);
        double along = (double)palp_dot(r, n), across = (double)palp_dot(r, r) - along * along;
        double left = s->radius * s->radius - across;
        if (left > 0 && along < 3 * s->radius) most = fmax(most, along + sqrt(left));
    }
    return most;
}

/* Connected pieces of the surface within the ball. */
static uint32_t count_regions(const search *s, palp_vec3 at) {
    const palp_blob *b = s->blob;
    uint32_t regions = 0;
    for (uint32_t j = 0; j < b->meta->nodes; j++)
        s->mark[j] = distance(at_node(b->rest_m, j), at) < s->radius;
    for (uint32_t j = 0; j < b->meta->nodes; j++) {
        if (s->mark[j] != 1) continue;
        uint32_t size = 0, depth = 0;
        s->stack[depth++] = j;
        s->mark[j] = 2;
        while (depth > 0) {
            uint32_t i = s->stack[--depth];
            size++;
            for (uint32_t k = b->ring_offset[i]; k < b->ring_offset[i + 1]; k++) {
                uint32_t other = b->ring[k];
                if (s->mark[other] != 1) continue;
                s->mark[other] = 2;
                s->stack[depth++] = other;
            }
        }
        regions += size >= LEAST_PIECE;
    }
    return regions;
}

static bool is_of(const candidate *c, place_kind kind) {
    switch (kind) {
    case PLACE_TIP:
        return c->height < -TIP && c->regions == 1;
    case PLACE_VALLEY:
        return c->height > VALLEY && c->regions == 1;
    default:
        return c->regions >= 2;
    }
}

uint32_t places_find(const palp_blob *blob, place_kind kind, double radius, double depth,
                     place *out, uint32_t most) {
    const uint32_t nodes = blob->meta->nodes;
    search s = {blob, radius, allocate(nodes, sizeof *s.mark), allocate(nodes, sizeof *s.stack)};
    candidate *c = allocate(nodes, sizeof *c);
    for (uint32_t i = 0; i < nodes; i++) {
        if (palp_node_is_fixed(blob, i) || !survey(&s, i, &c[i].height)) continue;
        palp_vec3 n = at_node(blob->normal, i);
        palp_vec3 at = palp_madd(at_node(blob->rest_m, i), (float)first_touch(&s, i), n);
        c[i].at = (place){at, palp_scale(-1.0f, n)};
        c[i].regions = count_regions(&s, palp_madd(at, (float)-depth, n));
        c[i].usable = is_of(&c[i], kind);
    }
    uint32_t found = 0;
    while (found < most) {
        uint32_t best = UINT32_MAX;
        for (uint32_t i = 0; i < nodes; i++) {
            if (!c[i].usable) continue;
            if (best == UINT32_MAX || fabs(c[i].height) > fabs(c[best].height)) best = i;
        }
        if (best == UINT32_MAX) break;
        out[found++] = c[best].at;
        for (uint32_t i = 0; i < nodes; i++) {
            if (distance(c[i].at.at_m, c[best].at.at_m) < 2 * radius) c[i].usable = false;
        }
        c[best].usable = false;
    }
    free(s.mark);
    free(s.stack);
    free(c);
    return found;
}
