/* SPDX-License-Identifier: MIT */
/*
 * What the formulas of core say (contact/cost.h, green/cost.h, zone/seams.h, servo/answer.h, servo/dynamic.h), as how many of each
 * kind of work they count, beside the counts that they were asked for: formulas SEED DRAWS BLOB... On each line an operation, the kind of
 * tool, counts as NAME=VALUE, a bar, and KIND:NUMBER of what is not 0. ipet.py holds them against the machine code.
 *
 * Counts are those of the blob, and others drawn at random from all that there may be: a formula must hold for any.
 */
#include "core/green/cost.h"
#include "core/palp.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static uint32_t draws;
static uint64_t state;
static uint32_t below(uint32_t n) {
    state ^= state << 13, state ^= state >> 7, state ^= state << 17;
    return (uint32_t)(state >> 33) % n;
}

typedef float (*formula)(const palp_prices *price, const void *of);

static void tell(const char *operation, const char *tool, const char *counts, formula f,
                 const void *of) {
    printf("%s %s %s |", operation, tool, counts);
    for (uint32_t k = 0; k < PALP_WORKS; k++) {
        palp_prices one = {{0}};
        one.of[k] = 1.0f;
        const float n = f(&one, of);
        if (n > 0.0f) printf(" %u:%.9g", k, (double)n);
    }
    printf("\n");
}

/* ---- contact on one body ---- */

typedef struct {
    palp_contact_cost cost; /* of the body and tools, at no prices */
    palp_tool tool[PALP_CONTACT_TOOLS];
    uint32_t tools, ring, ring_nodes, nodes, visits, level, count, active;
} contact_case;

static palp_contact_cost cost_at(const palp_prices *price, const contact_case *c) {
    palp_contact_cost k = palp_contact_cost_at(&c->cost, c->tool, price);
    k.ring = (float)c->ring;
    k.rings[c->level] = (float)c->ring_nodes;
    k.nodes = k.presser[0].nodes = (float)c->nodes;
    k.visits = k.presser[0].visits = (float)c->visits;
    return k;
}

static float of_fill(const palp_prices *price, const void *of) {
    const contact_case *c = of;
    const palp_contact_cost k = cost_at(price, c);
    return palp_contact_cost_fill_by(&k, palp_contact_cost_level(&k, c->level), 0);
}
static float of_points(const palp_prices *price, const void *of) {
    const contact_case *c = of;
    const palp_contact_cost k = cost_at(price, c);
    return palp_contact_cost_points(&k, palp_contact_cost_level(&k, c->level), c->count);
}
static float of_assemble(const palp_prices *price, const void *of) {
    const contact_case *c = of;
    const palp_contact_cost k = cost_at(price, c);
    return palp_contact_cost_assemble(&k, palp_contact_cost_level(&k, c->level), c->count);
}
static float of_iterate(const palp_prices *price, const void *of) {
    const contact_case *c = of;
    const palp_contact_cost k = cost_at(price, c);
    return palp_contact_cost_iterate(&k, c->count, c->active, 1);
}
static float of_finish(const palp_prices *price, const void *of) {
    const contact_case *c = of;
    const palp_contact_cost k = cost_at(price, c);
    return palp_contact_cost_finish(&k, palp_contact_cost_level(&k, c->level), c->count, c->active);
}
static float of_around(const palp_prices *price, const void *of) {
    const palp_contact_cost k = cost_at(price, of);
    return palp_answer_cost_around(&k);
}

typedef struct {
    const contact_case *c;
    palp_lattice_counts done;
} filled_case;

static float of_filled(const palp_prices *price, const void *of) {
    const filled_case *f = of;
    const palp_contact_cost k = cost_at(price, f->c);
    return palp_contact_cost_filled(&k, f->done);
}

typedef struct {
    const contact_case *c;
    uint32_t readings;
} glue_case;

/* What surrounds the steps of a tick, with so many of them. */
static float of_glue(const palp_prices *price, const void *of) {
    const glue_case *g = of;
    return of_around(price, g->c) + (float)g->readings * price->of[PALP_WORK_QUANTUM];
}

/* One of them. */
static float of_quantum(const palp_prices *price, const void *unused) {
    (void)unused;
    return price->of[PALP_WORK_QUANTUM];
}

static palp_tool tool_of(uint32_t kind, float friction) {
    static const float flat[64u * 64u];
    palp_tool t = palp_tool_sphere(0.01f);
    const palp_vec3 x = {1.0f, 0.0f, 0.0f}, y = {0.0f, 1.0f, 0.0f}, z = {0.0f, 0.0f, 1.0f};
    if (kind == 0u) {
        t.balls = 1u + below(PALP_TOOL_BALLS);
        for (uint32_t i = 0; i < t.balls; i++) t.ball[i] = t.ball[0];
    } else if (kind == 1u) {
        t = palp_tool_capsule(z, 0.02f, 0.01f);
    } else if (kind == 2u) {
        t.shape = PALP_TOOL_PAD;
        t.pad = (palp_pad){.axis = {x, y, z}, .half_m = {0.01f, 0.01f}, .edge_m = 0.004f};
        t.pad.columns = below(2u) * below(65u);
        t.pad.rows = t.pad.columns > 0u ? 1u + below(64u) : 0u;
        t.pad.height_m = flat;
    } else {
        t.shape = PALP_TOOL_FIELD;
        t.field.size_m = 0.01f;
        t.field.extremes = below(65u);
    }
    t.friction = friction;
    return t;
}

static void of_contact(const palp_blob *blob) {
    static const char *const kinds[] = {"balls", "cylinder", "pad", "field"};
    char counts[600];
    const uint32_t random = 4u * PALP_CONTACT_LEVELS * draws;
    for (uint32_t draw = 0; draw < random + 6u * PALP_CONTACT_LEVELS; draw++) {
        const bool own = draw >= random; /* the counts of this body, not of any other */
        contact_case c = {.level = draw % PALP_CONTACT_LEVELS,
                          .tools = own ? 1u : 1u + below(PALP_CONTACT_TOOLS)};
        const uint32_t kind = draw / PALP_CONTACT_LEVELS % (own ? 3u : 4u);
        const float friction = below(2u) == 0u ? 0.3f : 0.0f;
        for (uint32_t t = 0; t < c.tools; t++)
            c.tool[t] = t == 0u ? tool_of(kind, friction) : c.tool[0];
        if (own && kind == 0u) c.tool[0] = palp_tool_sphere(2.0f * blob->meta->mean_edge_m);
        c.tool[0].friction = friction;
        const palp_prices none = {{0}};
        c.cost = palp_contact_cost_of(blob, c.tool, c.tools, &none);
        const palp_contact_cost here = c.cost;
        c.ring = own ? (uint32_t)here.ring : 4u + below(28u);
        c.nodes = own                ? (uint32_t)here.nodes
                  : below(4u) == 0u ? below(4000u)
                                    : below(300u);
        const uint32_t cell_rows =
            own ? (uint32_t)(here.visits - here.presser[0].passed) : 1u + below(100u);
        const uint32_t passed = own ? (uint32_t)here.presser[0].passed : c.nodes + below(300u);
        c.visits = passed + cell_rows;
        if (kind == 3u) {
            c.visits += passed;
            if (c.nodes > PALP_LATTICE_TESTS) c.nodes = PALP_LATTICE_TESTS;
        }
        const palp_contact_cost k = cost_at(&none, &c);
        const palp_contact_level l = palp_contact_cost_level(&k, c.level);
        c.count = draw < 4u * PALP_CONTACT_LEVELS || own ? l.points : 1u + below(l.points);
        c.active = c.count < l.contacts ? c.count : l.contacts;
        if (draw >= 8u * PALP_CONTACT_LEVELS && !own) c.active = below(c.active + 1u);
        const palp_contact_level most = palp_contact_cost_level(&k, k.finest);
        const uint32_t shots = PALP_LATTICE_SHOTS(l.points), feet = PALP_LATTICE_FEET(l.points),
                       rings = PALP_LATTICE_RINGS(l.points);
        c.ring_nodes = own ? (uint32_t)here.rings[c.level]
                           : rings + below(rings * (c.ring - 1u) + 1u);
        (void)snprintf(counts, sizeof counts,
                       "here=%u tools=%u patches=%u bodies=1 runs=1 hops=1 balls=%u extremes=%u "
                       "patch_samples=%u ring=%u nodes=%u visits=%u "
                       "cell_rows=%u shots=%u feet=%u rings=%u ring_nodes=%u gaps=%u crossings=%u points=%u "
                       "before=%u modes=%u mode_lanes=2",
                       own, c.tools, c.tools, c.tool[0].balls > 0u ? c.tool[0].balls : 1u,
                       c.tool[0].field.extremes, c.tool[0].pad.columns * c.tool[0].pad.rows, c.ring,
                       c.nodes, passed, cell_rows, shots, feet, rings, c.ring_nodes,
                       c.nodes + c.ring_nodes + shots + 5u * feet + 2u,
                       PALP_LATTICE_CROSSINGS(l.points), l.points, most.points, l.modes);
        tell("fill", kinds[kind], counts, of_fill, &c);
        /* less of some of it, so that each kind of work stands for its own */
        const uint32_t some[7] = {below(2u) * below(shots + 1u),
                                  below(2u) * below(feet + 1u),
                                  below(2u) * below(rings + 1u),
                                  below(2u) * below(c.nodes + 1u),
                                  below(2u) * below(PALP_LATTICE_CROSSINGS(l.points) + 1u),
                                  below(2u) * below(most.points + 1u),
                                  below(2u) * below(passed + 1u)};
        const uint32_t followed = some[0] < l.points ? some[0] : l.points;
        const uint32_t asked = some[2] * c.ring_nodes / rings; /* neighbours of these nodes */
        const uint32_t ways = 1u + palp_tool_out(&c.tool[0]);
        const filled_case f = {
            &c,
            {.fillings = 1u,
             .around = (kind == 3u ? 2u : 1u) * some[6] + cell_rows + some[1] * c.ring,
             .nodes = some[3],
             .evaluations = some[3] + ways * some[0] + asked + 5u * some[1] + 4u + PALP_TOOL_EXIT,
             .feet = some[1],
             .shots = some[0],
             .crossings = some[4],
             .kept = some[5],
             .followed = followed}};
        (void)snprintf(counts, sizeof counts,
                       "tools=%u patches=%u bodies=1 runs=1 hops=1 balls=%u extremes=%u "
                       "patch_samples=%u ring=%u nodes=%u visits=%u "
                       "cell_rows=%u shots=%u feet=%u rings=%u ring_nodes=%u gaps=%u crossings=%u points=%u "
                       "before=%u modes=%u mode_lanes=2",
                       c.tools, c.tools, c.tool[0].balls > 0u ? c.tool[0].balls : 1u,
                       c.tool[0].field.extremes, c.tool[0].pad.columns * c.tool[0].pad.rows, c.ring,
                       some[3], some[6], cell_rows, some[0], some[1], some[2],
                       asked, some[3] + asked + some[0] + 5u * some[1] + 2u, some[4],
                       followed, some[5], l.modes);
        tell("filled", kinds[kind], counts, of_filled, &f);
        const uint32_t in_factor = c.active < c.count / 2u ? c.active : c.count / 2u;
        double appended = 0, squares = 0; /* as it goes in factor_active */
        for (uint32_t p = 0; p < c.count; p++) {
            const double in = p < c.active ? p : c.active;
            appended += in;
            squares += in * in;
        }
        (void)snprintf(
            counts, sizeof counts,
            "here=%u tools=%u patches=%u bodies=1 runs=1 hops=1 balls=%u extremes=%u patch_samples=%u "
            "ring=%u points=%u sides=%u "
            "active=%u pressed=%u modes=%u mode_lanes=%u lanes=%u rows=%u pairs=%u batches=%u "
            "paired=0 idle=%u friction=%u before=%u appended=%.9g squares=%.9g looked=%u own=%.9g",
            own, c.tools, c.tools, c.tool[0].balls > 0u ? c.tool[0].balls : 1u, c.tool[0].field.extremes,
            c.tool[0].pad.columns * c.tool[0].pad.rows, c.ring, c.count, c.count, c.active,
            c.active + 7u, l.modes, l.modes / 8u, (c.active + 7u) / 8u, c.count,
            c.count * (c.count + 1u) / 2u, (c.count + PALP_CONTACT_ROWS - 1u) / PALP_CONTACT_ROWS,
            c.tools - 1u, friction > 0.0f ? 1u : 0u, most.points, appended, squares,
            (in_factor + 1u) * (c.count - in_factor), (double)c.active / c.tools);
        tell("points", kinds[kind], counts, of_points, &c);
        tell("assemble", kinds[kind], counts, of_assemble, &c);
        tell("iterate", kinds[kind], counts, of_iterate, &c);
        tell(friction > 0.0f ? "finish_rubbing" : "finish", kinds[kind], counts, of_finish, &c);
        tell("around", kinds[kind], counts, of_around, &c);
        const uint32_t fillings = below(2u) * below(17u), batches = below(2u) * below(17u),
                       rounds = below(2u) * below(13u);
        const glue_case g = {&c, fillings + batches + rounds};
        (void)snprintf(counts, sizeof counts,
                       "tools=%u patches=%u bodies=1 runs=1 hops=1 patch_samples=%u extremes=%u "
                       "points=%u before=%u fillings=%u batches=%u rounds=%u zones=0",
                       c.tools, c.tools, c.tool[0].pad.columns * c.tool[0].pad.rows,
                       c.tool[0].field.extremes, l.points, most.points, fillings, batches, rounds);
        tell("glue", kinds[kind], counts, of_glue, &g);
        const uint32_t which = below(3u);
        (void)snprintf(counts, sizeof counts,
                       "tools=%u patches=%u fillings=%u batches=%u rounds=%u zones=0", c.tools,
                       c.tools, which == 0u, which == 1u, which == 2u);
        tell("quantum", kinds[kind], counts, of_quantum, NULL);
    }
}

/* ---- columns, rows and transforms ---- */

typedef struct {
    const palp_blob *blob;
    uint32_t n, m;
} green_case;

static float of_row(const palp_prices *price, const void *of) {
    const green_case *c = of;
    return palp_cost_row(price, c->blob, c->n);
}
static float of_extract(const palp_prices *price, const void *of) {
    const green_case *c = of;
    return palp_cost_extract(price, c->blob, c->n, c->m);
}
static float of_add(const palp_prices *price, const void *of) {
    const green_case *c = of;
    return palp_cost_add(price, c->blob, c->n);
}
static float of_inverse(const palp_prices *price, const void *of) {
    const green_case *c = of;
    return palp_cost_inverse(price, c->blob, c->n);
}

static float of_split_add(const palp_prices *price, const void *of) {
    const green_case *c = of;
    return palp_cost_split_add(price, c->blob, c->n);
}
static float of_split_modes(const palp_prices *price, const void *of) {
    const green_case *c = of;
    return palp_cost_split_modes(price, c->blob, c->n);
}

static uint32_t longest(const uint32_t *offset, uint32_t n) {
    uint32_t most = 0;
    for (uint32_t i = 0; offset != NULL && i < n; i++)
        most = offset[i + 1u] - offset[i] > most ? offset[i + 1u] - offset[i] : most;
    return most;
}

static void of_green(const palp_blob *b) {
    const palp_domain *d = &b->domain[PALP_FREE];
    const bool half = b->level[b->meta->constraint_level].columns.half != NULL;
    char counts[300];
    for (uint32_t draw = 0; draw < draws; draw++) {
        green_case c = {.blob = b, .n = 1u + below(draw % 2u == 0u ? d->slots : 40u)};
        const double all = d->child_offset[d->slots],
                     children = (double)c.n * longest(d->child_offset, d->slots);
        (void)snprintf(counts, sizeof counts,
                       "levels=%u row=%u slots=%u mark_words=%.9g child_visits=%.9g stencils=%.9g",
                       d->levels, c.n, d->slots, d->slots / 32.0 + 1.0,
                       d->levels * (children < all ? children : all),
                       (double)c.n * longest(d->stencil_offset, d->slots));
        tell("row", "-", counts, of_row, &c);
        tell("basis", "-", counts, of_row, &c);
        c.m = 1u + below(d->slots / PALP_LANES + 1u);
        const uint32_t blocks = PALP_LANES * c.m;
        (void)snprintf(counts, sizeof counts, "row=%u groups=%u matches=%u", c.n, c.m,
                       c.n < blocks ? c.n : blocks);
        tell(half ? "extract_half" : "extract", "-", counts, of_extract, &c);
        c.n = c.m;
        tell(half ? "add_half" : "add", "-", counts, of_add, &c);
        if (!palp_blob_has(b, PALP_META_SPLIT)) continue;
        (void)snprintf(counts, sizeof counts, "slots=%u modes=%u groups=%u", d->slots,
                       b->split.count, c.m);
        tell(half ? "split_add_half" : "split_add", "-", counts, of_split_add, &c);
        c.n = 1u + below(d->slots);
        (void)snprintf(counts, sizeof counts, "slots=%u modes=%u", c.n, b->split.count);
        tell("split_modes", "-", counts, of_split_modes, &c);
    }
    for (uint32_t l = 0; l < d->levels; l++) {
        const green_case c = {.blob = b, .n = l};
        uint32_t odd = 0, gathered = 0, children = 0, stencils = 0;
        for (uint32_t k = 1; k <= l; k++) {
            const uint32_t first = d->level_start[k], end = d->level_start[k + 1u];
            odd += end - first;
            gathered += first;
            children += d->child_offset[first];
            if (d->stencil_offset != NULL)
                stencils += d->stencil_offset[end] - d->stencil_offset[first];
        }
        (void)snprintf(counts, sizeof counts,
                       "levels=%u odd=%u gathered=%u children=%u stencils=%u", l, odd, gathered,
                       children, stencils);
        tell(d->stencil_offset != NULL ? "inverse_butterfly" : "inverse", "-", counts, of_inverse,
             &c);
    }
}

/* ---- a tick of the servo ---- */

typedef struct {
    palp_device device;
    uint32_t frames;
} servo_case;

/* With fewer frames than there is time for. */
static float of_servo(const palp_prices *price, const void *of) {
    const servo_case *c = of;
    palp_prices frame = *price, rest = *price;
    for (uint32_t k = 0; k < PALP_WORKS; k++) {
        const bool is = k == PALP_WORK_FRAME || k == PALP_WORK_FRAME_BYTE;
        (is ? &rest : &frame)->of[k] = 0.0f;
    }
    return palp_servo_cost_before(&rest, &c->device) + palp_servo_cost_after(price, &c->device) +
           (float)c->frames / (float)PALP_SERVO_FRAMES_IN *
               palp_servo_cost_before(&frame, &c->device);
}

static void of_devices(void) {
    static const palp_mechanism kinds[] = {PALP_ARM3, PALP_FIVE_BAR};
    char counts[200];
    static const palp_drive_config drives[] = {{.protocol = PALP_PROTOCOL_ODRIVE},
                                               {.protocol = PALP_PROTOCOL_PALP, .fd = true},
                                               {.protocol = PALP_PROTOCOL_MOTEUS, .fd = true}};
    for (uint32_t k = 0; k < 6u; k++) {
        for (uint32_t frames = 0; frames <= PALP_SERVO_FRAMES_IN; frames += 4u) {
            servo_case c = {
                .device = {.kinematics = {.mechanism = kinds[k / 3u]}, .drives = drives[k % 3u]},
                .frames = frames};
            (void)snprintf(counts, sizeof counts,
                           "hands=1 tools=1 patches=1 bodies=1 frames=%u frame_bytes=%u axes=%u "
                           "drives=0 joints=0 seams=0 unknowns=0 "
                           "zone_unknowns=0 zones=0",
                           frames, palp_drive_frame_bytes(&c.device.drives),
                           palp_axes(&c.device.kinematics));
            tell("servo", "-", counts, of_servo, &c);
        }
    }
}

/* ---- a dynamic body ---- */

typedef struct {
    palp_dynamic *body;
    uint32_t most_class;
} dynamic_case;

static float at_price(const palp_prices *price, const dynamic_case *c,
                      float (*f)(const palp_dynamic *)) {
    palp_dynamic d = *c->body;
    d.price = *price;
    return f(&d);
}
static float of_dynamic(const palp_prices *price, const void *of) {
    const dynamic_case *c = of;
    palp_dynamic d = *c->body;
    d.price = *price;
    return palp_dynamic_cost_tick(&d, c->most_class);
}
static float of_collapse(const palp_prices *price, const void *of) {
    return at_price(price, of, palp_dynamic_cost_collapse);
}
static float of_reset(const palp_prices *price, const void *of) {
    return at_price(price, of, palp_dynamic_cost_adapt);
}

static uint64_t no_time(void *context) {
    (void)context;
    return 0;
}

static void of_body(const palp_tets *t) {
    static const char *const kinds[] = {"balls", "cylinder", "pad", "field"};
    const palp_frame begin = PALP_FRAME_IDENTITY;
    const palp_tets_meta *m = t->meta;
    char counts[700];
    for (uint32_t draw = 0; draw < 2u * draws; draw++) {
        palp_tool tool[PALP_CONTACT_TOOLS];
        const uint32_t kind = draw % 3u, tools = 1u + below(PALP_CONTACT_TOOLS),
                       points = 8u << below(5u);
        palp_dynamic body;
        for (uint32_t i = 0; i < tools; i++)
            tool[i] = i == 0u ? tool_of(kind, below(2u) == 0u ? 0.3f : 0.0f) : tool[0];
        palp_dynamic_config config = {.tets = t,
                                      .material = palp_material_of(4e3f, 0.4f, 1000, 3e-4f, 5),
                                      .adapt = palp_adapt_defaults(t),
                                      .tools = tool,
                                      .tool_count = tools,
                                      .max_points = points,
                                      .most_class = 5,
                                      .cost = {&palp_target_counted, 1e-6f, 0.0f, 0.8f},
                                      .port = {.now_ns = no_time},
                                      .tick_s = 1e-3f};
        palp_frame at[PALP_CONTACT_TOOLS] = {begin, begin, begin, begin};
        config.adapt.max_changes = 1u + below(12u);
        const size_t bytes = palp_dynamic_memsize(t, points);
        void *memory = aligned_alloc(64, (bytes + 63u) / 64u * 64u);
        if (palp_dynamic_init(&body, &config, at, memory, bytes, NULL) != PALP_OK) {
            free(memory);
            continue;
        }
        if (draw % 4u == 1u) palp_dynamic_refine_all(&body);
        for (uint32_t l = 0; draw % 4u > 1u && l + 1u < m->levels; l++) { /* here and there */
            for (uint32_t k = m->first_family[l]; k < m->first_family[l + 1u]; k++) {
                const uint32_t parent = t->parent[t->parent_offset[k]];
                if (below(4u) < draw % 4u && body.dyna.state[parent] == PALP_ACTIVE)
                    body.dyna.split[k] = 1;
            }
            palp_dyna_relist(&body.dyna);
        }
        const palp_dyna *d = &body.dyna;
        const uint32_t balls = tool[0].balls > 0u ? tool[0].balls : 1u;
        for (uint32_t k = 0; k <= d->top_class; k++) {
            dynamic_case c = {&body, k};
            (void)snprintf(
                counts, sizeof counts,
                "tools=%u balls=%u extremes=0 patch_samples=0 points=%u tests=%u nodes=%u tets=%u "
                "skin=%u families=%u levels=%u "
                "active_nodes=%u interface_nodes=%u sources=%u terms=%u groups=%u steps=%u "
                "changes=%u element_tests=%u "
                "children=%u family_nodes=%u family_terms=%u family_parents=%u rubs=%u",
                tools, balls, points, PALP_IMPOSE_NARROW_TESTS * points, m->nodes, m->tets, m->skin,
                m->families, m->levels, d->active_count, d->up_count + d->down_count,
                d->interpolation_terms, t->mean_offset[m->nodes] + 4u * m->nodes,
                palp_dyna_work(d, k) / PALP_LANES, palp_dyna_steps(d, k),
                body.adapt.config.max_changes, body.adapt.config.max_element_tests,
                t->child_offset[m->families], body.adapt.most_nodes, body.adapt.most_terms,
                longest(t->parent_offset, m->families), tool[0].friction > 0.0f ? 1u : 0u);
            tell(tool[0].friction > 0.0f ? "dynamic_rubbing" : "dynamic", kinds[kind], counts,
                 of_dynamic, &c);
            if (k > 0u) continue;
            tell("collapse", "-", counts, of_collapse, &c);
            tell("reset", "-", counts, of_reset, &c);
        }
        free(memory);
    }
}

int main(int argc, char **argv) {
    if (argc < 4) return 2;
    state = 88172645463325252ull * (uint64_t)atoi(argv[1]);
    draws = (uint32_t)atoi(argv[2]);
    of_devices();
    for (int i = 3; i < argc; i++) {
        FILE *f = fopen(argv[i], "rb");
        if (f == NULL || fseek(f, 0, SEEK_END) != 0) return 2;
        const long bytes = ftell(f);
        void *data = aligned_alloc(64, ((size_t)bytes + 63u) / 64u * 64u);
        rewind(f);
        if (fread(data, 1, (size_t)bytes, f) != (size_t)bytes) return 2;
        fclose(f);
        palp_blob blob;
        if (palp_blob_open(&blob, data, (size_t)bytes) == PALP_OK && blob.regular.modes > 0u) {
            of_contact(&blob);
            of_green(&blob);
        }
        palp_tets tets;
        if (palp_tets_open(&tets, data, (size_t)bytes) == PALP_OK) of_body(&tets);
        free(data);
    }
    return 0;
}
