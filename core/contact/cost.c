/* SPDX-License-Identifier: MIT */
#include "core/contact/cost.h"

#define PRICE(cost, kind) ((cost)->price.of[PALP_WORK_##kind])

static float evaluation_of(const palp_tool *tool, const palp_prices *price) {
    if (tool->balls > 0u) return (float)tool->balls * price->of[PALP_WORK_BALL];
    return tool->cylinder.radius_m > 0.0f ? price->of[PALP_WORK_CYLINDER]
                                          : price->of[PALP_WORK_PAD];
}

/* Cells along one axis that a tool's box of half width `reach` may meet. */
static uint32_t cells_met(const palp_meta *m, uint32_t axis, float reach) {
    float met = palp_min(2.0f * reach / m->cell_size_m + 2.0f, (float)m->cells[axis]);
    return met > 1.0f ? (uint32_t)met : 1u;
}

/* Most nodes in any box of cells that a tool may meet. */
static uint32_t nodes_around(const palp_blob *b, const uint32_t met[3]) {
    const palp_meta *m = b->meta;
    uint32_t most = 0;
    /* each at most the cells of its axis */
    for (uint32_t z = 0; z + met[2] <= m->cells[2]; z++) {
        /* at most cells */
        for (uint32_t y = 0; y + met[1] <= m->cells[1]; y++) {
            /* at most cells */
            for (uint32_t x = 0; x + met[0] <= m->cells[0]; x++) {
                uint32_t sum = 0;
                for (uint32_t k = 0; k < met[2] * met[1]; k++) {
                    uint32_t row = ((z + k / met[1]) * m->cells[1] + y + k % met[1]) * m->cells[0];
                    sum += b->cell_offset[row + x + met[0]] - b->cell_offset[row + x];
                }
                most = sum > most ? sum : most;
            }
        }
    }
    return most;
}

palp_contact_cost palp_contact_cost_of(const palp_blob *blob, const palp_tool *tools,
                                       uint32_t tool_count, const palp_prices *price) {
    palp_contact_cost c = {.price = *price,
                           .tools = (float)tool_count,
                           .ring = (float)blob->meta->max_ring,
                           .modes = blob->regular.modes};
    for (uint32_t t = 0; t < tool_count; t++) {
        float reach = palp_lattice_reach(&tools[t], blob);
        uint32_t met[3];
        for (uint32_t k = 0; k < 3u; k++) met[k] = cells_met(blob->meta, k, reach);
        c.evaluation = palp_max(c.evaluation, evaluation_of(&tools[t], price));
        c.nodes = palp_max(c.nodes, (float)nodes_around(blob, met));
        c.rows = palp_max(c.rows, (float)(met[1] * met[2]));
        c.friction = c.friction || tools[t].friction > 0.0f;
    }
    return c;
}

float palp_contact_cost_filled(const palp_contact_cost *cost, palp_lattice_counts done) {
    return (float)done.fillings * PRICE(cost, FILLING) + (float)done.around * PRICE(cost, AROUND) +
           (float)done.evaluations * (cost->evaluation + PRICE(cost, GIVEN)) +
           (float)done.shots * PRICE(cost, SHOT) + (float)done.crossings * PRICE(cost, CROSSING) +
           (float)done.fillings * PALP_LATTICE_WATCHED *
               (PRICE(cost, CORNER) + PALP_LATTICE_FAR_MODES * PRICE(cost, CORNER_MODE));
}

palp_lattice_counts palp_contact_most_filled(const palp_contact_cost *cost,
                                             palp_contact_level level) {
    const uint32_t looks = PALP_LATTICE_LOOKS(level.points), nodes = (uint32_t)cost->nodes;
    const uint32_t feet = PALP_LATTICE_FEET(level.points), ring = (uint32_t)cost->ring;
    return (palp_lattice_counts){.fillings = 1u,
                                 .around = nodes + (uint32_t)cost->rows + feet * ring,
                                 .evaluations = nodes + looks + PALP_LATTICE_WANTED(level.points) +
                                                PALP_LATTICE_RINGS(level.points) * ring +
                                                10u * feet + 1u,
                                 .shots = looks + 4u * feet,
                                 .crossings = PALP_LATTICE_CROSSINGS(level.points)};
}

float palp_contact_cost_fill(const palp_contact_cost *cost, palp_contact_level level) {
    return palp_contact_cost_filled(cost, palp_contact_most_filled(cost, level));
}

float palp_contact_cost_points(const palp_contact_cost *cost, palp_contact_level level,
                               uint32_t count) {
    return (float)count * (PRICE(cost, POINT) + cost->evaluation + 3.0f * PRICE(cost, CORNER) +
                           (float)level.modes * PRICE(cost, MODE_AT));
}

float palp_contact_cost_assemble(const palp_contact_cost *cost, palp_contact_level level,
                                 uint32_t count) {
    const float n = (float)count;
    return 0.5f * n * (n + 1.0f) *
               (PRICE(cost, COMPLIANCE) + (float)level.modes * PRICE(cost, MODE_PAIR)) +
           n * (PRICE(cost, GATHER) + 0.5f * PRICE(cost, POINT) +
                0.25f * (float)level.modes * PRICE(cost, MODE_AT));
}

float palp_contact_cost_iterate(const palp_contact_cost *cost, uint32_t count, uint32_t active) {
    const float n = (float)count, a = (float)active;
    return PRICE(cost, ITERATION) + PRICE(cost, QUANTUM) + (n + a) * PRICE(cost, PRESSED) +
           0.5f * a * (a + 1.0f) *
               (PRICE(cost, GATHER) + PRICE(cost, SUBSTITUTE) + PRICE(cost, DOT)) +
           a * a * a / 6.0f * PRICE(cost, AXPY) + 2.0f * a * PRICE(cost, SUBSTITUTE) +
           0.5f * a * a * (PRICE(cost, AXPY) + PRICE(cost, DOT)) +
           palp_max(n - a, 0.0f) * a * PRICE(cost, DOT);
}

float palp_contact_cost_finish(const palp_contact_cost *cost, palp_contact_level level,
                               uint32_t count, uint32_t active) {
    const float n = (float)count, a = (float)active, modes = (float)level.modes;
    const float corners = 3.0f * n * (PRICE(cost, CORNER) + modes * PRICE(cost, CORNER_MODE));
    float sum = cost->tools * PRICE(cost, FINISH) +
                n * (PRICE(cost, POINT) + a * PRICE(cost, DISPLACE)) +
                1.25f * a * a * PRICE(cost, DISPLACE) + corners +
                n * (PRICE(cost, FOLLOW) + cost->evaluation) + a * modes * PRICE(cost, MODE_AT);
    if (!cost->friction) return sum;
    return sum + 2.0f * (a * (PRICE(cost, POINT) + modes * PRICE(cost, MODE_AT)) +
                         a * a * PRICE(cost, DISPLACE) + corners);
}
