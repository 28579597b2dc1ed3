/* SPDX-License-Identifier: MIT */
/* Contact, first half: which basis functions are near a tool, and their compliances. */
#include "contact.h"
#include "core/base/frame.h"

#define MARGIN 0.35f /* candidates are taken in this far before they touch, over the size */
#define FACING 0.2f  /* least cosine between a new one's normal and the direction of the tool */
#define KEEP 1.25f   /* idle candidates are kept to this times the reach for new ones */
#define MAX_NEIGHBOURS 64u /* of a basis function on a coarse level */

static uint32_t level_in(const palp_node_contact *c, uint32_t body) {
    return c->assembly != NULL ? palp_node_contact_blob(c, body)->meta->constraint_level : c->level;
}

/* Longest row that a candidate may need, 0 if all compliances are in tables. */
static uint32_t longest_row(const palp_blob *b) {
    return b->level[b->meta->constraint_level].table != NULL ? 0u : b->meta->max_row;
}

void palp_node_contact_lay_out(palp_node_contact *contact, palp_arena *arena, uint32_t longest,
                               uint32_t most_slots) {
    palp_node_contact *c = contact;
    const palp_node_contact_limits l = c->limits;
    uint32_t slots = c->first_slot[c->bodies];
    size_t pairs = (size_t)l.max_candidates * l.max_candidates;
    uint32_t spots = c->seam_width > 0u ? 2u : 1u;
    c->candidate = palp_take(arena, l.max_candidates, sizeof *c->candidate);
    c->row = palp_take(arena, spots * l.max_candidates, sizeof *c->row);
    c->compliance = palp_take(arena, pairs, sizeof(float));
    c->block = l.friction ? palp_take(arena, 9u * pairs, sizeof(float)) : NULL;
    c->factor = palp_take(arena, (size_t)l.max_active * l.max_active, sizeof(float));
    c->active = palp_take(arena, l.max_active, sizeof(uint32_t));
    c->target = palp_take(arena, l.max_active + 1u, sizeof(float));
    c->work = palp_take(arena, l.max_active + 1u, sizeof(float));
    c->jacobian = palp_take(arena, 3u * PALP_MAX_TOOLS * (size_t)l.max_active, sizeof(float));
    c->place = palp_take(arena, slots, sizeof(uint16_t));
    c->scratch.weight = palp_take(arena, most_slots, sizeof(float));
    c->scratch.mark = palp_take(arena, (most_slots + 31u) / 32u, sizeof(uint32_t));
    if (c->seam_width > 0u) {
        c->local = palp_take(arena, pairs, sizeof(float));
        c->seam_row = palp_take(arena, (size_t)l.max_candidates * c->seam_width, sizeof(float));
        c->touched = palp_take(arena, l.max_candidates, sizeof(uint64_t));
    }
    for (uint32_t i = 0; i < spots * l.max_candidates; i++) {
        uint16_t *index = palp_take(arena, longest, sizeof(uint16_t));
        float *weight = palp_take(arena, longest, sizeof(float));
        if (arena->base != NULL) c->row[i] = (palp_row){.index = index, .weight = weight};
    }
}

bool palp_node_contact_limits_sound(palp_node_contact_limits l) {
    return l.max_candidates >= 1u && l.max_candidates <= PALP_MAX_CANDIDATES &&
           l.max_active >= 1u && l.max_active <= l.max_candidates && l.max_new >= 1u &&
           l.max_new <= l.max_candidates && l.max_pivots >= 1u;
}

size_t palp_node_contact_memsize(const palp_blob *blob, palp_node_contact_limits limits) {
    uint32_t slots = blob->domain[PALP_FREE].slots;
    palp_node_contact c = {.blob = blob, .limits = limits, .bodies = 1, .first_slot = {0, slots}};
    palp_arena arena = {0};
    palp_node_contact_lay_out(&c, &arena, longest_row(blob), slots);
    return arena.used;
}

palp_status palp_node_contact_begin_use(palp_node_contact *contact, const palp_tool *tools,
                                        uint32_t tool_count) {
    palp_node_contact *c = contact;
    if (tool_count < 1u || tool_count > PALP_MAX_TOOLS) return PALP_ERR_ARGUMENT;
    for (uint32_t t = 0; t < tool_count; t++) {
        if (!palp_tool_is_sound(&tools[t])) return PALP_ERR_ARGUMENT;
        if (tools[t].friction > 0.0f && !c->limits.friction) return PALP_ERR_ARGUMENT;
        c->size_m[t] = palp_tool_size(&tools[t]);
    }
    c->size_m[PALP_ZONE_TOOL] = c->blob->meta->mean_edge_m;
    c->tools = tools;
    c->tool_count = tool_count;
    c->level = c->blob->meta->constraint_level;
    return PALP_OK;
}

void palp_node_contact_clean(palp_node_contact *contact, uint32_t most_slots) {
    palp_node_contact *c = contact;
    for (uint32_t i = 0; i < c->first_slot[c->bodies]; i++) c->place[i] = 0;
    for (uint32_t i = 0; i < most_slots; i++) c->scratch.weight[i] = 0.0f;
    for (uint32_t i = 0; i < (most_slots + 31u) / 32u; i++) c->scratch.mark[i] = 0u;
}

palp_status palp_node_contact_init(palp_node_contact *contact, const palp_blob *blob,
                                   const float *position_m, const palp_tool *tools,
                                   uint32_t tool_count, palp_node_contact_limits limits,
                                   void *memory, size_t bytes) {
    palp_arena arena = {.base = memory};
    palp_node_contact *c = contact;
    uint32_t slots = blob->domain[PALP_FREE].slots;
    if (!palp_node_contact_limits_sound(limits)) return PALP_ERR_LIMITS;
    if (palp_blob_has(blob, PALP_META_SCALAR)) return PALP_ERR_ARGUMENT; /* nothing to touch */
    *c = (palp_node_contact){.blob = blob,
                             .position_m = position_m,
                             .limits = limits,
                             .bodies = 1,
                             .first_slot = {0, slots}};
    palp_status status = palp_node_contact_begin_use(c, tools, tool_count);
    if (status != PALP_OK) return status;
    if (memory == NULL || ((uintptr_t)memory & (PALP_ALIGN - 1u)) != 0u) return PALP_ERR_ALIGNMENT;
    if (bytes < palp_node_contact_memsize(blob, limits)) return PALP_ERR_MEMORY;
    palp_node_contact_lay_out(c, &arena, longest_row(blob), slots);
    palp_node_contact_clean(c, slots);
    return PALP_OK;
}

void palp_node_contact_clear(palp_node_contact *contact, uint32_t level) {
    for (uint32_t i = 0; i < contact->count; i++) {
        const palp_candidate *k = &contact->candidate[i];
        contact->place[contact->first_slot[k->body] + k->slot] = 0;
    }
    contact->count = contact->active_count = contact->changes = contact->flags = 0;
    bool table = contact->assembly == NULL && contact->blob->level[level].table != NULL;
    contact->level = table ? level : contact->blob->meta->constraint_level;
}

/* What one evaluation of a tool counts as. */
static uint32_t evaluation(const palp_node_contact *c, uint32_t tool) {
    if (tool == PALP_ZONE_TOOL) return 60u + c->place_work;
    return c->place_work + (c->tools[tool].balls > 0u ? 60u * c->tools[tool].balls : 160u);
}

/* ---- search ---- */

static float distance2(const float *position_m, uint32_t node, palp_vec3 p) {
    palp_vec3 d = palp_sub(palp_vec3_at(position_m + 3u * (size_t)node), p);
    return palp_dot(d, d);
}

/* Cell of coordinate x along `axis`, clamped to the grid. */
static uint32_t cell_of(const palp_meta *m, uint32_t axis, float x) {
    float cell = (x - m->cell_origin_m[axis]) / m->cell_size_m;
    float last = (float)(m->cells[axis] - 1u);
    return (uint32_t)palp_clamp(cell, 0.0f, last);
}

/* Nearest node among the 27 cells around p, then downhill along the surface. */
uint32_t palp_node_contact_nearest(const palp_node_contact *contact, uint32_t body,
                                   palp_vec3 rest_m, uint32_t nearest) {
    const palp_blob *blob = palp_node_contact_blob(contact, body);
    const float *place = contact->assembly != NULL ? blob->rest_m : contact->position_m;
    const palp_meta *m = blob->meta;
    const palp_vec3 p = rest_m;
    const float x[3] = {p.x, p.y, p.z};
    uint32_t low[3], high[3];
    for (uint32_t k = 0; k < 3; k++) {
        uint32_t cell = cell_of(m, k, x[k]);
        low[k] = cell > 0u ? cell - 1u : 0u;
        high[k] = cell + 1u < m->cells[k] ? cell + 1u : cell;
    }
    float best = distance2(place, nearest, p);
    for (uint32_t z = low[2]; z <= high[2]; z++) {
        for (uint32_t y = low[1]; y <= high[1]; y++) {
            uint32_t row = (z * m->cells[1] + y) * m->cells[0];
            for (uint32_t i = blob->cell_offset[row + low[0]];
                 i < blob->cell_offset[row + high[0] + 1u]; i++) {
                float d = distance2(place, blob->cell_node[i], p);
                if (d >= best) continue;
                best = d;
                nearest = blob->cell_node[i];
            }
        }
    }
    for (uint32_t step = 0; step < PALP_NODE_CONTACT_DESCENT; step++) {
        uint32_t from = nearest;
        for (uint32_t i = blob->ring_offset[from]; i < blob->ring_offset[from + 1u]; i++) {
            float d = distance2(place, blob->ring[i], p);
            if (d >= best) continue;
            best = d;
            nearest = blob->ring[i];
        }
        if (nearest == from) break;
    }
    return nearest;
}

/* The slot on the contact's level above `slot`: parents until one is coarse enough; the number of
 * slots if there is none. */
static uint32_t ancestor(const palp_node_contact *c, uint32_t body, uint32_t slot) {
    const palp_blob *b = palp_node_contact_blob(c, body);
    const palp_domain *d = &b->domain[PALP_FREE];
    uint32_t nodes = b->level[level_in(c, body)].nodes;
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
    uint32_t found, looks; /* listed; close looks left */
} proposals;

/* Keeps the `max_new` deepest proposals, deepest first. */
static void insert(palp_node_contact *c, proposals *p, palp_fresh fresh, float depth) {
    if (p->found == c->limits.max_new) c->flags |= PALP_NODE_CONTACT_DEFERRED;
    uint32_t at = p->found;
    /* at most max_new */
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

/* An idle candidate of another zone makes way for a tool. */
static bool gives_way(const palp_node_contact *c, uint32_t candidate) {
    return c->candidate[candidate].tool == PALP_ZONE_TOOL && !c->candidate[candidate].active;
}

/* Whether the slot is a candidate that stays one. */
static bool is_taken(const palp_node_contact *c, palp_fresh fresh) {
    uint16_t taken = c->place[c->first_slot[fresh.body] + fresh.slot];
    return taken != 0u && !gives_way(c, taken - 1u);
}

static palp_touch look_at(palp_node_contact *c, proposals *p, palp_fresh fresh) {
    p->looks--;
    uint32_t node = palp_node_contact_blob(c, fresh.body)->domain[PALP_FREE].node[fresh.slot];
    c->work_done += evaluation(c, fresh.tool);
    return palp_tool_at(&c->tools[fresh.tool], p->center[fresh.tool],
                        palp_node_contact_place(c, fresh.body, node),
                        palp_node_contact_normal(c, fresh.body, node));
}

/* Lists what a tool sees like this, if it is near enough and not listed yet. */
static void consider(palp_node_contact *c, proposals *p, palp_fresh fresh, palp_touch at) {
    if (at.facing < FACING || at.reach > 1.0f) return;
    if (at.depth_m < -MARGIN * c->size_m[fresh.tool]) return;
    for (uint32_t i = 0; i < p->found; i++) {
        if (p->fresh[i].slot == fresh.slot && p->fresh[i].body == fresh.body) return;
    }
    insert(c, p, fresh, at.depth_m);
}

/* Looks at a slot of the contact's level. */
static void propose(palp_node_contact *c, proposals *p, palp_fresh fresh) {
    const palp_blob *b = palp_node_contact_blob(c, fresh.body);
    if (c->assembly != NULL) fresh.slot = ancestor(c, fresh.body, fresh.slot);
    if (fresh.slot >= b->level[level_in(c, fresh.body)].nodes || is_taken(c, fresh)) return;
    if (p->looks > 0u) consider(c, p, fresh, look_at(c, p, fresh));
}

static void propose_neighbours(palp_node_contact *c, proposals *p, const palp_candidate *k) {
    const palp_blob *b = palp_node_contact_blob(c, k->body);
    if (k->tool == PALP_ZONE_TOOL) return; /* follow.c */
    if (k->level + 1u < b->meta->levels) {
        uint32_t near[MAX_NEIGHBOURS];
        uint32_t n =
            palp_level_neighbours(&b->domain[PALP_FREE], k->slot, k->level, near, MAX_NEIGHBOURS);
        for (uint32_t i = 0; i < n; i++)
            propose(c, p, (palp_fresh){near[i], k->tool, k->body, 0, 0});
        return;
    }
    for (uint32_t i = b->ring_offset[k->node]; i < b->ring_offset[k->node + 1u]; i++) {
        if (!palp_node_is_fixed(b, b->ring[i]))
            propose(c, p, (palp_fresh){palp_node_slot(b, b->ring[i]), k->tool, k->body, 0, 0});
    }
}

/* The last candidate takes the place of candidate i, which carries no force. */
static void drop(palp_node_contact *c, uint32_t i) {
    uint32_t last = --c->count;
    size_t stride = c->limits.max_candidates;
    const palp_candidate *gone = &c->candidate[i];
    c->place[c->first_slot[gone->body] + gone->slot] = 0;
    if (i == last) return;
    /* at most two: a row for each spot */
    for (size_t k = 0; k < (c->assembly != NULL ? 2u * stride : stride); k += stride) {
        palp_row spare = c->row[k + i];
        c->row[k + i] = c->row[k + last];
        c->row[k + last] = spare;
    }
    c->candidate[i] = c->candidate[last];
    c->place[c->first_slot[c->candidate[i].body] + c->candidate[i].slot] = (uint16_t)(i + 1u);
    for (uint32_t k = 0; k <= last; k++) {
        uint32_t from = k == i ? last : k;
        float g = c->compliance[last * stride + from];
        c->compliance[i * stride + k] = g;
        c->compliance[k * stride + i] = g;
        if (c->assembly != NULL) {
            g = c->local[last * stride + from];
            c->local[i * stride + k] = g;
            c->local[k * stride + i] = g;
        }
        if (c->block == NULL) continue;
        for (uint32_t e = 0; e < 9; e++) {
            float value = c->block[9u * (last * stride + from) + e];
            c->block[9u * (i * stride + k) + e] = value;
            c->block[9u * (k * stride + i) + (e % 3u) * 3u + e / 3u] = value;
        }
    }
    for (uint32_t k = 0; k < c->seam_width; k++)
        c->seam_row[(size_t)i * c->seam_width + k] = c->seam_row[(size_t)last * c->seam_width + k];
    if (c->assembly != NULL) c->touched[i] = c->touched[last];
    for (uint32_t a = 0; a < c->active_count; a++) {
        if (c->active[a] == last) c->active[a] = i;
    }
    c->work_done += (c->block != NULL ? 18u * last : last) + c->seam_width;
}

/*
 * Backing out shrinks the relief of idle candidates: what the tool of the last solve, where its
 * grip let it rest, still asked of them, with the forces of that solve.
 */
static void shrink_relief(palp_node_contact *c) {
    palp_vec3 moved[PALP_MAX_TOOLS + 1u] = {{0}};
    for (uint32_t t = 0; t < c->tool_count; t++) {
        if (c->grip[t].stiffness_N_per_m > 0.0f)
            moved[t] =
                palp_scale(1.0f / c->grip[t].stiffness_N_per_m, palp_node_contact_force(c, t));
    }
    for (uint32_t i = 0; i < c->count; i++) {
        palp_candidate *k = &c->candidate[i];
        if (!(k->relief_m > 0.0f) || k->active) continue;
        float missing = k->target_m - palp_dot(k->at.push, moved[k->tool]) -
                        palp_node_contact_indentation(c, i);
        c->work_done += c->active_count;
        if (missing < 0.0f) k->relief_m = palp_max(k->relief_m + missing, 0.0f);
    }
}

/* Those out of reach, at most as many as a tick may take in. */
static void drop_idle(palp_node_contact *c, const palp_vec3 *center) {
    uint32_t left = c->limits.max_new;
    for (uint32_t i = c->count; i-- > 0u;) {
        palp_candidate *k = &c->candidate[i];
        k->at = palp_node_contact_see(c, k, center);
        c->work_done += evaluation(c, k->tool);
        bool near = k->at.depth_m > -2.0f * MARGIN * c->size_m[k->tool] && k->at.reach < KEEP;
        if (near || k->active || left == 0u) continue;
        drop(c, i);
        left--;
    }
}

static bool touches(const palp_node_contact *c, uint32_t tool) {
    for (uint32_t a = 0; a < c->active_count; a++) {
        if (c->candidate[c->active[a]].tool == tool) return true;
    }
    return false;
}

/* Whether the tool at p is near enough to a body to look for its nearest node; p in its frame. */
static bool may_touch(const palp_node_contact *c, uint32_t body, uint32_t tool, palp_vec3 p) {
    if (c->assembly == NULL) return !touches(c, tool);
    const palp_meta *m = palp_node_contact_blob(c, body)->meta;
    const float at[3] = {p.x, p.y, p.z};
    float reach = 2.0f * c->size_m[tool] + 0.25f * palp_norm(palp_sub(palp_vec3_at(m->box_max_m),
                                                                      palp_vec3_at(m->box_min_m)));
    for (uint32_t k = 0; k < 3; k++) {
        if (at[k] < m->box_min_m[k] - reach || at[k] > m->box_max_m[k] + reach) return false;
    }
    return true;
}

/* The nearest nodes of the bodies near a tool. */
static void propose_nearest(palp_node_contact *c, proposals *p, uint32_t t) {
    palp_vec3 probe = palp_tool_probe(&c->tools[t], p->center[t], c->probe);
    for (uint32_t k = 0; k < c->bodies; k++) {
        const palp_blob *b = palp_node_contact_blob(c, k);
        palp_vec3 at = c->assembly != NULL ? palp_carry_back(&c->assembly->world[k], probe) : probe;
        if (!may_touch(c, k, t, at)) continue;
        uint32_t *nearest = &c->nearest[k][t];
        *nearest = palp_node_contact_nearest(c, k, at, *nearest);
        if (palp_node_is_fixed(b, *nearest)) continue;
        uint32_t slot = ancestor(c, k, palp_node_slot(b, *nearest));
        if (slot < b->level[level_in(c, k)].nodes) propose(c, p, (palp_fresh){slot, t, k, 0, 0});
    }
}

/* Around the next candidates in turn. */
static void propose_walk(palp_node_contact *c, proposals *p) {
    for (uint32_t i = 0; i < PALP_NODE_CONTACT_WALK && i < c->count && p->looks > 0u; i++) {
        c->walk = c->walk + 1u < c->count ? c->walk + 1u : 0u;
        propose_neighbours(c, p, &c->candidate[c->walk]);
    }
}

/* The next slots in turn. */
static void propose_scan(palp_node_contact *c, proposals *p) {
    uint32_t body = 0, nodes = c->blob->level[c->level].nodes;
    const uint32_t tools = c->tool_count;
    if (tools == 0u) return;
    if (c->assembly != NULL) nodes = c->first_slot[c->bodies];
    p->looks = PALP_NODE_CONTACT_SCAN;
    for (uint32_t i = 0; i < PALP_NODE_CONTACT_SCAN && i < nodes && p->looks > 0u; i++) {
        c->scan = c->scan + 1u < nodes ? c->scan + 1u : 0u;
        /* both in all at most bodies */
        while (body > 0u && c->scan < c->first_slot[body]) body--;
        /* in all at most bodies */
        while (body + 1u < c->bodies && c->scan >= c->first_slot[body + 1u]) body++;
        uint32_t tool = (c->scan + c->probe) % tools;
        propose(c, p, (palp_fresh){c->scan - c->first_slot[body], tool, body, 0, 0});
    }
}

uint32_t palp_node_contact_search(palp_node_contact *contact, const palp_vec3 *center,
                                  palp_fresh *fresh) {
    palp_node_contact *c = contact;
    if (c->tool_count == 0u) return 0; /* init refuses that */
    proposals p = {.center = center, .fresh = fresh, .looks = PALP_NODE_CONTACT_LOOKS};
    c->flags = 0;
    c->pivots = 0;
    shrink_relief(c);
    drop_idle(c, center);
    for (uint32_t t = 0; t < c->tool_count; t++) {
        c->about[t] = center[t];
        propose_nearest(c, &p, t);
    }
    c->probe++;
    propose_walk(c, &p);
    propose_scan(c, &p);
    if (c->assembly == NULL) return p.found;
    return p.found +
           palp_node_contact_search_pairs(c, fresh + p.found, c->limits.max_new - p.found);
}

/* ---- compliances ---- */

/* The 3x3 compliance between candidates i and j (i felt, j pushed). */
static void block_between(palp_node_contact *c, uint32_t i, uint32_t j, float block[9]) {
    const palp_blob *b = c->blob;
    uint32_t slot_i = c->candidate[i].slot, slot_j = c->candidate[j].slot;
    if (b->level[c->level].table != NULL) {
        palp_table_block(b, c->level, slot_i, slot_j, block);
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

static void cache_pair(palp_node_contact *c, uint32_t i, uint32_t j) {
    size_t stride = c->limits.max_candidates;
    float block[9];
    block_between(c, i, j, block);
    palp_vec3 n = c->candidate[j].n;
    float g = palp_dot(c->candidate[i].n, palp_rotate(block, n));
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
static bool make_room(palp_node_contact *c, float depth_m) {
    uint32_t farthest = c->count;
    float least = depth_m;
    for (uint32_t k = 0; k < c->count; k++) {
        if (c->candidate[k].at.depth_m >= least || c->candidate[k].active) continue;
        least = c->candidate[k].at.depth_m;
        farthest = k;
    }
    c->work_done += c->count;
    if (farthest < c->count) {
        drop(c, farthest);
        return true;
    }
    if (depth_m > 0.0f) c->flags |= PALP_NODE_CONTACT_CANDIDATES_FULL;
    return false;
}

/* The row of W^-1 for a place on a body; true where a table makes it needless. */
bool palp_node_contact_make_row(palp_node_contact *contact, uint32_t body, uint32_t slot,
                                palp_row *row) {
    palp_node_contact *c = contact;
    const palp_blob *b = palp_node_contact_blob(c, body);
    uint32_t level = level_in(c, body);
    return b->level[level].table != NULL ||
           palp_basis_row(b, (palp_basis){level, slot}, &c->scratch, row, b->meta->max_row);
}

/* What a candidate for this place would be. */
static palp_candidate describe(const palp_node_contact *c, palp_fresh fresh, uint32_t level) {
    const palp_blob *b = palp_node_contact_blob(c, fresh.body);
    uint32_t node = b->domain[PALP_FREE].node[fresh.slot];
    palp_candidate k = {.node = node,
                        .slot = fresh.slot,
                        .level = level,
                        .tool = fresh.tool,
                        .body = fresh.body,
                        .d = palp_vec3_at(b->normal + 3u * (size_t)node),
                        .x = palp_node_contact_place(c, fresh.body, node),
                        .n = palp_node_contact_normal(c, fresh.body, node)};
    if (fresh.tool == PALP_ZONE_TOOL) {
        k.facing = (palp_spot){.body = fresh.facing_body, .node = fresh.facing_node};
        palp_node_contact_aim(c, &k);
    }
    k.at = palp_node_contact_see(c, &k, c->about);
    return k;
}

void palp_node_contact_admit(palp_node_contact *contact, palp_fresh fresh) {
    palp_node_contact *c = contact;
    const uint32_t level = level_in(c, fresh.body);
    uint16_t *place = &c->place[c->first_slot[fresh.body] + fresh.slot];
    size_t stride = c->limits.max_candidates;
    if (*place != 0u && fresh.tool != PALP_ZONE_TOOL && gives_way(c, *place - 1u))
        drop(c, *place - 1u);
    if (*place != 0u || fresh.slot >= palp_node_contact_blob(c, fresh.body)->level[level].nodes)
        return;
    palp_candidate made = describe(c, fresh, level);
    if (c->count == c->limits.max_candidates && !make_room(c, made.at.depth_m)) return;
    uint32_t i = c->count;
    palp_candidate *k = &c->candidate[i];
    *k = made;
    bool fits =
        palp_node_contact_make_row(c, k->body, k->slot, &c->row[i]) &&
        (k->tool != PALP_ZONE_TOOL ||
         palp_node_contact_make_row(c, k->facing.body, k->facing.slot, &c->row[stride + i]));
    if (!fits) { /* a blob that understates max_row */
        c->flags |= PALP_NODE_CONTACT_CANDIDATES_FULL;
        return;
    }
    *place = (uint16_t)(i + 1u);
    c->count++;
    if (c->assembly != NULL) palp_node_contact_join(c, i);
    for (uint32_t j = 0; j <= i && c->assembly == NULL; j++) cache_pair(c, i, j);
    k->relief_m = palp_max(k->at.depth_m - palp_node_contact_indentation(c, i), 0.0f);
    k->target_m = k->at.depth_m - k->relief_m;
}
