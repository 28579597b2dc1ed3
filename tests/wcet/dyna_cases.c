/* SPDX-License-Identifier: MIT */
/* Ticks of a dynamic body, with a tool that jumps about in it. */
#include "tests/wcet/cases.h"

typedef struct {
    palp_dynamic body;
    palp_tool tool;
} poked;

static uint64_t no_time(void *context) {
    (void)context;
    return 0;
}

typedef struct {
    const palp_prices *price;
    const palp_dynamic *body;
    uint32_t most_class;
    bool collapsed;
} question;

static float answer(const void *context, uint32_t k) {
    const question *q = context;
    palp_dynamic d = *q->body;
    d.price = q->price[k];
    const float whole = palp_dynamic_cost_tick(&d, q->most_class);
    if (!q->collapsed) return whole;
    return palp_dynamic_cost_least(&d) + palp_dynamic_cost_collapse(&d);
}

/* A tick with so much time, in what the code itself counts. */
static void count_tick(cases *c, const palp_prices *price, poked *p, palp_vec3 place,
                       float margin) {
    const palp_frame at = palp_frame_at(place);
    palp_dynamic before = p->body;
    palp_dynamic_report r;
    palp_wrench on_tool;
    p->body.config.cost.margin = margin;
    const uint64_t start = instructions();
    palp_dynamic_tick(&p->body, 0, &at, &on_tool, &r);
    const uint64_t end = instructions();
    uint32_t most_class = 0;
    while (1u << most_class < r.steps) most_class++;
    const question q = {price, &before, most_class, r.collapsed};
    if (!r.coasted && !r.lost)
        cases_tell(c, r.collapsed ? "collapse" : "dynamic", most_class, answer, &q, end - start);
}

void cases_of_dyna(cases *c, const palp_tets *tets, uint64_t seed, uint32_t episodes) {
    dice d = {seed};
    palp_prices *price = cases_take(c, PALP_WORKS * sizeof *price);
    size_t used = c->used;
    for (uint32_t k = 0; k < cases_prices(c); k++) price[k] = cases_price(c, k);
    for (uint32_t e = 0; e < episodes; e++, c->used = used) {
        poked *p = cases_take(c, sizeof *p);
        uint32_t points = 16u << dice_below(&d, 3);
        size_t bytes = palp_dynamic_memsize(tets, points);
        p->tool =
            palp_tool_sphere(tets->meta->diagonal_m *
                             (dice_below(&d, 3) == 0u ? 0.6f : 0.08f + 0.07f * dice_float(&d)));
        p->tool.friction = e % 2u == 1u ? 0.3f : 0.0f;
        palp_dynamic_config config = {.tets = tets,
                                      .material = palp_material_of(4e3f, 0.4f, 1000, 3e-4f, 5),
                                      .adapt = palp_adapt_defaults(tets),
                                      .tools = &p->tool,
                                      .tool_count = 1,
                                      .max_points = points,
                                      .most_class = dice_below(&d, 6),
                                      .cost = {&palp_target_counted, 1e-6f, 0.0f, 0.8f},
                                      .port = {.now_ns = no_time},
                                      .tick_s = 1e-3f};
        palp_vec3 at = {0};
        const palp_frame begin = PALP_FRAME_IDENTITY;
        config.adapt.max_changes = 1u + dice_below(&d, 12);
        config.adapt.dwell_ticks = dice_below(&d, 30);
        if (palp_dynamic_init(&p->body, &config, &begin, cases_take(c, bytes), bytes, NULL) !=
            PALP_OK)
            return;
        for (uint32_t tick = 0; tick < 120u; tick++) {
            uint32_t node = tets->skin_node[dice_below(&d, tets->meta->skin)];
            if (tick % 16u == 0u) at = palp_vec3_at(tets->rest_m + 3u * node);
            float pace = 0.05f * p->tool.ball[0].radius_m;
            at = palp_madd(at, pace, (palp_vec3){dice_float(&d), dice_float(&d), dice_float(&d)});
            count_tick(c, price, p, at, tick % 40u < 30u ? 1e9f : 4.0f * (1.0f + dice_float(&d)));
        }
    }
    c->used = used;
}
