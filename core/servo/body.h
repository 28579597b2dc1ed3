/* SPDX-License-Identifier: MIT */
/*
 * One face of the three engines to the servo: a body in a scene, and how tools feel it within a share
 * of each period. A closed set of kinds.
 *
 *     elastic    one elastostatic body (green/, contact/): palp_answer
 *     zones      a multizone model (zone/), in the configuration that it is given: palp_answer
 *     dynamic    a body that moves (dyna/): palp_dynamic, each tool on a proxy (haptic/proxy.h)
 *
 * All have the same rules: an answer in the share of the period that the servo leaves, on the finest
 * level that fits; what was degraded is in the report; the energy stored bounds what a hand is given.
 */
#ifndef PALP_SERVO_BODY_H
#define PALP_SERVO_BODY_H

#include "core/haptic/proxy.h"
#include "core/servo/answer.h"
#include "core/servo/dynamic.h"
#include "core/servo/hand.h"

typedef enum { PALP_BODY_ELASTIC, PALP_BODY_ZONES, PALP_BODY_DYNAMIC } palp_body_kind;

/* Pointers are kept. */
typedef struct {
    palp_body_kind kind;
    palp_frame at;           /* of its coordinates in the scene; a rotation */
    const palp_blob *blob;   /* elastic: with a regular part */
    palp_assembly *assembly; /* zones: with a regular part each, posed and settled */
    bool pairs;              /* zones touch each other */
    uint32_t finest;         /* level of contact; below PALP_CONTACT_LEVELS */
    /* dynamic: what palp_dynamic_config says, but for tools, cost, port and tick */
    const palp_tets *tets;
    palp_material material;
    palp_vec3 gravity_m_s2;
    palp_adapt_config adapt;
    uint32_t max_points, most_class;
} palp_body_config;

/* A tool in a tick, in the scene. */
typedef struct {
    palp_frame at; /* where its device holds it */
    palp_vec3 velocity_m_s, turning_rad_s;
    float part; /* of its spring: 0 touches nothing, 1 is all there */
} palp_body_tool;

/* What a tool feels of a body, about its reference point, in the scene. */
typedef struct {
    palp_wrench wrench;
    palp_frame tool; /* where it came to rest */
    float held_J;    /* in its springs, friction or proxy */
    float damped_W, moved_m;
    float brought_J; /* by joints that move the body, in this tick */
    bool touching, slipping;
    bool found; /* where it is about the body is known: else nothing says that it is clear of it */
} palp_body_felt;

/* What a body did in a tick. */
typedef struct {
    uint32_t level, limit; /* of contact; of a dynamic body the level of its finest node
                                            at work, and the finest there is */
    uint32_t points, active,
        iterations; /* contact points; in contact; of the active set, or steps */
    uint32_t flags; /* PALP_CONTACT_ flags; 0 */
    float stored_J; /* by the forces on it; of a dynamic body all of its energy */
    float doubt_N;
    bool held, shortened;
    palp_moving_report moving;   /* zones */
    palp_dynamic_report dynamic; /* dynamic */
} palp_body_report;

/* Shared by all bodies of a scene. */
typedef struct {
    const palp_tool *tools; /* [tool_count], by reference */
    uint32_t tool_count;
    const palp_hand_spring *spring; /* [tool_count] */
    palp_cost_table cost;
    palp_port port;
    float dt_s;
    float before_ns, after_ns; /* of the period: what comes before and after it at least */
} palp_body_room;

typedef struct {
    palp_body_config config;
    uint32_t tool_count;
    const palp_hand_spring *spring;
    float dt_s;
    palp_answer *answer;   /* elastic, zones */
    palp_dynamic *dynamic; /* dynamic */
    palp_proxy proxy[PALP_CONTACT_TOOLS];
    palp_frame held[PALP_CONTACT_TOOLS]; /* of the tick under way */
    palp_coupling_result result[PALP_CONTACT_TOOLS];
    float least_ns, most_ns; /* of a tick: what always has to fit; all that its level allows */
} palp_body;

/* Bytes besides the palp_body itself; 0 for a config out of range. */
size_t palp_body_memsize(const palp_body_config *config, uint32_t tool_count);

/* Errors: those of palp_answer_init or palp_dynamic_init; *bound_ns: with what comes before and after.
 */
palp_status palp_body_init(palp_body *body, const palp_body_config *config,
                           const palp_body_room *room, void *memory, size_t bytes, float *bound_ns);

/* A tick that began at start_ns, tools at tool[tool_count]. */
void palp_body_tick(palp_body *body, uint64_t start_ns, const palp_body_tool *tool,
                    palp_body_felt *felt, palp_body_report *report);

/* Lets all tools go, and forgets what it was in; a dynamic body goes on moving. */
void palp_body_reset(palp_body *body);

/* Time left over in the same period. */
void palp_body_spare(palp_body *body);

#endif
