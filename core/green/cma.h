/* SPDX-License-Identifier: MIT */
/*
 * The general capacitance matrix algorithm (MR 3.2, 5.4) in force form.
 *
 * The blob answers one reference boundary value problem (RBVP): nodes of the free domain F carry a
 * given nodal force, nodes of the fixed domain U a given displacement, and
 *
 *     | u_F |   | G_FF  G_FU | | f_F |
 *     | f_U | = | G_UF  K_UU | | u_U | + B g
 *
 * Any other problem switches some scalar unknowns: for each switched pair (node, direction e) the
 * quantity that the RBVP gives becomes unknown (g_k) and the one that it yields is prescribed
 * (t_k):
 *
 *     C g = t - E^T v0,     C_kl = e_k^T Xi_kl e_l                    (MR 18-20, 39, 43-44)
 *     v   = v0 + Xi E g,    values at switched nodes set exactly      (MR 45-47)
 *
 * Displacements of free nodes may be imposed on a coarser constraint level l (MR 6-8): the unknowns
 * are then forces on the basis functions [l,k] of the listed nodes k in K(l). Listed nodes that lie
 * under those hats are represented by them; others keep a constraint of their own on the finest
 * stored level, so the set is a mixed one (MR 68). The mean displacement under the hat takes the
 * node's value (energetic), or the node itself does (collocated, as in the paper: unsymmetric).
 *
 * With only free nodes switched and reciprocity enforced C is symmetric positive definite and is
 * factored by Cholesky; otherwise by LU with partial pivoting after scaling by powers of two, since
 * compliances and stiffnesses meet in it. Both are followed by two steps of refinement with
 * residuals in twice the working precision.
 */
#ifndef PALP_GREEN_CMA_H
#define PALP_GREEN_CMA_H

#include "core/base/arena.h"
#include "core/base/real.h"
#include "core/green/hierarchy.h"
#include "core/green/split.h"

typedef enum {
    PALP_PRESCRIBE_DISPLACEMENT, /* u = value (m) */
    PALP_PRESCRIBE_NORMAL,       /* n.u = value.x (m), no tangential force */
    PALP_PRESCRIBE_FORCE,        /* nodal force f = value (N) */
    PALP_PRESCRIBE_TRACTION,     /* traction p = value (Pa), f = a_j p */
    PALP_RELEASE                 /* a fixed node set free */
} palp_condition;

typedef enum { PALP_ENERGETIC, PALP_COLLOCATED } palp_pairing;

/* One scalar unknown: the column value at `node` along `direction`. */
typedef struct {
    uint32_t node;
    uint32_t level; /* of the basis function, for a free node; chosen by palp_cma_solve */
    palp_vec3 direction;
    float target; /* what the RBVP's result must be along `direction`: m on F, N on U */
    float value;  /* solved: N on F, m on U */
} palp_switched_unknown;

typedef struct {
    const palp_blob *blob;
    uint32_t capacity, count;
    palp_switched_unknown *switches;          /* [capacity], `count` of them as given */
    uint32_t solved, *chosen;                 /* [capacity] those that are unknowns on the level */
    float *capacitance;                       /* [capacity][capacity] */
    float *factor;                            /* [capacity][capacity] */
    float *scale, *rhs, *solution, *residual; /* [capacity] */
    uint32_t *perm;                           /* [capacity] */
    float *detail[PALP_DOMAINS];              /* [slots][4] */
    float *given;     /* [nodes][3] what the column of each node is multiplied with */
    float *carried;   /* [free slots][3] forces on the basis functions of the constraint level */
    uint8_t *covered; /* [free slots] under a chosen basis function */
    uint8_t *state;   /* [nodes] 1 + condition given, 0 for none */
    palp_vec3 gravity_m_s2;
    uint32_t level; /* on which displacements are imposed */
    palp_pairing pairing;
    palp_row row; /* of W^-1, or of R_l W^-1 */
    palp_row_scratch scratch[PALP_DOMAINS];
    /* Of a split blob (green/split.h), whose sums are nodal values: */
    float load[PALP_MAX_MODES]; /* what the forces give its modes */
    float *turned;              /* [free slots][4] W^-T of the forces */
    palp_row weights, others;   /* of R_l, of the row's and of the column's unknown */
} palp_cma;

/* Bytes that palp_cma_init needs for `max_unknowns` switched scalars; SIZE_MAX when that is more
 * than the address space. */
size_t palp_cma_memsize(const palp_blob *blob, uint32_t max_unknowns);

/*
 * Lays the solver out in `memory` (64-byte aligned, owned by the caller, as long as `cma` is used).
 * Errors: MEMORY, ALIGNMENT, LIMITS. Clears all conditions.
 */
palp_status palp_cma_init(palp_cma *cma, const palp_blob *blob, uint32_t max_unknowns, void *memory,
                          size_t bytes);

/* Back to the RBVP without loads. O(nodes). */
void palp_cma_clear(palp_cma *cma);

/*
 * Gives `node` a condition. Costs 3, 2, 1 or 0 unknowns. Errors: ARGUMENT (node out of range, given
 * twice, RELEASE of a free node, or in a scalar blob anything but x), NOT_FINITE, CAPACITY, ABSENT
 * (a fixed node in a blob without its column). On error nothing changes.
 */
palp_status palp_cma_prescribe(palp_cma *cma, uint32_t node, palp_condition condition,
                               palp_vec3 value);

/* Imposes displacements of free nodes on `level`. Error: ARGUMENT (above the blob's constraint
 * level).
 */
palp_status palp_cma_level(palp_cma *cma, uint32_t level, palp_pairing pairing);

/* Body force: acceleration in m/s^2 times the baked density. Error: ABSENT, NOT_FINITE. */
palp_status palp_cma_gravity(palp_cma *cma, palp_vec3 acceleration_m_s2);

/*
 * Solves; u_m and f_N are float[nodes][3]: displacement, and the force that the surroundings apply.
 * Without reactions in the blob f_N is 0 at fixed nodes. Errors: NOT_SPD, SINGULAR (also when
 * what is displaced, fixed or held along its normal leaves the body a rigid motion), ABSENT (a
 * displaced node that no stored column can hold, or released fixed nodes with collocated
 * constraints on a coarse level); then the conditions are as before. Afterwards cma->solved is the
 * number of unknowns that there were, and the forces found count as given: palp_cma_clear comes
 * before the next problem. Cost, s unknowns: s^2 extractions (of a split blob palp_split_between),
 * s^3/6 (Cholesky) or s^3/3 (LU), s columns, one transform.
 */
palp_status palp_cma_solve(palp_cma *cma, float *u_m, float *f_N);

#endif
