/* SPDX-License-Identifier: MIT */
/*
 * The deformed surface under nodal forces on the free domain: fast summation with temporal
 * coherence (MR 11-12, 36, 45-47), at any level of detail. Runs on the display path, never before
 * the force.
 */
#ifndef PALP_GREEN_FIELD_H
#define PALP_GREEN_FIELD_H

#include "core/base/arena.h"
#include "core/base/real.h"
#include "core/green/hierarchy.h"
#include "core/green/split.h"

/* A force on a basis function of the constraint hierarchy; on the constraint level itself, when
 * that is the finest, a nodal force. */
typedef struct {
    palp_basis at;
    palp_vec3 force_N;
} palp_load;

typedef struct {
    const palp_blob *blob;
    float *detail; /* [slots][4] sum of columns so far; of a split blob of its nodal values */
    float load[PALP_MAX_MODES];           /* of a split blob: what the loads give its modes */
    float *field;                         /* [slots][4] */
    uint32_t first[PALP_MAX_LEVELS + 1u]; /* number of [l,0] among all basis functions */
    float *applied_N;                     /* [all][3] forces that `detail` holds */
    uint8_t *wanted;                      /* [all] marks of the current update */
    uint32_t *loaded;                     /* [all] basis functions with a force applied */
    uint32_t loaded_count;
    uint32_t updates; /* since the last sum from scratch */
    palp_vec3 gravity_m_s2;
} palp_field;

/* Bytes for a field: by the free nodes and by all basis functions, those of the constraint levels
 * added up (palp info prints them), as a constant for static memory; and of this blob. */
#define PALP_FIELD_BYTES(free_nodes, basis_functions)                                              \
    (32u * (size_t)(free_nodes) + 17u * (size_t)(basis_functions) + 320u)
size_t palp_field_memsize(const palp_blob *blob);

/* Lays out in `memory` (64-byte aligned, owned by the caller). Errors: MEMORY, ALIGNMENT. */
palp_status palp_field_init(palp_field *field, const palp_blob *blob, void *memory, size_t bytes);

/* Constant acceleration; takes effect at once. Errors: ABSENT, NOT_FINITE. */
palp_status palp_field_gravity(palp_field *field, palp_vec3 acceleration_m_s2);

/*
 * Replaces the forces by `loads` (each basis function at most once; those that the blob does not
 * hold are ignored: a split blob has none but the nodes).
 * Only columns whose force changed are summed; every PALP_FIELD_REFRESH updates all are, so that
 * rounding does not build up. Cost: 9 multiply-adds per stored block of each changed column, of a
 * split blob palp_split_add for each.
 */
#define PALP_FIELD_REFRESH 1000u
void palp_field_update(palp_field *field, const palp_load *loads, uint32_t count);

/*
 * Displacements of the nodes up to `level`, float[level_start[level + 1]][4] in slot order (m);
 * valid until the next call. Cost: one inverse transform; of a split blob palp_split_add_modes.
 */
const float *palp_field_reconstruct(palp_field *field, uint32_t level);

/* Sets the component along `direction` (unit) of the node's displacement exactly (MR 47). */
void palp_field_pin(palp_field *field, uint32_t node, palp_vec3 direction, float displacement_m);

#endif
