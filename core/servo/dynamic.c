/* SPDX-License-Identifier: MIT */
#include "dynamic.h"
#include "core/base/arena.h"

/* Operations of the parts, each about two instructions (tests/check/dynamic.sh counts them). */
#define EVALUATION 210.0f
#define NODE_STEP 45.0f
#define SOURCE 24.0f
#define SPOT 260.0f
#define SPOT_STEP 120.0f
#define SKIN 40.0f
#define SKIN_TOOL 60.0f
#define NODE_TICK 30.0f
#define LIST_NODE 40.0f
#define LIST_TET 12.0f
#define LIST_SKIN 20.0f

static void lay_out(palp_arena *a, const palp_tets *t, uint32_t spots, void *part[3],
                    size_t bytes[3]) {
    bytes[0] = palp_dyna_memsize(t);
    bytes[1] = palp_adapt_memsize(t);
    bytes[2] = palp_impose_memsize(t, spots);
    for (uint32_t k = 0; k < 3u; k++) part[k] = palp_take(a, bytes[k], 1);
}

size_t palp_dynamic_memsize(const palp_tets *tets, uint32_t max_spots) {
    palp_arena a = {NULL, 0};
    void *part[3];
    size_t bytes[3];
    lay_out(&a, tets, max_spots, part, bytes);
    return a.used;
}

static float budget_ops(const palp_dynamic *d, float left_ns) {
    return left_ns / d->config.cost.ns_per_operation;
}

static float period_ns(const palp_dynamic_config *c) { return c->cost.margin * c->tick_s * 1e9f; }

/* Everything is split, level by level. */
static void refine_all(palp_dynamic *d) {
    const palp_tets *t = d->dyna.tets;
    for (uint32_t l = 0; l + 1u < t->meta->levels; l++) {
        for (uint32_t f = t->meta->first_family[l]; f < t->meta->first_family[l + 1u]; f++)
            d->dyna.split[f] = 1;
        palp_dyna_relist(&d->dyna);
    }
}

palp_status palp_dynamic_init(palp_dynamic *dynamic, const palp_dynamic_config *config,
                              const palp_vec3 *at_m, void *memory, size_t bytes, float *bound_ns) {
    palp_arena a = {memory, 0};
    void *part[3];
    size_t size[3];
    const palp_dyna_config dyna = {.material = config->material,
                                   .gravity_m_s2 = config->gravity_m_s2,
                                   .tick_s = config->tick_s,
                                   .most_class = config->most_class};
    bool sound = config->cost.ns_per_operation > 0.0f && config->cost.margin > 0.0f &&
                 config->cost.margin <= 1.0f && config->port.now_ns != NULL;
    if (!sound) return PALP_ERR_ARGUMENT;
    if (((uintptr_t)memory & (PALP_ALIGN - 1u)) != 0u) return PALP_ERR_ALIGNMENT;
    if (memory == NULL || palp_dynamic_memsize(config->tets, config->max_spots) > bytes)
        return PALP_ERR_MEMORY;
    lay_out(&a, config->tets, config->max_spots, part, size);
    palp_dynamic *d = dynamic;
    *d = (palp_dynamic){.config = *config};
    palp_status status = palp_dyna_init(&d->dyna, config->tets, &dyna, part[0], size[0]);
    if (status != PALP_OK) return status;
    status = palp_adapt_init(&d->adapt, &d->dyna, &config->adapt, part[1], size[1]);
    if (status != PALP_OK) return status;
    status =
        palp_impose_init(&d->impose, &d->dyna, config->uniform ? NULL : &d->adapt, config->tools,
                         config->tool_count, at_m, config->max_spots, part[2], size[2]);
    if (status != PALP_OK) return status;
    float least = palp_dynamic_cost_least(d) * config->cost.ns_per_operation;
    if (bound_ns != NULL) *bound_ns = least;
    if (least > period_ns(config)) return PALP_ERR_BUDGET;
    if (!config->uniform) return PALP_OK;
    refine_all(d);
    least = palp_dynamic_cost_tick(d, 0) * config->cost.ns_per_operation;
    if (bound_ns != NULL) *bound_ns = least;
    return least > period_ns(config) ? PALP_ERR_BUDGET : PALP_OK;
}

/* ---- bounds ---- */

static float cost_search(const palp_dynamic *d) {
    float tools = (float)d->config.tool_count, spots = (float)d->config.max_spots;
    return (SKIN + SKIN_TOOL * tools) * (float)d->config.tets->meta->skin +
           (float)PALP_IMPOSE_LOOKS * spots * (SPOT + spots);
}

static float cost_steps(const palp_dynamic *d, float steps) {
    const palp_dyna *b = &d->dyna;
    return steps * (NODE_STEP * (float)b->active_count + SOURCE * (float)b->follow_terms +
                    SPOT_STEP * (float)d->config.max_spots);
}

static float cost_lists(const palp_tets *t) {
    const palp_tets_meta *m = t->meta;
    return LIST_NODE * (float)m->nodes + LIST_TET * (float)m->tets + LIST_SKIN * (float)m->skin +
           SOURCE * (float)t->mean_offset[m->nodes];
}

float palp_dynamic_cost_adapt(const palp_dynamic *dynamic) {
    const palp_tets_meta *m = dynamic->config.tets->meta;
    float nodes = (float)m->nodes, families = (float)m->families;
    return 12.0f * nodes + 8.0f * families +
           (float)dynamic->adapt.config.max_changes * 8.0f * families +
           24.0f * (float)dynamic->adapt.config.max_looks + cost_lists(dynamic->config.tets);
}

float palp_dynamic_cost_tick(const palp_dynamic *dynamic, uint32_t most_class) {
    const palp_dyna *b = &dynamic->dyna;
    return cost_search(dynamic) + EVALUATION * (float)palp_dyna_work(b, most_class) +
           cost_steps(dynamic, (float)palp_dyna_steps(b, most_class)) +
           NODE_TICK * (float)b->active_count + palp_dynamic_cost_adapt(dynamic);
}

/* All means, and lists. */
static float cost_collapse(const palp_tets *t) {
    return cost_lists(t) + SOURCE * (float)t->mean_offset[t->meta->nodes];
}

float palp_dynamic_cost_least(const palp_dynamic *dynamic) {
    const palp_tets_meta *m = dynamic->config.tets->meta;
    float nodes = (float)m->first_node[1];
    float tets = (float)((m->first_tet[1] + PALP_LANES - 1u) / PALP_LANES * PALP_LANES);
    float after = palp_max(palp_dynamic_cost_adapt(dynamic), cost_collapse(dynamic->config.tets));
    return cost_search(dynamic) + EVALUATION * tets + (NODE_STEP + NODE_TICK) * nodes +
           SPOT_STEP * (float)dynamic->config.max_spots + SOURCE * 4.0f * (float)m->nodes + after;
}

/* ---- the tick ---- */

static float left_ns(const palp_dynamic *d, uint64_t start_ns) {
    uint64_t now_ns = d->config.port.now_ns(d->config.port.context);
    float gone = now_ns > start_ns ? (float)(now_ns - start_ns) : 0.0f;
    return period_ns(&d->config) - gone;
}

/* The finest steps that fit; collapses when none does. False if not even that fits. */
static bool choose(palp_dynamic *d, float ops, uint32_t *most_class, palp_dynamic_report *r) {
    *most_class = d->dyna.top_class;
    for (;; (*most_class)--) {
        if (palp_dynamic_cost_tick(d, *most_class) <= ops) break;
        r->shortened = true;
        if (*most_class == 0u) {
            if (palp_dynamic_cost_least(d) > ops) return false;
            palp_dyna_collapse(&d->dyna);
            d->work += (uint64_t)cost_collapse(d->config.tets);
            r->collapsed = true;
            d->changed = true;
            break;
        }
    }
    return true;
}

/* What the budget leaves beside a tick on the finest steps; each evaluation comes with its share of
 * nodes and interface. */
static palp_adapt_room room_left(const palp_dynamic *d) {
    float whole = budget_ops(d, period_ns(&d->config));
    return (palp_adapt_room){.spare = whole - palp_dynamic_cost_tick(d, d->dyna.top_class),
                             .per_evaluation = EVALUATION + NODE_STEP + 4.0f * SOURCE,
                             .per_step = cost_steps(d, 1.0f)};
}

static void count_nodes(const palp_dynamic *d, palp_dynamic_report *r) {
    const palp_tets_meta *m = d->config.tets->meta;
    uint32_t level = 0;
    for (uint32_t i = 0; i < d->dyna.active_count; i++) {
        while (d->dyna.active[i] >= m->first_node[level + 1u]) level++;
        r->active[level]++;
    }
    r->elements = d->dyna.element_count;
    r->interface = d->dyna.up_count + d->dyna.down_count;
}

static float work_of_tools(const palp_impose *p, const palp_vec3 *force_N) {
    float sum = 0.0f;
    for (uint32_t t = 0; t < p->tool_count; t++)
        sum -= palp_dot(force_N[t], palp_sub(p->to_m[t], p->from_m[t]));
    return sum;
}

static void run(palp_dynamic *d, uint32_t most_class, const palp_vec3 *tool_m,
                palp_dynamic_report *r) {
    uint64_t before = d->dyna.evaluations;
    uint64_t overflow = d->impose.overflow;
    palp_impose_begin(&d->impose, tool_m);
    r->steps = palp_dyna_steps(&d->dyna, most_class);
    for (uint32_t s = 0; s < r->steps; s++) {
        palp_dyna_forces(&d->dyna, s, r->steps);
        palp_dyna_move(&d->dyna, r->steps);
        palp_impose_step(&d->impose, s, r->steps);
        palp_dyna_follow(&d->dyna);
    }
    palp_impose_end(&d->impose, d->force_N);
    r->evaluations = (uint32_t)(d->dyna.evaluations - before);
    r->spots = d->impose.count;
    r->inside = d->impose.inside;
    r->overflow = (uint32_t)(d->impose.overflow - overflow);
    d->work +=
        (uint64_t)(cost_search(d) + EVALUATION * (float)palp_dyna_work(&d->dyna, most_class) +
                   cost_steps(d, (float)r->steps) + NODE_TICK * (float)d->dyna.active_count);
}

/* Numbers beyond what floats hold: the body is put back to rest, and nothing is felt. */
static void begin_again(palp_dynamic *d, palp_dynamic_report *r) {
    palp_adapt_reset(&d->adapt);
    if (d->config.uniform) refine_all(d);
    d->energy.allowed_J = d->energy.kinetic_J = d->energy.total_J = 0.0f;
    for (uint32_t t = 0; t < d->config.tool_count; t++)
        d->force_N[t] = (palp_vec3){0.0f, 0.0f, 0.0f};
    r->lost = true;
}

void palp_dynamic_tick(palp_dynamic *dynamic, uint64_t start_ns, const palp_vec3 *tool_m,
                       palp_vec3 *force_N, palp_dynamic_report *report) {
    palp_dynamic *d = dynamic;
    uint32_t most_class;
    *report = (palp_dynamic_report){.steps = 0};
    if (choose(d, budget_ops(d, left_ns(d, start_ns)), &most_class, report)) {
        report->bound = palp_dynamic_cost_tick(d, most_class);
        if (report->collapsed)
            report->bound += cost_collapse(d->config.tets) - palp_dynamic_cost_adapt(d);
        run(d, most_class, tool_m, report);
        report->calmed = palp_energy_watch(&d->energy, &d->dyna,
                                           work_of_tools(&d->impose, d->force_N), d->changed);
        d->changed = false;
        if (!palp_is_finite(d->energy.total_J)) begin_again(d, report);
        if (!d->config.uniform && !report->collapsed) {
            report->adapt = palp_adapt_tick(&d->adapt, room_left(d));
            d->changed = report->adapt.splits + report->adapt.merges > 0u;
            d->work += (uint64_t)(palp_dynamic_cost_adapt(d) -
                                  (d->changed ? 0.0f : cost_lists(d->config.tets)));
        }
    } else {
        report->coasted = true;
    }
    for (uint32_t t = 0; t < d->config.tool_count; t++) force_N[t] = d->force_N[t];
    report->kinetic_J = d->energy.kinetic_J;
    report->total_J = d->energy.total_J;
    count_nodes(d, report);
}
