/* SPDX-License-Identifier: MIT */
/*
 * Green's functions of the free domain with their singularity taken out, the form of blobs with
 * PALP_META_SPLIT. Between the free nodes of slots i and j
 *
 *     G_ij = B(x_i - x_j) + sum_a value[a] U_ia U_ja^T + D_ij
 *
 * B is the half-space's point kernel (half_space.h; 0 for i = j), U the modes that contact works
 * with, of a zone its own (blob.h), and D, stored for few pairs, what both miss: every node's own block, and pairs
 * for which the miss exceeds epsilon (or a half, a quarter .. of it, so that the RMS error is at most
 * 0.4 epsilon) times the geometric mean of both own blocks. D stands in
 * columns[PALP_FREE][PALP_FREE], by nodes, not transformed; its last column is the response to
 * gravity, whole.
 *
 * Fields are float[slots][4] of nodal values: nothing here is wavelet-transformed.
 */
#ifndef PALP_GREEN_SPLIT_H
#define PALP_GREEN_SPLIT_H

#include "core/green/columns.h"

/*
 * field += (B + D) column of `slot` times the force, load[modes] += the force's share of each mode.
 * Cost: about 35 operations per free node, 9 multiply-adds per stored block of D, 3 per mode.
 */
void palp_split_add(const palp_blob *blob, uint32_t slot, const float force_N[3], float *load,
                    float *field);

/* field += what the loaded modes displace the first `slots` slots by. Cost: 3 multiply-adds per
 * mode and slot. */
void palp_split_add_modes(const palp_blob *blob, const float *load, uint32_t slots, float *field);

/*
 * field[slots][4] := what all free nodes are displaced by when `force_N` acts on basis function `slot` of
 * the constraint level (of a split blob on the node), of a blob in either form. Cost: one column, one
 * transform or palp_split_add_modes.
 */
void palp_nodal_response(const palp_blob *blob, uint32_t slot, const float force_N[3],
                         float *field);

/*
 * sum_ij a_i b_j G_ij, row-major: the mean displacement under weights a by a force spread with
 * weights b. Cost: 30 operations per pair of entries, 3 multiply-adds per mode and entry, one
 * extraction per entry of b.
 */
void palp_split_between(const palp_blob *blob, const palp_row *a, const palp_row *b,
                        float block[9]);

#endif
