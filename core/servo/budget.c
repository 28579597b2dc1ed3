/* SPDX-License-Identifier: MIT */
#include "budget.h"

#define BALL 60.0f /* one ball evaluated, with its look-ups */
#define PAD 160.0f
#define LOOKUP 24.0f            /* one block of a table, contracted and cached */
#define FRAMES_AND_POSE 8000.0f /* decoding, kinematics, output chain, encoding */
#define DESCENT 32.0f           /* moves of the nearest node, as in contact.c */

/* Most nodes that the search can meet in 27 cells: three cells of a row are one run. */
static float most_in_block(const palp_blob *b) {
    const palp_meta *m = b->meta;
    uint32_t most = 0;
    for (uint32_t z = 0; z < m->cells[2]; z++) {
        for (uint32_t y = 0; y < m->cells[1]; y++) {
            uint32_t row = (z * m->cells[1] + y) * m->cells[0];
            for (uint32_t x = 0; x < m->cells[0]; x++) {
                uint32_t low = x > 0u ? x - 1u : 0u;
                uint32_t high = x + 1u < m->cells[0] ? x + 2u : m->cells[0];
                uint32_t n = b->cell_offset[row + high] - b->cell_offset[row + low];
                if (n > most) most = n;
            }
        }
    }
    float nine_runs = 9.0f * (float)most;
    float all = (float)m->nodes;
    return nine_runs < all ? nine_runs : all;
}

palp_cost_bound palp_cost_of(const palp_blob *blob, palp_contact_limits limits,
                             const palp_tool *tools, uint32_t tool_count) {
    const palp_meta *m = blob->meta;
    palp_cost_bound b = {.pairs = 1.0f,
                         .fixed = FRAMES_AND_POSE,
                         .pair = limits.friction ? 22.0f : 5.0f,
                         .columns = 3.0f * (float)tool_count};
    float candidates = (float)limits.max_candidates, active = (float)limits.max_active;
    float row = (float)m->max_row, slots = (float)m->domain_nodes[PALP_FREE];
    b.ring = (float)m->max_ring;
    for (uint32_t t = 0; t < tool_count; t++) {
        float one = tools[t].balls > 0u ? BALL * (float)tools[t].balls : PAD;
        b.tool = palp_max(b.tool, one);
    }
    b.near = b.tool + 3.0f * (float)limits.max_new;
    b.grid = (float)PALP_CONTACT_SCAN * b.near +
             (float)tool_count * 8.0f * (most_in_block(blob) + DESCENT * b.ring);
    b.row = (float)m->levels * (slots / 16.0f + row) + 8.0f * row;
    b.extraction = 16.0f * row + (float)(m->max_groups * PALP_LANES) + 40.0f;
    for (uint32_t l = 0; l <= m->constraint_level; l++) {
        if (blob->level[l].table != NULL) b.tables |= 1u << l;
    }
    uint32_t lowest = b.tables != 0u ? (uint32_t)__builtin_ctz(b.tables) : m->constraint_level;
    float coarsest = (float)blob->level[lowest].nodes;
    b.limit_active = active;
    b.limit_candidates = candidates;
    b.least_candidates = palp_min(candidates, coarsest);
    b.least_active = palp_min(active, coarsest);
    return b;
}

palp_cost_bound palp_cost_of_zones(const palp_zones *zones, uint32_t finest, bool pairs,
                                   palp_contact_limits limits, const palp_tool *tools,
                                   uint32_t tool_count) {
    palp_cost_bound all = palp_cost_of(&zones->blob[0], limits, tools, tool_count);
    float grid = 0.0f, largest = 0.0f;
    all.tables = UINT32_MAX;
    all.row = all.extraction = 0.0f;
    all.pairs = pairs ? 2.0f : 1.0f;
    for (uint32_t i = 0; i < zones->meta->zones; i++) {
        palp_cost_bound b = palp_cost_of(&zones->blob[i], limits, tools, tool_count);
        all.ring = palp_max(all.ring, b.ring);
        if ((b.tables >> zones->blob[i].meta->constraint_level & 1u) == 0u) { /* look-ups fail */
            all.tables = 0;
            all.row = palp_max(all.row, b.row);
            all.extraction = palp_max(all.extraction, b.extraction);
        }
        float modes = 0.0f;
        for (uint32_t k = 0; k < zones->part[i].seams; k++)
            modes += (float)zones->seam[zones->part[i].seam[k]].level_modes[finest];
        all.modes = palp_max(all.modes, modes);
        grid += b.grid - (float)PALP_CONTACT_SCAN * b.near;
        largest = palp_max(largest, b.grid - (float)PALP_CONTACT_SCAN * b.near);
    }
    all.bodies = (float)zones->meta->zones;
    float place = 9.0f * all.modes + 40.0f; /* where a node is, its zone's seams displaced */
    all.tool += place;
    all.near += place;
    all.grid = grid + (float)PALP_CONTACT_SCAN * all.near;
    if (pairs) { /* each node that is looked at finds its nearest on every other zone */
        all.nearest = largest / (float)tool_count + all.row;
        float looks = (float)PALP_CONTACT_PAIR_SCAN * (all.bodies - 1.0f) + all.ring;
        all.grid += looks * (largest / (float)tool_count + 2.0f * place + 60.0f);
    }
    all.least_candidates = all.limit_candidates;
    all.least_active = all.limit_active;
    return all;
}

float palp_cost_follow(const palp_cost_bound *bound, palp_contact_limits limits, uint32_t count,
                       float unknowns, float solve) {
    float n = (float)count;
    float aimed = bound->pairs > 1.0f ? (float)limits.max_new : 0.0f;
    return n * (60.0f * bound->modes + 0.5f * solve + unknowns + 60.0f) +
           30.0f * bound->modes * bound->limit_active + 0.5f * n * n * (unknowns + 8.0f) +
           aimed * (bound->nearest + 4.0f * n * (LOOKUP + 2.0f * bound->extraction));
}

float palp_cost_search(const palp_cost_bound *bound, palp_rung rung, uint32_t count,
                       uint32_t active) {
    float k = (float)count, times = rung.outer < rung.level ? 5.0f : 1.0f;
    return times * bound->grid + k * (bound->tool + 5.0f * (float)active +
                                      times * bound->ring * bound->near + bound->pair * k);
}

float palp_cost_tail(const palp_cost_bound *bound, uint32_t active) {
    float n = (float)active;
    return 0.5f * bound->fixed + bound->columns * (n * n + 2.0f * n) + 45.0f * n;
}

/* Look-ups that one pair may take. */
static float look_ups(const palp_cost_bound *b, palp_rung rung) {
    return rung.outer < rung.level ? 1.0f + b->ring : 1.0f;
}

float palp_cost_admit(const palp_cost_bound *bound, palp_rung rung, uint32_t count) {
    float pairs = (float)count + 1.0f;
    float room = 4.0f * bound->tool + pairs * (bound->limit_active + bound->pair + 2.0f) +
                 bound->seam_row + pairs * bound->unknowns;
    if ((bound->tables >> rung.level & 1u) != 0u)
        return room + pairs * LOOKUP * look_ups(bound, rung) * bound->pairs * bound->pairs;
    float rows = bound->pairs > 1.0f ? 2.0f : 1.0f;
    return room + rows * bound->row + rows * (2.0f * pairs - 1.0f) * bound->extraction;
}

float palp_cost_pivot(const palp_cost_bound *bound, uint32_t count, uint32_t active) {
    float n = (float)active, k = bound->columns;
    return 5.0f * n * n + k * (0.5f * n * n + k * n) + (float)count * (4.0f * n + 12.0f) +
           32.0f * n + k * k * k;
}

float palp_cost_solve(const palp_cost_bound *bound, uint32_t count, uint32_t active) {
    float n = (float)active;
    return (float)count * (bound->tool + 4.0f) + n * n * n / 6.0f + 40.0f * n;
}

float palp_cost_answer(const palp_cost_bound *bound, uint32_t count, uint32_t active,
                       uint32_t pivots) {
    float n = (float)active;
    float solve = palp_cost_solve(bound, count, active) +
                  (float)pivots * palp_cost_pivot(bound, count, active);
    return (float)PALP_COUPLING_SOLVES * solve + 10.0f * n * n;
}

float palp_cost_change(const palp_cost_bound *bound, palp_rung rung, uint32_t load) {
    float h = (float)load;
    float pairs = 0.5f * LOOKUP * look_ups(bound, rung) * h;
    return h * (6.0f * bound->tool + 40.0f + pairs) + h * h * h / 6.0f + 3.0f * h * h +
           bound->limit_active * bound->limit_active + bound->columns * bound->row;
}

float palp_cost_full(const palp_cost_bound *bound, palp_contact_limits limits) {
    const palp_rung finest = {PALP_MAX_LEVELS, PALP_MAX_LEVELS}; /* no table */
    return bound->fixed +
           palp_cost_search(bound, finest, limits.max_candidates, limits.max_active) +
           palp_cost_answer(bound, limits.max_candidates, limits.max_active, limits.max_pivots) +
           (float)limits.max_new * palp_cost_admit(bound, finest, limits.max_candidates - 1u);
}

float palp_cost_least(const palp_cost_bound *bound) {
    const palp_rung coarsest = {0, 0};
    uint32_t count = (uint32_t)bound->least_candidates, active = (uint32_t)bound->least_active;
    return bound->fixed + palp_cost_search(bound, coarsest, count, active) +
           palp_cost_answer(bound, count, active, 1u);
}
