/* SPDX-License-Identifier: MIT */
/*
 * The answer of a tick in bounded time: contact on the surface, friction and coupling of one or
 * several tools within a share of each period.
 *
 * What a level takes is known before it is begun (contact/cost.h), so a tick works on the finest
 * level that always fits the period, and nothing else decides the level. When time is missing at
 * the start or in the middle of a tick, because the machine was busy with something else, the level
 * stays: the tick goes on as the last contact foresees (haptic/coupling.h), and the next one solves
 * again. Only when time has been missing for PALP_ANSWER_PATIENCE_S does the level give way, fewer
 * points first, then fewer modes; it comes back when ticks have had time for PALP_ANSWER_CALM_S,
 * twice as late each time that it did not last.
 *
 * Of a multizone model a tick first keeps the seams up with the configuration (moving.h), on the
 * finest level that leaves time for the contact. The least answer has time for one pair of zones
 * that touch each other; on the coarsest level those that there is no time for are left out.
 */
#ifndef PALP_SERVO_ANSWER_H
#define PALP_SERVO_ANSWER_H

#include "core/contact/cost.h"
#include "core/haptic/coupling.h"
#include "core/servo/moving.h"

#define PALP_ANSWER_PATIENCE_S 0.02f
#define PALP_ANSWER_CALM_S 0.2f
#define PALP_ANSWER_MISSES 8u     /* ticks in which a contact that was lost is searched again */
#define PALP_ANSWER_ITERATIONS 3u /* of the active set for which there is always time */

typedef struct {
    palp_contact_config contact;
    palp_cost_table cost;
    palp_port port;
    float dt_s;                /* above 0 */
    float before_ns, after_ns; /* of the period: what the caller does before and after the answer */
} palp_answer_config;

typedef struct {
    palp_answer_config config;
    palp_contact_cost bound; /* in ns */
    palp_contact contact;
    palp_moving moving;     /* of a multizone model */
    palp_coupling coupling; /* the caller sets stiffness and damping of each tool after init */
    float least_ns[PALP_CONTACT_LEVELS]; /* that an answer on each level always needs */
    float tail_ns;                       /* kept back for the end of a tick */
    uint64_t start_ns;                   /* of the tick under way */
    uint32_t limit;                      /* finest level that always fits the period */
    uint32_t held_in_a_row, calm, calm_wanted;
    uint32_t missed; /* ticks in a row in which a contact was not found again */
    palp_vec3 solved_N[PALP_CONTACT_TOOLS]; /* on the devices, when last solved */
    uint64_t held, coarsened, refined;      /* ticks, changes so far */
} palp_answer;

typedef struct {
    uint32_t level, flags; /* PALP_CONTACT_ flags */
    uint32_t points, active, iterations;
    palp_moving_report moving; /* of a multizone model */
    float doubt_N;             /* by how much the largest force of a tool may be off, see below */
    bool held;      /* went on as foreseen: no time for a contact, none found, or none settled */
    bool shortened; /* did less than it would have with more time */
} palp_answer_report;

/* Bytes for the answer: by what it touches (palp_contact_memsize); and on any body, as a constant
 * for static memory. */
size_t palp_answer_memsize(const palp_contact_config *contact);
#define PALP_ANSWER_BYTES(tools, finest) PALP_CONTACT_BYTES(tools, finest)

/*
 * Errors: those of palp_contact_init; ARGUMENT also for an unsound cost table, a target without
 * prices for contact on the surface, no clock or dt_s <= 0; BUDGET when the coarsest level does not
 * fit the period: *bound_ns (may be NULL) then says how much time it needs.
 */
palp_status palp_answer_init(palp_answer *answer, const palp_answer_config *config, void *memory,
                             size_t bytes, float *bound_ns);

/* Lets everything go. */
void palp_answer_reset(palp_answer *answer);

/* Takes joint values and the place of zone 0 of a multizone model, for the next tick. */
void palp_answer_pose(palp_answer *answer, const float *value, const palp_frame *root);

/* Time left over in the same period: finer factors of the seams. */
void palp_answer_spare(palp_answer *answer);

/* Multiply-adds and look-ups counted so far. */
uint64_t palp_answer_work(const palp_answer *answer);

/*
 * A tick that began at start_ns on the port's clock, with the devices at device[tool_count].
 *
 * report->doubt_N is an estimate: the largest error of the level in use against the finest one in
 * the presses that bake made (palp_regular.level_error), times the force; and when the tick was
 * held, half of what the force has changed by since a contact was last solved.
 */
void palp_answer_tick(palp_answer *answer, uint64_t start_ns, const palp_frame *device,
                      palp_coupling_result *result, palp_answer_report *report);

/* What surrounds the contact in a tick: TICK + QUANTUM + tools (COUPLE + LEAVE +
 * PALP_COUPLING_SEARCHED SOUGHT) + samples of their faces SOUGHT. Seams: palp_moving_least. */
float palp_answer_cost_around(const palp_contact_cost *cost);
/* The bound of a whole tick on a level (unit of the prices): all that its points allow. */
float palp_answer_cost_full(const palp_contact_cost *cost, uint32_t level);
/* The same with one filling for each tool, or of a multizone model for as many patches as there are
 * tools, and one between zones; and PALP_ANSWER_ITERATIONS. */
float palp_answer_cost_least(const palp_contact_cost *cost, uint32_t level);

#endif
