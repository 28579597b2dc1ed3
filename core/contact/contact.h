/* SPDX-License-Identifier: MIT */
/*
 * Contact between rigid tools and the surface of an elastostatic body, or of the zones of a
 * multizone model, which may also touch each other; without friction, in a work that the number of
 * points alone decides.
 *
 * Each tick the tools' lattices give contact points y_i (contact/lattice.h), the surface their
 * mutual compliance C_ij (surface/surface.h). With phi a tool's distance, the surface must stay out
 * of the tools and may only be pushed:
 *
 *     phi(y_i + u_i - c) >= 0,   f_i = lambda_i m_i,   lambda_i >= 0,   u = C f,   m = grad phi
 *
 * about the last tick's displacements this is the linear complementarity problem
 *
 *     g lambda >= d,   lambda >= 0,   lambda (g lambda - d) = 0
 *     g_ij = m_i C_ij m_j + m_i m_j / k,   d_i = m_i . u_i - phi_i + m_i . (held - c)
 *
 * where each tool is held by a spring k at `held`: it comes to rest at c = held + F / k, with F the
 * force on it. A spring k_r may hold its directions as well, which then turn by M / k_r, with M the
 * moment about its reference point; g has r_i . r_j / k_r besides, and d r_i . (turn to held),
 * with r_i = (y_i + u_i - c) x m_i. An active set solves it on Cholesky factors, beginning with last
 * tick's set.
 *
 * The elastic energy E = f C f / 2 is a function of the tools' places and directions, and F and M
 * its exact gradient:
 *
 *     F = - sum lambda_i m_i + sum f_i . dy_i/dc + 1/2 f (dC/dc) f
 *     M = - sum lambda_i r_i + the same of a turn about c
 *
 * The last two belong to the points, not to the body, and vanish as points become more. They are
 * cut off at PALP_CONTACT_BEYOND of the first, which they reach where a tool meets folds or lies in
 * several regions with few points in each; what F and M then lack is repaid on the way (repay.h).
 *
 * A multizone model is one body at rest, so C is that of the rest configuration in the zones' own
 * coordinates, which are the model's at rest, and what its seams do differently in this
 * configuration (zone/assembly.h). Its surface lies in pieces, each zone in a frame of its own,
 * which a tool's lattice goes over as if they were one. What the seams and weight have bent a zone
 * by is there before any contact. Where a zone lies on another, there is a lattice between the two,
 * and each of its points has two sides, y on the one and z before it on the other,
 *
 *     m (y + u_y - z - u_z) >= 0,   m = (n_z - n_y) / |n_z - n_y|
 *
 * Calls of a tick, in this order, so that the caller can look at the clock in between:
 *
 *     palp_contact_begin       tools where they are expected
 *     palp_contact_fill        their lattices, one filling at a time; second ones may be skipped
 *     palp_contact_points      what the points ask
 *     palp_contact_assemble    some rows of g at a time
 *     palp_contact_iterate     one change of the active set at a time
 *     palp_contact_finish      displacements, forces, where the tools come to rest
 */
#ifndef PALP_CONTACT_CONTACT_H
#define PALP_CONTACT_CONTACT_H

#include "core/base/arena.h"
#include "core/base/status.h"
#include "core/contact/lattice.h"
#include "core/zone/assembly.h"

#define PALP_CONTACT_TOOLS 4u
#define PALP_CONTACT_PAIRS 8u /* of zones that touch each other, at a time */
#define PALP_CONTACT_BEYOND 0.03f
#define PALP_CONTACT_MAX_POINTS 122u /* of the finest level there is */
#define PALP_CONTACT_ITERATIONS 12u  /* changes of the active set in one tick at most */
#define PALP_CONTACT_ROWS 8u         /* of g that one call assembles */
#define PALP_CONTACT_PAIR_REACH                                                                    \
    4.0f                        /* edges about where zones meet, within which nodes are searched */
#define PALP_CONTACT_SCAN 4u    /* nodes that a tick compares with other zones in turn */
#define PALP_CONTACT_TRACKED 4u /* pairs of zones whose nearest nodes it follows */

/*
 * One constraint level: how many points are wanted in contact, and how many modes of H are used.
 * Coarser levels have fewer points before they have fewer modes. Points lie about the middle of the
 * contact in whole shells of the hexagonal lattice (1, 7, 19, 37 in contact), on which its sum
 * comes near the integral; numbers in between are less exact though they are more.
 *
 *     level              0      1      2     3    4
 *     in contact         7      7      7    19   37     about, on a plain surface
 *     points, about     13     13     13    37   73     where the tool overlaps
 *     modes            1/4    1/2    all   all  all
 */
typedef struct {
    uint32_t number;   /* below PALP_CONTACT_LEVELS */
    uint32_t cells;    /* wanted in contact */
    uint32_t points;   /* room: three times the cells, and some */
    uint32_t contacts; /* in contact, at most: half as many again as a plain surface needs */
    uint32_t modes;
} palp_contact_level;
#define PALP_CONTACT_LEVELS PALP_LEVEL_ERRORS
#define PALP_CONTACT_FINEST 3u        /* by default */
#define PALP_CONTACT_NODE_PROBES 16u  /* of them that are looked at for a node */
#define PALP_CONTACT_NODE_SLOTS 1024u /* a power of two, above 3 x 1.5 PALP_CONTACT_MAX_POINTS */

#define PALP_CONTACT_FULL                                                                          \
    1u                        /* more points were wanted than the level has room for, in all or    \
                                 in contact; the lattice grows wider until they fit */
#define PALP_CONTACT_SPENT 2u /* the active set was not settled after all its iterations */
#define PALP_CONTACT_REDUNDANT 4u /* a point was left out because its pivot vanished */
#define PALP_CONTACT_LOST                                                                          \
    8u /* a point was left out because nothing lies before it, or the way there was too long */

/* A tool on its springs; stiffness 0: it stays where it is held, or does not turn. */
typedef struct {
    palp_frame held;
    float stiffness_N_per_m, stiffness_Nm_per_rad;
} palp_contact_spring;

/* A tool on all bodies, or a zone on another. */
typedef struct {
    bool used, filled;        /* filled: in this tick, or about to be */
    uint32_t tool;            /* PALP_CONTACT_TOOLS: not a tool, */
    uint32_t body, other;     /* but these two zones; points lie on the first */
    uint32_t before;          /* node of the other one near where they meet */
    uint32_t near_body, near; /* of a tool that does not press: the node nearest to it */
    palp_frame at;            /* where the tool is taken to be; of two zones: where they met, */
    palp_vec3 met_m;          /* and that in the frame of the first */
    palp_lattice lattice;
    palp_lattice_table *table, *table_before;
    palp_far_field far_field;       /* by the body as a whole under the forces of the last tick */
    palp_far_field bent;            /* and without them */
    palp_far_field bent_field_used; /* what of lattice.used.far_field is that */
    uint32_t points_before;         /* in the last tick, */
    uint32_t pressed_before;        /* and in contact */
    uint32_t pressed, most_pressed; /* in this one, and as many as there may be */
    float spacing_before;           /* of the lattice then */
    float normal_N;                 /* sum of lambda */
    palp_vec3 push_N, push_Nm;      /* - sum lambda m and its moment, where the bodies are */
    palp_vec3 beyond_N, beyond_Nm;  /* what the exact ones have beyond them */
} palp_contact_patch;

/* Sides of points that lie on one body, one behind the other. */
typedef struct {
    uint32_t body, first, end;
} palp_contact_run;

/* What a point between two zones pushes on the other one. */
typedef struct {
    palp_surface_point at;
    palp_vec3 m, u_m; /* its direction and displacement there, in that zone's frame */
    bool found;
} palp_contact_facing;

typedef struct {
    palp_surface *surface;   /* [bodies] */
    palp_assembly *assembly; /* of the zones, by reference; NULL: one body at rest */
    bool pairs;              /* zones touch each other */
    uint32_t bodies, patches;
    uint32_t modes;                     /* of the body, or of all zones together */
    const palp_tool *tools;             /* by reference */
    float extent_m[PALP_CONTACT_TOOLS]; /* palp_tool_extent of each, */
    float reach_m[PALP_CONTACT_TOOLS];  /* and palp_lattice_reach on the body that asks for most */
    uint32_t tool_count, room;          /* room: points, of the level that has most */
    uint32_t now;              /* the level in use; set between ticks, at most that of init */
    palp_contact_level level;  /* of this tick */
    palp_contact_patch *patch; /* [patches]; patch t is tool t, pairs follow */
    const palp_frame *frame;   /* [bodies] where they are; NULL: at rest */
    palp_frame *frame_before;  /* [bodies] where they were in the last tick */
    uint32_t **beyond;         /* [bodies] palp_lattice_room.beyond */
    palp_contact_point *point, *before;          /* [room]: of this tick; of the last */
    palp_contact_facing *facing, *facing_before; /* [room] of points between zones */
    uint32_t count;                              /* contact points */
    uint32_t count_before;
    bool solved;     /* the last tick was finished */
    bool approached; /* a tool tested nodes of a zone in this tick */
    palp_contact_spring spring[PALP_CONTACT_TOOLS];
    palp_vec3 turn_rad[PALP_CONTACT_TOOLS];  /* from where they are taken to be to `held` */
    palp_frame rest[PALP_CONTACT_TOOLS];     /* where they come to rest */
    palp_vec3 force_N[PALP_CONTACT_TOOLS];   /* exact, on each tool, */
    palp_vec3 moment_Nm[PALP_CONTACT_TOOLS]; /* about its reference point */
    palp_vec3 beyond_N[PALP_CONTACT_TOOLS];  /* what of them lies beyond - sum lambda m, */
    palp_vec3 beyond_Nm[PALP_CONTACT_TOOLS];
    palp_vec3 repaid_N[PALP_CONTACT_TOOLS]; /* and what makes up for work not done (repay.h) */
    palp_vec3 repaid_Nm[PALP_CONTACT_TOOLS];
    float normal_N[PALP_CONTACT_TOOLS];         /* sum of lambda */
    palp_frame held_before[PALP_CONTACT_TOOLS]; /* spring.held of the last solved tick */
    float stored_J;                             /* the most that was of late, fading */
    float owed_J;                               /* to the hand */
    float far_share; /* of patch.far_field, that the patch under way is taken to meet */
    float forward;   /* how far that is put forward, over its size */
    float energy_J;  /* f C f / 2 */
    float crowd;     /* share of the cells that is asked for: below 1 after PALP_CONTACT_FULL */
    uint32_t sides, side_room; /* the points, then the other sides of those between zones */
    uint16_t *side_point;      /* [side_room] */
    uint16_t *other_side;      /* [room] of a point between zones; 0: it has none */
    palp_contact_run *run;     /* [side_room] */
    uint32_t runs;
    uint32_t *node, *node_body; /* [3 side_room] corners of the sides' triangles, each once */
    palp_vec3 *node_u_m;        /* [3 side_room] what modes and seams displace them by */
    palp_vec3 *node_bent_m;     /* [3 side_room] and what moves them without contact */
    uint16_t *node_slot;   /* [PALP_CONTACT_NODE_SLOTS] where they are in the list; 0: nowhere */
    uint16_t (*corner)[3]; /* [side_room] of each side, in the list */
    uint32_t nodes;
    float *column[11];  /* [side_room] the sides side by side (contact_internal.h) */
    float *pressed[11]; /* [side_room, rounded up] those in contact, body by body, with forces */
    uint16_t *pressed_side;       /* [side_room, rounded up] */
    palp_contact_run *pressed_of; /* [bodies] where those of each body are */
    float *mode;                  /* [modes][side_room] what unit forces along m give the modes */
    float *load;                  /* [modes] */
    float far_load[PALP_LATTICE_FAR_MODES]; /* of the first modes, in the last tick */
    float *seam;                      /* [2][3 modes of the seams][side_room] rows y and y_0 */
    uint64_t seam_touched;            /* seams where they are not zero */
    float *felt, *answer;             /* of one zone's seams; [2] over all seams */
    float *side_row[2];               /* [side_room] */
    float *g;                         /* [room][room] */
    float *factor;                    /* [room][room] */
    float *target, *lambda, *scratch; /* [room] */
    uint32_t *active;                 /* [room] points in contact */
    uint32_t active_count, row, iterations, flags;
    uint32_t most_active;              /* points in contact at a time, during the iterations */
    uint32_t filling, fillings, first; /* patch that is being filled, how often, its first point */
    uint32_t scan, pair_scan; /* node of a zone that is compared with others next; pair of zones */
    uint32_t (*closest)[2];   /* [pairs of zones] nodes that are near each other */
    palp_lattice_counts done, filled; /* by the last filling; by all of this tick */
    uint64_t work_done;
} palp_contact;

/* A level of a blob with `modes`; of a multizone model, where a tool may lie on several zones, the
 * coarse levels have more points. */
palp_contact_level palp_contact_level_of(uint32_t level, uint32_t modes);
palp_contact_level palp_contact_level_of_zones(uint32_t level, uint32_t modes);

/* What touches what; pointers are kept. */
typedef struct {
    const palp_blob *blob;   /* one body at rest, with a regular part; or: */
    palp_assembly *assembly; /* zones with a regular part each, posed and settled before a tick
                                begins; NULL: the blob */
    bool pairs;              /* the zones touch each other */
    const palp_tool *tools;  /* [tool_count], as palp_tool_is_sound */
    uint32_t tool_count;     /* 1 to PALP_CONTACT_TOOLS */
    uint32_t finest;         /* level that memory is there for, below PALP_CONTACT_LEVELS */
} palp_contact_config;

/* Bytes for contact: by this config, 0 where it is out of range; and with so many tools on any blob
 * that is not a multizone model, as a constant for static memory. */
size_t palp_contact_memsize(const palp_contact_config *config);
#define PALP_CONTACT_SIDES(finest) ((finest) < 3u ? 24u : (finest) == 3u ? 64u : 128u)
#define PALP_CONTACT_BYTES(tools, finest)                                                          \
    (sizeof(palp_surface) +                                                                        \
     (tools) * (sizeof(palp_contact_patch) + 2u * sizeof(palp_lattice_table) + PALP_ALIGN) +       \
     PALP_CONTACT_SIDES(finest) * (2u * sizeof(palp_contact_point) + 4u * PALP_MAX_MODES + 240u +  \
                                   8u * PALP_CONTACT_SIDES(finest)) +                              \
     7168u)

/* Starts on the finest level. Errors: ABSENT (no regular part), ARGUMENT (unsound tools, none or
 * too many), LIMITS (finest), MEMORY, ALIGNMENT. */
palp_status palp_contact_init(palp_contact *contact, const palp_contact_config *config,
                              void *memory, size_t bytes);

/* Whether anything was touched in the last tick, or near enough to be. */
bool palp_contact_near(const palp_contact *contact);

/* Tells the assembly the forces of the last tick. */
void palp_contact_load_seams(palp_contact *contact);

/* What of the elastic energy is due to a tool or pair with this sum of lambda: its share of all. */
float palp_contact_energy(const palp_contact *contact, float normal_N);

/* How far the bodies that a tool presses have carried it since the last tick that was finished (m).
 */
palp_vec3 palp_contact_carried(const palp_contact *contact, uint32_t tool);

/* Forgets all contacts. */
void palp_contact_clear(palp_contact *contact);

/* A tick with the tools at[tool_count], held by spring[tool_count]; one that no spring turns is at
 * the directions in which it is held. */
void palp_contact_begin(palp_contact *contact, const palp_frame *at,
                        const palp_contact_spring *spring);
/* One filling of one lattice (palp_lattice_fill); false when there is none left to do. */
bool palp_contact_fill(palp_contact *contact);
/* Whether the present patch's next filling can be left out: it has points, or it carried no force;
 * and to leave it out. Patches of a multizone model that press are filled before the others. */
bool palp_contact_may_skip(const palp_contact *contact);
void palp_contact_skip(palp_contact *contact);
/* Returns how many contact points there are. Each: 200 and 9 modes. */
uint32_t palp_contact_points(palp_contact *contact);
/* PALP_CONTACT_ROWS rows of g; false when all are there. Row i: i (30 + modes). */
bool palp_contact_assemble(palp_contact *contact);
/* One change of the active set with its factor, a^3 / 6 + a^2 + count a; false when settled. */
bool palp_contact_iterate(palp_contact *contact);
/* Forces, displacements, exact gradient: points (30 a + 60), a (60 a), 1500 per place, corners 9
 * modes. */
void palp_contact_finish(palp_contact *contact);

/* All of them. */
void palp_contact_solve(palp_contact *contact, const palp_frame *at,
                        const palp_contact_spring *spring);

#endif
