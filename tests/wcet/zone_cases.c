/* SPDX-License-Identifier: MIT */
/* The seams of a multizone model in changing postures, and contact that follows them. */
#include "cases.h"

typedef struct {
    palp_zones zones;
    palp_assembly assembly;
    palp_node_contact contact;
    palp_tool tool;
    palp_touch_cost unit[PALP_WORKS];
} grip;

typedef float (*seam_bound)(const grip *g, uint32_t unit, uint32_t level);

static const palp_prices *price_of(const grip *g, uint32_t unit) { return &g->unit[unit].price; }
static float of_factor(const grip *g, uint32_t u, uint32_t level) {
    return palp_seams_cost_factor(&g->assembly.seams, price_of(g, u), level);
}
static float of_solve(const grip *g, uint32_t u, uint32_t level) {
    return palp_seams_cost_solve(&g->assembly.seams, price_of(g, u), level);
}
static float of_settle(const grip *g, uint32_t u, uint32_t level) {
    return palp_assembly_cost_settle(&g->assembly, price_of(g, u), level);
}
static float unknowns(const grip *g, uint32_t level) {
    float n = 0.0f;
    for (uint32_t s = 0; s < g->zones.meta->seams; s++)
        n += 3.0f * (float)palp_seam_modes(&g->assembly.seams, s, level);
    return n;
}
static float of_follow(const grip *g, uint32_t u, uint32_t level) {
    return palp_cost_follow(&g->unit[u], g->contact.count, g->contact.active_count,
                            unknowns(g, level), of_solve(g, u, level));
}

typedef struct {
    const grip *g;
    seam_bound bound;
    uint32_t level;
} question;

static float answer(const void *context, uint32_t k) {
    const question *q = context;
    return q->bound(q->g, k, q->level);
}

static void tell(cases *c, const grip *g, const char *name, seam_bound bound, uint32_t level,
                 uint64_t counted) {
    const question q = {g, bound, level};
    cases_tell(c, name, level == PALP_DIAGONAL ? PALP_SEAM_LEVELS : level, answer, &q, counted);
}

static void one_posture(cases *c, grip *g, dice *d, palp_fresh *fresh) {
    palp_assembly *a = &g->assembly;
    const palp_frame rest = PALP_FRAME_IDENTITY;
    float value[PALP_MAX_JOINTS];
    for (uint32_t j = 0; j < PALP_MAX_JOINTS; j++) value[j] = 0.3f * dice_float(d);
    palp_assembly_pose(a, value, &rest);
    uint32_t level = dice_below(d, a->seams.finest + 2u);
    if (level > a->seams.finest) level = PALP_DIAGONAL;
    uint64_t before = instructions();
    palp_seams_begin(&a->seams, a->posture, level);
    while (palp_seams_step(&a->seams)) {}
    uint64_t after = instructions();
    tell(c, g, "factor", of_factor, level, after - before);
    (void)palp_assembly_take(a, true);
    for (uint32_t j = 0; j < PALP_MAX_JOINTS; j++) value[j] += 0.01f; /* iterations, then */
    palp_assembly_pose(a, value, &rest);
    before = instructions();
    palp_assembly_settle(a);
    after = instructions();
    tell(c, g, "settle", of_settle, a->level, after - before);
    before = instructions();
    palp_node_contact_load(&g->contact, a);
    palp_node_contact_follow(&g->contact);
    after = instructions();
    tell(c, g, "follow", of_follow, a->level, after - before);
    uint32_t zone = dice_below(d, g->zones.meta->zones);
    const palp_blob *b = &g->zones.blob[zone];
    uint32_t node = b->domain[PALP_FREE].node[dice_below(d, b->domain[PALP_FREE].slots)];
    palp_vec3 at = palp_madd(palp_assembly_place(a, zone, node), 0.7f * g->tool.ball[0].radius_m,
                             palp_assembly_normal(a, zone, node));
    for (uint32_t k = 0; k < 6u; k++) {
        uint32_t n = palp_node_contact_search(&g->contact, &at, fresh);
        for (uint32_t i = 0; i < n; i++) palp_node_contact_admit(&g->contact, fresh[i]);
        (void)palp_node_contact_solve(&g->contact, at, (palp_grip){at, 300.0f});
    }
}

void cases_of_zones(cases *c, const void *data, size_t bytes, uint64_t seed, uint32_t rounds) {
    const palp_node_contact_limits limits = {40, 24, 4, 12, false};
    dice d = {seed};
    size_t used = c->used;
    grip *g = cases_take(c, sizeof *g);
    palp_fresh fresh[PALP_MAX_CANDIDATES];
    if (palp_zones_open(&g->zones, data, bytes) != PALP_OK) return;
    for (uint32_t finest = 0; finest < PALP_SEAM_LEVELS; finest++) {
        size_t mark = c->used, room = palp_assembly_memsize(&g->zones, finest);
        if (palp_assembly_init(&g->assembly, &g->zones, finest, cases_take(c, room), room) !=
            PALP_OK)
            break;
        g->tool = palp_tool_sphere(1.5f * g->zones.blob[0].meta->mean_edge_m);
        for (uint32_t k = 0; k < cases_prices(c); k++) {
            palp_prices price = cases_price(c, k);
            g->unit[k] =
                palp_touch_cost_of_zones(&g->zones, finest, true, limits, &g->tool, 1, &price);
        }
        room = palp_node_contact_memsize_zones(&g->zones, finest, limits);
        if (palp_node_contact_init_zones(&g->contact, &g->assembly, true, &g->tool, 1, limits,
                                         cases_take(c, room), room) != PALP_OK)
            break;
        for (uint32_t i = 0; i < rounds; i++) one_posture(c, g, &d, fresh);
        c->used = mark;
    }
    c->used = used;
}
