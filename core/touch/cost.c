/* SPDX-License-Identifier: MIT */
#include "cost.h"

#define PRICE(cost, kind) ((cost)->price.of[PALP_WORK_##kind])

static float least(float a, float b) { return a < b ? a : b; }

/* ---- counts of the blob ---- */

/* Most nodes that a search can meet in 27 cells: three cells of a row are one run. */
static float most_in_block(const palp_blob *b) {
    const palp_meta *m = b->meta;
    uint32_t most = 0;
    for (uint32_t z = 0; z < m->cells[2]; z++) {
        for (uint32_t y = 0; y < m->cells[1]; y++) {
            for (uint32_t x = 0; x < m->cells[0]; x++) {
                uint32_t sum = 0;
                for (uint32_t k = 0; k < 9u; k++) { /* rows around this one */
                    uint32_t row_y = y + k % 3u, row_z = z + k / 3u;
                    if (row_y < 1u || row_z < 1u || row_y > m->cells[1] || row_z > m->cells[2])
                        continue;
                    uint32_t row = ((row_z - 1u) * m->cells[1] + row_y - 1u) * m->cells[0];
                    uint32_t low = x > 0u ? x - 1u : 0u;
                    uint32_t high = x + 1u < m->cells[0] ? x + 2u : m->cells[0];
                    sum += b->cell_offset[row + high] - b->cell_offset[row + low];
                }
                most = sum > most ? sum : most;
            }
        }
    }
    return (float)most;
}

static float most_children(const palp_domain *d) {
    uint32_t most = 0;
    for (uint32_t i = 0; i < d->slots; i++) {
        uint32_t n = d->child_offset[i + 1u] - d->child_offset[i];
        most = n > most ? n : most;
    }
    return (float)most;
}

/* Most neighbours of a slot of `level`, as propose_neighbours meets them. */
static float most_near(const palp_blob *b, uint32_t level) {
    const palp_domain *d = &b->domain[PALP_FREE];
    uint32_t most = 0;
    if (level + 1u >= b->meta->levels) return (float)b->meta->max_ring;
    for (uint32_t i = 0; i < b->level[level].nodes; i++) {
        palp_child_range r = palp_children(d, i, level + 1u);
        most = r.end - r.first > most ? r.end - r.first : most;
    }
    return (float)most;
}

static float evaluation_of(const palp_prices *p, const palp_tool *tool) {
    if (tool->balls > 0u) return p->of[PALP_WORK_BALL] * (float)tool->balls;
    bool cylinder = tool->cylinder.radius_m > 0.0f;
    return p->of[cylinder ? PALP_WORK_CYLINDER : PALP_WORK_PAD];
}

palp_touch_cost palp_touch_cost_of(const palp_blob *blob, palp_node_contact_limits limits,
                                   const palp_tool *tools, uint32_t tool_count,
                                   const palp_prices *price) {
    const palp_meta *m = blob->meta;
    palp_touch_cost c = {.price = *price,
                         .limits = limits,
                         .tools = (float)tool_count,
                         .pairs = 1.0f,
                         .zones = 1.0f,
                         .ring = (float)m->max_ring,
                         .slots = (float)blob->domain[PALP_FREE].slots,
                         .cells = most_in_block(blob),
                         .children = most_children(&blob->domain[PALP_FREE])};
    for (uint32_t t = 0; t < tool_count; t++)
        c.evaluation = palp_max(c.evaluation, evaluation_of(price, &tools[t]));
    for (uint32_t l = 0; l <= m->constraint_level; l++) {
        if (blob->level[l].table != NULL) c.tables |= 1u << l;
        c.near[l] = most_near(blob, l);
        c.nodes[l] = (float)blob->level[l].nodes;
    }
    c.row = palp_cost_row(price, blob, m->max_row);
    c.extraction = palp_cost_extract(price, blob, m->max_row, m->max_groups);
    return c;
}

palp_touch_cost palp_touch_cost_of_zones(const palp_zones *zones, uint32_t finest, bool pairs,
                                         palp_node_contact_limits limits, const palp_tool *tools,
                                         uint32_t tool_count, const palp_prices *price) {
    palp_touch_cost all = palp_touch_cost_of(&zones->blob[0], limits, tools, tool_count, price);
    all.tables = UINT32_MAX;
    all.row = all.extraction = 0.0f;
    all.zones = (float)zones->meta->zones;
    all.pairs = pairs ? 2.0f : 1.0f;
    for (uint32_t i = 0; i < zones->meta->zones; i++) {
        const palp_blob *blob = &zones->blob[i];
        const palp_meta *m = blob->meta;
        float near = most_near(blob, m->constraint_level);
        all.ring = palp_max(all.ring, (float)m->max_ring);
        all.cells = palp_max(all.cells, most_in_block(blob));
        all.children = palp_max(all.children, most_children(&blob->domain[PALP_FREE]));
        all.slots = palp_max(all.slots, (float)blob->domain[PALP_FREE].slots);
        for (uint32_t l = 0; l < PALP_MAX_LEVELS; l++) all.near[l] = palp_max(all.near[l], near);
        if (blob->level[m->constraint_level].table == NULL) { /* look-ups fail */
            all.tables = 0;
            all.row = palp_max(all.row, palp_cost_row(price, blob, m->max_row));
            all.extraction =
                palp_max(all.extraction, palp_cost_extract(price, blob, m->max_row, m->max_groups));
        }
        float modes = 0.0f;
        for (uint32_t k = 0; k < zones->part[i].seams; k++)
            modes += (float)zones->seam[zones->part[i].seam[k]].level_modes[finest];
        all.modes = palp_max(all.modes, modes);
    }
    for (uint32_t s = 0; s < zones->meta->seams; s++)
        all.seam_width += 3.0f * (float)zones->seam[s].level_modes[finest];
    all.unknowns = all.seam_width; /* until a level is in use */
    for (uint32_t l = 0; l < PALP_MAX_LEVELS; l++) all.nodes[l] = (float)PALP_MAX_CANDIDATES;
    all.place = PRICE(&all, PLACE) + PRICE(&all, PLACE_MODE) * all.modes;
    all.evaluation += all.place;
    all.nearest = PRICE(&all, NEAREST) +
                  PRICE(&all, CELL) * (all.cells + (float)PALP_NODE_CONTACT_DESCENT * all.ring);
    return all;
}

/* ---- contact ---- */

static float drop(const palp_touch_cost *c, float k) {
    float moved = PRICE(c, MOVE) + (c->limits.friction ? PRICE(c, MOVE_BLOCK) : 0.0f);
    float seams = c->zones > 1.0f ? PRICE(c, SEAM_DOT) * c->seam_width : 0.0f;
    return PRICE(c, DROP) + moved * k + seams;
}

float palp_cost_search(const palp_touch_cost *cost, uint32_t level, uint32_t count,
                       uint32_t active) {
    const palp_touch_cost *c = cost;
    float k = (float)count, n = (float)active, idle = k - n;
    float near = c->near[level < PALP_MAX_LEVELS ? level : 0u];
    float look = PRICE(c, CLOSE) + c->evaluation + PRICE(c, SIFT) * (float)c->limits.max_new;
    float seek = PRICE(c, NEAREST) +
                 PRICE(c, CELL) * (c->cells + (float)PALP_NODE_CONTACT_DESCENT * c->ring);
    float free_tools = c->zones > 1.0f || active == 0u ? c->tools : c->tools - 1.0f;
    float walked = least((float)PALP_NODE_CONTACT_WALK, k);
    float asked = (walked * near + free_tools * c->zones);
    float nodes = c->nodes[level < PALP_MAX_LEVELS ? level : 0u];
    float scanned = least((float)PALP_NODE_CONTACT_SCAN, nodes > 0.0f ? nodes : c->slots);
    float looks = scanned + least((float)PALP_NODE_CONTACT_LOOKS, asked);
    float sum = PRICE(c, SEARCH) + k * (PRICE(c, CANDIDATE) + c->evaluation) +
                idle * n * PRICE(c, IDLE) + c->tools * n * PRICE(c, FORCE) +
                least((float)c->limits.max_new, idle) * drop(c, k) + free_tools * c->zones * seek +
                walked * (PRICE(c, CHILD) * c->children + near * PRICE(c, NEIGHBOUR)) +
                scanned * PRICE(c, NEIGHBOUR) + looks * look;
    if (c->pairs > 1.0f) { /* each node that is looked at finds its nearest on every other zone */
        float pairs = (float)PALP_NODE_CONTACT_PAIR_SCAN * (c->zones - 1.0f) + c->ring;
        sum += pairs * (c->nearest + c->row + 2.0f * c->place + PRICE(c, NEIGHBOUR));
    }
    return sum;
}

/* One compliance between two candidates. */
static float look_up(const palp_touch_cost *c, uint32_t level) {
    float one = c->limits.friction ? PRICE(c, PAIR_BLOCK) : 0.0f;
    if ((c->tables >> level & 1u) == 0u)
        return one + PRICE(c, PAIR) + 2.0f * c->pairs * c->pairs * c->extraction;
    return one + PRICE(c, PAIR) * c->pairs * c->pairs;
}

float palp_cost_admit(const palp_touch_cost *cost, uint32_t level, uint32_t count,
                      uint32_t active) {
    const palp_touch_cost *c = cost;
    float k = (float)count;
    float sum = PRICE(c, ADMIT) + c->evaluation + PRICE(c, IDLE) * (float)active +
                (k + 1.0f) * look_up(c, level);
    if (count >= c->limits.max_candidates || c->pairs > 1.0f)
        sum += PRICE(c, ROOM) * k + drop(c, k);
    if ((c->tables >> level & 1u) == 0u) sum += c->pairs * c->row;
    if (c->zones > 1.0f)
        sum += c->seam_row + (k + 1.0f) * PRICE(c, SEAM_DOT) * c->unknowns + 2.0f * c->evaluation;
    return sum;
}

float palp_cost_begin(const palp_touch_cost *cost, uint32_t count) {
    return PRICE(cost, BEGIN) + (float)count * (PRICE(cost, TARGET) + cost->evaluation);
}

/* One more row of the factor of n. */
static float append(const palp_touch_cost *c, float n) {
    return PRICE(c, APPEND) + n * (PRICE(c, GATHER) + PRICE(c, SUBSTITUTE) + PRICE(c, DOT)) +
           0.5f * n * n * PRICE(c, AXPY);
}

float palp_cost_refactor(const palp_touch_cost *cost, uint32_t active) {
    const palp_touch_cost *c = cost;
    float n = (float)active;
    return 0.5f * n * (n + 1.0f) * (PRICE(c, GATHER) + PRICE(c, SUBSTITUTE) + PRICE(c, DOT)) +
           n * n * n / 6.0f * PRICE(c, AXPY) + n * PRICE(c, APPEND);
}

float palp_cost_pivot_solve(const palp_touch_cost *cost, uint32_t active) {
    const palp_touch_cost *c = cost;
    float n = (float)active, columns = 3.0f * c->tools, half = 0.5f * n * n;
    return PRICE(c, PIVOT) + n * PRICE(c, ACTIVE) +
           (1.0f + columns) * (n * PRICE(c, SUBSTITUTE) + half * PRICE(c, AXPY)) +
           n * PRICE(c, SUBSTITUTE) + half * PRICE(c, DOT) +
           columns * (PRICE(c, SPRING) + n * (PRICE(c, ACTIVE) + PRICE(c, AXPY))) +
           columns * (columns + 1.0f) * n * PRICE(c, DOT);
}

float palp_cost_pivot_out(const palp_touch_cost *cost, uint32_t active) {
    float n = (float)active;
    return n * PRICE(cost, ROTATION) + 0.5f * n * n * PRICE(cost, ROTATE);
}

float palp_cost_relieve(const palp_touch_cost *cost, uint32_t count, uint32_t active) {
    float n = (float)active, idle = (float)count - n;
    return idle * (PRICE(cost, CHOICE) + n * PRICE(cost, IDLE));
}

float palp_cost_pivot_in(const palp_touch_cost *cost, uint32_t count, uint32_t active) {
    const palp_touch_cost *c = cost;
    float k = (float)count, n = (float)active;
    float choice =
        k * PRICE(c, CHOICE) + (k - n) * n * PRICE(c, IDLE) + c->tools * n * PRICE(c, FORCE);
    bool full = active >= c->limits.max_active;
    return choice + (full ? palp_cost_relieve(c, count, active) : append(c, n));
}

float palp_cost_pivot(const palp_touch_cost *cost, uint32_t count, uint32_t active) {
    return palp_cost_pivot_solve(cost, active) +
           palp_max(palp_cost_pivot_out(cost, active), palp_cost_pivot_in(cost, count, active));
}

float palp_cost_couple(const palp_touch_cost *cost, uint32_t active) {
    const palp_touch_cost *c = cost;
    float n = (float)active;
    float friction = c->limits.friction ? PRICE(c, FRICTION) + n * PRICE(c, FORCE) : 0.0f;
    return c->tools * (PRICE(c, COUPLE) + n * PRICE(c, FORCE) + friction);
}

float palp_cost_leave(const palp_touch_cost *cost, uint32_t active) {
    const palp_touch_cost *c = cost;
    float n = (float)active;
    float friction =
        c->limits.friction ? PRICE(c, FRICTION) + n * n * PRICE(c, FRICTION_PAIR) : 0.0f;
    return c->tools *
               (PRICE(c, LEAVE) + 4.0f * n * PRICE(c, FORCE) + n * n * PRICE(c, IDLE) + friction) +
           3.0f * n * PRICE(c, ACTIVE);
}

/* ---- zones ---- */

float palp_cost_follow(const palp_touch_cost *cost, uint32_t count, uint32_t active, float unknowns,
                       float solve) {
    const palp_touch_cost *c = cost;
    float k = (float)count, place = PRICE(c, PLACE) + 3.0f * c->modes * PRICE(c, PLACE_MODE);
    float aimed = c->pairs > 1.0f ? (float)c->limits.max_new : 0.0f;
    float pair = PRICE(c, PAIR) + 2.0f * c->extraction;
    return k * (c->pairs * place + 0.5f * solve + unknowns * PRICE(c, SEAM_MODE) +
                c->seam_width * PRICE(c, SEAM_DOT)) +
           (float)active * c->pairs * place +
           0.5f * k * (k + 1.0f) * (unknowns * PRICE(c, SEAM_DOT) + PRICE(c, MOVE)) +
           aimed * (c->nearest + c->row + 4.0f * c->place + 4.0f * k * pair);
}
