/* SPDX-License-Identifier: MIT */
#include "tools/press/press.h"
#include "port/host/parallel.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>

#define FINEST (PALP_CONTACT_LEVELS - 1u)
#define SIZES 4
#define DEPTH 0.1      /* over the radius */
#define SETTLE_TICKS 8 /* of a rigid press */

void press_hold(palp_contact *c, palp_vec3 place, int ticks) {
    const palp_frame at = palp_frame_at(place);
    const palp_contact_spring held = {.held = at};
    for (int i = 0; i < ticks; i++) palp_contact_solve(c, &at, &held);
}

bool press_point(const palp_contact *c, palp_vec3 from, palp_vec3 n, palp_surface_point *p) {
    uint32_t crossings = 64;
    return palp_surface_shoot(c->surface, from, palp_scale(-1.0f, n), &crossings, p);
}

palp_surface_point press_start(const palp_contact *c, uint32_t node) {
    const palp_blob *b = c->surface->blob;
    palp_surface_point p = {.triangle = b->regular.triangle[node]};
    palp_vec3 x = at_node(b->rest_m, node), n = at_node(b->normal, node);
    p.y = x;
    p.n = n;
    (void)press_point(c, palp_madd(x, b->meta->mean_edge_m, n), n, &p);
    return p;
}

bool press_is_clear(const palp_blob *b, palp_vec3 at, double radius, double depth) {
    float least = (float)(radius - 1.5 * depth - 0.02 * (double)b->meta->mean_edge_m);
    for (uint32_t i = 0; i < b->meta->nodes; i++) {
        palp_vec3 d = palp_sub(at_node(b->rest_m, i), at);
        if (palp_dot(d, d) < least * least) return false;
    }
    return true;
}

/* ---- levels ---- */

typedef struct {
    double off[PALP_CONTACT_LEVELS];
    bool pressed;
} press;

typedef struct {
    const palp_blob *blob;
    const uint32_t *place;
    press *of; /* [places][SIZES] */
} work;

static void press_one(void *context, size_t i) {
    static const double sizes[SIZES] = {1, 2, 4, 6};
    const work *w = context;
    const double radius = sizes[i % SIZES] * (double)w->blob->meta->mean_edge_m,
                 depth = DEPTH * radius;
    const palp_tool tool = palp_tool_sphere((float)radius);
    palp_contact *c = contact_open(w->blob, &tool, 1, FINEST);
    palp_surface_point p = press_start(c, w->place[i / SIZES]);
    palp_vec3 at = palp_madd(p.y, (float)(radius - depth), p.n);
    press *out = &w->of[i];
    if (press_is_clear(w->blob, at, radius, depth)) {
        press_hold(c, at, SETTLE_TICKS);
        const palp_vec3 fine = c->force_N[0];
        const double size = (double)palp_norm(fine);
        out->pressed = size > 0;
        for (uint32_t l = 0; l < FINEST && out->pressed; l++) {
            c->now = l;
            press_hold(c, at, SETTLE_TICKS);
            out->off[l] = (double)palp_norm(palp_sub(c->force_N[0], fine)) / size;
        }
    }
    contact_close(c);
}

press_errors press_levels(const palp_blob *blob, const uint32_t *place, uint32_t places) {
    work w = {blob, place, allocate(SIZES * (size_t)places, sizeof *w.of)};
    press_errors e = {.count = 0};
    parallel_for(SIZES * (size_t)places, press_one, &w);
    for (uint32_t i = 0; i < SIZES * places; i++) {
        if (!w.of[i].pressed) continue;
        e.count++;
        for (uint32_t l = 0; l < FINEST; l++) {
            e.mean[l] += w.of[i].off[l];
            e.worst[l] = fmax(e.worst[l], w.of[i].off[l]);
        }
    }
    for (uint32_t l = 0; l < FINEST && e.count > 0; l++) e.mean[l] /= e.count;
    free(w.of);
    return e;
}
