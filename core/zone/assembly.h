/* SPDX-License-Identifier: MIT */
/*
 * A posed multizone model as contact sees it: where its surface is without contact, and how it
 * gives where it is pushed.
 *
 * The compliance between a push along d at one place and another elsewhere is (MZ VII, in force
 * form)
 *
 *     d^T G d'  (within a zone)  +  h^T A^-1 h',   h = T H^T d
 *
 * the zone's own Green's functions and the response of all seams. The first is singular at the
 * load, and near a seam, which it holds, so is the second, and only their sum is smooth. So bake
 * takes the model at rest as one body (the regular part that its zones' blobs have is common to all
 * of them), and what is left for a tick is how the response of the seams differs from that of the
 * rest configuration,
 *
 *     h^T A^-1 h' - h_0^T A_0^-1 h_0'
 *
 * on the level of the factor in use, as dot products of rows y = R^-T h.
 */
#ifndef PALP_ZONE_ASSEMBLY_H
#define PALP_ZONE_ASSEMBLY_H

#include "core/zone/seams.h"

/* What is kept of a node: how far all that is there without contact moves it (its zone's frame), as
 * of a settling; and which node of which of the zone's seams it is. */
typedef struct {
    palp_vec3 u_m;
    uint32_t when;
    uint32_t on_seam; /* seam << 24 | node; PALP_NONE */
} palp_zone_node;

typedef struct {
    const palp_zones *zones;
    palp_seams seams;
    palp_configuration *configuration;
    float length_m;                   /* of the largest seam */
    palp_frame world[PALP_MAX_ZONES]; /* zone -> world */
    palp_vec3 gravity_m_s2;           /* world; set by palp_assembly_gravity */
    float
        *gravity_response[PALP_MAX_ZONES]; /* [free slots][9] by unit acceleration; NULL: unknown */
    float *field;                          /* [most free slots][4], for opening */
    float *w;                              /* seams without contact */
    float *carried;                       /* what a change of level is still held back by, like w */
    float *load, *total, *kept;           /* vectors over the seams */
    float *pushed[PALP_MAX_ZONES];        /* [M][3] H^T f of the load on each zone */
    float *bent[PALP_MAX_ZONES];          /* [M][3] of each zone without contact, its frame */
    palp_zone_node *node[PALP_MAX_ZONES]; /* [nodes] */
    uint32_t settled;                     /* settlings so far */
    uint32_t level;  /* of the factor in use; PALP_DIAGONAL: the approximation */
    uint32_t extent; /* level beyond which w, and what is carried, is zero */
} palp_assembly;

#define PALP_ASSEMBLY_ITERATIONS                                                                   \
    4u /* of conjugate gradients with a factor of another configuration */

size_t palp_assembly_memsize(const palp_zones *zones, uint32_t finest);

/* In the rest configuration, on the finest level. Errors: those of palp_seams_init. */
palp_status palp_assembly_init(palp_assembly *assembly, const palp_zones *zones, uint32_t finest,
                               void *memory, size_t bytes);

/* Takes joint values and the place of zone 0. The seams follow by palp_assembly_settle. */
void palp_assembly_pose(palp_assembly *assembly, const float *value, const palp_frame *root);

/* Constant acceleration (world), from the next settling on. Error: ABSENT when a zone has no
 * gravity response, NOT_FINITE. */
palp_status palp_assembly_gravity(palp_assembly *assembly, palp_vec3 acceleration_m_s2);

/* Forgets forces and what a change of level held back. */
void palp_assembly_forget_forces(palp_assembly *assembly);

/* How far the configuration has moved off that of the factor in use: largest change of a rotation's
 * entry or of a place over the seam's size. */
float palp_assembly_drift(const palp_assembly *assembly);

/*
 * The seams without contact, by the factor in use: one solve, or where the configuration is another
 * than the factor's, PALP_ASSEMBLY_ITERATIONS of conjugate gradients. Then each zone's share of
 * them.
 */
void palp_assembly_settle(palp_assembly *assembly);
float palp_assembly_cost_settle(const palp_assembly *assembly, const palp_prices *price,
                                uint32_t level);

/* Lets what a change of level held back fade; share 0..1. */
void palp_assembly_relax(palp_assembly *assembly, float share);

/* Modes of a zone's seams on the finest level. */
float palp_assembly_modes(const palp_assembly *assembly, uint32_t zone);

/* How far a node is moved without contact (zone's frame, m): by the seams and by gravity. Kept
 * until the next settling; before that 9 a mode of the finest level, and 9. */
palp_vec3 palp_assembly_bent(palp_assembly *assembly, uint32_t zone, uint32_t node);

/* palp_zone_modal_load and palp_zone_modal_displacement; where a node is on a seam is known here.
 */
void palp_assembly_modal_load(const palp_assembly *assembly, uint32_t level, uint32_t zone,
                              uint32_t node, palp_vec3 f, float *felt);
palp_vec3 palp_assembly_modal_displacement(const palp_assembly *assembly, uint32_t level,
                                           uint32_t zone, uint32_t node, const float *u);

/* Where a node is without contact, and its rest normal, turned (world, m). */
palp_vec3 palp_assembly_position(palp_assembly *assembly, uint32_t zone, uint32_t node);
palp_vec3 palp_assembly_normal(const palp_assembly *assembly, uint32_t zone, uint32_t node);

/*
 * How the seams answer forces, that of the rest configuration taken away: what a zone's seams feel
 * of its forces (palp_zone_modal_load) is added to `sum`, [2][3 modes], zone by zone; then `sum` is
 * solved for once; then u[M][3] of each zone's seams, in its frame.
 */
void palp_assembly_add_modal_load(palp_assembly *assembly, uint32_t zone, const float *felt,
                                  float *sum);
void palp_assembly_answer(palp_assembly *assembly, float *sum);
void palp_assembly_answer_of(palp_assembly *assembly, uint32_t zone, const float *sum, float *u);

/* Seams under forces: load is cleared, what each zone's seams feel of its forces added, then
 * total = w + A^-1 load, valid until the next settling. */
void palp_assembly_unload(palp_assembly *assembly);
void palp_assembly_load(palp_assembly *assembly, uint32_t zone, const float *felt);
const float *palp_assembly_total(palp_assembly *assembly);

/*
 * Puts a factor that has been made aside (palp_seams_step) to use without a jump: `carried` takes
 * up the difference that it makes under the present loads, unless not `smooth`: after a leap there
 * is nothing to go on from. False if it is not sound.
 */
bool palp_assembly_take(palp_assembly *assembly, bool smooth);

/*
 * What the elastic model does to the link of `zone` through its seams: force (N) and moment (Nm)
 * about the world's origin, world frame, under the total displacements. Minus the work that links
 * do on it. Forces of tools on the zone's surface come on top. Comes
 * behind palp_assembly_total, whose result it reads.
 */
void palp_assembly_wrench(palp_assembly *assembly, uint32_t zone, palp_vec3 *force_N,
                          palp_vec3 *moment_Nm);

#endif
