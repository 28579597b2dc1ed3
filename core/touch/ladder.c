/* SPDX-License-Identifier: MIT */
#include "ladder.h"
#include "core/base/linalg.h"

#define LEAST_CARRIED 0.5f /* share of the force that must find its nodes for a climb */
#define RIDGE 1e-6f        /* of the 3x3 system that restores the force on a tool */
#define LARGEST_FACTOR 3.0f
#define FAR 1e6f /* in units of reach */

size_t palp_ladder_memsize(const palp_blob *blob, palp_node_contact_limits limits) {
    palp_arena arena = {0};
    (void)palp_take(&arena, palp_node_contact_memsize(blob, limits), 1);
    (void)palp_take(&arena, palp_node_contact_memsize(blob, limits), 1);
    return arena.used;
}

palp_status palp_ladder_init(palp_ladder *ladder, const palp_blob *blob, const float *position_m,
                             const palp_tool *tools, uint32_t tool_count,
                             palp_node_contact_limits limits, void *memory, size_t bytes) {
    if (!palp_node_contact_limits_sound(limits)) return PALP_ERR_LIMITS;
    if (memory == NULL || ((uintptr_t)memory & (PALP_ALIGN - 1u)) != 0u) return PALP_ERR_ALIGNMENT;
    if (bytes < palp_ladder_memsize(blob, limits)) return PALP_ERR_MEMORY;
    palp_arena arena = {.base = memory};
    palp_ladder *l = ladder;
    size_t each = palp_node_contact_memsize(blob, limits);
    *l = (palp_ladder){.now = 0};
    for (uint32_t k = 0; k < 2; k++) {
        void *part = palp_take(&arena, each, 1);
        palp_status status = palp_node_contact_init(&l->contact[k], blob, position_m, tools, tool_count,
                                               limits, part, each);
        if (status != PALP_OK) return status;
    }
    for (uint32_t level = 0; level <= blob->meta->constraint_level; level++) {
        bool table = blob->level[level].table != NULL;
        bool usable = table || level == blob->meta->constraint_level;
        if (!usable || blob->level[level].nodes == 0u) continue;
        bool below = l->rungs > 0u && l->at[l->rungs - 1u].level + 1u == level;
        if (table && below) l->at[l->rungs++] = (palp_rung){level, level - 1u};
        l->at[l->rungs++] = (palp_rung){level, level};
    }
    l->rung = l->rungs - 1u;
    return PALP_OK;
}

palp_status palp_ladder_init_zones(palp_ladder *ladder, palp_assembly *assembly, bool pairs,
                                   const palp_tool *tools, uint32_t tool_count,
                                   palp_node_contact_limits limits, void *memory, size_t bytes) {
    uint32_t level = assembly->zones->blob[0].meta->constraint_level;
    *ladder = (palp_ladder){.rungs = 1, .at = {{level, level}}};
    return palp_node_contact_init_zones(&ladder->contact[0], assembly, pairs, tools, tool_count, limits,
                                   memory, bytes);
}

/* The zone of a mixed rung that has room for what is in contact now: half of max_active inside. */
static float choose_zone(const palp_node_contact *now, uint32_t inner) {
    /* Of finer candidates each is one inside, of coarser ones each becomes about four. */
    uint32_t room = now->limits.max_active / 2u;
    uint32_t wanted = now->outer >= inner ? room : room / 4u;
    float zone = -FAR;
    for (uint32_t a = 0; a < now->active_count; a++) { /* the largest reach that leaves room */
        float reach = now->candidate[now->active[a]].at.reach;
        uint32_t within = 0;
        for (uint32_t b = 0; b < now->active_count; b++)
            within += now->candidate[now->active[b]].at.reach <= reach ? 1u : 0u;
        if (within <= wanted && reach > zone) zone = reach;
    }
    return zone;
}

/* Makes `to` empty, on the given rung. */
static void clear_for(palp_node_contact *to, const palp_node_contact *now, palp_rung rung) {
    if (rung.outer == rung.level) {
        palp_node_contact_clear(to, rung.level);
    } else {
        palp_node_contact_clear_mixed(to, rung.level, rung.outer, choose_zone(now, rung.level));
    }
}

void palp_ladder_clear(palp_ladder *ladder) { palp_ladder_clear_to(ladder, ladder->rungs - 1u); }

void palp_ladder_clear_to(palp_ladder *ladder, uint32_t rung) {
    ladder->rung = rung;
    ladder->preparing = false;
    ladder->waited = 0;
    ladder->tank_J = 0.0f;
    for (uint32_t k = 0; k < (ladder->rungs > 1u ? 2u : 1u); k++)
        clear_for(&ladder->contact[k], &ladder->contact[k], ladder->at[rung]);
}

/* ---- forces from level to level, on the marks of a scratch ---- */

/* Marks the forces of candidates on one level. */
static void mark_forces(const palp_node_contact *from, uint32_t tool, uint32_t level,
                        palp_row_scratch *s) {
    for (uint32_t a = 0; a < from->active_count; a++) {
        const palp_candidate *k = &from->candidate[from->active[a]];
        if (k->tool == tool && k->level == level) palp_row_mark(s, k->slot, k->force_N);
    }
}

static void unmark(palp_row_scratch *s, uint32_t slot) {
    s->weight[slot] = 0.0f;
    s->mark[slot / 32u] &= ~(1u << (slot % 32u));
}

/* The force on odd slot m goes to its parents, whole. */
static void gather_one(const palp_domain *d, uint32_t m, palp_row_scratch *s) {
    float total = d->predict[2u * m] + d->predict[2u * m + 1u];
    for (uint32_t side = 0; side < 2; side++) {
        float w = d->predict[2u * m + side];
        if (w > 0.0f) palp_row_mark(s, d->parent[2u * m + side], w / total * s->weight[m]);
    }
    unmark(s, m);
}

/* Forces on the odd slots of `level` go to their parents. */
static void gather(const palp_domain *d, uint32_t level, palp_row_scratch *s) {
    uint32_t first = d->level_start[level], end = d->level_start[level + 1u];
    for (uint32_t m = palp_row_next(s, first, end); m < end; m = palp_row_next(s, m + 1u, end))
        gather_one(d, m, s);
}

/* The force on [level,a] goes to hats of level + 1. */
static void spread_one(const palp_blob *b, uint32_t level, uint32_t a, palp_row_scratch *s) {
    const palp_domain *d = &b->domain[PALP_FREE];
    float force = s->weight[a];
    palp_child_range r = palp_children(d, a, level + 1u);
    for (uint32_t c = r.first; c < r.end; c++)
        palp_row_mark(s, d->child[c], force * palp_child_share(b, level, a, d->child[c]));
    s->weight[a] = force * palp_own_share(b, level, a);
}

/* Forces on the hats of `level` go to those of level + 1. */
static void spread(const palp_blob *b, uint32_t level, palp_row_scratch *s) {
    uint32_t end = b->level[level].nodes;
    for (uint32_t a = palp_row_next(s, 0, end); a < end; a = palp_row_next(s, a + 1u, end))
        spread_one(b, level, a, s);
}

/* Of a mixed set: forces on slots that it does not hold go to the hats above them. */
static void settle_outside(const palp_node_contact *to, uint32_t tool, palp_row_scratch *s) {
    const palp_domain *d = &to->blob->domain[PALP_FREE];
    uint32_t first = to->blob->level[to->outer].nodes, end = to->blob->level[to->level].nodes;
    for (uint32_t m = palp_row_next(s, first, end); m < end; m = palp_row_next(s, m + 1u, end)) {
        if (palp_node_contact_level_of(to, m, tool) < PALP_MAX_LEVELS) continue;
        gather_one(d, m, s);
    }
}

/* Marks on `s` what the forces of `from` under one tool are on the basis functions of `to`. */
static void move_forces(const palp_node_contact *from, const palp_node_contact *to, uint32_t tool,
                        palp_row_scratch *s) {
    const palp_blob *b = from->blob;
    uint32_t level = from->outer;
    if (to->level > from->outer && from->outer < from->level) { /* the hats come down first */
        mark_forces(from, tool, from->outer, s);
        spread(b, from->outer, s);
        level = from->level;
    } else if (from->outer < from->level) { /* the nodes go up first */
        mark_forces(from, tool, from->level, s);
        gather(&b->domain[PALP_FREE], from->level, s);
    }
    mark_forces(from, tool, level, s);
    for (; level > to->level; level--) gather(&b->domain[PALP_FREE], level, s);
    if (to->outer < to->level && level == to->outer) { /* only hats inside the zone are spread */
        uint32_t end = b->level[level].nodes;
        for (uint32_t a = palp_row_next(s, 0, end); a < end; a = palp_row_next(s, a + 1u, end)) {
            if (palp_node_contact_level_of(to, a, tool) == to->level) spread_one(b, level, a, s);
        }
        level = to->level;
    }
    for (; level < to->level; level++) spread(b, level, s);
    if (to->outer < to->level) settle_outside(to, tool, s);
}

uint32_t palp_ladder_load(palp_ladder *ladder, uint32_t rung) {
    palp_node_contact *now = palp_ladder_contact(ladder);
    palp_rung at = ladder->at[rung];
    palp_node_contact to = *now; /* shares all arrays; only levels and zone are looked at */
    uint32_t count = 0, slots = now->blob->level[at.level].nodes;
    to.level = at.level;
    to.outer = at.outer;
    if (at.outer < at.level) to.zone = choose_zone(now, at.level);
    for (uint32_t t = 0; t < now->tool_count; t++) {
        move_forces(now, &to, t, &now->scratch);
        for (uint32_t i = palp_row_next(&now->scratch, 0, slots); i < slots;
             i = palp_row_next(&now->scratch, i + 1u, slots)) {
            unmark(&now->scratch, i);
            count++;
        }
    }
    now->work_done += 8u * now->active_count;
    return count;
}

/* ---- taking over ---- */

/* Hands the marked forces of `tool` to candidates of `to`, admitting them if asked; returns the sum
 * that found a place. */
static float hand_over(palp_node_contact *to, uint32_t tool, palp_row_scratch *s, bool admit) {
    uint32_t slots = to->blob->level[to->level].nodes;
    float carried = 0.0f;
    for (uint32_t i = palp_row_next(s, 0, slots); i < slots; i = palp_row_next(s, i + 1u, slots)) {
        if (admit) palp_node_contact_admit(to, (palp_fresh){.slot = i, .tool = tool});
        uint32_t place = to->place[i];
        if (place > 0u && to->candidate[place - 1u].tool == tool && s->weight[i] > 0.0f) {
            to->candidate[place - 1u].force_N += s->weight[i];
            carried += s->weight[i];
        }
        unmark(s, i);
    }
    return carried;
}

/* Candidates with a force become active, as far as there is room and their pivots allow. */
static void activate(palp_node_contact *c) {
    for (uint32_t i = 0; i < c->count; i++) {
        palp_candidate *k = &c->candidate[i];
        if (!(k->force_N > 0.0f)) continue;
        bool room = c->active_count < c->limits.max_active;
        if (!room || !palp_node_contact_let_in(c, i)) k->force_N = 0.0f;
    }
    c->changes = 0;
}

/* lambda_i := lambda_i (1 + p_i . m), so that the force on the tool is `wanted`. */
static void restore_force(palp_node_contact *c, uint32_t tool, palp_vec3 wanted) {
    palp_vec3 off = palp_sub(wanted, palp_node_contact_force(c, tool));
    float m[9] = {0}, r[3] = {off.x, off.y, off.z};
    for (uint32_t a = 0; a < c->active_count; a++) {
        const palp_candidate *k = &c->candidate[c->active[a]];
        if (k->tool != tool) continue;
        const float p[3] = {k->at.push.x, k->at.push.y, k->at.push.z};
        for (uint32_t e = 0; e < 9; e++) m[e] += k->force_N * p[e / 3u] * p[e % 3u];
    }
    float ridge = RIDGE * (m[0] + m[4] + m[8]);
    for (uint32_t e = 0; e < 9; e += 4) m[e] += ridge;
    if (!(ridge > 0.0f) || palp_chol_factor(m, 3, 3) != PALP_OK) return;
    palp_chol_solve(m, 3, 3, r);
    const palp_vec3 multiplier = {r[0], r[1], r[2]};
    for (uint32_t a = 0; a < c->active_count; a++) {
        palp_candidate *k = &c->candidate[c->active[a]];
        if (k->tool != tool) continue;
        float factor = 1.0f + palp_dot(k->at.push, multiplier);
        k->force_N *= palp_clamp(factor, 0.0f, LARGEST_FACTOR);
    }
}

/* Forces that would store more than `allowed_J` are lowered; returns what is stored then. */
static float limit_energy(palp_node_contact *c, float allowed_J) {
    float stored = palp_node_contact_energy(c);
    if (!(stored > allowed_J)) return stored;
    float factor = palp_sqrt(allowed_J / stored);
    for (uint32_t a = 0; a < c->active_count; a++) c->candidate[c->active[a]].force_N *= factor;
    return allowed_J;
}

/* What each candidate is relieved of, or credited with, so that the forces are in equilibrium. */
static void set_reliefs(palp_node_contact *c, const palp_vec3 *tool_m) {
    for (uint32_t i = 0; i < c->count; i++) {
        palp_candidate *k = &c->candidate[i];
        k->at = palp_tool_at(&c->tools[k->tool], tool_m[k->tool], k->x, k->n);
        float off = k->at.depth_m - palp_node_contact_indentation(c, i);
        k->relief_m = k->active ? off : palp_max(off, 0.0f);
        palp_vec3 off_grip = palp_sub(c->grip[k->tool].held_m, tool_m[k->tool]);
        k->target_m = k->at.depth_m - k->relief_m - palp_dot(k->at.push, off_grip);
    }
    c->work_done += (uint64_t)c->count * (60u + c->active_count);
}

/* Moves the contact from `from` to `to`, on the way down taking in what is needed; false if on the
 * way up too much of the force finds no place. */
static bool take_over(palp_ladder *ladder, palp_node_contact *from, palp_node_contact *to, bool down,
                      const palp_vec3 *tool_m) {
    float carried = 0.0f, total = 0.0f;
    for (uint32_t t = 0; t < from->tool_count; t++) {
        palp_vec3 axis;
        to->about[t] = tool_m[t];
        to->grip[t] = from->grip[t];
        to->nearest[0][t] = from->nearest[0][t];
        total += palp_node_contact_normal_force(from, t, &axis);
        move_forces(from, to, t, &to->scratch);
        carried += hand_over(to, t, &to->scratch, down);
    }
    if (!down && carried < LEAST_CARRIED * total) return false;
    activate(to);
    for (uint32_t i = 0; i < to->count; i++) {
        palp_candidate *k = &to->candidate[i];
        k->at = palp_tool_at(&to->tools[k->tool], tool_m[k->tool], k->x, k->n);
    }
    for (uint32_t t = 0; t < from->tool_count; t++)
        restore_force(to, t, palp_node_contact_force(from, t));
    float before = palp_node_contact_energy(from) + ladder->tank_J;
    ladder->tank_J = palp_max(before - limit_energy(to, before), 0.0f);
    set_reliefs(to, tool_m);
    to->flags = 0;
    to->pivots = from->pivots;
    return true;
}

bool palp_ladder_drop(palp_ladder *ladder, const palp_vec3 *tool_m) {
    if (ladder->rung == 0u) return false;
    palp_node_contact *from = palp_ladder_contact(ladder), *to = palp_ladder_other(ladder);
    clear_for(to, from, ladder->at[ladder->rung - 1u]);
    (void)take_over(ladder, from, to, true, tool_m);
    ladder->now = 1u - ladder->now;
    ladder->rung--;
    ladder->preparing = false;
    ladder->waited = 0;
    ladder->dropped++;
    return true;
}

/* ---- climbing ---- */

/* Nodes that the forces would come to below, not yet taken in. */
static uint32_t list_missing(palp_ladder *ladder, palp_fresh *fresh) {
    palp_node_contact *from = palp_ladder_contact(ladder), *to = palp_ladder_other(ladder);
    uint32_t slots = to->blob->level[to->level].nodes, found = 0;
    for (uint32_t t = 0; t < from->tool_count; t++) {
        move_forces(from, to, t, &to->scratch);
        for (uint32_t i = palp_row_next(&to->scratch, 0, slots); i < slots;
             i = palp_row_next(&to->scratch, i + 1u, slots)) {
            bool wanted = to->place[i] == 0u && found < to->limits.max_new;
            if (wanted) fresh[found++] = (palp_fresh){.slot = i, .tool = t};
            unmark(&to->scratch, i);
        }
    }
    to->work_done += slots / 4u;
    return found;
}

uint32_t palp_ladder_prepare(palp_ladder *ladder, const palp_vec3 *tool_m, palp_fresh *fresh) {
    if (ladder->rung + 1u >= ladder->rungs) return 0;
    palp_node_contact *to = palp_ladder_other(ladder);
    if (!ladder->preparing) {
        clear_for(to, palp_ladder_contact(ladder), ladder->at[ladder->rung + 1u]);
        ladder->preparing = true;
        ladder->waited = 0;
    }
    for (uint32_t t = 0; t < to->tool_count; t++) to->about[t] = tool_m[t];
    ladder->waited++;
    return to->count < to->limits.max_candidates ? list_missing(ladder, fresh) : 0u;
}

void palp_ladder_forget(palp_ladder *ladder) {
    ladder->preparing = false;
    ladder->waited = 0;
}

bool palp_ladder_climb(palp_ladder *ladder, const palp_vec3 *tool_m) {
    if (!ladder->preparing) return false;
    palp_node_contact *from = palp_ladder_contact(ladder), *to = palp_ladder_other(ladder);
    palp_ladder_forget(ladder);
    if (!take_over(ladder, from, to, false, tool_m)) return false;
    ladder->now = 1u - ladder->now;
    ladder->rung++;
    ladder->climbed++;
    return true;
}

void palp_ladder_relax(palp_ladder *ladder, float dt_s) {
    palp_node_contact *c = palp_ladder_contact(ladder);
    float share = palp_min(dt_s / PALP_RELAX_S, 1.0f), wanted_J = 0.0f;
    for (uint32_t a = 0; a < c->active_count; a++) {
        palp_candidate *k = &c->candidate[c->active[a]];
        float step = share * k->relief_m;
        if (step > 0.0f) {
            wanted_J += step * k->force_N;
        } else {
            ladder->tank_J -= 0.5f * step * k->force_N;
            k->relief_m -= step;
        }
    }
    float pay = palp_min(0.5f * ladder->tank_J, wanted_J);
    if (!(pay > 0.0f)) return;
    for (uint32_t a = 0; a < c->active_count; a++) {
        palp_candidate *k = &c->candidate[c->active[a]];
        if (k->relief_m > 0.0f) k->relief_m -= share * pay / wanted_J * k->relief_m;
    }
    ladder->tank_J -= 2.0f * pay < ladder->tank_J ? 2.0f * pay : ladder->tank_J;
}
