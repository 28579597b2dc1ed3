/* SPDX-License-Identifier: MIT */
#include "cost.h"
#include <stddef.h>

#define PRICE(kind) (price->of[PALP_WORK_##kind])

/* Largest difference of neighbouring offsets. */
static float longest(const uint32_t *offset, uint32_t count) {
    uint32_t most = 0;
    for (uint32_t i = 0; offset != NULL && i < count; i++) {
        uint32_t n = offset[i + 1u] - offset[i];
        most = n > most ? n : most;
    }
    return (float)most;
}

float palp_cost_row(const palp_prices *price, const palp_blob *blob, uint32_t entries) {
    const palp_domain *d = &blob->domain[PALP_FREE];
    float levels = (float)blob->meta->levels, marked = (float)entries;
    float all = (float)d->child_offset[d->slots];
    float children = marked * longest(d->child_offset, d->slots);
    float stencils = marked * longest(d->stencil_offset, d->slots);
    return PRICE(ROW) +
           3.0f * levels * ((float)d->slots / 32.0f * PRICE(ROW_WORD) + marked * PRICE(ROW_MARK)) +
           (levels * (children < all ? children : all) + stencils) * PRICE(ROW_CHILD);
}

float palp_cost_extract(const palp_prices *price, const palp_blob *blob, uint32_t entries,
                        uint32_t groups) {
    bool half = blob->level[blob->meta->constraint_level].columns.half != NULL;
    float match = PRICE(EXTRACT_MATCH) + (half ? PRICE(EXTRACT_HALF) : 0.0f);
    uint32_t blocks = groups * PALP_LANES, matches = entries < blocks ? entries : blocks;
    return PRICE(EXTRACT) + (float)entries * PRICE(EXTRACT_ENTRY) + (float)matches * match +
           (float)blocks * PRICE(EXTRACT_SKIP);
}

float palp_cost_add(const palp_prices *price, const palp_blob *blob, uint32_t groups) {
    bool half = blob->level[blob->meta->constraint_level].columns.half != NULL;
    float group = PRICE(ADD_GROUP) + (half ? PRICE(ADD_HALF) : 0.0f);
    return PRICE(ADD) + (float)groups * group;
}

float palp_cost_inverse(const palp_prices *price, const palp_blob *blob, uint32_t level) {
    const palp_domain *d = &blob->domain[PALP_FREE];
    float slots = 0.0f, terms = 0.0f;
    for (uint32_t l = 1; l <= level && l < d->levels; l++) {
        slots += (float)d->level_start[l + 1u];
        uint32_t first = d->level_start[l], end = d->level_start[l + 1u];
        uint32_t predicted = d->stencil_offset != NULL
                                 ? d->stencil_offset[end] - d->stencil_offset[first]
                                 : 2u * (end - first);
        terms += (float)(predicted + d->child_offset[first]);
    }
    return (float)(level + 1u) * PRICE(TRANSFORM) + slots * PRICE(TRANSFORM_SLOT) +
           terms * PRICE(TRANSFORM_TERM);
}

float palp_cost_split_add(const palp_prices *price, const palp_blob *blob, uint32_t groups) {
    return PRICE(SPREAD) + (float)blob->domain[PALP_FREE].slots * PRICE(SPREAD_NODE) +
           (float)blob->split.count * PRICE(SPREAD_MODE) + palp_cost_add(price, blob, groups);
}

float palp_cost_split_modes(const palp_prices *price, const palp_blob *blob, uint32_t slots) {
    const float modes = (float)blob->split.count;
    return PRICE(SPREAD) + modes * PRICE(SPREAD_MODE) +
           (float)slots * (PRICE(FIELD_NODE) + modes * PRICE(FIELD_MODE));
}
