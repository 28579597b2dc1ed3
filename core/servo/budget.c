/* SPDX-License-Identifier: MIT */
#include "budget.h"

#define SPHERE 60.0f          /* one sphere evaluation with its look-ups */
#define FRAMES_AND_POSE 4000.0f /* decoding, kinematics, output chain, encoding */
#define DESCENT 32.0f         /* moves of the nearest node, as in contact.c */

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
    float row_walk = (float)m->levels * (slots / 16.0f + row) + 8.0f * row;
    float extraction = 11.0f * row + column + 40.0f;
    float solve = active * active + 3.0f * active;                        /* z = C^-1 d */
    float violation = candidates * (active + active);                     /* is_active and indentation */
    float exchange = 2.0f * active * active + 8.0f * active;              /* let in or let out */
    float refactor = active * active * active / 6.0f + active * active;
    float stiffness = 1.5f * active * active + 12.0f * active;
    palp_cost_bound c = {.pivot_operations = solve + violation + exchange};
    c.operations[PALP_STEP_FIXED] = FRAMES_AND_POSE;
    c.operations[PALP_STEP_SEARCH] = candidates * (SPHERE + active) +
                                     candidates * ring * (SPHERE + (float)limits.max_new) +
                                     candidates * candidates * 3.0f + 8.0f * (most_in_block(blob) + DESCENT * ring);
    c.operations[PALP_STEP_ADMIT] = row_walk + (2.0f * candidates + 1.0f) * extraction;
    c.operations[PALP_STEP_SOLVE] = candidates * SPHERE + refactor + stiffness + c.pivot_operations;
    return c;
}

float palp_cost_full(const palp_cost_bound *bound, palp_contact_limits limits) {
    const float *o = bound->operations;
    float solve = o[PALP_STEP_SOLVE] + (float)(limits.max_pivots - 1u) * bound->pivot_operations;
    return o[PALP_STEP_FIXED] + o[PALP_STEP_SEARCH] + (float)limits.max_new * o[PALP_STEP_ADMIT] +
           (float)PALP_NEWTON_STEPS * solve;
}

float palp_cost_least(const palp_cost_bound *bound) {
    const float *o = bound->operations;
    return o[PALP_STEP_FIXED] + o[PALP_STEP_SEARCH] + (float)PALP_NEWTON_STEPS * o[PALP_STEP_SOLVE];
}
