/* SPDX-License-Identifier: MIT */
#include "dynamic.h"
#include "core/base/apart.h"
#include "core/base/arena.h"
#include "core/contact/cost.h"

#define PRICE(d, kind) ((d)->price.of[PALP_WORK_##kind])

static void lay_out(palp_arena *a, const palp_tets *t, uint32_t points, void *part[3],
                    size_t bytes[3]) {
    bytes[0] = palp_dyna_memsize(t);
    bytes[1] = palp_adapt_memsize(t);
    bytes[2] = palp_impose_memsize(t, points);
    for (uint32_t k = 0; k < 3u; k++) part[k] = palp_take(a, bytes[k], 1);
}

size_t palp_dynamic_memsize(const palp_tets *tets, uint32_t max_points) {
    palp_arena a = {NULL, 0};
    void *part[3];
    size_t bytes[3];
    lay_out(&a, tets, max_points, part, bytes);
    return a.used;
}

static float period_ns(const palp_dynamic_config *c) { return c->cost.margin * c->tick_s * 1e9f; }

/* Everything is split, level by level. */
PALP_APART void palp_dynamic_refine_all(palp_dynamic *d) {
    const palp_tets *t = d->dyna.tets;
    for (uint32_t l = 0; l + 1u < t->meta->levels; l++) {
        for (uint32_t f = t->meta->first_family[l]; f < t->meta->first_family[l + 1u]; f++)
            d->dyna.split[f] = 1;
        palp_dyna_relist(&d->dyna);
    }
}

palp_status palp_dynamic_init(palp_dynamic *d, const palp_dynamic_config *config,
                              const palp_frame *at, void *memory, size_t bytes, float *bound_ns) {
    palp_arena a = {memory, 0};
    void *part[3];
    size_t size[3];
    const palp_dyna_config dyna = {.material = config->material,
                                   .gravity_m_s2 = config->gravity_m_s2,
                                   .tick_s = config->tick_s,
                                   .most_class = config->most_class};
    if (!palp_cost_table_is_sound(&config->cost) || config->port.now_ns == NULL)
        return PALP_ERR_ARGUMENT;
    palp_status status =
        palp_check_block(memory, bytes, palp_dynamic_memsize(config->tets, config->max_points));
    if (status != PALP_OK) return status;
    lay_out(&a, config->tets, config->max_points, part, size);
    *d = (palp_dynamic){.config = *config, .price = palp_prices_of(&config->cost)};
    status = palp_dyna_init(&d->dyna, config->tets, &dyna, part[0], size[0]);
    if (status != PALP_OK) return status;
    status = palp_adapt_init(&d->adapt, &d->dyna, &config->adapt, part[1], size[1]);
    if (status != PALP_OK) return status;
    const palp_impose_config impose = {.dyna = &d->dyna,
                                       .adapt = config->uniform ? NULL : &d->adapt,
                                       .tools = config->tools,
                                       .tool_count = config->tool_count,
                                       .at = at,
                                       .max_points = config->max_points};
    status = palp_impose_init(&d->impose, &impose, part[2], size[2]);
    if (status != PALP_OK) return status;
    float least = palp_dynamic_cost_least(d);
    if (bound_ns != NULL) *bound_ns = least;
    if (least > period_ns(config)) return PALP_ERR_BUDGET;
    if (!config->uniform) return PALP_OK;
    palp_dynamic_refine_all(d);
    least = palp_dynamic_cost_tick(d, 0);
    if (bound_ns != NULL) *bound_ns = least;
    return least > period_ns(config) ? PALP_ERR_BUDGET : PALP_OK;
}

/* ---- bounds ---- */

/* Of the most expensive tool. */
static float cost_evaluation(const palp_dynamic *d) {
    float most = 0.0f;
    for (uint32_t t = 0; t < d->config.tool_count; t++)
        most = palp_max(most, palp_contact_cost_evaluation(&d->config.tools[t], &d->price));
    return most;
}

static float cost_search(const palp_dynamic *d) {
    const float tools = (float)d->config.tool_count, points = (float)d->config.max_points;
    const float held = (float)d->config.tets->meta->levels * (float)(d->adapt.most_parents + 1u);
    return (PRICE(d, SKIN) + PRICE(d, SKIN_TOOL) * tools + PRICE(d, ELEMENT_TEST) * held) *
               (float)d->config.tets->meta->skin +
           (float)PALP_IMPOSE_NARROW_TESTS * points *
               (PRICE(d, NARROW) + cost_evaluation(d) + PRICE(d, ROOM) * points);
}

/* Of one point in one step. */
static float cost_imposed(const palp_dynamic *d) {
    bool rubs = false;
    for (uint32_t t = 0; t < d->config.tool_count; t++)
        rubs = rubs || d->config.tools[t].friction > 0.0f;
    return (rubs ? PALP_IMPOSE_RUBS : 1.0f) * PRICE(d, IMPOSED) + cost_evaluation(d);
}

static float cost_steps(const palp_dynamic *d, float steps) {
    const palp_dyna *b = &d->dyna;
    return steps * (PRICE(d, NODE_STEP) * (float)b->active_count +
                    PRICE(d, SOURCE) * (float)b->interpolation_terms +
                    cost_imposed(d) * (float)d->config.max_points);
}

static float cost_lists(const palp_dynamic *d) {
    const palp_tets *t = d->config.tets;
    const palp_tets_meta *m = t->meta;
    return PRICE(d, LIST_NODE) * (float)m->nodes + PRICE(d, LIST_TET) * (float)m->tets +
           PRICE(d, LIST_SKIN) * (float)m->skin +
           PRICE(d, SOURCE) * (float)t->mean_offset[m->nodes];
}

float palp_dynamic_cost_adapt(const palp_dynamic *d) {
    const float families = (float)d->config.tets->meta->families;
    const float changes = (float)d->adapt.config.max_changes;
    /* merges are looked for, then splits, and merges that make room for these */
    return PRICE(d, FAMILY) * families * (2.0f * changes + 2.0f) +
           PRICE(d, ELEMENT_TEST) * (float)d->adapt.config.max_element_tests +
           changes * (PRICE(d, NODE_STEP) * (float)d->adapt.most_nodes +
                      PRICE(d, SOURCE) * (float)d->adapt.most_terms) +
           (d->config.uniform ? (float)d->config.tets->meta->levels : 1.0f) * cost_lists(d);
}

float palp_dynamic_cost_tick(const palp_dynamic *d, uint32_t most_class) {
    const palp_dyna *b = &d->dyna;
    return PRICE(d, TICK) + cost_search(d) +
           PRICE(d, ELEMENT) * (float)palp_dyna_work(b, most_class) +
           cost_steps(d, (float)palp_dyna_steps(b, most_class)) +
           PRICE(d, NODE_TICK) * (float)d->config.tets->meta->nodes + palp_dynamic_cost_adapt(d);
}

/* All means, and lists. */
float palp_dynamic_cost_collapse(const palp_dynamic *d) {
    const palp_tets *t = d->config.tets;
    return cost_lists(d) + PRICE(d, SOURCE) * (float)t->mean_offset[t->meta->nodes];
}

float palp_dynamic_cost_least(const palp_dynamic *d) {
    const palp_tets_meta *m = d->config.tets->meta;
    float tets = (float)((m->first_tet[1] + PALP_LANES - 1u) / PALP_LANES * PALP_LANES);
    float after = palp_max(palp_dynamic_cost_adapt(d), palp_dynamic_cost_collapse(d));
    return PRICE(d, TICK) + cost_search(d) + PRICE(d, ELEMENT) * tets +
           PRICE(d, NODE_STEP) * (float)m->first_node[1] + PRICE(d, NODE_TICK) * (float)m->nodes +
           cost_imposed(d) * (float)d->config.max_points +
           PRICE(d, SOURCE) * 4.0f * (float)m->nodes + after;
}

/* ---- the tick ---- */

static float left_ns(const palp_dynamic *d, uint64_t start_ns) {
    return period_ns(&d->config) -
           palp_elapsed_ns(start_ns, d->config.port.now_ns(d->config.port.context));
}

/* The finest steps that fit; collapses when none does. False if not even that fits. */
static bool choose(palp_dynamic *d, float left_ns, uint32_t *most_class, palp_dynamic_report *r) {
    *most_class = d->dyna.top_class;
    /* at most most_class: ends at 0 */
    for (;; (*most_class)--) {
        if (palp_dynamic_cost_tick(d, *most_class) <= left_ns) break;
        r->shortened = true;
        if (*most_class == 0u) {
            if (palp_dynamic_cost_least(d) > left_ns) return false;
            palp_dyna_collapse(&d->dyna);
            d->work_ns += (uint32_t)palp_dynamic_cost_collapse(d);
            r->collapsed = true;
            d->changed = true;
            break;
        }
    }
    return true;
}

/* What a tick on the finest steps leaves of the budget. An evaluation counts with its share of
 * nodes and of the interface. */
static palp_adapt_room room_left(const palp_dynamic *d) {
    float whole = period_ns(&d->config);
    return (palp_adapt_room){.spare = whole - palp_dynamic_cost_tick(d, d->dyna.top_class),
                             .per_evaluation =
                                 PRICE(d, ELEMENT) + PRICE(d, NODE_STEP) + 4.0f * PRICE(d, SOURCE),
                             .per_step = cost_steps(d, 1.0f)};
}

static void count_nodes(const palp_dynamic *d, palp_dynamic_report *r) {
    const palp_tets_meta *m = d->config.tets->meta;
    uint32_t level = 0;
    for (uint32_t i = 0; i < d->dyna.active_count; i++) {
        /* at most levels in all of count_nodes */
        while (d->dyna.active[i] >= m->first_node[level + 1u]) level++;
        r->active[level]++;
    }
    r->elements = d->dyna.element_count;
    r->interface = d->dyna.up_count + d->dyna.down_count;
}

static float work_of_tools(const palp_impose *p, const palp_wrench *on_tool) {
    float sum = 0.0f;
    for (uint32_t t = 0; t < p->tool_count; t++)
        sum -= palp_dot(on_tool[t].force_N, palp_sub(p->to[t].t, p->from[t].t)) +
               palp_dot(on_tool[t].moment_Nm, p->turn_rad[t]);
    return sum;
}

static void run(palp_dynamic *d, uint32_t most_class, const palp_frame *tool,
                palp_dynamic_report *r) {
    uint64_t before = d->dyna.evaluations;
    uint64_t overflow = d->impose.overflow;
    palp_impose_begin(&d->impose, tool);
    r->steps = palp_dyna_steps(&d->dyna, most_class);
    for (uint32_t s = 0; s < r->steps; s++) {
        palp_dyna_forces(&d->dyna, s, r->steps);
        palp_dyna_move(&d->dyna, r->steps);
        palp_impose_step(&d->impose, s, r->steps);
        palp_dyna_interpolate(&d->dyna);
    }
    palp_impose_end(&d->impose, d->on_tool);
    r->evaluations = (uint32_t)(d->dyna.evaluations - before);
    r->points = d->impose.count;
    r->inside = d->impose.inside;
    r->overflow = (uint32_t)(d->impose.overflow - overflow);
    d->work_ns += (uint32_t)(palp_dynamic_cost_tick(d, most_class) - palp_dynamic_cost_adapt(d));
}

/* Numbers that a float cannot hold: the body is put back to rest, with zero force. */
static void begin_again(palp_dynamic *d, palp_dynamic_report *r) {
    palp_adapt_reset(&d->adapt);
    if (d->config.uniform) palp_dynamic_refine_all(d);
    d->energy.allowed_J = d->energy.kinetic_J = d->energy.total_J = 0.0f;
    for (uint32_t t = 0; t < d->config.tool_count; t++)
        d->on_tool[t] = (palp_wrench){.force_N = {0.0f, 0.0f, 0.0f}};
    r->lost = true;
}

void palp_dynamic_tick(palp_dynamic *d, uint64_t start_ns, const palp_frame *tool,
                       palp_wrench *on_tool, palp_dynamic_report *report) {
    uint32_t most_class;
    *report = (palp_dynamic_report){.steps = 0};
    if (choose(d, left_ns(d, start_ns), &most_class, report)) {
        report->bound_ns = palp_dynamic_cost_tick(d, most_class);
        if (report->collapsed)
            report->bound_ns += palp_dynamic_cost_collapse(d) - palp_dynamic_cost_adapt(d);
        run(d, most_class, tool, report);
        report->energy_limited = palp_energy_watch(
            &d->energy, &d->dyna, work_of_tools(&d->impose, d->on_tool), d->changed);
        d->changed = false;
        if (!palp_is_finite(d->energy.total_J)) begin_again(d, report);
        if (!d->config.uniform && !report->collapsed && !report->lost) {
            report->adapt = palp_adapt_tick(&d->adapt, room_left(d));
            d->changed = report->adapt.splits + report->adapt.merges > 0u;
            d->work_ns +=
                (uint32_t)(palp_dynamic_cost_adapt(d) - (d->changed ? 0.0f : cost_lists(d)));
        }
    } else {
        report->coasted = true;
    }
    for (uint32_t t = 0; t < d->config.tool_count; t++) on_tool[t] = d->on_tool[t];
    report->kinetic_J = d->energy.kinetic_J;
    report->total_J = d->energy.total_J;
    count_nodes(d, report);
}
