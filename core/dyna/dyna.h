/* SPDX-License-Identifier: MIT */
/*
 * A visco-elastic body in motion, adaptive in space and time (AD 2, 3).
 *
 * Every node of every level is active (it has mass and moves by the forces of its elements), split
 * (its children move in its place) or inactive (an ancestor does). An element is computed when one
 * of its nodes is active; its other nodes are the paper's interface nodes and follow: split ones
 * are means of their children, from fine to coarse, inactive ones are embedded in their containers,
 * from coarse to fine. Both rules are exact for affine motions.
 *
 * An element counts by the share of its corners that are active, as the body's mass does, and what
 * it does to an interface node is handed back to those that the node follows. So all forces are the
 * gradient of one stored energy: at a given resolution energy and momenta are conserved across
 * interfaces as anywhere else. (The paper lets interface nodes follow and drops the forces on them;
 * that is exact for uniform strain, but no energy stands behind it. The price here is
 * that a uniformly strained body feels an interface slightly, as where elements of the two
 * levels overlap by more or less than their share.)
 *
 *   tick = 2^C steps        step s: forces of the elements that are due, impulses to active nodes,
 *                                   nodes move, tools move what they touch, interface nodes follow
 *   after the tick          measures, splits and merges (adapt.h)
 *
 * Time. A node of class c takes steps of tick / 2^c, the largest that its stiffness allows (AD 10:
 * limit_s below); an element goes with its fastest active node and pushes all four by f dt, so
 * momentum is conserved at any mixture of steps. (Paper: each node evaluates its own elements.)
 *
 * Slivers, whose steps would be far smaller than those of all others, are made heavier when the
 * body is opened, by half a per cent of a level at most.
 *
 * The filter (AD 11) acts on the change of the velocity: where dt is beyond the limit the node's
 * mass m is raised to theta/4 (dt^2 j + 2 dt c), with j and c the largest eigenvalues of its
 * Jacobian and its damping matrix, times how much its elements have stiffened by stretching. That
 * is stable for any step, since the stiffness of the mesh is at most theta times its block
 * diagonal (theta is at most 4 for tetrahedra; bake estimates it by iteration); at interfaces about
 * so (interface.c). It leaves rigid motion alone, while filtering the velocity itself, as the paper
 * writes it, brakes it; and it does not change when the body turns, as the paper's fixed 3x3 matrix
 * would. Where elements are overstretched, so that the raised mass grows by factors, the
 * momentum stays and the velocity falls.
 */
#ifndef PALP_DYNA_DYNA_H
#define PALP_DYNA_DYNA_H

#include "core/base/real.h"
#include "core/dyna/element.h"
#include "core/dyna/tets.h"

#define PALP_STEP_CLASSES 8u

typedef enum { PALP_INACTIVE = 0, PALP_ACTIVE = 1, PALP_SPLIT = 2 } palp_node_state;

typedef struct {
    palp_material material;
    palp_vec3 gravity_m_s2;
    float tick_s;
    uint32_t most_class; /* finest step, below PALP_STEP_CLASSES */
} palp_dyna_config;

typedef struct {
    const palp_tets *tets;
    palp_dyna_config config;
    /* of each node of all levels */
    float *u_m, *v_m_s; /* [3] displacement from rest, velocity */
    float *impulse_Ns;  /* [3] of the step under way */
    float *force_N;     /* [3] of all elements, at the first step of the tick */
    float *mass_kg, *j_N_per_m, *c_N_s_per_m;
    float *limit_s;         /* largest step without the filter, with room for stretching */
    float *stretch;         /* of its elements in this tick */
    float *overstretched;   /* how far beyond ordinary stretching it was in the last step, >= 1 */
    float *stiffness_ratio; /* growth of the stiffness by what interface nodes hand back, >= 1 */
    uint8_t *state, *step_class, *needed;
    uint8_t *active_flag;   /* 1 for active nodes, 0 for others */
    uint8_t *borders;       /* corners of elements at work */
    uint8_t *duty;          /* 1 + step class of nodes that are moved by forces, else 0 */
    uint8_t *split;         /* [families] */
    uint32_t *cost;         /* [families] evaluations per tick that splitting adds, about */
    uint8_t *family_class;  /* [families] finest step among their elements */
    uint8_t *element_class; /* [tets] of those at work, else PALP_STEP_CLASSES */
    uint8_t *skin_level;    /* [skin] level on which each vertex is embedded */
    /* lists, made anew when a family splits or merges */
    uint32_t *active, *up, *down, *element;
    uint32_t active_count, up_count, down_count, element_count;
    uint32_t class_start[PALP_STEP_CLASSES + 1u]; /* in element */
    uint32_t top_class;                           /* of the nodes at work */
    uint32_t interpolation_terms;                 /* sources of all interface nodes on the lists */
    uint64_t evaluations, moves, interpolated; /* done so far: elements, nodes, interface nodes */
    uint64_t lists;                            /* made so far */
    float stored_J;                            /* in the elements, at the first step of the tick */
} palp_dyna;

size_t palp_dyna_memsize(const palp_tets *tets);

/*
 * A body at rest with its coarsest nodes active. Errors: ARGUMENT (a material that is not positive,
 * 2 mu + 3 lambda included; tick; class), ALIGNMENT, MEMORY. The body is kept by reference.
 */
palp_status palp_dyna_init(palp_dyna *dyna, const palp_tets *tets, const palp_dyna_config *config,
                           void *memory, size_t bytes);

/* Back to rest. */
void palp_dyna_reset(palp_dyna *dyna);

/* Largest eigenvalue of a s + b tr(s) I, from above (no eigenvalue exceeds a row sum or the trace);
 * s symmetric: xx, yy, zz, yz, zx, xy. */
float palp_dyna_bound(const float s[6], float a, float b);

/* Steps of a tick when none may be finer than `most_class`: 2^min(top_class, most_class). */
uint32_t palp_dyna_steps(const palp_dyna *dyna, uint32_t most_class);

/* Element evaluations of such a tick, in whole groups of lanes. */
uint32_t palp_dyna_work(const palp_dyna *dyna, uint32_t most_class);

/* Forces of the elements due in step s of a tick of `steps`. Elements due + 3 per active node. */
void palp_dyna_forces(palp_dyna *dyna, uint32_t s, uint32_t steps);

/* Active nodes move: v += impulse / max(m, filter) + g dt, u += v dt. */
void palp_dyna_move(palp_dyna *dyna, uint32_t steps);

/* 1 / max(m, filter) of a node in a step of dt_s. */
float palp_dyna_per_mass(const palp_dyna *dyna, uint32_t node, float dt_s);

/* Interface nodes follow. */
void palp_dyna_interpolate(palp_dyna *dyna);

/* A whole tick without tools. */
void palp_dyna_tick(palp_dyna *dyna, uint32_t most_class);

/* States of nodes, and all lists, from which families are split. Cost: about 8 per node and
 * element of the blob. */
void palp_dyna_relist(palp_dyna *dyna);

/* Merges everything: the coarsest nodes take over. Cost: 2 per child and per entry of the means,
 * and palp_dyna_relist. */
void palp_dyna_collapse(palp_dyna *dyna);

/* Where a node's displacement and velocity come from, when it is not active. */
void palp_dyna_embed(palp_dyna *dyna, uint32_t node); /* in its container */
void palp_dyna_mean(palp_dyna *dyna, uint32_t node);  /* of its children */

/* Of interface.c: impulses on interface nodes go to what they follow; how much that stiffens the
 * active ones (when the lists are new). */
void palp_dyna_hand_back(palp_dyna *dyna);
void palp_dyna_stiffness_ratios(palp_dyna *dyna);

static inline palp_vec3 palp_dyna_position(const palp_dyna *d, uint32_t node) {
    return palp_add(palp_vec3_at(d->tets->rest_m + 3u * (size_t)node),
                    palp_vec3_at(d->u_m + 3u * (size_t)node));
}
static inline bool palp_dyna_pinned(const palp_dyna *d, uint32_t node) {
    return (d->tets->node[node].flags & PALP_TET_PINNED) != 0u;
}

/* Kinetic energy of the active nodes, J. */
float palp_dyna_kinetic_J(const palp_dyna *dyna);

#endif
