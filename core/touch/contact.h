/* SPDX-License-Identifier: MIT */
/*
 * Unilateral contact between one or several rigid tools and the nodes of one constraint level, in
 * bounded work.
 *
 * Candidates are basis functions [l,k] of that level near a tool. They are kept from tick to tick
 * with their mutual normal compliances
 *
 *     g_ij = n_i^T G_[l,i][l,j] n_j        (MR 39, 69; energetic, green/hierarchy.h)
 *
 * looked up in the level's table, or extracted from compressed columns and averaged over (i, j) and
 * (j, i), plus the blob's softening on the diagonal, which keeps them positive definite after
 * thresholding. They are cached, so the symmetric positive definite capacitance matrix costs
 * nothing while the tools stay in place. Contact forces lambda >= 0 solve the complementarity
 * problem
 *
 *     w = g lambda - d >= 0,   lambda >= 0,   w lambda = 0
 *
 * by a primal active set on the Cholesky factor: each step either finishes, lets one candidate in
 * or lets one out, and never leaves lambda >= 0 or raises the energy. It starts from the last
 * tick's set. Steps are separate calls, so that the caller can look at the clock in between and
 * stop with the best forces so far.
 *
 * On a multizone model each zone is a body of its own, on its constraint level, and the compliance
 * has the seams' response on top (zone/assembly.h): candidates are moved along and compliances
 * renewed by palp_node_contact_follow whenever the posture has changed. Zones also touch each
 * other: a candidate of PALP_ZONE_TOOL is a node of one zone before a node of another, pushed apart
 * along their mean normal.
 *
 * A candidate that is found already under a tool (it came late, belongs to the far side of a thin
 * part, found no room, or takes over from another level) is relieved of that depth: it feels only
 * what the tool adds, and the relief shrinks as the tool backs out. So nothing that the search, a
 * capacity or a change of level does can push the tool, and a closed path never gains energy.
 */
#ifndef PALP_TOUCH_CONTACT_H
#define PALP_TOUCH_CONTACT_H

#include "core/base/arena.h"
#include "core/green/hierarchy.h"
#include "core/contact/tool.h"
#include "core/zone/assembly.h"

typedef struct {
    uint32_t max_candidates; /* near the tools, at most PALP_MAX_CANDIDATES */
    uint32_t max_active;     /* in contact */
    uint32_t max_new;        /* candidates taken in per tick */
    uint32_t max_pivots;     /* active set steps per solve */
    bool friction;           /* keep full 3x3 compliances, which friction needs */
} palp_node_contact_limits;

#define PALP_MAX_TOOLS 4u
#define PALP_MAX_CANDIDATES 256u
#define PALP_NODE_CONTACT_SCAN 32u    /* slots looked at in turn by each search */
#define PALP_NODE_CONTACT_DESCENT 32u /* moves of the nearest node, at most */
#define PALP_NODE_CONTACT_WALK 24u    /* candidates whose neighbours are, in turn */
#define PALP_NODE_CONTACT_LOOKS                                                                    \
    48u /* close looks at those, and as many as slots in turn at the slots                         \
         */
#define PALP_NODE_CONTACT_DEFAULTS ((palp_node_contact_limits){96u, 48u, 4u, 12u, false})

#define PALP_NODE_CONTACT_REFACTOR 64u /* changes of the factor before it is made afresh */

#define PALP_NODE_CONTACT_PIVOTS_SPENT 1u /* stopped before the complementarity conditions held */
#define PALP_NODE_CONTACT_ACTIVE_FULL 2u  /* more candidates wanted in than max_active */
#define PALP_NODE_CONTACT_CANDIDATES_FULL 4u
#define PALP_NODE_CONTACT_DEFERRED 8u   /* candidates left for the next tick */
#define PALP_NODE_CONTACT_REDUNDANT 16u /* a candidate was left out because its pivot vanished */

#define PALP_ZONE_TOOL PALP_MAX_TOOLS /* stands for the other zones */
#define PALP_NODE_CONTACT_PAIR_SCAN                                                                \
    4u /* nodes that are compared with other zones by each search                                  \
        */

/* Something that search found: a slot of the contact's level, and the tool near it. */
typedef struct {
    uint32_t slot, tool, body;
    uint32_t facing_body, facing_node; /* of PALP_ZONE_TOOL */
} palp_fresh;

/* A place on a body, and the direction in its frame along which it is felt and gives way. */
typedef struct {
    uint32_t body, node, slot;
    palp_vec3 d;
} palp_spot;

typedef struct {
    uint32_t node, slot, level, tool, body;
    palp_spot facing; /* of PALP_ZONE_TOOL: what it would touch */
    palp_vec3 d;      /* its normal in the frame of its body */
    palp_vec3 x, n;   /* where it is without contact, and its normal; world */
    palp_touch at;    /* the tool as it sees it now */
    float relief_m;   /* depth that it does not feel; below 0: depth that it feels beyond its own */
    float target_m;   /* indentation that it asks for with no force on the tool */
    float force_N;    /* lambda, along -n on the body */
    uint32_t blocked; /* solve in which its pivot vanished */
    bool active;      /* among those in contact */
} palp_candidate;

/*
 * A tool that hangs on a spring: it sits at c = held_m + F / stiffness with F the contact force on
 * it. Stiffness 0 stands for a rigid grip, c = held_m.
 */
typedef struct {
    palp_vec3 held_m;
    float stiffness_N_per_m;
} palp_grip;

typedef struct {
    const palp_blob *blob;   /* the only body, or zone 0 */
    palp_assembly *assembly; /* NULL: one body at rest */
    const float *position_m; /* [nodes][3] surface without contact, of the only body */
    const palp_tool *tools;
    float size_m[PALP_MAX_TOOLS +
                 1u]; /* palp_tool_size of each; largest mean edge for PALP_ZONE_TOOL */
    uint32_t tool_count, bodies, level;
    uint32_t first_slot[PALP_MAX_ZONES + 1u]; /* of each body in `place` */
    palp_node_contact_limits limits;
    palp_candidate *candidate; /* [max_candidates], the first `count` in use */
    palp_row *row;             /* [max_candidates], unless the level has a table */
    float *compliance;         /* [max_candidates][max_candidates] g */
    float *block;              /* the same, 3x3, with limits.friction */
    float *local;              /* with an assembly: g without the seams' part */
    float *seam_row;           /* [max_candidates][seam_width] y of each candidate */
    uint64_t *touched;         /* [max_candidates] its seams */
    uint32_t seam_width, pair_scan, renewed;
    uint32_t place_work;  /* operations to say where a node of a zone is */
    bool pairs;           /* zones touch each other */
    float *factor;        /* [max_active][max_active] R, C = R^T R */
    uint32_t *active;     /* [max_active] candidate of each row of R */
    float *target, *work; /* [max_active + 1] */
    float *jacobian;      /* [3 PALP_MAX_TOOLS][max_active] R^-T J */
    uint16_t *place;      /* [free slots] candidate number + 1, 0 if none */
    palp_row_scratch scratch;
    uint32_t count, active_count, solves, changes, scan, walk, probe;
    uint32_t nearest[PALP_MAX_ZONES][PALP_MAX_TOOLS]; /* node of each body */
    uint32_t flags;                                   /* of the last tick */
    uint32_t pivots;                                  /* of the last tick */
    uint32_t pivots_now;                              /* of the solve under way */
    palp_grip grip[PALP_MAX_TOOLS + 1u];              /* of the last solve */
    palp_vec3 about[PALP_MAX_TOOLS + 1u];             /* of the last search or solve */
    uint64_t work_done; /* multiply-adds and look-ups so far, counted */
} palp_node_contact;

/* Each limit at least 1, max_candidates at most PALP_MAX_CANDIDATES, the others at most
 * max_candidates. */
bool palp_node_contact_limits_sound(palp_node_contact_limits limits);

size_t palp_node_contact_memsize(const palp_blob *blob, palp_node_contact_limits limits);

/*
 * `position_m` (float[nodes][3]: the surface without contact, normally blob->rest_m) and `tools`
 * are kept by reference. Starts on the blob's constraint level. Errors: LIMITS, ARGUMENT (unsound
 * tools, or friction without limits.friction), MEMORY, ALIGNMENT; *contact is then not to be used.
 */
palp_status palp_node_contact_init(palp_node_contact *contact, const palp_blob *blob,
                                   const float *position_m, const palp_tool *tools,
                                   uint32_t tool_count, palp_node_contact_limits limits,
                                   void *memory, size_t bytes);

/*
 * The same on a multizone model, held by reference, with PALP_ZONE_TOOL contact if `pairs`.
 * Friction needs compliances along three directions and is not offered: ARGUMENT.
 */
size_t palp_node_contact_memsize_zones(const palp_zones *zones, uint32_t finest,
                                       palp_node_contact_limits limits);
palp_status palp_node_contact_init_zones(palp_node_contact *contact, palp_assembly *assembly,
                                         bool pairs, const palp_tool *tools, uint32_t tool_count,
                                         palp_node_contact_limits limits, void *memory,
                                         size_t bytes);

/*
 * Moves all candidates along with the posture and renews their compliances by the seams' factor in
 * use. Cost: candidates (18 M + modes^2) and candidates^2 modes, M of a zone and modes of the seams
 * on a zone's way to the last one.
 */
void palp_node_contact_follow(palp_node_contact *contact);

/* Tells the assembly the present contact forces (palp_assembly_load). */
void palp_node_contact_load(const palp_node_contact *contact, palp_assembly *assembly);

/* Forgets all contacts; further ones are sought on `level` if it has a table, else on the blob's
 * constraint level. */
void palp_node_contact_clear(palp_node_contact *contact, uint32_t level);

/*
 * Updates the candidates for tools at center[tool_count]: drops idle ones out of reach, walks the
 * surface from the others and from the node nearest to a tool that touches nothing, looks at the
 * next PALP_NODE_CONTACT_SCAN slots in turn, and lists up to max_new to take in, deepest first.
 * Returns how many are listed in `fresh`. Cost: max_candidates (1 + max_ring) +
 * PALP_NODE_CONTACT_SCAN evaluations of a tool, and one look at 27 grid cells.
 */
uint32_t palp_node_contact_search(palp_node_contact *contact, const palp_vec3 *center,
                                  palp_fresh *fresh);

/*
 * Takes one in. On a level with a table: count + 1 look-ups; else one row of W^-1 and 2 count + 1
 * extractions. Call it for what search lists, as far as time allows; the rest is found again on the
 * next tick.
 */
void palp_node_contact_admit(palp_node_contact *contact, palp_fresh fresh);

/*
 * A solve in steps. begin linearises the depths about tools at `about`:
 *
 *     d(c) = d(about) - J (c - about),   J = rows `push`,   F = J^T lambda
 *     (g + J K^-1 J^T) lambda - (d(about) - J (held - about)) >= 0,  complementary to lambda >= 0
 *
 * The factor is that of g alone, whatever the pose; the springs enter by Woodbury's identity with a
 * system of three unknowns per tool. Each step is one pivot, and returns false when there is
 * nothing left to do or max_pivots are spent. Cost of a step: 2.5 active^2 for the solve, 2.5
 * active^2 for the exchange, count * active for the violations.
 */
void palp_node_contact_begin(palp_node_contact *contact, const palp_vec3 *about,
                             const palp_grip *grip);
bool palp_node_contact_step(palp_node_contact *contact);
/* Force on tool `tool` (N). */
palp_vec3 palp_node_contact_force(const palp_node_contact *contact, uint32_t tool);

/* begin, all steps, and the force on the only tool. */
palp_vec3 palp_node_contact_solve(palp_node_contact *contact, palp_vec3 about, palp_grip grip);

/* Elastic energy of the contact, lambda^T g lambda / 2 (J). active^2 multiply-adds. */
float palp_node_contact_energy(const palp_node_contact *contact);

/* Sum of the normal forces under tool `tool` (N), and the direction of their resultant. */
float palp_node_contact_normal_force(const palp_node_contact *contact, uint32_t tool,
                                     palp_vec3 *axis);

/* For the files of this folder. */
palp_touch palp_node_contact_see(const palp_node_contact *contact, const palp_candidate *candidate,
                                 const palp_vec3 *center);
const palp_blob *palp_node_contact_blob(const palp_node_contact *contact, uint32_t body);
uint32_t palp_node_contact_nearest(const palp_node_contact *contact, uint32_t body,
                                   palp_vec3 rest_m, uint32_t nearest);
bool palp_node_contact_make_row(palp_node_contact *contact, uint32_t body, uint32_t slot,
                                palp_row *row);
void palp_node_contact_aim(const palp_node_contact *contact, palp_candidate *candidate);
void palp_node_contact_join(palp_node_contact *contact, uint32_t candidate);
void palp_node_contact_lay_out(palp_node_contact *contact, palp_arena *arena, uint32_t longest,
                               uint32_t most_slots);
palp_status palp_node_contact_begin_use(palp_node_contact *contact, const palp_tool *tools,
                                        uint32_t tool_count);
void palp_node_contact_clean(palp_node_contact *contact, uint32_t most_slots);
uint32_t palp_node_contact_search_pairs(palp_node_contact *contact, palp_fresh *fresh,
                                        uint32_t room);
palp_vec3 palp_node_contact_place(const palp_node_contact *contact, uint32_t body, uint32_t node);
palp_vec3 palp_node_contact_normal(const palp_node_contact *contact, uint32_t body, uint32_t node);
float palp_node_contact_indentation(const palp_node_contact *contact, uint32_t candidate);
bool palp_node_contact_let_in(palp_node_contact *contact, uint32_t candidate);
static inline float palp_node_contact_g(const palp_node_contact *contact, uint32_t i, uint32_t j) {
    return contact->compliance[(size_t)i * contact->limits.max_candidates + j];
}

#endif
