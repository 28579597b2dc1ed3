/* SPDX-License-Identifier: MIT */
/*
 * Unilateral frictionless contact between the tool and the surface, in bounded work.
 *
 * Candidates are nodes near the tool, kept from tick to tick with their mutual normal compliances
 *
 *     g_ij = n_i^T (G_ij + G_ji^T) n_j / 2                        (selective reconstruction, MR 39)
 *
 * plus the blob's softening on the diagonal, which keeps them positive definite after thresholding,
 * cached, so that the symmetric positive definite capacitance matrix costs nothing while the tool
 * stays in place. Contact forces lambda >= 0 solve the complementarity problem
 *
 *     w = g lambda - d >= 0,   lambda >= 0,   w lambda = 0        (MATH.md 6)
 *
 * by a primal active set on the Cholesky factor: each step either finishes, lets one node in or
 * lets one out, and never leaves lambda >= 0 or raises the energy. It starts from the last tick's
 * set and stops after `max_pivots` steps with the best forces so far, flagged.
 *
 * A node that is found already under the tool (it came late, belongs to the far side of a thin
 * part, or found no room) is relieved of that depth: it feels only what the tool adds, and the
 * relief shrinks as the tool backs out. So nothing that the search or a capacity does can push the
 * tool, and a closed path never gains energy.
 */
#ifndef PALP_TOUCH_CONTACT_H
#define PALP_TOUCH_CONTACT_H

#include "core/base/arena.h"
#include "core/green/columns.h"
#include "core/touch/sphere.h"

typedef struct {
    uint32_t max_candidates; /* nodes near the tool, at most PALP_MAX_CANDIDATES */
    uint32_t max_active;     /* nodes in contact */
    uint32_t max_new;        /* candidates taken in per tick */
    uint32_t max_pivots;     /* active set steps per solve */
} palp_contact_limits;

#define PALP_MAX_CANDIDATES 256u
#define PALP_CONTACT_DEFAULTS ((palp_contact_limits){96u, 48u, 4u, 12u})

#define PALP_CONTACT_PIVOTS_SPENT 1u /* stopped before the complementarity conditions held */
#define PALP_CONTACT_ACTIVE_FULL 2u  /* more nodes wanted in than max_active */
#define PALP_CONTACT_CANDIDATES_FULL 4u
#define PALP_CONTACT_DEFERRED 8u   /* candidates left for the next tick */
#define PALP_CONTACT_REDUNDANT 16u /* a node was left out because its pivot vanished */

typedef struct {
    uint32_t node;
    palp_vec3 x, n;         /* where it is without contact, and its normal */
    palp_sphere_contact at; /* the tool as it sees it now */
    float relief_m;         /* depth that it does not feel */
    float target_m;         /* indentation that it asks for with no force on the tool */
    float force_N;          /* lambda, along -n on the body */
    uint32_t blocked;       /* solve in which its pivot vanished */
} palp_candidate;

typedef struct {
    const palp_blob *blob;
    const float *position_m; /* [nodes][3] surface without contact */
    palp_contact_limits limits;
    float radius_m, margin_m;
    palp_candidate *candidate; /* [max_candidates], the first `count` in use */
    palp_row *row;             /* [max_candidates] */
    float *compliance;         /* [max_candidates][max_candidates] g */
    float *factor;             /* [max_active][max_active] R, C = R^T R */
    uint32_t *active;          /* [max_active] candidate of each row of R */
    float *target, *work;      /* [max_active + 1] */
    float *jacobian[3];        /* [max_active] R^-T J, one column each */
    uint16_t *place;           /* [nodes] candidate number + 1, 0 if none */
    palp_row_scratch scratch;
    uint32_t count, active_count, nearest, solves, changes;
    uint32_t flags;          /* of the last tick */
    uint32_t pivots;         /* of the last tick */
    palp_vec3 axis;          /* outward direction of the contact */
    palp_vec3 center;        /* of the last search */
    float stiffness_N_per_m; /* of the last grip */
} palp_contact;

/* Each limit at least 1, max_candidates at most PALP_MAX_CANDIDATES, the others at most
 * max_candidates. */
bool palp_contact_limits_sound(palp_contact_limits limits);

size_t palp_contact_memsize(const palp_blob *blob, palp_contact_limits limits);

/*
 * `position_m` (float[nodes][3], kept by reference): the surface without contact, normally
 * blob->rest_m. Errors: LIMITS, ARGUMENT (radius not positive), MEMORY, ALIGNMENT.
 */
palp_status palp_contact_init(palp_contact *contact, const palp_blob *blob, const float *position_m,
                              float radius_m, palp_contact_limits limits, void *memory,
                              size_t bytes);

/* Forgets all contacts. */
void palp_contact_clear(palp_contact *contact);

/*
 * Updates the candidates for a tool at `center`: drops idle ones out of reach, walks the surface
 * from the others (from the grid when nothing touches), and lists up to max_new nodes to take in,
 * nearest first. Returns how many are listed in `fresh`. Cost: max_candidates * max_ring sphere
 * evaluations plus one look at 27 grid cells.
 */
uint32_t palp_contact_search(palp_contact *contact, palp_vec3 center, uint32_t *fresh);

/*
 * Takes `node` in: one row of W^-1 and 2 count + 1 extractions. Call it for the nodes listed by
 * search, as far as time allows; the rest is found again on the next tick.
 */
void palp_contact_admit(palp_contact *contact, uint32_t node);

/*
 * A tool that hangs on a spring: it sits at c = held_m + F / stiffness with F the force on it.
 * Stiffness 0 stands for a rigid grip, c = held_m.
 */
typedef struct {
    palp_vec3 held_m;
    float stiffness_N_per_m;
} palp_grip;

/*
 * Solves with the depths linearised about a tool at `about`:
 *
 *     d(c) = d(about) - J (c - about),   J = rows `push`,   F = J^T lambda
 *     (g + J J^T / k) lambda - (d(about) - J (held - about)) >= 0,  complementary to lambda >= 0
 *
 * The factor is that of g alone, whatever the pose; the spring enters by Woodbury's identity with a
 * 3 x 3 system. Returns F (N). Cost per pivot: 3 active^2 for the solve, active^2 for the exchange,
 * count * active for the violations; at most max_pivots of them.
 */
palp_vec3 palp_contact_solve(palp_contact *contact, palp_vec3 about, palp_grip grip);

/* Elastic energy of the contact, lambda^T g lambda / 2 (J). active^2 multiply-adds. */
float palp_contact_energy(const palp_contact *contact);

#endif
