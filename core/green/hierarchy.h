/* SPDX-License-Identifier: MIT */
/*
 * The constraint hierarchy (MR 6-8): basis functions [l,k] on every level
 * of the free domain and their compliances.
 *
 * P_l interpolates from K(l) to all nodes by the unlifted filter; a_[l,k] = sum_i P_ik a_i. A force
 * F on [l,k] acts on the nodes as f = R_l^T F, and the displacement that belongs to it is the mean
 * w = R_l u under the same weights, so that F.w = f.u and
 *
 *     G_[l,k][l',k'] = R_l G R_l'^T        (energetic; symmetric positive definite)
 *
 * for any two basis functions, of the same level or not (MR 68-69). Going down one level a force is
 * shared among [l+1,k] and the [l+1,m] of the children m of k, in parts that sum to one.
 */
#ifndef PALP_GREEN_HIERARCHY_H
#define PALP_GREEN_HIERARCHY_H

#include "core/green/columns.h"

typedef struct {
    uint32_t level, slot;
} palp_basis;

/* The share of a force on [l,slot] that [l+1,slot] takes. */
static inline float palp_own_share(const palp_blob *blob, uint32_t level, uint32_t slot) {
    return blob->level[level + 1u].area_m2[slot] / blob->level[level].area_m2[slot];
}

/* The share of a force on [l,slot] that [l+1,child] takes, child an odd slot of level l+1. 0 if
 * they are not related. */
float palp_child_share(const palp_blob *blob, uint32_t level, uint32_t slot, uint32_t child);

/*
 * The children of `slot` that are odd on `level`: their range in domain.child. Cost: the children
 * of the slot.
 */
typedef struct {
    uint32_t first, end;
} palp_child_range;
palp_child_range palp_children(const palp_domain *domain, uint32_t slot, uint32_t level);

/*
 * The row of R_l W^-1 for one basis function: what to multiply details with to get w. As
 * palp_wavelet_row, which it equals on the finest level; on coarser levels it meets about 4^(L-l)
 * times as many slots.
 */
bool palp_basis_row(const palp_blob *blob, palp_basis basis, palp_row_scratch *scratch,
                    palp_row *row, uint32_t capacity);

/* The row of R_l itself: weights of the nodes under the hat. On the finest level one entry. */
bool palp_basis_weights(const palp_blob *blob, palp_basis basis, palp_row_scratch *scratch,
                        palp_row *row, uint32_t capacity);

/* The 3x3 block R_l G R_l^T at (i, j) looked up in the table of `level`. */
static inline void palp_table_block(const palp_blob *blob, uint32_t level, uint32_t i, uint32_t j,
                                    float block[9]) {
    const float *table = blob->level[level].table;
    size_t low = i < j ? i : j, high = i < j ? j : i;
    const float *stored = table + 9u * (high * (high + 1u) / 2u + low);
    for (uint32_t r = 0; r < 3; r++) {
        for (uint32_t c = 0; c < 3; c++)
            block[3u * r + c] = stored[i < j ? 3u * c + r : 3u * r + c];
    }
}

#endif
