/* SPDX-License-Identifier: MIT */
#include "budget.h"

#define SPHERE 60.0f            /* one sphere evaluation with its look-ups */
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

palp_cost_bound palp_cost_of(const palp_blob *blob, palp_contact_limits limits) {
    const palp_meta *m = blob->meta;
    float candidates = (float)limits.max_candidates;
    float active = (float)limits.max_active;
    float ring = (float)m->max_ring;
    float row = (float)m->max_row;
    float slots = (float)m->domain_nodes[PALP_FREE];
    float column = (float)(m->max_groups * PALP_LANES);
    return (palp_cost_bound){
        .fixed = FRAMES_AND_POSE,
        .search = candidates * (SPHERE + 5.0f * active) +
                  candidates * ring * (SPHERE + 3.0f * (float)limits.max_new) +
                  candidates * candidates * 3.0f + 8.0f * (most_in_block(blob) + DESCENT * ring),
        .row = (float)m->levels * (slots / 16.0f + row) + 8.0f * row,
        .extraction = 16.0f * row + column + 40.0f,
    };
}

float palp_cost_admit(const palp_cost_bound *bound, uint32_t count) {
    return bound->row + (2.0f * (float)count + 1.0f) * bound->extraction;
}

float palp_cost_solve(uint32_t count, uint32_t active, uint32_t pivots) {
    float n = (float)active;
    /* depths, refactorisation, relief of what found no room, axis and force */
    float once = (float)count * (SPHERE + 2.0f * n) + n * n * n / 6.0f + n * n + 20.0f * n;
    float step = 2.5f * n * n + 24.0f * n; /* z, with the spring's give */
    float exchange = 2.5f * n * n + 8.0f * n;
    float violation = (float)count * (2.0f * n + 6.0f); /* is it active, and its indentation */
    return once + (float)pivots * (step + exchange + violation);
}

float palp_cost_full(const palp_cost_bound *bound, palp_contact_limits limits) {
    float solve = palp_cost_solve(limits.max_candidates, limits.max_active, limits.max_pivots);
    return bound->fixed + bound->search + (float)PALP_COUPLING_SOLVES * solve +
           (float)limits.max_new * palp_cost_admit(bound, limits.max_candidates - 1u);
}

float palp_cost_least(const palp_cost_bound *bound, palp_contact_limits limits) {
    float solve = palp_cost_solve(limits.max_candidates, limits.max_active, 1u);
    return bound->fixed + bound->search + (float)PALP_COUPLING_SOLVES * solve;
}
