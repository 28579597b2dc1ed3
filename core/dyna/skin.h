/* SPDX-License-Identifier: MIT */
/*
 * The surface that is seen (AD 4.1): the boundary of the finest mesh, each vertex embedded in a
 * tetrahedron of the level that is active around it. When families split or merge each vertex goes
 * on from where it is; the difference to where it should be fades exponentially, to 37 % in
 * PALP_SKIN_FADE_S, so nothing pops.
 */
#ifndef PALP_DYNA_SKIN_H
#define PALP_DYNA_SKIN_H

#include "core/dyna/dyna.h"

#define PALP_SKIN_FADE_S 0.1f

/* Where skin vertex i is on the level that is active there, without any fading; and its normal,
 * which goes with the gradient D of its tetrahedron as det D D^-T n. */
palp_vec3 palp_skin_position(const palp_dyna *dyna, uint32_t i);
palp_vec3 palp_skin_velocity(const palp_dyna *dyna, uint32_t i);
palp_vec3 palp_skin_normal(const palp_dyna *dyna, uint32_t i);

typedef struct {
    const palp_dyna *dyna;
    float *position_m; /* [skin][3] shown */
    float *off_m;      /* [skin][3] still to fade */
    uint64_t lists;    /* of the body, at the last update */
    float
        jump_m; /* largest difference that a change of resolution left to fade in the last update */
} palp_skin;

size_t palp_skin_memsize(const palp_tets *tets);

/* Errors: ALIGNMENT, MEMORY. */
palp_status palp_skin_init(palp_skin *skin, const palp_dyna *dyna, void *memory, size_t bytes);

/* The surface dt_s after the last update. Cost: 40 per vertex. */
void palp_skin_update(palp_skin *skin, float dt_s);

#endif
