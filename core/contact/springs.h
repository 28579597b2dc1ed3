/* SPDX-License-Identifier: MIT */
/*
 * Partial slip in one region of a contact (Cattaneo and Mindlin; Deresiewicz for torsion), by
 * springs of different depths (Jaeger 1998; Popov and Hess, method of dimensionality reduction).
 *
 * Pressed deeper, a contact becomes stiffer: what touches at depth z_j adds a stiffness w_j along
 * the surface and k_j about its normal, and carries at most mu w_j (z - z_j) before it slips, so
 * the rim slips first. Spring j is stretched by e_j and twisted by t_j, from the material that it
 * holds on to:
 *
 *     P = sum_j w_j M e_j,   |M e_j| <= mu (z - z_j)               force on the body
 *     Q = sum_j k_j t_j,     |t_j| <= mu N / (G a^2) phi(a_j / a)  moment about the normal
 *
 * where both act together the squares of what each asks of its bound add up to at most 1 (the
 * ellipsoid of Howe and Cutkosky).
 *
 *     A    compliance along the surface as on a half-space; m = tr A / 2, M = m A^-1
 *     w_j  sum_j w_j = 1 / m
 *     z_j  sum_j w_j (z - z_j) = N, so that |P| <= mu N
 *     a_j  radius of what has touched at depth z_j, a of all; sum_j k_j = 16/3 G a^3
 *     phi  (3 / 4 pi) (K - E)(sqrt(1 - x^2)), complete elliptic integrals: the turn at which the
 *          stick radius of Lubkin's contact is x a; its moment grows as that of a punch of this
 *          radius, to 3 pi / 16 mu N a
 *
 * For a rounded tool (A ~ 1 / sqrt(z), Hertz) z = 1.5 N m, in PALP_SPRINGS_DEPTHS depths that are
 * equidistant in sqrt(z) up to z_top and stay where they are while the load changes: what is
 * stretched stays so, whatever the load does; what loses touch forgets. Where the load has been at
 * its least a depth is two springs, what kept touch and what has touched since. z_top is laid anew
 * when z leaves it. A flat tool has one spring at depth 0, z = N m, and pi/4 mu N a.
 *
 * e_j is a vector of space of which the part in the region's plane counts, so that a tool that
 * comes back finds the force that it left, also where the plane has turned meanwhile.
 *
 * The coefficient goes from mu (static) to that of sliding over a path of mu z when all slips, and
 * back at once when something sticks.
 */
#ifndef PALP_CONTACT_SPRINGS_H
#define PALP_CONTACT_SPRINGS_H

#include "core/contact/regions.h"

#define PALP_SPRINGS_DEPTHS 16u
#define PALP_SPRINGS (PALP_SPRINGS_DEPTHS + 1u)

typedef struct {
    palp_contact_region at;
    palp_symmetric2 near_m_per_N;      /* A */
    float radius_m;                    /* a */
    float top_m, root;                 /* z_top, sqrt(z / z_top) */
    float kept;                        /* the least root since the depths were laid */
    palp_vec3 stretch_m[PALP_SPRINGS]; /* e_j; from shallow to deep, those within `kept` first */
    float twist_rad[PALP_SPRINGS];     /* t_j */
    float slid_m;                      /* since all springs slip */
    bool rounded;
} palp_springs;

/* One spring in a solution: in the plane of its region, about its normal. */
typedef struct {
    float stretch_m[2], stiffness_N_per_m, reach_m;
    float twist_rad, stiffness_Nm, reach_rad;
    uint32_t number;
} palp_spring;

/* The springs of one region, for a motion of their tool. */
typedef struct {
    palp_springs *of;
    palp_spring spring[PALP_SPRINGS];
    uint32_t count;
    palp_symmetric2 m;                     /* M */
    float stiffness_N_per_m, stiffness_Nm; /* 1 / m over root; sum of k_j */
    palp_vec3 moved_m;                     /* of the region by the turn of the tool */
    float turned_rad;                      /* about its normal */
} palp_spring_set;

/* What springs do together. */
typedef struct {
    palp_vec3 force_N;      /* P */
    palp_vec3 moment_Nm;    /* Q along the normal, and P at the region's centre */
    float sticking_N_per_m; /* stiffness of those that do not slip */
    float energy_J;
    bool slipping; /* all of them */
} palp_springs_pull;

/* The load is now such that the contact is z deep. */
void palp_springs_press(palp_springs *springs, float z);

/* z of a region with its normal force, and mu as it is there. */
float palp_springs_depth(const palp_springs *springs);
float palp_springs_coefficient(const palp_springs *springs, const palp_tool *tool);

/* The set for a tool that turns by turn_rad about its reference point. */
void palp_springs_gather(palp_springs *springs, float mu, palp_vec3 turn_rad, palp_spring_set *set);

/* Adds P of springs stretched by by_m more, and its derivative by that, column by column. */
void palp_springs_add(const palp_spring_set *set, palp_vec3 by_m, palp_vec3 *force_N,
                      palp_vec3 slope[3]);

/* Stretches them so, lets slip what reaches its bound, and adds what they do to `pull`. */
void palp_springs_slip(palp_spring_set *set, palp_vec3 by_m, palp_springs_pull *pull);

/* The tool has moved by more_m besides. */
void palp_springs_move(palp_springs *springs, palp_vec3 more_m);

/*
 * The springs of a region of which `at` and `near_m_per_N` are known, after those of the regions
 * that go on in it: all of one of them, or shares of several, or a share of one, such that its
 * force is those shares of theirs. The first leads.
 */
void palp_springs_inherit(palp_springs *springs, const palp_springs *const *from,
                          const float *share, uint32_t count);

#endif
