/* SPDX-License-Identifier: MIT */
/*
 * A multizone model: elastic zones on the links of a mechanism, bonded at conforming seams (MZ
 * III-VI).
 *
 * Each zone's blob answers for its own RBVP, with its bone and seam nodes held. Seam displacements
 * are described by orthonormal modes q_k of each seam: polynomials of rising degree, completed by
 * nodal vectors, so that the first few are smooth and all of them are everything. The first ones
 * span the affine functions, so any rigid mismatch of two posed rest shapes lies in them, on every
 * level. In these modes, with M the modes of all seams of a zone,
 *
 *     stiffness   K = Q^T M Xi_SS Q   [M][M], symmetric (N/m; M makes tractions forces)
 *     response    H = Xi_FS Q         displacement of each free node
 *     reaction                        force on each fixed node
 *     weight                          force at the seams for unit acceleration
 *
 * all in 3x3 blocks, in the model's rest coordinates.
 */
#ifndef PALP_ZONE_ZONES_H
#define PALP_ZONE_ZONES_H

#include "core/blob/blob.h"

typedef struct {
    const float *stiffness, *response, *reaction, *weight; /* weight: NULL without gravity */
    uint32_t seams, seam[PALP_MAX_ZONE_SEAMS];             /* ascending */
    uint32_t first[PALP_MAX_ZONE_SEAMS];                   /* mode of the zone that is its first */
    uint32_t first_node; /* when the nodes of all zones are counted */
} palp_zone_part;

typedef struct {
    const palp_zones_meta *meta;
    const palp_zone_entry *zone;
    const palp_joint_entry *joint;
    const palp_seam_entry *seam;
    const uint32_t *seam_node[PALP_MAX_SEAMS]; /* [nodes][2] */
    const float *seam_mode[PALP_MAX_SEAMS];    /* [nodes][modes] */
    palp_zone_part part[PALP_MAX_ZONES];
    palp_blob blob[PALP_MAX_ZONES];
    uint32_t nodes; /* of all zones */
} palp_zones;

/* Whether the bytes look like a multizone model rather than a single body. */
bool palp_zones_are_here(const void *data, size_t bytes);

/*
 * Opens a multizone model in place (64-byte aligned), with all the checks of palp_blob_open.
 * Errors: those of palp_blob_open.
 */
palp_status palp_zones_open(palp_zones *zones, const void *data, size_t bytes);

/* The 3x3 block (i, j) of a zone's stiffness, row-major. */
static inline void palp_zone_stiffness(const palp_zone_part *part, uint32_t i, uint32_t j,
                                       float block[9]) {
    size_t low = i < j ? i : j, high = i < j ? j : i;
    const float *stored = part->stiffness + 9u * (high * (high + 1u) / 2u + low);
    for (uint32_t e = 0; e < 9; e++) block[e] = stored[i < j ? 3u * (e % 3u) + e / 3u : e];
}

/* Whether `zone` is the second of the seam's zones, whose rest shape is moved to meet the first. */
static inline bool palp_zone_is_second(const palp_zones *zones, uint32_t seam, uint32_t zone) {
    return zones->seam[seam].zone[1] == zone;
}

#endif
