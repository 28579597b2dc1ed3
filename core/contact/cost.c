/* SPDX-License-Identifier: MIT */
#include "core/contact/cost.h"

#define FLARED 1.0f /* evaluations that palp_tool_gap_flared takes at most */
#define GONE 2.0f   /* far fields that a new point is asked, at most */
#define MANY 64u    /* neighbours of a node, from which it is not known how many have so many */
#define RUNS 2.0f   /* the half-space between points that alternate between zones, over one run */
#define BEGUN 30.0f /* sides: what rows of the seams take however few there are */
#define LANES 7.0f  /* sides that fill a lane up, at most */
#define PRICE(cost, kind) ((cost)->price.of[PALP_WORK_##kind])

float palp_contact_cost_evaluation(const palp_tool *tool, const palp_prices *price) {
    switch (tool->shape) {
    case PALP_TOOL_CYLINDER:
        return price->of[PALP_WORK_CYLINDER];
    case PALP_TOOL_PAD:
        return price->of[PALP_WORK_PAD];
    case PALP_TOOL_FIELD:
        return price->of[PALP_WORK_FIELD];
    default:
        return (float)tool->balls * price->of[PALP_WORK_BALL];
    }
}

/* What is gone through to know how far a tool extends. */
static float samples_of(const palp_tool *tool) {
    if (tool->shape == PALP_TOOL_PAD) return (float)(tool->pad.columns * tool->pad.rows);
    return tool->shape == PALP_TOOL_FIELD ? (float)tool->field.extremes : 0.0f;
}

static void take_evaluation(palp_contact_presser *p, const palp_tool *tool,
                            const palp_prices *price) {
    p->evaluation = palp_contact_cost_evaluation(tool, price);
    p->ways = 1.0f + (float)palp_tool_out(tool);
    p->deep = (p->ways + FLARED) * p->evaluation;
}

/* Cells along one axis that a tool's box of half width `reach` may meet. */
static uint32_t cells_met(const palp_meta *m, uint32_t axis, float reach) {
    float met = palp_min(2.0f * reach / m->cell_size_m + 2.0f, (float)m->cells[axis]);
    return met > 1.0f ? (uint32_t)met : 1u;
}

/* Most nodes in any box of cells that a tool may meet. */
static uint32_t nodes_around(const palp_blob *b, const uint32_t met[3]) {
    const palp_meta *m = b->meta;
    uint32_t most = 0;
    /* at most cells */
    for (uint32_t z = 0; z + met[2] <= m->cells[2]; z++) {
        /* at most cells */
        for (uint32_t y = 0; y + met[1] <= m->cells[1]; y++) {
            /* at most cells */
            for (uint32_t x = 0; x + met[0] <= m->cells[0]; x++) {
                uint32_t sum = 0;
                for (uint32_t k = 0; k < met[2] * met[1]; k++) {
                    uint32_t row = ((z + k / met[1]) * m->cells[1] + y + k % met[1]) * m->cells[0];
                    sum += b->cell_offset[row + x + met[0]] - b->cell_offset[row + x];
                }
                most = sum > most ? sum : most;
            }
        }
    }
    return most;
}

/* Nodes in a row of cells that are within `reach` of a box. */
static uint32_t near_in_row(const palp_blob *b, uint32_t from, uint32_t to, const float low[3],
                            float side, float reach) {
    uint32_t count = 0;
    for (uint32_t k = b->cell_offset[from]; k < b->cell_offset[to]; k++) {
        const float *x = b->rest_m + 3u * (size_t)b->cell_node[k];
        float d2 = 0.0f;
        for (uint32_t e = 0; e < 3u; e++) {
            const float d = palp_max(palp_max(low[e] - x[e], x[e] - low[e] - side), 0.0f);
            d2 += d * d;
        }
        count += d2 <= reach * reach ? 1u : 0u;
    }
    return count;
}

/* Nodes within `reach` of a box. */
static uint32_t near_box(const palp_blob *b, const float low[3], float side, float reach) {
    const palp_meta *m = b->meta;
    uint32_t from[3], to[3], count = 0;
    for (uint32_t e = 0; e < 3u; e++) {
        const float last = (float)(m->cells[e] - 1u), at = low[e] - m->cell_origin_m[e];
        from[e] = (uint32_t)palp_clamp((at - reach) / m->cell_size_m, 0.0f, last);
        to[e] = (uint32_t)palp_clamp((at + side + reach) / m->cell_size_m, 0.0f, last);
    }
    /* at most cells */
    for (uint32_t z = from[2]; z <= to[2]; z++) {
        /* at most cells */
        for (uint32_t y = from[1]; y <= to[1]; y++) {
            const uint32_t row = (z * m->cells[1] + y) * m->cells[0];
            count += near_in_row(b, row + from[0], row + to[0] + 1u, low, side, reach);
        }
    }
    return count;
}

#define COARSE 8u /* boxes along a side of one that is looked at first */

/* Most nodes within `reach` of any place in a coarse box, or so many as are known of elsewhere. */
static uint32_t nodes_near(const palp_blob *b, const float low[3], float side, float reach,
                           uint32_t known) {
    uint32_t most = known;
    if (near_box(b, low, side * (float)COARSE, reach) <= known) return known;
    for (uint32_t k = 0; k < COARSE * COARSE * COARSE; k++) {
        const float at[3] = {low[0] + side * (float)(k % COARSE),
                             low[1] + side * (float)(k / COARSE % COARSE),
                             low[2] + side * (float)(k / COARSE / COARSE)};
        const uint32_t count = near_box(b, at, side, reach);
        most = count > most ? count : most;
    }
    return most;
}

/* Most nodes within `reach` of any place. Moving a place outside the grid to the grid's nearest
 * brings it nearer to every node, so places in the grid are all that count. They are looked at in
 * boxes of half the reach, or half a cell where that is more. */
static uint32_t nodes_within(const palp_blob *b, float reach) {
    const palp_meta *m = b->meta;
    const float side = 0.5f * palp_max(reach, m->cell_size_m), coarse = side * (float)COARSE;
    const float sure = 1.001f * reach + 1e-3f * m->cell_size_m; /* whatever rounding does */
    uint32_t boxes[3], most = 0;
    for (uint32_t e = 0; e < 3u; e++)
        boxes[e] = 1u + (uint32_t)palp_min((float)m->cells[e] * m->cell_size_m / coarse, 1e3f);
    /* at most boxes */
    for (uint32_t k = 0; k < boxes[0] * boxes[1] * boxes[2] && most < m->nodes; k++) {
        const uint32_t x = k % boxes[0], y = k / boxes[0] % boxes[1], z = k / boxes[0] / boxes[1];
        const float low[3] = {m->cell_origin_m[0] + coarse * (float)x,
                              m->cell_origin_m[1] + coarse * (float)y,
                              m->cell_origin_m[2] + coarse * (float)z};
        most = nodes_near(b, low, side, sure, most);
    }
    return most;
}

/* Neighbours that PALP_LATTICE_RINGS(level's points) nodes have together at most: of the k largest
 * numbers the sum over all v >= 1 of min(k, how many are at least v). */
static float rings_of(const palp_blob *blob, uint32_t blobs, palp_contact_level level) {
    const uint32_t most = PALP_LATTICE_RINGS(level.points);
    uint32_t sum = 0, valence = 0;
    for (uint32_t b = 0; b < blobs; b++)
        valence = blob[b].meta->max_ring > valence ? blob[b].meta->max_ring : valence;
    if (valence > MANY) return (float)most * (float)valence; /* not worth the time to know better */
    for (uint32_t v = 1; v <= valence; v++) {
        uint32_t count = 0;
        for (uint32_t b = 0; b < blobs; b++) {
            for (uint32_t n = 0; n < blob[b].meta->nodes; n++)
                count += blob[b].ring_offset[n + 1u] - blob[b].ring_offset[n] >= v ? 1u : 0u;
        }
        sum += count < most ? count : most;
    }
    return (float)sum;
}

static void count_rings(palp_contact_cost *c, const palp_blob *blob, uint32_t blobs) {
    for (uint32_t l = 0; l < PALP_CONTACT_LEVELS; l++)
        c->rings[l] = rings_of(blob, blobs, palp_contact_cost_level(c, l));
}

/* Nodes within `reach` of one more body, and all visits on the way to them. */
static void around(const palp_blob *blob, float reach, palp_contact_presser *p) {
    uint32_t met[3];
    for (uint32_t k = 0; k < 3u; k++) met[k] = cells_met(blob->meta, k, reach);
    p->passed += (float)nodes_around(blob, met);
    p->nodes += (float)nodes_within(blob, reach);
    p->visits += (float)(met[1] * met[2]);
}

/* Of a tool, once the nodes of all bodies are counted. */
static void count_visits(palp_contact_presser *p, const palp_tool *tool) {
    const bool field = tool != NULL && tool->shape == PALP_TOOL_FIELD;
    p->visits += p->passed + (field ? p->nodes : 0.0f);
    if (field) p->nodes = palp_min(p->nodes, (float)PALP_LATTICE_TESTS);
}

static void take_worst(palp_contact_cost *c, const palp_contact_presser *p) {
    c->evaluation = palp_max(c->evaluation, p->evaluation);
    c->ways = palp_max(c->ways, p->ways);
    c->deep = palp_max(c->deep, p->deep);
    c->nodes = palp_max(c->nodes, p->nodes);
    c->visits = palp_max(c->visits, p->visits);
}

palp_contact_cost palp_contact_cost_at(const palp_contact_cost *cost, const palp_tool *tools,
                                       const palp_prices *price) {
    palp_contact_cost c = *cost;
    c.price = *price;
    c.evaluation = c.deep = 0.0f;
    for (uint32_t t = 0; t < (uint32_t)c.tools; t++) {
        take_evaluation(&c.presser[t], &tools[t], price);
        take_worst(&c, &c.presser[t]);
    }
    return c;
}

palp_contact_cost palp_contact_cost_of(const palp_blob *blob, const palp_tool *tools,
                                       uint32_t tool_count, const palp_prices *price) {
    palp_contact_cost c = {.tools = (float)tool_count,
                           .ring = (float)blob->meta->max_ring,
                           .finest = PALP_CONTACT_FINEST,
                           .modes = blob->regular.modes};
    for (uint32_t t = 0; t < tool_count; t++) {
        around(blob, palp_lattice_reach(&tools[t], blob), &c.presser[t]);
        count_visits(&c.presser[t], &tools[t]);
        c.friction = c.friction || tools[t].friction > 0.0f;
        c.samples += samples_of(&tools[t]);
    }
    c.patches = (float)tool_count;
    count_rings(&c, blob, 1u);
    return palp_contact_cost_at(&c, tools, price);
}

palp_contact_cost palp_contact_cost_of_zones(const palp_assembly *assembly, bool pairs,
                                             const palp_tool *tools, uint32_t tool_count,
                                             const palp_prices *price) {
    const palp_seams *q = &assembly->seams;
    const palp_zones *z = assembly->zones;
    palp_contact_cost c = {
        .price = *price, .tools = (float)tool_count, .finest = PALP_CONTACT_FINEST};
    palp_contact_presser *pair = &c.presser[PALP_CONTACT_TOOLS];
    float modes = 0.0f, reach[PALP_CONTACT_TOOLS] = {0};
    for (uint32_t i = 0; i < z->meta->zones; i++) {
        for (uint32_t t = 0; t < tool_count; t++)
            reach[t] = palp_max(reach[t], palp_lattice_reach(&tools[t], &z->blob[i]));
    }
    for (uint32_t i = 0; i < z->meta->zones; i++) {
        const palp_blob *b = &z->blob[i];
        uint32_t met[3];
        palp_contact_presser one = {.evaluation = 0.0f};
        for (uint32_t t = 0; t < tool_count; t++) around(b, reach[t], &c.presser[t]);
        around(b, PALP_CONTACT_PAIR_REACH * b->meta->mean_edge_m, &one);
        pair->nodes = palp_max(pair->nodes, one.nodes);
        pair->passed = palp_max(pair->passed, one.passed);
        pair->visits = palp_max(pair->visits, one.visits);
        for (uint32_t k = 0; k < 3u; k++) met[k] = b->meta->cells[k] < 3u ? b->meta->cells[k] : 3u;
        c.cells = palp_max(c.cells, (float)nodes_around(b, met));
        c.ring = palp_max(c.ring, (float)b->meta->max_ring);
        c.modes = b->regular.modes > c.modes ? b->regular.modes : c.modes;
        modes = palp_max(modes, palp_assembly_modes(assembly, i));
    }
    pair->ways = 1.0f;
    for (uint32_t t = 0; t < tool_count; t++) {
        take_evaluation(&c.presser[t], &tools[t], price);
        count_visits(&c.presser[t], &tools[t]);
        c.friction = c.friction || tools[t].friction > 0.0f;
        c.samples += samples_of(&tools[t]);
        take_worst(&c, &c.presser[t]);
    }
    count_visits(pair, NULL);
    if (pairs) take_worst(&c, pair);
    c.zones = (float)z->meta->zones;
    count_rings(&c, z->blob, z->meta->zones);
    c.pairs = pairs ? 1.0f : 0.0f;
    c.patches = (float)tool_count;
    if (pairs) c.patches += palp_min(0.5f * c.zones * (c.zones - 1.0f), (float)PALP_CONTACT_PAIRS);
    c.bent = price->of[PALP_WORK_POSITION] + modes * price->of[PALP_WORK_POSITION_MODE];
    c.unknowns = 3.0f * (float)q->modes;
    c.solve = palp_seams_cost_solve(q, price, q->finest);
    c.forward = palp_seams_cost_forward(q, price, q->finest);
    return c;
}

palp_contact_level palp_contact_cost_level(const palp_contact_cost *cost, uint32_t level) {
    return cost->zones > 0.0f ? palp_contact_level_of_zones(level, cost->modes)
                              : palp_contact_level_of(level, cost->modes);
}

float palp_contact_cost_patches(const palp_contact_cost *cost) {
    const float search = 2.0f * cost->bent + PRICE(cost, SHOT) +
                         (float)PALP_SURFACE_CROSSINGS * PRICE(cost, CROSSING) +
                         cost->cells * PRICE(cost, AROUND);
    const float others = palp_max(cost->zones - 1.0f, 0.0f);
    const float tracked = palp_min(0.5f * cost->zones * others, (float)PALP_CONTACT_TRACKED);
    const float neighbours = cost->ring + 1.0f;
    const float used = cost->patches - cost->tools; /* pairs at a time */
    return cost->zones * cost->tools * PRICE(cost, SOUGHT) +
           cost->pairs *
               ((float)PALP_CONTACT_SCAN * others * search +
                tracked * (2.0f * search + neighbours * neighbours * PRICE(cost, AROUND)) +
                used * 2.0f * (cost->ring * PRICE(cost, AROUND) + PRICE(cost, FILLING)));
}

static float filled(const palp_contact_cost *cost, palp_lattice_counts done, float evaluation) {
    const float turned = 2.0f * (float)done.around + 6.0f * (float)done.shots +
                         24.0f * (float)done.feet + (float)done.evaluations;
    const float sum =
        (float)done.fillings * PRICE(cost, FILLING) + (float)done.around * PRICE(cost, AROUND) +
        (float)done.nodes * PRICE(cost, NODE) + (float)done.feet * PRICE(cost, FOOT) +
        (float)done.evaluations * (evaluation + PRICE(cost, FAR_FIELD)) +
        (float)done.shots * PRICE(cost, SHOT) + (float)done.crossings * PRICE(cost, CROSSING) +
        (float)done.kept * PRICE(cost, KEPT) + (float)done.followed * PRICE(cost, FOLLOWED) +
        (float)done.bent * cost->bent +
        (float)done.fillings * PALP_LATTICE_WATCHED *
            (PRICE(cost, CORNER) + PALP_LATTICE_FAR_MODES * PRICE(cost, CORNER_MODE) + cost->bent);
    if (!(cost->zones > 0.0f)) return sum;
    return sum + turned * PRICE(cost, TURN) +
           (float)done.fillings * cost->zones * PRICE(cost, SOUGHT);
}

float palp_contact_cost_filled(const palp_contact_cost *cost, palp_lattice_counts done) {
    return filled(cost, done, cost->evaluation);
}

static palp_lattice_counts most_filled(const palp_contact_cost *cost, palp_contact_level level,
                                       const palp_contact_presser *p) {
    const uint32_t shots = PALP_LATTICE_SHOTS(level.points), ring = (uint32_t)cost->ring;
    const uint32_t nodes = (uint32_t)p->nodes, visits = (uint32_t)p->visits;
    const uint32_t seen = (uint32_t)p->ways * shots;
    const uint32_t feet = PALP_LATTICE_FEET(level.points);
    const uint32_t bent = cost->zones > 0.0f ? PALP_LATTICE_BENT : 0u;
    return (palp_lattice_counts){.fillings = 1u,
                                 .around = visits + feet * ring,
                                 .nodes = nodes,
                                 .evaluations = nodes + seen + (uint32_t)cost->rings[level.number] +
                                                5u * feet + 4u + PALP_TOOL_EXIT,
                                 .feet = feet,
                                 .shots = shots,
                                 .crossings = PALP_LATTICE_CROSSINGS(level.points),
                                 .kept = palp_contact_cost_level(cost, cost->finest).points,
                                 .followed = level.points,
                                 .bent = bent};
}

palp_lattice_counts palp_contact_most_filled(const palp_contact_cost *cost,
                                             palp_contact_level level) {
    const palp_contact_presser worst = {.evaluation = cost->evaluation,
                                        .nodes = cost->nodes,
                                        .visits = cost->visits,
                                        .ways = cost->ways,
                                        .deep = cost->deep};
    return most_filled(cost, level, &worst);
}

float palp_contact_cost_fill(const palp_contact_cost *cost, palp_contact_level level) {
    return filled(cost, palp_contact_most_filled(cost, level), cost->evaluation);
}

float palp_contact_cost_fill_by(const palp_contact_cost *cost, palp_contact_level level,
                                uint32_t tool) {
    const palp_contact_presser *p = &cost->presser[tool];
    palp_lattice_counts most = most_filled(cost, level, p);
    if (tool == PALP_CONTACT_TOOLS) {
        most.shots += most.evaluations;
        most.crossings *= PALP_LATTICE_BETWEEN;
        return filled(cost, most, 0.0f);
    }
    return filled(cost, most, p->evaluation);
}

/* What a zone's seams feel of a push, on the level of the seams in use. */
static float felt(const palp_contact_cost *cost) {
    return palp_min(cost->bent,
                    PRICE(cost, POSITION) + cost->unknowns / 3.0f * PRICE(cost, POSITION_MODE));
}

/* Other sides that so many points have: half of all points at most lie between zones. */
static float others(const palp_contact_cost *cost, palp_contact_level level, uint32_t points) {
    const uint32_t most = level.points / 2u;
    return cost->pairs * (float)(points < most ? points : most);
}

float palp_contact_cost_points(const palp_contact_cost *cost, palp_contact_level level,
                               uint32_t count) {
    const float n = (float)count, between = others(cost, level, count), sides = n + between;
    const float side = 3.0f * PRICE(cost, CORNER) + (float)level.modes * PRICE(cost, MODE_AT);
    const float sum =
        n * (PRICE(cost, POINT) + cost->deep + GONE * PRICE(cost, FAR_FIELD)) + sides * side;
    if (!(cost->zones > 0.0f)) return sum;
    return sum +
           sides *
               (3.0f * (cost->bent + felt(cost)) + 2.0f * cost->unknowns * PRICE(cost, SEAM_TURN)) +
           2.0f * (sides + BEGUN) * cost->forward +
           between *
               (2.0f * PRICE(cost, SHOT) + (float)PALP_SURFACE_CROSSINGS * PRICE(cost, CROSSING));
}

/* A row of the assembly, or a call that assembles some: what is read of a side and its modes. */
static float begun(const palp_contact_cost *cost, palp_contact_level level) {
    return PRICE(cost, ROW_BEGUN) + (float)level.modes * PRICE(cost, ROW_MODE);
}

/* So many products between sides, of which `sides` are new. */
static float products(const palp_contact_cost *cost, palp_contact_level level, float split,
                      float pairs, float sides) {
    const float seams = 2.0f * cost->unknowns * PRICE(cost, MODE_PAIR);
    return pairs * (split * PRICE(cost, COMPLIANCE) + (float)level.modes * PRICE(cost, MODE_PAIR) +
                    seams) +
           sides * (1.0f + 1.0f / (float)PALP_CONTACT_ROWS) * begun(cost, level);
}

float palp_contact_cost_assemble(const palp_contact_cost *cost, palp_contact_level level,
                                 uint32_t count) {
    const float n = (float)count, sides = n + others(cost, level, count);
    if (!(cost->zones > 0.0f))
        return begun(cost, level) + products(cost, level, 1.0f, 0.5f * n * (n + 1.0f), n);
    /* a row takes as if it had one side more */
    return begun(cost, level) +
           products(cost, level, RUNS, 0.5f * sides * (sides + 3.0f + cost->pairs), sides);
}

float palp_contact_cost_rows(const palp_contact_cost *cost, palp_contact_level level, uint32_t from,
                             uint32_t count) {
    const float n = (float)from; /* tools come first: these have one side */
    return palp_contact_cost_assemble(cost, level, count) -
           products(cost, level, 1.0f, 0.5f * n * (n + 1.0f), n);
}

float palp_contact_cost_iterate(const palp_contact_cost *cost, uint32_t count, uint32_t active,
                                uint32_t iterations) {
    const float n = (float)count, a = (float)active, times = (float)iterations;
    /* one that comes in has been held against those before it, one left out against all at most,
     * and is not tried again */
    const float out = palp_min(times * palp_max(n - a, 0.0f), n);
    const float before = 0.5f * times * a * a + out * a;
    const float pairs = times * a * a * a / 6.0f + 0.5f * out * a * a;
    const float in = palp_min(a, 0.5f * n); /* of which most looks are taken at the others */
    return times * (PRICE(cost, ITERATION) + PRICE(cost, QUANTUM) + (n + a) * PRICE(cost, PRESSED) +
                    2.0f * a * PRICE(cost, SUBSTITUTE) +
                    0.5f * a * a * (PRICE(cost, AXPY) + PRICE(cost, SUBSTITUTE)) +
                    (in + 1.0f) * (n - in) * PRICE(cost, DOT)) +
           before * (PRICE(cost, GATHER) + PRICE(cost, SUBSTITUTE)) + pairs * PRICE(cost, AXPY);
}

float palp_contact_cost_finish(const palp_contact_cost *cost, palp_contact_level level,
                               uint32_t count, uint32_t active) {
    const float n = (float)count + others(cost, level, count);
    const float pressed = (float)active + others(cost, level, active);
    /* each body's sides in contact fill whole lanes */
    const float a = pressed + palp_max(palp_min(cost->zones, pressed) - 1.0f, 0.0f) * LANES;
    const float modes = (float)level.modes;
    float corners = 3.0f * n * (PRICE(cost, CORNER) + modes * PRICE(cost, CORNER_MODE));
    const float lanes = a + LANES; /* of a body in contact, whole */
    if (cost->zones > 0.0f)
        corners += cost->zones * (cost->solve + 4.0f * cost->unknowns * PRICE(cost, SEAM_MODE)) +
                   (6.0f * a + 3.0f * n) * felt(cost);
    const float idle = cost->pairs > 0.0f ? cost->tools : cost->tools - 1.0f; /* one presses */
    const float looks =
        idle * (1.0f + cost->ring + (float)PALP_LATTICE_WATCHED) *
        (PRICE(cost, CORNER) + modes * PRICE(cost, CORNER_MODE) + PRICE(cost, TURN));
    float sum = cost->tools * PRICE(cost, FINISH) + corners + looks +
                n * (PRICE(cost, DERIVATIVE) + cost->deep + lanes * PRICE(cost, DISPLACE)) +
                a * (cost->tools * PRICE(cost, ITERATION) + lanes * PRICE(cost, PULL)) +
                2.0f * lanes * modes * PRICE(cost, CORNER_MODE);
    if (!cost->friction) return sum;
    sum += cost->tools * (PRICE(cost, FRICTION) + 2.0f * corners +
                          lanes * (PRICE(cost, RUB) + 2.0f * modes * PRICE(cost, CORNER_MODE)));
    return sum + 4.0f * a * lanes * PRICE(cost, DISPLACE) +
           2.0f * a * (PRICE(cost, RUB) + modes * PRICE(cost, MODE_AT));
}
