/* SPDX-License-Identifier: MIT */
/*
 * Opens a blob in place and hands out typed views into it: no copy, no parsing, no allocation.
 *
 * palp_blob_open() checks everything that later code relies on: layout, CRCs, counts, index ranges,
 * orders, finite values. After PALP_OK nothing that reads through the views can leave the blob,
 * whatever its bytes are. The blob must stay mapped and unchanged for as long as the views are
 * used.
 */
#ifndef PALP_BLOB_BLOB_H
#define PALP_BLOB_BLOB_H

#include "core/base/status.h"
#include "core/blob/format.h"
#include <stdbool.h>

/*
 * One wavelet domain D (MR 4.1): its nodes in coarse-to-fine order and the filters.
 * Slots of level l are [level_start[l], level_start[l+1]). The slots of level l >= 1 are odd: each
 * has two parents on coarser levels with prediction weights w_ma and update weights s_am; a parent
 * that is missing from the domain has weight 0 and stands as slot 0.
 */
typedef struct {
    uint32_t slots, levels;
    const uint32_t *node;         /* [slots] */
    const uint32_t *level_start;  /* [levels + 1] */
    const uint32_t *parent;       /* [slots][2] */
    const float *predict;         /* [slots][2] */
    const float *update;          /* [slots][2] */
    const uint32_t *child_offset; /* [slots + 1] */
    const uint32_t *child;        /* odd slots that update this one, ascending */
    const float *child_weight;    /* their update weights s_am */
    /* Butterfly: x_m is predicted by these instead of by its parents; NULL for linear wavelets. */
    const uint32_t *stencil_offset; /* [slots + 1] */
    const uint32_t *stencil;
    const float *stencil_weight;
} palp_domain;

/*
 * One block of wavelet-transformed GF columns (MR 28-30): rows of one domain, columns of another.
 * Each column is a run of groups of PALP_LANES 3x3 blocks; entry e of the block in lane k of group
 * g is at value[(entries g + e) * PALP_LANES + k]. The last group is padded with zero blocks on its
 * last row. Of a scalar problem (MR 1: any elliptic one) blocks are single entries, xx.
 */
typedef struct {
    uint32_t columns, rows, entries; /* entries of a block: 9, or 1 */
    const uint32_t *offset;          /* [columns + 1], in groups */
    const uint16_t *index;           /* [groups][PALP_LANES] */
    const float *value;              /* f32 storage, else NULL */
    const uint16_t *half;            /* f16 storage, else NULL */
    const float *scale;              /* [columns] */
} palp_columns;

/*
 * One level of the constraint hierarchy (MR 6-7): the hierarchical basis functions [l,k], k in
 * K(l), the first `nodes` slots of the free domain. Forces on [l,k] are spread over the nodes by
 * R_l^T, R_l = diag(1/a_[l,k]) P_l^T diag(a), and so sum to what was given.
 */
typedef struct {
    uint32_t nodes;
    const float *area_m2; /* [nodes] a_[l,k] = sum_i P_ik a_i */
    palp_columns
        columns; /* G R_l^T, transformed and thresholded; no columns above constraint_level */
    const float *table; /* lower triangle of R_l G R_l^T by rows, 3x3 blocks; NULL if not stored */
} palp_level;

/* The display surface (MR 9.2): vertex v at sum_k weight[k] x[node[k]] plus height[v] along the
 * normal there. NULL pointers when the blob has none. */
typedef struct {
    uint32_t vertices, triangles;
    const uint32_t *offset, *node; /* [vertices + 1], [] */
    const float *weight, *height_m;
    const uint32_t *triangle; /* [triangles][3] */
    const uint32_t *near,
        *list; /* [nodes + 1], [vertices]: the vertices that lie nearest each node */
} palp_detail;

/*
 * What contact needs of the surface: which triangle lies across each edge, and the regular part
 * H = G - B of the compliance (MATH: B is the half-space's) by its largest eigenpairs,
 *
 *     H_kl = sum_a value[a] U_ka U_la^T,   U_ka = vector[k][.][a] / PALP_MODE_UNIT
 *
 * A shorter prefix of the modes is a coarser H.
 */
typedef struct {
    uint32_t modes;           /* 0: none stored, the other pointers are NULL */
    const uint32_t *across;   /* [triangles][3] across the edge that faces each corner */
    const uint32_t *triangle; /* [nodes] one of the triangles of each node */
    const float *value;       /* [modes] m/N */
    const int16_t *vector;    /* [nodes][3][modes] */
    /* [PALP_LEVEL_ERRORS][2] of the force on each level of contact against the finest, mean and
     * worst of the presses that bake made; NULL: not measured */
    const float *level_error;
} palp_regular;

/* The modes of the split form (green/split.h): those of contact, or of a zone its own, since contact
 * has the whole model's. */
typedef struct {
    uint32_t count;
    const float *value;    /* [count] m/N */
    const int16_t *vector; /* [nodes][3][count] */
} palp_split_modes;

typedef struct {
    const palp_meta *meta;
    const float *rest_m;         /* [nodes][3] */
    const float *normal;         /* [nodes][3] */
    const float *area_m2;        /* [nodes] */
    const uint32_t *triangle;    /* [triangles][3] */
    const uint32_t *slot;        /* [nodes] */
    const uint32_t *ring_offset; /* [nodes + 1] */
    const uint32_t *ring;
    const uint32_t *cell_offset;
    const uint32_t *cell_node;
    palp_domain domain[PALP_DOMAINS];
    palp_columns columns[PALP_DOMAINS][PALP_DOMAINS]; /* [row domain][column domain] */
    palp_level level[PALP_MAX_LEVELS]; /* constraint hierarchy, 0..constraint_level */
    palp_detail detail;
    palp_regular regular;
    palp_split_modes split; /* of blobs with PALP_META_SPLIT */
    size_t bytes;
} palp_blob;

/*
 * Opens the blob of `bytes` bytes at `data` (64-byte aligned). On error `blob` is untouched.
 * Errors: ALIGNMENT, TRUNCATED, MAGIC, VERSION, CRC, TABLE, RANGE, NOT_FINITE.
 * Cost: one pass over the bytes for the CRC and one over every section.
 */
palp_status palp_blob_open(palp_blob *blob, const void *data, size_t bytes);

static inline bool palp_blob_has(const palp_blob *blob, uint32_t flag) {
    return (blob->meta->flags & flag) != 0u;
}
static inline bool palp_node_is_fixed(const palp_blob *blob, uint32_t node) {
    return (blob->slot[node] & PALP_FIXED_FLAG) != 0u;
}
static inline uint32_t palp_node_slot(const palp_blob *blob, uint32_t node) {
    return blob->slot[node] & ~PALP_FIXED_FLAG;
}

#endif
