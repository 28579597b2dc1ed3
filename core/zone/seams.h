/* SPDX-License-Identifier: MIT */
/*
 * The condensed interface equations of a multizone model (MZ V-VII), in force form.
 *
 * The displacement w_s of seam s is kept in the frame of its first zone. Zone z sees it as
 *
 *     u = T^T w + g,   g = (R^T - I) x - R^T t        (MZ VI)
 *
 * with T = I, g = 0 for the first zone and T = R for the second, (R, t) their relative motion and x
 * the common rest shape: g is the mismatch of the posed rest shapes, the bending strain. Balance of
 * forces at the seams gives the symmetric form of (13),
 *
 *     A w = r,   A_ss' = sum_z T K^z_ss' T'^T,   r = - sum_z T (K^z g + p^)
 *
 * which is positive definite as long as bones hold the model, and couples seams that share a zone.
 * Seams are numbered in the order of elimination, leaves first, so block Cholesky A = R^T R fills
 * nothing on chains (where it is the block tridiagonal one) and trees; a loop fills the column of
 * the seam that closes it, which is the bordered system. Cost is linear in zones.
 *
 * Levels: on level l each seam keeps its first level_modes[l] modes, which is the leading part of
 * every block (Galerkin), so every level is positive definite and forces balance in the mean.
 * Below level 0 there is the block diagonal approximation, its inverses interpolated over the
 * joint's value.
 */
#ifndef PALP_ZONE_SEAMS_H
#define PALP_ZONE_SEAMS_H

#include "core/budget/price.h"
#include "core/base/arena.h"
#include "core/zone/configuration.h"

#define PALP_MAX_PARTNERS 12u     /* later seams that a seam meets, fill included */
#define PALP_DIAGONAL_SAMPLES 9u  /* of each joint's range */
#define PALP_DIAGONAL_LEVEL 1u    /* that the block diagonal approximation is made on */
#define PALP_DIAGONAL 0xfffffffeu /* stands for it where a level is asked for */

/* Later seams that one seam meets, fill included, and where their blocks begin: its own first. */
typedef struct {
    uint32_t offset[PALP_MAX_PARTNERS + 1u];
    uint8_t count, other[PALP_MAX_PARTNERS];
} palp_seam_links;

typedef struct {
    float *block;          /* the blocks of R, or the approximation's */
    palp_seam_links *link; /* [seams] where they are */
    palp_frame *relative;  /* [seams] configuration that it belongs to */
    uint32_t level;        /* of the modes it knows */
    uint32_t step, steps;  /* done, and to be done */
    bool diagonal, sound;
} palp_seam_factor;

/* A vector over the seams: seam s begins at 3 first_mode[s]. */
typedef struct {
    const palp_zones *zones;
    uint32_t finest; /* level that memory is there for */
    uint32_t modes;  /* of all seams on it */
    uint32_t first_mode[PALP_MAX_SEAMS];
    palp_configuration *spare;  /* for opening */
    palp_seam_factor factor[2]; /* in use, and being made */
    uint32_t now;
    palp_seam_factor rest[PALP_SEAM_LEVELS + 1u]; /* in the rest configuration; last: diagonal */
    float *sample[PALP_MAX_SEAMS];   /* [PALP_DIAGONAL_SAMPLES][n][n] inverses of diagonal blocks */
    float *work[4];                  /* vectors */
    float *zone_modes, *zone_forces; /* [largest M][3] */
    uint64_t work_done;              /* multiply-adds so far */
} palp_seams;

size_t palp_seams_memsize(const palp_zones *zones, uint32_t finest);

/*
 * Lays out in `memory` (64-byte aligned, owned by the caller), makes the samples of the block
 * diagonal approximation and, as far as `finest` goes, the factor of the rest configuration.
 * Errors: LIMITS (finest, or a seam with too many partners), MEMORY, ALIGNMENT, NOT_SPD when the
 * model is not held.
 */
palp_status palp_seams_init(palp_seams *seams, const palp_zones *zones, uint32_t finest,
                            void *memory, size_t bytes);

/* Modes of seam s on `level`, PALP_DIAGONAL included. */
uint32_t palp_seam_modes(const palp_seams *seams, uint32_t s, uint32_t level);

static inline const palp_seam_factor *palp_seams_factor(const palp_seams *seams) {
    return &seams->factor[seams->now];
}

/*
 * Makes the factor for a configuration beside the one in use, in steps: begin, then step until it
 * returns false, then take, which puts it to use; false if it is not positive definite. With N = 3
 * modes of a seam, b = 1 + its partners: a step assembles one row of blocks (about 6 N^2 b) or
 * eliminates one seam (N^3 / 6 + N^3 b (b - 1) / 2 + ...). There are two steps a seam, for the
 * approximation one (N^3 / 6 + 3 N^2).
 */
void palp_seams_begin(palp_seams *seams, const palp_configuration *configuration, uint32_t level);
bool palp_seams_step(palp_seams *seams);
bool palp_seams_take(palp_seams *seams);

/* All of that. Errors: NOT_SPD, the factor in use then stays. */
palp_status palp_seams_refresh(palp_seams *seams, const palp_configuration *configuration,
                               uint32_t level);

/*
 * What all steps on `level` cost at most, and the longest one, in the unit of the prices (names of
 * prices in capitals). A row of blocks: SEAM + N (N + sum of the partners' N) SEAM_TURN; a seam
 * eliminated: SEAM + (N^3 / 6 + sum over partners N^2 m / 2 + sum over pairs of them N m m')
 * SEAM_PRODUCT + (2 N^2 + sum over partners N m) SEAM_ROW.
 */
float palp_seams_cost_factor(const palp_seams *seams, const palp_prices *price, uint32_t level);
float palp_seams_cost_step(const palp_seams *seams, const palp_prices *price, uint32_t level);
/* Of palp_seams_forward_many, for one vector: seams SEAM + sum (N^2 / 2 + N m over links)
 * SEAM_PRODUCT. */
float palp_seams_cost_forward(const palp_seams *seams, const palp_prices *price, uint32_t level);
/* Of one solve on it, one matrix product included: seams SEAM + modes SEAM_MODE + (sum N^2 + 2 N m
 * over links + sum over zones M (M + 30)) SEAM_DOT. */
float palp_seams_cost_solve(const palp_seams *seams, const palp_prices *price, uint32_t level);

/* r := - sum T K g: what the mismatch of the configuration asks for. `level` bounds the modes. */
void palp_seams_mismatch(palp_seams *seams, const palp_configuration *configuration, uint32_t level,
                         float *r);

/* r -= weight: gravity, `acceleration` in the frame of zone 0. */
void palp_seams_gravity(palp_seams *seams, const palp_configuration *configuration, uint32_t level,
                        palp_vec3 acceleration_m_s2, float *r);

/* Where a zone's node is on a seam: the node-th of the zone's seam-th seam. */
typedef struct {
    uint32_t seam, node;
} palp_seam_place;

/*
 * What a zone's seams feel of a force f (N, zone's frame) at one of its nodes, added to felt[M][3]
 * in the modes of `level`: H^T f of a free node, q f of one on a seam, nothing of a bone. Cost: 9 a
 * mode.
 */
void palp_zone_modal_load(const palp_zones *zones, uint32_t level, uint32_t zone, uint32_t node,
                          palp_vec3 f, float *felt);
/* The same of a node whose place on a seam is known: the function above searches all nodes of the
 * zone's seams for it. */
void palp_zone_modal_load_at_seam(const palp_zones *zones, uint32_t level, uint32_t zone,
                                  palp_seam_place place, palp_vec3 f, float *felt);

/* r += T of what a zone's seams feel, on `level`. With configuration NULL: in the rest
 * configuration. */
void palp_seams_load(const palp_seams *seams, const palp_configuration *configuration,
                     uint32_t level, uint32_t zone, const float *felt, float *r);
/* The same on the level of the factor in use, into one of several vectors side by side: r[i
 * stride]. */
void palp_seams_load_among(const palp_seams *seams, const palp_configuration *configuration,
                           uint32_t zone, const float *felt, float *r, size_t stride);

/* x := A^-1 x, with the factor in use. */
void palp_seams_solve(palp_seams *seams, float *x);

/* The factor of the rest configuration on the level of the one in use. */
const palp_seam_factor *palp_seams_at_rest(const palp_seams *seams);

/*
 * Half of a solution by a factor, y := R^-T y, so that y . y = r^T A^-1 r; and the other half,
 * x := R^-1 x. `touched` has a bit for each seam where y is not zero and is updated; seams without
 * are skipped.
 */
void palp_seams_forward(palp_seams *seams, const palp_seam_factor *factor, float *y,
                        uint64_t *touched);
/* The same for `count` vectors side by side, y[3 modes][stride]. */
void palp_seams_forward_many(palp_seams *seams, const palp_seam_factor *factor, float *y,
                             size_t stride, size_t count, uint64_t *touched);
void palp_seams_backward(palp_seams *seams, const palp_seam_factor *factor, float *x);

/*
 * A w = r for the given configuration by `iterations` steps of conjugate gradients, preconditioned
 * by the factor in use, from w = 0; returns |r - A w| / |r| in the preconditioner's norm. On the
 * factor's level. Where the factor is of a configuration near by, a few steps replace a
 * factorisation: cost is iterations times palp_seams_cost_solve.
 */
float palp_seams_iterate(palp_seams *seams, const palp_configuration *configuration, const float *r,
                         uint32_t iterations, float *w);

/* What zone z sees of w: u = T^T w + g, [M][3] in its own frame. */
void palp_seams_zone(const palp_seams *seams, const palp_configuration *configuration,
                     uint32_t level, uint32_t zone, const float *w, float *u);

/* The same without the mismatch: u = T^T w; with configuration NULL in the rest configuration. */
void palp_seams_expand(const palp_seams *seams, const palp_configuration *configuration,
                       uint32_t level, uint32_t zone, const float *w, float *u);

/* What the neighbours exert at the seams of a zone, K (T^T w + g) + weight, in zone_forces, and the
 * displacements there in zone_modes: [M][3] in the zone's frame. Tools' part is left out. */
void palp_seams_reaction(palp_seams *seams, const palp_configuration *configuration, uint32_t zone,
                         const float *w, palp_vec3 acceleration_m_s2);

/* Displacement of a node of a zone by its seam modes u (m, zone's frame), those beyond `level`
 * being zero. 9 a mode; of a node on a seam 3 a mode of that. */
palp_vec3 palp_zone_modal_displacement(const palp_zones *zones, uint32_t level, uint32_t zone,
                                       uint32_t node, const float *u);
palp_vec3 palp_zone_modal_displacement_at_seam(const palp_zones *zones, uint32_t level,
                                               uint32_t zone, palp_seam_place place,
                                               const float *u);

/* Elastic energy of the seams' displacements, sum u^T K u / 2 (J). */
float palp_seams_energy(palp_seams *seams, const palp_configuration *configuration, uint32_t level,
                        const float *w);

#endif
