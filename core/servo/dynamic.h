/* SPDX-License-Identifier: MIT */
/*
 * The bounded tick of a dynamic body (AD 3.3, "guaranteed frame rate").
 *
 *   tick   as small steps as fit the time left: the filter makes larger ones admissible
 *          if not even one step of the whole tick fits, everything merges to the coarsest mesh
 *          forces, motion, tools, interface, step by step; force handed back as the mean
 *          energy monitor, then splits and merges within what the budget can carry
 *
 * Every part has a bound that is known before the tick begins, so nothing has to be
 * aborted on the way. A tick that begins too late for the coarsest answer repeats its force and
 * leaves the body as it is; that is counted.
 */
#ifndef PALP_SERVO_DYNAMIC_H
#define PALP_SERVO_DYNAMIC_H

#include "core/dyna/energy.h"
#include "core/servo/budget.h"
#include "core/contact/impose.h"

/* Pointers are kept. */
typedef struct {
    const palp_tets *tets;
    palp_material material; /* mu, density above 0; 3 lambda + 2 mu above 0, and with phi, psi at
                               least 0 */
    palp_vec3 gravity_m_s2;
    palp_adapt_config adapt;
    const palp_tool *tools; /* [tool_count], as palp_tool_is_sound */
    uint32_t tool_count;    /* 1 to PALP_CONTACT_TOOLS */
    uint32_t max_points; /* vertices of the skin that tools move at a time: 1 to PALP_MAX_NODES */
    uint32_t most_class; /* finest step: tick_s / 2^most_class; below PALP_STEP_CLASSES */
    palp_cost_table cost;
    palp_port port;
    float tick_s; /* above 0 */
    bool uniform; /* everything on the finest mesh, no adaptivity: for comparison */
} palp_dynamic_config;

typedef struct {
    uint32_t steps, evaluations;      /* of this tick */
    uint32_t active[PALP_TET_LEVELS]; /* nodes at the end, by level */
    uint32_t elements, interface;     /* at work, at the end */
    palp_adapt_report adapt;
    uint32_t points, inside, overflow; /* of the tools */
    bool shortened;                    /* larger steps than the material asks for, to be in time */
    bool collapsed;                    /* merged to the coarsest mesh to be in time */
    bool coasted;        /* began too late: the force is the last one, the body stands still */
    bool energy_limited; /* the energy monitor took something out */
    bool lost;           /* the motion was not finite any more: the body was put back to rest */
    float kinetic_J, total_J;
    float bound_ns; /* that this tick could take at most */
} palp_dynamic_report;

typedef struct {
    palp_dynamic_config config;
    palp_prices price; /* in ns */
    palp_dyna dyna;
    palp_adapt adapt;
    palp_impose impose;
    palp_energy energy;
    palp_wrench on_tool[PALP_CONTACT_TOOLS];
    bool changed;     /* families split or merged at the end of the last tick */
    uint64_t work_ns; /* bounds of what was done so far */
} palp_dynamic;

/* Bytes for a dynamic body and its tools: by its counts (palp info prints them), as a constant for
 * static memory; and of this body. */
#define PALP_DYNAMIC_BYTES(nodes, tets, families, skin, max_points)                                \
    (96u * (size_t)(nodes) + 5u * (size_t)(tets) + 15u * (size_t)(families) +                      \
     2u * (size_t)(skin) + (size_t)(max_points) * sizeof(palp_imposed) + 4096u)
size_t palp_dynamic_memsize(const palp_tets *tets, uint32_t max_points);

/*
 * Tools begin at at_m[tool_count], which is not kept. Errors: ARGUMENT (the config out of its
 * ranges), MEMORY, ALIGNMENT, and BUDGET when the coarsest mesh with one step does not fit the
 * period (or, uniform, the finest with one step); *bound_ns (may be NULL) then says how much time
 * it needs.
 */
palp_status palp_dynamic_init(palp_dynamic *dynamic, const palp_dynamic_config *config,
                              const palp_frame *at, void *memory, size_t bytes, float *bound_ns);

/*
 * Bounds in ns: sums of named counts times prices (budget/price.h), names of prices in capitals.
 *
 * Of a tick as the body stands, with steps no finer than most_class: TICK + skin (SKIN + tools
 * SKIN_TOOL) + 8 points (NARROW + points ROOM) + elements due ELEMENT + steps (active NODE_STEP +
 * sources of interface nodes SOURCE + points IMPOSED) + nodes NODE_TICK, and
 * palp_dynamic_cost_adapt.
 */
float palp_dynamic_cost_tick(const palp_dynamic *dynamic, uint32_t most_class);

/* Of measures and changes: families (1 + changes) FAMILY + element tests ELEMENT_TEST, and once the
 * lists, nodes LIST_NODE + tets LIST_TET + skin LIST_SKIN + means SOURCE. */
float palp_dynamic_cost_adapt(const palp_dynamic *dynamic);

/* The coarsest mesh with one step, and adaptivity or the collapse to it: what always has to fit. */
float palp_dynamic_cost_least(const palp_dynamic *dynamic);

/* All means and lists, which palp_dyna_collapse takes. */
float palp_dynamic_cost_collapse(const palp_dynamic *dynamic);

/* Splits everything, level by level: for comparison, and to know what that would cost. */
void palp_dynamic_refine_all(palp_dynamic *dynamic);

/* A tick that began at start_ns on the port's clock, tools at tool[tool_count] at its end; what
 * they feel of the body in on_tool[tool_count]. */
void palp_dynamic_tick(palp_dynamic *dynamic, uint64_t start_ns, const palp_frame *tool,
                       palp_wrench *on_tool, palp_dynamic_report *report);

#endif
