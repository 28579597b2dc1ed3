/* SPDX-License-Identifier: MIT */
#include "hunt.h"

hunt_path hunt_random(dice *d) {
    return (hunt_path){.dwell = 1u + dice_below(d, 60),
                       .radius = 7.0f + 6.0f * dice_float(d),
                       .stiffness = 0.6f + 0.5f * dice_float(d),
                       .sunk = 0.5f + 0.4f * dice_float(d),
                       .swing = 0.3f + 0.3f * dice_float(d),
                       .tremble = 0.5f + 0.5f * dice_float(d),
                       .far = 0.5f + 0.5f * dice_float(d),
                       .seed = dice_roll(d)};
}

hunt_path hunt_mutated(hunt_path path, dice *d) {
    hunt_path p = path;
    float *value[6] = {&p.radius, &p.stiffness, &p.sunk, &p.swing, &p.tremble, &p.far};
    for (uint32_t i = 0; i < 6u; i++) *value[i] *= 1.0f + 0.3f * dice_float(d) * dice_float(d);
    if (dice_below(d, 3) == 0u) p.dwell = 1u + (p.dwell + dice_below(d, 9)) % 60u;
    if (dice_below(d, 2) == 0u) p.seed = dice_roll(d);
    p.sunk = palp_min(p.sunk, 1.2f);
    return p;
}

static palp_vec3 next_place(const hunter *h, const hunt_path *p, dice *d, uint32_t tick,
                            uint32_t *node) {
    const palp_blob *b = h->blob;
    if (tick % p->dwell == 0u) {
        uint32_t first = b->ring_offset[*node], ring = b->ring_offset[*node + 1u] - first;
        bool far = 0.5f * (1.0f + dice_float(d)) < p->far || ring == 0u;
        *node = far ? b->domain[PALP_FREE].node[dice_below(d, b->domain[PALP_FREE].slots)]
                    : b->ring[first + dice_below(d, ring)];
    }
    float sunk = p->sunk + p->swing * dice_float(d);
    palp_vec3 at =
        palp_madd(palp_vec3_at(b->rest_m + 3u * *node), (1.0f - sunk) * h->tool.ball[0].radius_m,
                  palp_vec3_at(b->normal + 3u * *node));
    return palp_madd(at, p->tremble * b->meta->mean_edge_m,
                     (palp_vec3){dice_float(d), dice_float(d), dice_float(d)});
}

static uint32_t most(uint32_t a, uint32_t b) { return a > b ? a : b; }

float hunt_bound(const palp_touch_cost *cost, const hunt_tick *tick) {
    const palp_prices *p = &cost->price;
    uint32_t k = most(tick->count_before, tick->count);
    uint32_t n = most(tick->active_before, tick->active);
    float quanta = (float)(tick->pivots + tick->admitted + 1u);
    float sum = p->of[PALP_WORK_TICK] + quanta * p->of[PALP_WORK_QUANTUM] +
                palp_cost_search(cost, tick->rung, tick->count_before, tick->active_before) +
                (float)tick->admitted * palp_cost_admit(cost, tick->rung, k, n) +
                (float)tick->solves * (palp_cost_begin(cost, k) + palp_cost_couple(cost, n)) +
                (float)tick->pivots * palp_cost_pivot(cost, k, n) + palp_cost_leave(cost, n);
    if (tick->rung.level > 0u) {
        const palp_rung below = {tick->rung.level - 1u, tick->rung.level - 1u};
        sum += palp_cost_load(cost, below, n, n);
    }
    return tick->due ? sum + palp_cost_refactor(cost, n) : sum;
}

static void one_tick(hunter *h, palp_vec3 at) {
    palp_bounded *b = &h->bounded;
    const uint32_t pivots = PALP_NODE_COUPLING_PIVOTS * h->limits.max_pivots;
    const palp_node_contact *k = palp_ladder_contact(&b->ladder);
    hunt_tick t = {.rung = b->ladder.at[b->ladder.rung],
                   .count_before = k->count,
                   .active_before = k->active_count,
                   .due = k->changes + pivots >= PALP_NODE_CONTACT_REFACTOR};
    palp_node_coupling_result result;
    palp_bounded_report r;
    if (h->chill != NULL) h->chill();
    uint64_t before = h->port.now_ns(h->port.context);
    palp_bounded_tick(b, before, &at, &result, &r);
    t.cost = h->port.now_ns(h->port.context) - before;
    k = palp_ladder_contact(&b->ladder);
    t.count = k->count;
    t.active = most(k->active_count, t.active_before) + 2u; /* between its pivots */
    if (t.active > h->limits.max_active) t.active = h->limits.max_active;
    t.admitted = r.admitted;
    t.pivots = r.pivots;
    t.solves = b->coupling.solves;
    if (r.aborted == 0u) h->told(h->context, &t);
    palp_bounded_spare(b);
}

bool hunt_run(hunter *h, const hunt_path *path, uint32_t ticks) {
    dice d = {path->seed};
    h->tool = palp_tool_sphere(path->radius * h->blob->meta->mean_edge_m);
    h->tool.friction = h->limits.friction ? 0.3f : 0.0f;
    const palp_bounded_config config = {.blob = h->blob,
                                        .tools = &h->tool,
                                        .tool_count = 1,
                                        .limits = h->limits,
                                        .cost = {&palp_target_counted, 1e-9f, 0.0f, 1.0f},
                                        .port = h->port,
                                        .dt_s = 1.0f};
    if (palp_bounded_init(&h->bounded, &config, h->memory, h->bytes, NULL) != PALP_OK) return false;
    h->bounded.coupling.spring[0].stiffness_N_per_m =
        h->blob->meta->stiffness_max_N_per_m * path->stiffness;
    uint32_t node = h->blob->domain[PALP_FREE].node[0];
    for (uint32_t i = 0; i < ticks; i++) one_tick(h, next_place(h, path, &d, i, &node));
    return true;
}
