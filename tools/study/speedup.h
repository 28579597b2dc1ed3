/* SPDX-License-Identifier: MIT */
/* A dynamic body poked twice, adaptive and uniformly fine: what is saved, and what it costs. */
#ifndef PALP_TOOLS_SPEEDUP_H
#define PALP_TOOLS_SPEEDUP_H

#include "core/dyna/adapt.h"

typedef struct {
    float radius_m;       /* of the ball */
    palp_vec3 position_m; /* on the surface, where it presses */
    palp_vec3 normal;     /* outward there */
    float depth_m;        /* how far it goes in within 0.15 s; held 0.05 s, and away */
    uint32_t ticks;       /* of 1 ms */
} poke;

/* A ball of a twentieth of the diagonal against the vertex of the skin furthest from what is held,
 * as deep, 1.5 s. */
poke poke_for(const palp_tets *tets);

typedef struct {
    double fine, adaptive;          /* element evaluations */
    double worst_m, mean_m;         /* distance of the surfaces */
    double moved_m;                 /* largest motion of the fine one */
    double force_worst, force_mean; /* difference of the forces, of the largest */
    uint32_t most_nodes;            /* active at a time, of all levels */
} speedup;

/* gamma_max as a share of the diagonal; gamma_min is a tenth of it. */
speedup speedup_measure(const palp_tets *tets, palp_material material, const poke *p,
                        double refine_share);

#endif
