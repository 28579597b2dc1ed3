/* SPDX-License-Identifier: MIT */
/* Contact, third part: bodies that move. Candidates on the zones of a multizone model, the seams'
 * part of their compliances, and zones that touch each other. */
#include "contact.h"

#define OPPOSED -0.3f    /* cosine between normals that face each other */
#define PAIR_MARGIN 0.5f /* over the mean edge, before they touch */
#define PAIR_ASIDE 1.5f  /* over the mean edge, along the surface */
#define RENEW 0x10000u   /* changes that make the factor of the active set due */

const palp_blob *palp_node_contact_blob(const palp_node_contact *contact, uint32_t body) {
    return contact->assembly != NULL ? &contact->assembly->zones->blob[body] : contact->blob;
}

palp_vec3 palp_node_contact_place(const palp_node_contact *contact, uint32_t body, uint32_t node) {
    if (contact->assembly != NULL) return palp_assembly_place(contact->assembly, body, node);
    return palp_vec3_at(contact->position_m + 3u * (size_t)node);
}

palp_vec3 palp_node_contact_normal(const palp_node_contact *contact, uint32_t body, uint32_t node) {
    if (contact->assembly != NULL) return palp_assembly_normal(contact->assembly, body, node);
    return palp_vec3_at(contact->blob->normal + 3u * (size_t)node);
}

/* ---- opening ---- */

static uint32_t most_slots(const palp_zones *z) {
    uint32_t most = 0;
    for (uint32_t i = 0; i < z->meta->zones; i++) {
        uint32_t slots = z->blob[i].domain[PALP_FREE].slots;
        if (slots > most) most = slots;
    }
    return most;
}

static uint32_t longest_row(const palp_zones *z) {
    uint32_t longest = 0;
    for (uint32_t i = 0; i < z->meta->zones; i++) {
        const palp_blob *b = &z->blob[i];
        bool table = b->level[b->meta->constraint_level].table != NULL;
        if (!table && b->meta->max_row > longest) longest = b->meta->max_row;
    }
    return longest;
}

static void shape(palp_node_contact *c, const palp_zones *z, uint32_t finest,
                  palp_node_contact_limits limits) {
    *c = (palp_node_contact){.blob = &z->blob[0], .limits = limits, .bodies = z->meta->zones};
    for (uint32_t i = 0; i < c->bodies; i++)
        c->first_slot[i + 1u] = c->first_slot[i] + z->blob[i].domain[PALP_FREE].slots;
    for (uint32_t s = 0; s < z->meta->seams; s++)
        c->seam_width += 3u * z->seam[s].level_modes[finest];
    if (c->seam_width == 0u) c->seam_width = 1u;
}

size_t palp_node_contact_memsize_zones(const palp_zones *zones, uint32_t finest,
                                       palp_node_contact_limits limits) {
    if (finest >= PALP_SEAM_LEVELS) return 0;
    palp_node_contact c;
    palp_arena arena = {0};
    shape(&c, zones, finest, limits);
    palp_node_contact_lay_out(&c, &arena, longest_row(zones), most_slots(zones));
    return arena.used;
}

/* Operations to say where a node is now, on the zone with most modes. */
static uint32_t place_work(const palp_assembly *a) {
    uint32_t most = 0;
    for (uint32_t i = 0; i < a->zones->meta->zones; i++) {
        const palp_zone_part *part = &a->zones->part[i];
        uint32_t modes = 0;
        for (uint32_t k = 0; k < part->seams; k++)
            modes += a->zones->seam[part->seam[k]].level_modes[a->extent];
        most = modes > most ? modes : most;
    }
    return 9u * most + 40u;
}

palp_status palp_node_contact_init_zones(palp_node_contact *contact, palp_assembly *assembly,
                                         bool pairs, const palp_tool *tools, uint32_t tool_count,
                                         palp_node_contact_limits limits, void *memory,
                                         size_t bytes) {
    const palp_zones *z = assembly->zones;
    const uint32_t finest = assembly->seams.finest;
    palp_arena arena = {.base = memory};
    palp_node_contact *c = contact;
    if (!palp_node_contact_limits_sound(limits)) return PALP_ERR_LIMITS;
    if (limits.friction) return PALP_ERR_ARGUMENT;
    shape(c, z, finest, limits);
    palp_status status = palp_node_contact_begin_use(c, tools, tool_count);
    if (status != PALP_OK) return status;
    if (memory == NULL || ((uintptr_t)memory & (PALP_ALIGN - 1u)) != 0u) return PALP_ERR_ALIGNMENT;
    if (bytes < palp_node_contact_memsize_zones(z, finest, limits)) return PALP_ERR_MEMORY;
    c->assembly = assembly;
    c->pairs = pairs;
    for (uint32_t i = 0; i < c->bodies; i++)
        c->size_m[PALP_ZONE_TOOL] =
            palp_max(c->size_m[PALP_ZONE_TOOL], z->blob[i].meta->mean_edge_m);
    c->place_work = place_work(assembly);
    palp_node_contact_lay_out(c, &arena, longest_row(z), most_slots(z));
    palp_node_contact_clean(c, most_slots(z));
    return PALP_OK;
}

/* ---- what candidates see ---- */

palp_touch palp_node_contact_see(const palp_node_contact *contact, const palp_candidate *candidate,
                                 const palp_vec3 *center) {
    const palp_node_contact *c = contact;
    const palp_candidate *k = candidate;
    if (k->tool != PALP_ZONE_TOOL)
        return palp_tool_at(&c->tools[k->tool], center[k->tool], k->x, k->n);
    palp_vec3 off = palp_sub(k->x, palp_node_contact_place(c, k->facing.body, k->facing.node));
    float along = palp_dot(off, k->n);
    float aside = palp_norm(palp_madd(off, -along, k->n));
    return (palp_touch){.depth_m = along,
                        .reach = aside / (PAIR_ASIDE * c->size_m[PALP_ZONE_TOOL]),
                        .facing = 1.0f};
}

void palp_node_contact_aim(const palp_node_contact *contact, palp_candidate *candidate) {
    const palp_node_contact *c = contact;
    palp_candidate *k = candidate;
    palp_vec3 other = palp_node_contact_normal(c, k->facing.body, k->facing.node);
    palp_vec3 n = palp_sub(palp_node_contact_normal(c, k->body, k->node), other);
    float length = palp_norm(n);
    k->n = length > 0.0f ? palp_scale(1.0f / length, n) : palp_scale(-1.0f, other);
    k->d = palp_rotate_back(c->assembly->world[k->body].r, k->n);
    k->facing.d = palp_scale(-1.0f, palp_rotate_back(c->assembly->world[k->facing.body].r, k->n));
    k->facing.slot = palp_node_slot(palp_node_contact_blob(c, k->facing.body), k->facing.node);
}

/* ---- compliances ---- */

static palp_spot spot_of(const palp_candidate *k, uint32_t which) {
    if (which == 1u) return k->facing;
    return (palp_spot){.body = k->body, .node = k->node, .slot = k->slot, .d = k->d};
}

static uint32_t spots_of(const palp_candidate *k) { return k->tool == PALP_ZONE_TOOL ? 2u : 1u; }

/* d^T G d' on one body, the mean of both extractions where there is no table. */
static float between(palp_node_contact *c, const palp_spot *a, const palp_row *row_a,
                     const palp_spot *b, const palp_row *row_b) {
    const palp_blob *blob = palp_node_contact_blob(c, a->body);
    const palp_level *level = &blob->level[blob->meta->constraint_level];
    float block[9], back[9];
    if (level->table != NULL) {
        palp_table_block(blob, blob->meta->constraint_level, a->slot, b->slot, block);
        c->work_done += 18u;
        return palp_dot(a->d, palp_rotate(block, b->d));
    }
    palp_columns_extract(&level->columns, b->slot, row_a, block);
    palp_columns_extract(&level->columns, a->slot, row_b, back);
    c->work_done += row_a->count + row_b->count;
    return 0.5f *
           (palp_dot(a->d, palp_rotate(block, b->d)) + palp_dot(b->d, palp_rotate(back, a->d)));
}

/* The zones' own part of g between two candidates. */
static void cache_local(palp_node_contact *c, uint32_t i, uint32_t j) {
    const palp_candidate *p = &c->candidate[i], *q = &c->candidate[j];
    size_t stride = c->limits.max_candidates;
    float g = 0.0f;
    for (uint32_t a = 0; a < spots_of(p); a++) {
        palp_spot from = spot_of(p, a);
        for (uint32_t b = 0; b < spots_of(q); b++) {
            palp_spot to = spot_of(q, b);
            if (from.body != to.body) continue;
            g += between(c, &from, &c->row[a * stride + i], &to, &c->row[b * stride + j]);
            if (i == j) g += palp_node_contact_blob(c, from.body)->softening[from.node];
        }
    }
    c->local[i * stride + j] = g;
    c->local[j * stride + i] = g;
}

/* The row y of a candidate. */
static void cache_row(palp_node_contact *c, uint32_t i) {
    const palp_candidate *k = &c->candidate[i];
    float *row = c->seam_row + (size_t)i * c->seam_width;
    for (uint32_t e = 0; e < c->seam_width; e++) row[e] = 0.0f;
    c->touched[i] = 0;
    for (uint32_t a = 0; a < spots_of(k); a++) {
        palp_spot s = spot_of(k, a);
        palp_assembly_push(c->assembly, s.body, s.slot, s.d, row, &c->touched[i]);
    }
    palp_assembly_sweep(c->assembly, row, &c->touched[i]);
}

static void cache_total(palp_node_contact *c, uint32_t i, uint32_t j) {
    size_t stride = c->limits.max_candidates;
    const float *a = c->seam_row + (size_t)i * c->seam_width;
    const float *b = c->seam_row + (size_t)j * c->seam_width;
    float g = c->local[i * stride + j] +
              palp_assembly_dot(c->assembly, a, c->touched[i], b, c->touched[j]);
    c->compliance[i * stride + j] = g;
    c->compliance[j * stride + i] = g;
}

void palp_node_contact_join(palp_node_contact *contact, uint32_t candidate) {
    palp_node_contact *c = contact;
    cache_row(c, candidate);
    for (uint32_t j = 0; j < c->count; j++) {
        cache_local(c, candidate, j);
        cache_total(c, candidate, j);
    }
}

/* Looks for the node that a pair's own one is before now, unless they are pressed together and
 * still meet, and aims at it; false if it has no row. */
static bool aim_anew(palp_node_contact *c, uint32_t candidate) {
    palp_candidate *k = &c->candidate[candidate];
    const palp_blob *b = palp_node_contact_blob(c, k->facing.body);
    palp_vec3 rest = palp_carry_back(&c->assembly->world[k->facing.body],
                                     palp_node_contact_place(c, k->body, k->node));
    uint32_t nearest = palp_node_contact_nearest(c, k->facing.body, rest, k->facing.node);
    uint32_t before = k->facing.node;
    bool pressed = k->active && k->at.reach <= 1.0f;
    if (!pressed && !palp_node_is_fixed(b, nearest)) k->facing.node = nearest;
    palp_node_contact_aim(c, k);
    c->work_done += 2u * c->place_work + 8u * b->meta->max_ring;
    if (k->facing.node == before) return true;
    /* What it is asked for stays as it was; the difference is relieved. */
    float asked = k->at.depth_m - k->relief_m;
    k->at = palp_node_contact_see(c, k, c->about);
    k->relief_m = k->at.depth_m - asked;
    if (!k->active) k->relief_m = palp_max(k->relief_m, 0.0f);
    return palp_node_contact_make_row(c, k->facing.body, k->facing.slot,
                                      &c->row[c->limits.max_candidates + candidate]);
}

/* Pairs whose zones have turned are aimed anew, a few at a time. */
static void renew_pairs(palp_node_contact *c) {
    uint32_t left = c->limits.max_new;
    for (uint32_t k = 0; k < c->count && left > 0u; k++) {
        c->renewed = c->renewed + 1u < c->count ? c->renewed + 1u : 0u;
        if (c->candidate[c->renewed].tool != PALP_ZONE_TOOL) continue;
        if (!aim_anew(c, c->renewed)) continue;
        for (uint32_t j = 0; j < c->count; j++) cache_local(c, c->renewed, j);
        left--;
    }
}

void palp_node_contact_follow(palp_node_contact *contact) {
    palp_node_contact *c = contact;
    const palp_assembly *a = c->assembly;
    if (a == NULL) return;
    c->place_work = place_work(a);
    renew_pairs(c);
    for (uint32_t i = 0; i < c->count; i++) {
        palp_candidate *k = &c->candidate[i];
        k->x = palp_node_contact_place(c, k->body, k->node);
        k->n = palp_rotate(a->world[k->body].r, k->d);
        cache_row(c, i);
        c->work_done += c->place_work;
    }
    for (uint32_t i = 0; i < c->count; i++) {
        for (uint32_t j = 0; j <= i; j++) cache_total(c, i, j);
    }
    c->work_done += (uint64_t)c->count * c->count / 2u * c->seam_width;
    c->changes = RENEW;
}

void palp_node_contact_load(const palp_node_contact *contact, palp_assembly *assembly) {
    palp_assembly_unload(assembly);
    for (uint32_t a = 0; a < contact->active_count; a++) {
        const palp_candidate *k = &contact->candidate[contact->active[a]];
        for (uint32_t i = 0; i < spots_of(k); i++) {
            palp_spot s = spot_of(k, i);
            palp_assembly_load(assembly, s.body, s.slot, palp_scale(-k->force_N, s.d));
        }
    }
}

/* ---- zones before zones ---- */

/* Whether a node has one of another zone before it; that one is put into `fresh`. */
static bool faces(palp_node_contact *c, uint32_t body, uint32_t node, uint32_t other, uint32_t from,
                  palp_fresh *fresh) {
    const palp_blob *b = palp_node_contact_blob(c, other);
    float size = c->size_m[PALP_ZONE_TOOL];
    palp_vec3 x = palp_node_contact_place(c, body, node);
    palp_vec3 rest = palp_carry_back(&c->assembly->world[other], x);
    const float at[3] = {rest.x, rest.y, rest.z};
    c->work_done += 60u + c->place_work;
    for (uint32_t k = 0; k < 3; k++) {
        if (at[k] < b->meta->box_min_m[k] - 2.0f * size ||
            at[k] > b->meta->box_max_m[k] + 2.0f * size)
            return false;
    }
    uint32_t nearest = palp_node_contact_nearest(c, other, rest, from);
    palp_vec3 n = palp_node_contact_normal(c, body, node);
    if (palp_node_is_fixed(b, nearest)) return false;
    if (palp_dot(n, palp_node_contact_normal(c, other, nearest)) > OPPOSED) return false;
    *fresh = (palp_fresh){.slot = palp_node_slot(palp_node_contact_blob(c, body), node),
                          .tool = PALP_ZONE_TOOL,
                          .body = body,
                          .facing_body = other,
                          .facing_node = nearest};
    palp_candidate k = {.node = node,
                        .slot = fresh->slot,
                        .tool = PALP_ZONE_TOOL,
                        .body = body,
                        .x = x,
                        .facing = {.body = other, .node = nearest}};
    palp_node_contact_aim(c, &k);
    palp_touch touch = palp_node_contact_see(c, &k, c->about);
    return touch.depth_m > -PAIR_MARGIN * size && touch.reach < 1.0f;
}

static bool is_new(const palp_node_contact *c, const palp_fresh *fresh, uint32_t found,
                   uint32_t body, uint32_t slot) {
    for (uint32_t i = 0; i < found; i++) {
        if (fresh[i].body == body && fresh[i].slot == slot) return false;
    }
    return c->place[c->first_slot[body] + slot] == 0u;
}

uint32_t palp_node_contact_search_pairs(palp_node_contact *contact, palp_fresh *fresh,
                                        uint32_t room) {
    palp_node_contact *c = contact;
    uint32_t found = 0, body = 0, all = c->first_slot[c->bodies];
    if (!c->pairs || c->bodies < 2u) return 0;
    if (c->count > 0u) { /* around one of the pairs there are */
        const palp_candidate *k = &c->candidate[c->probe % c->count];
        const palp_blob *b = palp_node_contact_blob(c, k->body);
        uint32_t end = k->tool == PALP_ZONE_TOOL ? b->ring_offset[k->node + 1u] : 0u;
        for (uint32_t i = b->ring_offset[k->node]; i < end && found < room; i++) {
            uint32_t node = b->ring[i];
            if (palp_node_is_fixed(b, node)) continue;
            if (!is_new(c, fresh, found, k->body, palp_node_slot(b, node))) continue;
            if (faces(c, k->body, node, k->facing.body, k->facing.node, &fresh[found])) found++;
        }
    }
    for (uint32_t i = 0; i < PALP_NODE_CONTACT_PAIR_SCAN && i < all && found < room; i++) {
        c->pair_scan = c->pair_scan + 1u < all ? c->pair_scan + 1u : 0u;
        /* both in all at most bodies */
        while (body > 0u && c->pair_scan < c->first_slot[body]) body--;
        /* in all at most bodies */
        while (body + 1u < c->bodies && c->pair_scan >= c->first_slot[body + 1u]) body++;
        const palp_blob *b = palp_node_contact_blob(c, body);
        uint32_t slot = c->pair_scan - c->first_slot[body];
        if (slot >= b->level[b->meta->constraint_level].nodes) continue;
        for (uint32_t other = body + 1u; other < c->bodies && found < room; other++) {
            if (!is_new(c, fresh, found, body, slot)) break;
            uint32_t node = b->domain[PALP_FREE].node[slot];
            if (faces(c, body, node, other, 0, &fresh[found])) found++;
        }
    }
    return found;
}
