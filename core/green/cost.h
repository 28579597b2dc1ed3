/* SPDX-License-Identifier: MIT */
/*
 * What the operations of this folder cost at most, in the unit of the prices given
 * (budget/price.h); names of prices in capitals.
 */
#ifndef PALP_GREEN_COST_H
#define PALP_GREEN_COST_H

#include "core/budget/price.h"
#include "core/blob/blob.h"

/* palp_wavelet_row, palp_basis_row with up to `entries` marks: ROW + 3 levels (words ROW_WORD +
 * entries ROW_MARK) + (levels times the children of as many slots, no more than all, and of
 * butterfly wavelets their stencils) ROW_CHILD. */
float palp_cost_row(const palp_prices *price, const palp_blob *blob, uint32_t entries);

/* palp_columns_extract, a row of `entries` with a column of `groups`: EXTRACT + entries
 * EXTRACT_ENTRY + 8 groups EXTRACT_SKIP + the fewer of both EXTRACT_MATCH (from halves +
 * EXTRACT_HALF). */
float palp_cost_extract(const palp_prices *price, const palp_blob *blob, uint32_t entries,
                        uint32_t groups);

/* palp_columns_add: ADD + groups (ADD_GROUP, from halves + ADD_HALF). */
float palp_cost_add(const palp_prices *price, const palp_blob *blob, uint32_t groups);

/* palp_wavelet_inverse up to `level`: TRANSFORM, and of each level TRANSFORM + the slots up to it
 * TRANSFORM_SLOT + (parents or stencils of the odd ones + the children of all below)
 * TRANSFORM_TERM. */
float palp_cost_inverse(const palp_prices *price, const palp_blob *blob, uint32_t level);

/* palp_split_add with a column of `groups` corrections: SPREAD + the free nodes SPREAD_NODE + the modes
 * SPREAD_MODE + palp_cost_add. */
float palp_cost_split_add(const palp_prices *price, const palp_blob *blob, uint32_t groups);

/* palp_split_add_modes on the first `slots` slots: SPREAD + the modes SPREAD_MODE + slots (FIELD_NODE +
 * the modes FIELD_MODE). */
float palp_cost_split_modes(const palp_prices *price, const palp_blob *blob, uint32_t slots);

#endif
