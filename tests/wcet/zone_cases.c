/* SPDX-License-Identifier: MIT */
/* A multizone model in changing configurations: its seams, and contact that follows them. */
#include "tests/wcet/cases.h"

typedef struct {
    cases *c;
    palp_zones zones;
    palp_assembly assembly;
    palp_contact contact;
    palp_tool tool[2];
    palp_contact_cost *unit; /* at unit prices, on the level of the seams in use */
    palp_prices *price;
    palp_moving *moving; /* at unit prices */
} setup;

typedef float (*seam_bound)(const setup *g, uint32_t unit, uint32_t level);

static float of_factor(const setup *g, uint32_t u, uint32_t level) {
    return palp_seams_cost_factor(&g->assembly.seams, &g->price[u], level);
}
static float of_settle(const setup *g, uint32_t u, uint32_t level) {
    return palp_assembly_cost_settle(&g->assembly, &g->price[u], level);
}
static float of_load(const setup *g, uint32_t u, uint32_t level) {
    (void)level;
    return g->moving[u].load_ns;
}

typedef struct {
    const setup *g;
    seam_bound bound;
    uint32_t level;
} question;

static float answer(const void *context, uint32_t k) {
    const question *q = context;
    return q->bound(q->g, k, q->level);
}

static void tell(const setup *g, const char *name, seam_bound bound, uint32_t level,
                 uint64_t counted) {
    const question q = {g, bound, level};
    cases_tell(g->c, name, level == PALP_DIAGONAL ? PALP_SEAM_LEVELS : level, answer, &q, counted);
}

/* The seams in another configuration, on some level. */
static void one_configuration(setup *g, dice *d) {
    palp_assembly *a = &g->assembly;
    const palp_frame rest = PALP_FRAME_IDENTITY;
    float value[PALP_MAX_JOINTS];
    for (uint32_t j = 0; j < PALP_MAX_JOINTS; j++) value[j] = 0.3f * dice_float(d);
    palp_assembly_pose(a, value, &rest);
    uint32_t level = dice_below(d, a->seams.finest + 2u);
    if (level > a->seams.finest) level = PALP_DIAGONAL;
    uint64_t before = instructions();
    palp_seams_begin(&a->seams, a->configuration, level);
    while (palp_seams_step(&a->seams)) {}
    uint64_t after = instructions();
    tell(g, "factor", of_factor, level, after - before);
    (void)palp_assembly_take(a, true);
    for (uint32_t j = 0; j < PALP_MAX_JOINTS; j++) value[j] += 0.01f; /* iterations, then */
    palp_assembly_pose(a, value, &rest);
    before = instructions();
    palp_assembly_settle(a);
    after = instructions();
    tell(g, "settle", of_settle, a->level, after - before);
    before = instructions();
    palp_contact_load_seams(&g->contact);
    after = instructions();
    tell(g, "load", of_load, a->level, after - before);
    for (uint32_t k = 0; k < cases_prices(g->c); k++) {
        const palp_seams *q = &a->seams;
        g->unit[k].unknowns = 0.0f;
        for (uint32_t s = 0; s < g->zones.meta->seams; s++)
            g->unit[k].unknowns += 3.0f * (float)palp_seam_modes(q, s, a->level);
        g->unit[k].solve = palp_seams_cost_solve(q, &g->price[k], a->level);
        g->unit[k].forward = palp_seams_cost_forward(q, &g->price[k], a->level);
    }
}

/* Tools near some place of the surface, seams not far away. */
static void press(setup *g, dice *d) {
    palp_assembly *a = &g->assembly;
    const uint32_t zone = dice_below(d, g->zones.meta->zones);
    const palp_blob *b = &g->zones.blob[zone];
    const uint32_t node = dice_below(d, b->meta->nodes);
    palp_frame at[2];
    palp_contact_spring spring[2];
    for (uint32_t t = 0; t < 2u; t++) {
        const float out = palp_tool_extent(&g->tool[t]) * (0.75f + 0.25f * dice_float(d));
        at[t] = palp_frame_at(palp_madd(palp_assembly_position(a, zone, node), out,
                                        palp_assembly_normal(a, zone, node)));
        spring[t] = (palp_contact_spring){.held = at[t], .stiffness_N_per_m = 300.0f};
    }
    for (uint32_t k = 0; k < 3u; k++) cases_of_tick(g->c, &g->contact, g->unit, at, spring);
}

static bool open(setup *g, uint32_t finest) {
    cases *c = g->c;
    const float edge = g->zones.blob[0].meta->mean_edge_m;
    size_t room = palp_assembly_memsize(&g->zones, finest);
    if (palp_assembly_init(&g->assembly, &g->zones, finest, cases_take(c, room), room) != PALP_OK)
        return false;
    g->tool[0] = palp_tool_sphere(1.5f * edge);
    g->tool[1] = (palp_tool){.shape = PALP_TOOL_CYLINDER,
                             .cylinder = {{0.0f, 1.0f, 0.0f}, 2.0f * edge, 2.0f * edge, edge}};
    const palp_contact_config config = {.assembly = &g->assembly,
                                        .pairs = true,
                                        .tools = g->tool,
                                        .tool_count = 2,
                                        .finest = PALP_CONTACT_FINEST};
    room = palp_contact_memsize(&config);
    if (palp_contact_init(&g->contact, &config, cases_take(c, room), room) != PALP_OK) return false;
    g->unit = cases_take(c, PALP_WORKS * sizeof *g->unit);
    g->price = cases_take(c, PALP_WORKS * sizeof *g->price);
    g->moving = cases_take(c, PALP_WORKS * sizeof *g->moving);
    for (uint32_t k = 0; k < cases_prices(c); k++) {
        g->price[k] = cases_price(c, k);
        g->unit[k] = palp_contact_cost_of_zones(&g->assembly, true, g->tool, 2, &g->price[k]);
        palp_moving_init(&g->moving[k], &g->contact, &g->price[k], 1e-3f, 0.0f,
                         palp_contact_cost_level(&g->unit[k], PALP_CONTACT_FINEST).contacts);
    }
    return true;
}

void cases_of_zones(cases *c, const void *data, size_t bytes, uint64_t seed, uint32_t rounds) {
    dice d = {seed};
    size_t used = c->used;
    setup *g = cases_take(c, sizeof *g);
    g->c = c;
    if (palp_zones_open(&g->zones, data, bytes) != PALP_OK) return;
    for (uint32_t finest = 0; finest < PALP_SEAM_LEVELS; finest++) {
        size_t mark = c->used;
        if (!open(g, finest)) break;
        for (uint32_t i = 0; i < rounds; i++) {
            if (i % 8u == 0u) g->contact.now = dice_below(&d, PALP_CONTACT_FINEST + 1u);
            one_configuration(g, &d);
            press(g, &d);
        }
        c->used = mark;
    }
    c->used = used;
}
