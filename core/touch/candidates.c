/* SPDX-License-Identifier: MIT */
/* Contact, first half: which basis functions are near a tool, and their compliances. */
#include "contact.h"

#define MARGIN 0.35f /* candidates are taken in this far before they touch, over the size */
#define FACING 0.2f  /* least cosine between a new one's normal and the direction of the tool */
#define DESCENT_STEPS 32u  /* moves of the nearest node per search */
#define KEEP 1.25f         /* idle candidates are kept to this times the reach for new ones */
#define MAX_NEIGHBOURS 64u /* of a basis function on a coarse level */
#define BORDER 0.15f       /* idle candidates may be this far on the wrong side of the zone */

static void lay_out(palp_contact *c, const palp_blob *b, palp_contact_limits l, palp_arena *arena) {
    uint32_t slots = b->domain[PALP_FREE].slots;
    size_t pairs = (size_t)l.max_candidates * l.max_candidates;
    bool table = b->level[b->meta->constraint_level].table != NULL;
    *c = (palp_contact){.blob = b, .limits = l};
    c->candidate = palp_take(arena, l.max_candidates, sizeof *c->candidate);
    c->row = palp_take(arena, l.max_candidates, sizeof *c->row);
    c->compliance = palp_take(arena, pairs, sizeof(float));
    c->block = l.friction ? palp_take(arena, 9u * pairs, sizeof(float)) : NULL;
    c->factor = palp_take(arena, (size_t)l.max_active * l.max_active, sizeof(float));
    c->active = palp_take(arena, l.max_active, sizeof(uint32_t));
    c->target = palp_take(arena, l.max_active + 1u, sizeof(float));
    c->work = palp_take(arena, l.max_active + 1u, sizeof(float));
    c->jacobian = palp_take(arena, 3u * PALP_MAX_TOOLS * (size_t)l.max_active, sizeof(float));
    c->place = palp_take(arena, slots, sizeof(uint16_t));
    c->scratch.weight = palp_take(arena, slots, sizeof(float));
    c->scratch.mark = palp_take(arena, (slots + 31u) / 32u, sizeof(uint32_t));
    for (uint32_t i = 0; i < l.max_candidates; i++) {
        uint32_t longest = table ? 0u : b->meta->max_row;
        uint16_t *index = palp_take(arena, longest, sizeof(uint16_t));
        float *weight = palp_take(arena, longest, sizeof(float));
        if (arena->base != NULL) c->row[i] = (palp_row){.index = index, .weight = weight};
    }
}

bool palp_contact_limits_sound(palp_contact_limits l) {
    return l.max_candidates >= 1u && l.max_candidates <= PALP_MAX_CANDIDATES &&
           l.max_active >= 1u && l.max_active <= l.max_candidates && l.max_new >= 1u &&
           l.max_new <= l.max_candidates && l.max_pivots >= 1u;
}

size_t palp_contact_memsize(const palp_blob *blob, palp_contact_limits limits) {
    palp_contact c;
    palp_arena arena = {0};
    lay_out(&c, blob, limits, &arena);
    return arena.used;
}

palp_status palp_contact_init(palp_contact *contact, const palp_blob *blob, const float *position_m,
                              const palp_tool *tools, uint32_t tool_count,
                              palp_contact_limits limits, void *memory, size_t bytes) {
    palp_arena arena = {.base = memory};
    if (!palp_contact_limits_sound(limits)) return PALP_ERR_LIMITS;
    if (tool_count < 1u || tool_count > PALP_MAX_TOOLS) return PALP_ERR_ARGUMENT;
    if (palp_blob_has(blob, PALP_META_SCALAR)) return PALP_ERR_ARGUMENT; /* nothing to touch */
    for (uint32_t t = 0; t < tool_count; t++) {
        if (!palp_tool_is_sound(&tools[t])) return PALP_ERR_ARGUMENT;
        if (tools[t].friction > 0.0f && !limits.friction) return PALP_ERR_ARGUMENT;
    }
    if (memory == NULL || ((uintptr_t)memory & (PALP_ALIGN - 1u)) != 0u) return PALP_ERR_ALIGNMENT;
    if (bytes < palp_contact_memsize(blob, limits)) return PALP_ERR_MEMORY;
    lay_out(contact, blob, limits, &arena);
    uint32_t slots = blob->domain[PALP_FREE].slots;
    contact->position_m = position_m;
    contact->tools = tools;
    contact->tool_count = tool_count;
    for (uint32_t t = 0; t < tool_count; t++) contact->size_m[t] = palp_tool_size(&tools[t]);
    contact->level = contact->outer = blob->meta->constraint_level;
    for (uint32_t i = 0; i < slots; i++) contact->place[i] = 0;
    for (uint32_t i = 0; i < slots; i++) contact->scratch.weight[i] = 0.0f;
    for (uint32_t i = 0; i < (slots + 31u) / 32u; i++) contact->scratch.mark[i] = 0u;
    return PALP_OK;
}

void palp_contact_clear(palp_contact *contact, uint32_t level) {
    for (uint32_t i = 0; i < contact->count; i++) contact->place[contact->candidate[i].slot] = 0;
    contact->count = contact->active_count = contact->changes = contact->flags = 0;
    bool table = contact->blob->level[level].table != NULL;
    contact->level = table ? level : contact->blob->meta->constraint_level;
    contact->outer = contact->level;
}

void palp_contact_clear_mixed(palp_contact *contact, uint32_t level, uint32_t outer, float zone) {
    palp_contact_clear(contact, level);
    contact->outer = outer;
    contact->zone = zone;
}

static palp_vec3 position(const palp_contact *c, uint32_t node) {
    return palp_vec3_at(c->position_m + 3u * node);
}
static palp_vec3 normal(const palp_contact *c, uint32_t node) {
    return palp_vec3_at(c->blob->normal + 3u * node);
}

/* What one evaluation of a tool counts as. */
static uint32_t evaluation(const palp_tool *t) { return t->balls > 0u ? 60u * t->balls : 160u; }

static bool is_mixed(const palp_contact *c) { return c->outer != c->level; }

uint32_t palp_contact_level_of(const palp_contact *contact, uint32_t slot, uint32_t tool) {
    const palp_contact *c = contact;
    const palp_blob *b = c->blob;
    if (slot >= b->level[c->level].nodes) return PALP_MAX_LEVELS;
    if (!is_mixed(c)) return c->level;
    uint32_t node = b->domain[PALP_FREE].node[slot];
    palp_touch at =
        palp_tool_at(&c->tools[tool], c->about[tool], position(c, node), normal(c, node));
    if (at.reach <= c->zone) return c->level;
    return slot < b->level[c->outer].nodes ? c->outer : PALP_MAX_LEVELS;
}

/* ---- search ---- */

static float distance2(const palp_contact *c, uint32_t node, palp_vec3 p) {
    palp_vec3 d = palp_sub(position(c, node), p);
    return palp_dot(d, d);
}

/* Cell of coordinate x along `axis`, clamped to the grid. */
static uint32_t cell_of(const palp_meta *m, uint32_t axis, float x) {
    float cell = (x - m->cell_origin_m[axis]) / m->cell_size_m;
    float last = (float)(m->cells[axis] - 1u);
    return (uint32_t)palp_clamp(cell, 0.0f, last);
}

/* Nearest node among the 27 cells around p, then downhill along the surface. */
static uint32_t find_nearest(const palp_contact *c, palp_vec3 p, uint32_t nearest) {
    const palp_meta *m = c->blob->meta;
    const float x[3] = {p.x, p.y, p.z};
    uint32_t low[3], high[3];
    for (uint32_t k = 0; k < 3; k++) {
        uint32_t cell = cell_of(m, k, x[k]);
        low[k] = cell > 0u ? cell - 1u : 0u;
        high[k] = cell + 1u < m->cells[k] ? cell + 1u : cell;
    }
    float best = distance2(c, nearest, p);
    for (uint32_t z = low[2]; z <= high[2]; z++) {
        for (uint32_t y = low[1]; y <= high[1]; y++) {
            uint32_t row = (z * m->cells[1] + y) * m->cells[0];
            for (uint32_t i = c->blob->cell_offset[row + low[0]];
                 i < c->blob->cell_offset[row + high[0] + 1u]; i++) {
                float d = distance2(c, c->blob->cell_node[i], p);
                if (d >= best) continue;
                best = d;
                nearest = c->blob->cell_node[i];
            }
        }
    }
    for (uint32_t step = 0; step < DESCENT_STEPS; step++) {
        uint32_t from = nearest;
        for (uint32_t i = c->blob->ring_offset[from]; i < c->blob->ring_offset[from + 1u]; i++) {
            float d = distance2(c, c->blob->ring[i], p);
            if (d >= best) continue;
            best = d;
            nearest = c->blob->ring[i];
        }
        if (nearest == from) break;
    }
    return nearest;
}

/* The slot on the contact's level above `slot`: parents until one is coarse enough; the number of
 * slots if there is none. */
static uint32_t ancestor(const palp_contact *c, uint32_t slot) {
    const palp_domain *d = &c->blob->domain[PALP_FREE];
    uint32_t nodes = c->blob->level[c->level].nodes;
    for (uint32_t l = 0; l < PALP_MAX_LEVELS && slot >= nodes; l++) {
        uint32_t side = d->predict[2u * slot] > 0.0f ? 0u : 1u;
        if (!(d->predict[2u * slot + side] > 0.0f)) return d->slots;
        slot = d->parent[2u * slot + side];
    }
    return slot;
}

typedef struct {
    const palp_vec3 *center;
    palp_fresh *fresh;
    float depth[PALP_MAX_CANDIDATES];
    uint32_t found;
} proposals;

/* Keeps the `max_new` deepest proposals, deepest first. */
static void insert(palp_contact *c, proposals *p, palp_fresh fresh, float depth) {
    if (p->found == c->limits.max_new) c->flags |= PALP_CONTACT_DEFERRED;
    uint32_t at = p->found;
    while (at > 0u && p->depth[at - 1u] < depth) at--;
    if (at == c->limits.max_new) return;
    uint32_t last = p->found < c->limits.max_new ? p->found : p->found - 1u;
    for (uint32_t i = last; i > at; i--) {
        p->fresh[i] = p->fresh[i - 1u];
        p->depth[i] = p->depth[i - 1u];
    }
    p->fresh[at] = fresh;
    p->depth[at] = depth;
    p->found = last + 1u;
}

static void propose_one(palp_contact *c, proposals *p, uint32_t slot, uint32_t tool) {
    if (c->place[slot] != 0u) return;
    uint32_t node = c->blob->domain[PALP_FREE].node[slot];
    const palp_tool *t = &c->tools[tool];
    palp_touch at = palp_tool_at(t, p->center[tool], position(c, node), normal(c, node));
    c->work_done += evaluation(t);
    if (at.facing < FACING || at.reach > 1.0f) return;
    if (at.depth_m < -MARGIN * c->size_m[tool]) return;
    for (uint32_t i = 0; i < p->found; i++) {
        if (p->fresh[i].slot == slot) return;
    }
    insert(c, p, (palp_fresh){slot, tool}, at.depth_m);
}

/* A slot, or the hats above it where the set is coarse. */
static void propose(palp_contact *c, proposals *p, uint32_t slot, uint32_t tool) {
    const palp_domain *d = &c->blob->domain[PALP_FREE];
    if (is_mixed(c)) c->work_done += 3u * evaluation(&c->tools[tool]);
    if (palp_contact_level_of(c, slot, tool) < PALP_MAX_LEVELS) {
        propose_one(c, p, slot, tool);
        return;
    }
    for (uint32_t side = 0; side < 2; side++) {
        uint32_t parent = d->parent[2u * slot + side];
        bool known = d->predict[2u * slot + side] > 0.0f &&
                     palp_contact_level_of(c, parent, tool) < PALP_MAX_LEVELS;
        if (known) propose_one(c, p, parent, tool);
    }
}

static void propose_neighbours(palp_contact *c, proposals *p, const palp_candidate *k) {
    const palp_blob *b = c->blob;
    if (k->level + 1u < b->meta->levels) {
        uint32_t near[MAX_NEIGHBOURS];
        uint32_t n =
            palp_level_neighbours(&b->domain[PALP_FREE], k->slot, k->level, near, MAX_NEIGHBOURS);
        for (uint32_t i = 0; i < n; i++) propose(c, p, near[i], k->tool);
        return;
    }
    for (uint32_t i = b->ring_offset[k->node]; i < b->ring_offset[k->node + 1u]; i++) {
        if (!palp_node_is_fixed(b, b->ring[i]))
            propose(c, p, palp_node_slot(b, b->ring[i]), k->tool);
    }
}

/* The last candidate takes the place of candidate i, which carries no force. */
static void drop(palp_contact *c, uint32_t i) {
    uint32_t last = --c->count;
    size_t stride = c->limits.max_candidates;
    c->place[c->candidate[i].slot] = 0;
    if (i == last) return;
    palp_row spare = c->row[i];
    c->candidate[i] = c->candidate[last];
    c->row[i] = c->row[last];
    c->row[last] = spare;
    c->place[c->candidate[i].slot] = (uint16_t)(i + 1u);
    for (uint32_t k = 0; k <= last; k++) {
        uint32_t from = k == i ? last : k;
        float g = c->compliance[last * stride + from];
        c->compliance[i * stride + k] = g;
        c->compliance[k * stride + i] = g;
        if (c->block == NULL) continue;
        for (uint32_t e = 0; e < 9; e++) {
            float value = c->block[9u * (last * stride + from) + e];
            c->block[9u * (i * stride + k) + e] = value;
            c->block[9u * (k * stride + i) + (e % 3u) * 3u + e / 3u] = value;
        }
    }
    for (uint32_t a = 0; a < c->active_count; a++) {
        if (c->active[a] == last) c->active[a] = i;
    }
    c->work_done += c->block != NULL ? 18u * last : last;
}

/*
 * Backing out shrinks the relief of idle candidates: what the tool of the last solve, where its
 * grip let it rest, still asked of them, with the forces of that solve.
 */
static void shrink_relief(palp_contact *c) {
    palp_vec3 moved[PALP_MAX_TOOLS] = {{0}};
    for (uint32_t t = 0; t < c->tool_count; t++) {
        if (c->grip[t].stiffness_N_per_m > 0.0f)
            moved[t] = palp_scale(1.0f / c->grip[t].stiffness_N_per_m, palp_contact_force(c, t));
    }
    for (uint32_t i = 0; i < c->count; i++) {
        palp_candidate *k = &c->candidate[i];
        if (!(k->relief_m > 0.0f) || palp_contact_is_active(c, i)) continue;
        float missing =
            k->target_m - palp_dot(k->at.push, moved[k->tool]) - palp_contact_indentation(c, i);
        c->work_done += c->active_count;
        if (missing < 0.0f) k->relief_m = palp_max(k->relief_m + missing, 0.0f);
    }
}

static void drop_idle(palp_contact *c, const palp_vec3 *center) {
    for (uint32_t i = c->count; i-- > 0u;) {
        palp_candidate *k = &c->candidate[i];
        const palp_tool *t = &c->tools[k->tool];
        k->at = palp_tool_at(t, center[k->tool], k->x, k->n);
        c->work_done += evaluation(t);
        float slack = BORDER * palp_max(palp_abs(c->zone), BORDER);
        float border = k->level == c->level ? c->zone + slack : c->zone - slack;
        bool misplaced = is_mixed(c) && (k->at.reach <= border) != (k->level == c->level);
        bool near =
            !misplaced && k->at.depth_m > -2.0f * MARGIN * c->size_m[k->tool] && k->at.reach < KEEP;
        if (!near && !palp_contact_is_active(c, i)) drop(c, i);
    }
}

static bool touches(const palp_contact *c, uint32_t tool) {
    for (uint32_t a = 0; a < c->active_count; a++) {
        if (c->candidate[c->active[a]].tool == tool) return true;
    }
    return false;
}

uint32_t palp_contact_search(palp_contact *contact, const palp_vec3 *center, palp_fresh *fresh) {
    palp_contact *c = contact;
    const uint32_t tools = c->tool_count;
    if (tools == 0u) return 0; /* init refuses that */
    const palp_blob *b = c->blob;
    proposals p = {.center = center, .fresh = fresh};
    c->flags = 0;
    c->pivots = 0;
    shrink_relief(c);
    drop_idle(c, center);
    for (uint32_t t = 0; t < c->tool_count; t++) {
        c->about[t] = center[t];
        if (touches(c, t)) continue;
        palp_vec3 probe = palp_tool_probe(&c->tools[t], center[t], c->probe);
        c->nearest[t] = find_nearest(c, probe, c->nearest[t]);
        if (palp_node_is_fixed(b, c->nearest[t])) continue;
        uint32_t slot = ancestor(c, palp_node_slot(b, c->nearest[t]));
        if (slot < b->level[c->level].nodes) propose(c, &p, slot, t);
    }
    c->probe++;
    for (uint32_t i = 0; i < c->count; i++) propose_neighbours(c, &p, &c->candidate[i]);
    uint32_t nodes = b->level[c->level].nodes;
    for (uint32_t i = 0; i < PALP_CONTACT_SCAN && i < nodes; i++) {
        c->scan = c->scan + 1u < nodes ? c->scan + 1u : 0u;
        propose(c, &p, c->scan, (c->scan + c->probe) % tools);
    }
    return p.found;
}

/* ---- compliances ---- */

/* The block between the hat `a` and [inner,b]: what R says of the inner level's table. */
static void mixed_block(palp_contact *c, uint32_t a, uint32_t b, float block[9]) {
    const palp_blob *blob = c->blob;
    const palp_domain *d = &blob->domain[PALP_FREE];
    palp_child_range r = palp_children(d, a, c->level);
    float one[9], share = palp_own_share(blob, c->outer, a);
    palp_table_block(blob, c->level, a, b, one);
    for (uint32_t e = 0; e < 9; e++) block[e] = share * one[e];
    for (uint32_t k = r.first; k < r.end; k++) {
        share = palp_child_share(blob, c->outer, a, d->child[k]);
        palp_table_block(blob, c->level, d->child[k], b, one);
        for (uint32_t e = 0; e < 9; e++) block[e] += share * one[e];
    }
    c->work_done += 9u * (uint64_t)(1u + r.end - r.first);
}

/* The 3x3 compliance between candidates i and j (i felt, j pushed). */
static void block_between(palp_contact *c, uint32_t i, uint32_t j, float block[9]) {
    const palp_blob *b = c->blob;
    uint32_t slot_i = c->candidate[i].slot, slot_j = c->candidate[j].slot;
    uint32_t level_i = c->candidate[i].level, level_j = c->candidate[j].level;
    if (level_i < level_j) {
        mixed_block(c, slot_i, slot_j, block);
        return;
    }
    if (level_i > level_j) {
        float turned[9];
        mixed_block(c, slot_j, slot_i, turned);
        for (uint32_t e = 0; e < 9; e++) block[e] = turned[(e % 3u) * 3u + e / 3u];
        return;
    }
    if (b->level[level_i].table != NULL) {
        palp_table_block(b, level_i, slot_i, slot_j, block);
        c->work_done += 9u;
        return;
    }
    const palp_columns *columns = &b->level[c->level].columns;
    float back[9];
    palp_columns_extract(columns, slot_j, &c->row[i], block);
    c->work_done += c->row[i].count;
    if (i == j) return;
    palp_columns_extract(columns, slot_i, &c->row[j], back);
    c->work_done += c->row[j].count;
    for (uint32_t e = 0; e < 9; e++) block[e] = 0.5f * (block[e] + back[(e % 3u) * 3u + e / 3u]);
}

static void cache_pair(palp_contact *c, uint32_t i, uint32_t j) {
    size_t stride = c->limits.max_candidates;
    float block[9];
    block_between(c, i, j, block);
    palp_vec3 n = c->candidate[j].n;
    palp_vec3 u = {palp_dot(palp_vec3_at(block), n), palp_dot(palp_vec3_at(block + 3), n),
                   palp_dot(palp_vec3_at(block + 6), n)};
    float g = palp_dot(c->candidate[i].n, u);
    if (i == j) g += c->blob->softening[c->candidate[i].node];
    c->compliance[i * stride + j] = g;
    c->compliance[j * stride + i] = g;
    if (c->block == NULL) return;
    for (uint32_t e = 0; e < 9; e++) {
        c->block[9u * (i * stride + j) + e] = block[e];
        c->block[9u * (j * stride + i) + (e % 3u) * 3u + e / 3u] = block[e];
    }
}

/* Drops the idle candidate farthest from its tool, if the new one is nearer. */
static bool make_room(palp_contact *c, palp_fresh fresh) {
    uint32_t node = c->blob->domain[PALP_FREE].node[fresh.slot], farthest = c->count;
    float depth = palp_tool_at(&c->tools[fresh.tool], c->about[fresh.tool], position(c, node),
                               normal(c, node))
                      .depth_m;
    float least = depth;
    for (uint32_t k = 0; k < c->count; k++) {
        if (c->candidate[k].at.depth_m >= least || palp_contact_is_active(c, k)) continue;
        least = c->candidate[k].at.depth_m;
        farthest = k;
    }
    c->work_done += (uint64_t)c->count * (1u + c->active_count);
    if (farthest < c->count) {
        drop(c, farthest);
        return true;
    }
    if (depth > 0.0f) c->flags |= PALP_CONTACT_CANDIDATES_FULL;
    return false;
}

void palp_contact_admit(palp_contact *contact, palp_fresh fresh) {
    palp_contact *c = contact;
    uint32_t i = c->count, node = c->blob->domain[PALP_FREE].node[fresh.slot];
    uint32_t level = palp_contact_level_of(c, fresh.slot, fresh.tool);
    if (c->place[fresh.slot] != 0u || level == PALP_MAX_LEVELS) return;
    if (i == c->limits.max_candidates && !make_room(c, fresh)) return;
    i = c->count;
    palp_candidate *k = &c->candidate[i];
    *k = (palp_candidate){.node = node,
                          .slot = fresh.slot,
                          .level = level,
                          .tool = fresh.tool,
                          .x = position(c, node),
                          .n = normal(c, node)};
    bool fits = c->blob->level[c->level].table != NULL ||
                palp_basis_row(c->blob, (palp_basis){c->level, fresh.slot}, &c->scratch, &c->row[i],
                               c->blob->meta->max_row);
    if (!fits) { /* a blob that understates max_row */
        c->flags |= PALP_CONTACT_CANDIDATES_FULL;
        return;
    }
    c->place[fresh.slot] = (uint16_t)(i + 1u);
    c->count++;
    for (uint32_t j = 0; j <= i; j++) cache_pair(c, i, j);
    k->at = palp_tool_at(&c->tools[k->tool], c->about[k->tool], k->x, k->n);
    k->relief_m = palp_max(k->at.depth_m - palp_contact_indentation(c, i), 0.0f);
    k->target_m = k->at.depth_m - k->relief_m;
}
