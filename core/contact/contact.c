/* SPDX-License-Identifier: MIT */
#include "core/contact/contact.h"
#include "core/base/linalg.h"
#include "core/contact/contact_internal.h"

#define CLEAR 1e-6f      /* violation that lets a point in, over the tool's size */
#define LEAST_SHARE 0.3f /* of what the body gave way in the last tick, and most */
#define MOST_SHARE 2.0f
#define STEADY 30.0f /* ticks that a force beyond at its limit takes to come through */
#define SLOWLY 4.0f  /* a step of the force beyond counts so many times against a cell */
/* How far a tool whose contact was missed is put forward, over its size: first, and then. */
#define NEAR 0.02f
#define FAR 0.1f
#define OTHER_LATTICE 0.15f /* change of the spacing from which places are others */
#define BLOCK_CHANGES 6u    /* iterations that change many points at once; then one at a time */

/* ---- life ---- */

palp_contact_level palp_contact_level_of(uint32_t level, uint32_t modes) {
    static const uint32_t cells[PALP_CONTACT_LEVELS] = {6, 6, 6, 20, 40};
    static const uint32_t share[PALP_CONTACT_LEVELS] = {4, 2, 1, 1, 1};
    static const uint32_t contacts[PALP_CONTACT_LEVELS] = {12, 12, 12, 36, 72};
    uint32_t m = (modes / share[level] + PALP_MODE_LANES - 1u) / PALP_MODE_LANES * PALP_MODE_LANES;
    return (palp_contact_level){cells[level], 3u * cells[level] + 2u, contacts[level], m};
}

static uint32_t room_of(uint32_t finest) {
    uint32_t most = 0;
    for (uint32_t l = 0; l <= finest; l++) {
        uint32_t points = palp_contact_level_of(l, 0).points;
        if (points > most) most = points;
    }
    return most;
}

static void lay_out(palp_contact *c, palp_arena *arena, uint32_t modes) {
    const uint32_t room = c->room, padded = (room + LANES - 1u) / LANES * LANES;
    c->point = palp_take(arena, room, sizeof *c->point);
    c->before = palp_take(arena, room, sizeof *c->before);
    c->lattice = palp_take(arena, c->tool_count, sizeof *c->lattice);
    c->table = palp_take(arena, c->tool_count, sizeof *c->table);
    c->table_before = palp_take(arena, c->tool_count, sizeof *c->table_before);
    c->node = palp_take(arena, 3u * room, sizeof *c->node);
    c->node_u_m = palp_take(arena, 3u * room, sizeof *c->node_u_m);
    c->node_slot = palp_take(arena, PALP_CONTACT_NODE_SLOTS, sizeof *c->node_slot);
    c->corner = palp_take(arena, room, sizeof *c->corner);
    for (uint32_t k = 0; k < 11u; k++) c->column[k] = palp_take(arena, padded, sizeof(float));
    for (uint32_t k = 0; k < 11u; k++) c->pressed[k] = palp_take(arena, padded, sizeof(float));
    c->mode = palp_take(arena, (size_t)modes * room, sizeof(float));
    c->load = palp_take(arena, modes, sizeof(float));
    c->g = palp_take(arena, (size_t)room * room, sizeof(float));
    c->factor = palp_take(arena, (size_t)room * room, sizeof(float));
    c->target = palp_take(arena, room, sizeof(float));
    c->lambda = palp_take(arena, room, sizeof(float));
    c->scratch = palp_take(arena, room + 1u, sizeof(float));
    c->active = palp_take(arena, room, sizeof(uint32_t));
}

size_t palp_contact_memsize(const palp_blob *blob, uint32_t tool_count, uint32_t finest) {
    palp_arena arena = {0};
    palp_contact c = {.tool_count = tool_count};
    if (finest >= PALP_CONTACT_LEVELS || tool_count > PALP_CONTACT_TOOLS) return 0;
    c.room = room_of(finest);
    lay_out(&c, &arena, blob->regular.modes);
    return arena.used;
}

palp_status palp_contact_init(palp_contact *contact, const palp_blob *blob, const palp_tool *tools,
                              uint32_t tool_count, uint32_t finest, void *memory, size_t bytes) {
    palp_arena arena = {.base = memory};
    palp_surface surface;
    if (finest >= PALP_CONTACT_LEVELS) return PALP_ERR_LIMITS;
    palp_status status = palp_surface_open(&surface, blob);
    if (status != PALP_OK) return status;
    if (tool_count < 1u || tool_count > PALP_CONTACT_TOOLS) return PALP_ERR_ARGUMENT;
    for (uint32_t t = 0; t < tool_count; t++) {
        if (!palp_tool_is_sound(&tools[t])) return PALP_ERR_ARGUMENT;
    }
    if (memory == NULL || ((uintptr_t)memory & (PALP_ALIGN - 1u)) != 0u) return PALP_ERR_ALIGNMENT;
    if (bytes < palp_contact_memsize(blob, tool_count, finest)) return PALP_ERR_MEMORY;
    palp_contact *c = contact;
    *c = (palp_contact){.surface = surface,
                        .tools = tools,
                        .tool_count = tool_count,
                        .room = room_of(finest),
                        .now = finest};
    c->level = palp_contact_level_of(finest, blob->regular.modes);
    lay_out(c, &arena, blob->regular.modes);
    for (uint32_t k = 0; k < PALP_CONTACT_NODE_SLOTS; k++) c->node_slot[k] = 0;
    c->nodes = 0;
    palp_contact_clear(c);
    return PALP_OK;
}

void palp_contact_clear(palp_contact *contact) {
    palp_contact *c = contact;
    for (uint32_t t = 0; t < c->tool_count; t++) {
        c->lattice[t] = (palp_lattice){.placed = false};
        palp_lattice_clear(&c->table[t]);
        palp_lattice_clear(&c->table_before[t]);
        c->force_N[t] = c->beyond_N[t] = (palp_vec3){0};
        c->normal_N[t] = 0.0f;
        c->given[t] = (palp_given){.mean_m = {0}};
    }
    for (uint32_t m = 0; m < PALP_LATTICE_FAR_MODES; m++) c->far_load[m] = 0.0f;
    c->count = c->count_before = c->active_count = 0;
    c->energy_J = 0.0f;
    c->solved = false;
    c->crowd = 1.0f;
}

/* ---- points ---- */

static int16_t nearest(float x) {
    x = palp_clamp(x, -16000.0f, 16000.0f);
    return (int16_t)(x + (x >= 0.0f ? 0.5f : -0.5f));
}

/* The contact point of the last tick at the same place of the lattice, or next to it; NULL if
 * there is none. */
static const palp_contact_point *last_of(const palp_contact *c, const palp_contact_point *p,
                                         bool *same) {
    static const int16_t step[7][2] = {{0, 0}, {1, 0}, {0, 1}, {-1, 1}, {-1, 0}, {0, -1}, {1, -1}};
    const float before = c->spacing_before[p->tool];
    float scale = before > 0.0f ? c->lattice[p->tool].used.spacing / before : 1.0f;
    const bool changed = palp_abs(scale - 1.0f) > OTHER_LATTICE;
    if (!changed) scale = 1.0f;
    const int16_t i = nearest(scale * (float)p->i), j = nearest(scale * (float)p->j);
    for (uint32_t k = 0; k < 7u; k++) {
        uint32_t at = palp_lattice_find(&c->table_before[p->tool], (int16_t)(i + step[k][0]),
                                        (int16_t)(j + step[k][1]));
        *same = k == 0u && !changed;
        if (at < c->count_before) return &c->before[at];
    }
    return NULL;
}

/* ---- corners ---- */

static uint32_t slot_of_node(const palp_contact *c, uint32_t node) {
    uint32_t slot = (node * 2654435761u) >> 22u;
    for (uint32_t k = 0; k < PALP_CONTACT_NODE_SLOTS; k++) {
        uint32_t at = (slot + k) & (PALP_CONTACT_NODE_SLOTS - 1u);
        if (c->node_slot[at] == 0u || c->node[c->node_slot[at] - 1u] == node) return at;
    }
    return 0u;
}

static void forget_nodes(palp_contact *c) {
    for (uint32_t k = 0; k < PALP_CONTACT_NODE_SLOTS; k++) c->node_slot[k] = 0;
    c->nodes = 0;
}

static void list_corners(palp_contact *c, uint32_t i) {
    const uint32_t *v = c->surface.blob->triangle + 3u * (size_t)c->point[i].at.triangle;
    for (uint32_t k = 0; k < 3u; k++) {
        uint32_t slot = slot_of_node(c, v[k]);
        if (c->node_slot[slot] == 0u) {
            c->node[c->nodes++] = v[k];
            c->node_slot[slot] = (uint16_t)c->nodes;
        }
        c->corner[i][k] = (uint16_t)(c->node_slot[slot] - 1u);
    }
}

/* A tick that was given up before its end leaves nothing to go on from. */
static void swap_ticks(palp_contact *c) {
    if (!c->solved) {
        c->count = 0;
        return;
    }
    c->solved = false;
    palp_contact_point *point = c->point;
    palp_lattice_table *table = c->table;
    c->point = c->before;
    c->before = point;
    c->table = c->table_before;
    c->table_before = table;
    c->count_before = c->count;
    c->count = 0;
    for (uint32_t t = 0; t < c->tool_count; t++) c->spacing_before[t] = c->lattice[t].used.spacing;
}

/* What the tool asks of a point, about its last displacement. */
static void linearise(palp_contact *c, uint32_t i) {
    palp_contact_point *p = &c->point[i];
    const uint32_t t = p->tool;
    const palp_contact_spring *s = &c->spring[t];
    bool same;
    const palp_contact_point *last = last_of(c, p, &same);
    p->u_m = last != NULL ? last->u_m : (palp_vec3){0};
    p->active = last != NULL ? same && last->active : true;
    p->left_out = false;
    palp_gap gap = palp_tool_gap(&c->tools[t], c->tool_m[t], palp_add(p->at.y, p->u_m));
    p->m = gap.normal;
    palp_vec3 held = s->held_m;
    if (s->stiffness_N_per_m > 0.0f)
        held = palp_madd(held, 1.0f / s->stiffness_N_per_m, c->beyond_N[t]);
    c->target[i] =
        palp_dot(p->m, p->u_m) - gap.gap_m + palp_dot(p->m, palp_sub(held, c->tool_m[t]));
    const float of[11] = {p->at.y.x, p->at.y.y, p->at.y.z, p->at.n.x, p->at.n.y,     p->at.n.z,
                          p->m.x,    p->m.y,    p->m.z,    p->cell_m, (float)p->tool};
    for (uint32_t k = 0; k < 11u; k++) c->column[k][i] = of[k];
    list_corners(c, i);
    palp_surface_modes(&c->surface, &p->at, p->m, c->level.modes, c->mode + i, c->room);
    c->work_done += 120u + 9u * c->level.modes;
}

/* What the body as a whole gives way grows with the force, and the force with the depth as in
 * Hertz' law: by 3/2 F dx / (work F dx is done against), from where the tool came to rest. */
static float foreseen_share(const palp_contact *c, uint32_t t) {
    float all = 0.0f;
    for (uint32_t k = 0; k < c->tool_count; k++) all += c->normal_N[k];
    if (!(c->energy_J > 0.0f) || !(c->normal_N[t] > 0.0f)) return 0.0f;
    palp_vec3 moved = palp_sub(c->tool_m[t], c->rest_m[t]);
    float energy = c->energy_J * c->normal_N[t] / all;
    return palp_clamp(1.0f - 0.6f * palp_dot(c->force_N[t], moved) / energy, LEAST_SHARE,
                      MOST_SHARE);
}

void palp_contact_begin(palp_contact *contact, const palp_vec3 *tool_m,
                        const palp_contact_spring *spring) {
    palp_contact *c = contact;
    const float cells = (float)c->level.cells;
    c->level = palp_contact_level_of(c->now, c->surface.blob->regular.modes);
    for (uint32_t t = 0; t < c->tool_count && cells > 0.0f; t++)
        c->lattice[t].at.spacing *= palp_sqrt(cells / (float)c->level.cells);
    swap_ticks(c);
    forget_nodes(c);
    bool full = (c->flags & PALP_CONTACT_FULL) != 0u;
    c->crowd = full ? palp_max(0.9f * c->crowd, 0.2f) : palp_min(1.002f * c->crowd, 1.0f);
    c->flags = c->row = c->iterations = c->most_active = c->active_count = 0;
    c->filled = (palp_lattice_counts){.fillings = 0};
    c->filling = c->fillings = c->first = 0;
    for (uint32_t t = 0; t < c->tool_count; t++) {
        c->tool_m[t] = tool_m[t];
        c->spring[t] = spring[t];
    }
    c->given_share = foreseen_share(c, 0);
    c->forward = 0.0f;
}

/* The present tool's lattice is as it should be. */
static void next_tool(palp_contact *c) {
    c->filling++;
    c->fillings = 0;
    c->first = c->count;
    if (c->filling < c->tool_count) c->given_share = foreseen_share(c, c->filling);
    c->forward = 0.0f;
}

bool palp_contact_may_skip(const palp_contact *contact) {
    return contact->fillings > 0u &&
           (contact->count > contact->first || !(contact->normal_N[contact->filling] > 0.0f));
}

void palp_contact_skip(palp_contact *contact) { next_tool(contact); }

static palp_lattice_counts sum_of(palp_lattice_counts a, palp_lattice_counts b) {
    return (palp_lattice_counts){a.fillings + b.fillings, a.around + b.around,
                                 a.evaluations + b.evaluations, a.shots + b.shots,
                                 a.crossings + b.crossings};
}

/*
 * The displacement by the body as a whole that a filling is to meet: as foreseen; and when a
 * contact is missed there, less of it, with the tool put forward towards where its spring pulls it.
 * So a contact is not lost because the tool was foreseen a little above a surface that gives hardly
 * way.
 */
static palp_given given_for(const palp_contact *c, uint32_t t) {
    palp_given g = palp_given_times(&c->given[t], c->given_share);
    if (!(c->forward > 0.0f)) return g;
    palp_vec3 pull = palp_sub(c->spring[t].held_m, c->tool_m[t]);
    float most = c->forward * palp_tool_size(&c->tools[t]), length = palp_norm(pull);
    if (length > most) pull = palp_scale(most / length, pull);
    g.mean_m = palp_sub(g.mean_m, pull);
    return g;
}

static uint32_t far_modes(const palp_contact *c) {
    const uint32_t modes = c->surface.blob->regular.modes;
    return modes < PALP_LATTICE_FAR_MODES ? modes : PALP_LATTICE_FAR_MODES;
}

bool palp_contact_fill(palp_contact *contact) {
    palp_contact *c = contact;
    const uint32_t t = c->filling;
    if (t >= c->tool_count) return false;
    const palp_lattice_room room = {.surface = &c->surface,
                                    .tool = &c->tools[t],
                                    .number = t,
                                    .tool_m = c->tool_m[t],
                                    .cells = (float)c->level.cells * c->crowd,
                                    .given = given_for(c, t),
                                    .load = c->far_load,
                                    .far_modes = far_modes(c),
                                    .share = c->normal_N[t] > 0.0f ? c->given_share : 1.0f,
                                    .point = c->point,
                                    .count = &c->count,
                                    .most = c->level.points,
                                    .before = c->before,
                                    .count_before = c->count_before,
                                    .table = &c->table[t],
                                    .done = &c->done};
    c->done = (palp_lattice_counts){.fillings = 0};
    uint32_t flags = palp_lattice_fill(&c->lattice[t], &room, c->first);
    c->filled = sum_of(c->filled, c->done);
    c->work_done += 400u * (uint64_t)c->done.fillings + 10u * c->done.around +
                    72u * c->done.evaluations + 240u * (uint64_t)c->done.shots +
                    45u * (uint64_t)c->done.crossings +
                    3u * PALP_LATTICE_WATCHED * PALP_LATTICE_FAR_MODES;
    const bool begun = (flags & PALP_LATTICE_BEGUN) != 0u;
    const bool missed = c->count == c->first && !begun && c->normal_N[t] > 0.0f;
    bool again = ((flags & PALP_LATTICE_MOVED) != 0u || begun || missed) &&
                 ++c->fillings < PALP_LATTICE_FILLINGS;
    if (missed) {
        c->given_share = c->fillings == 1u ? 0.5f * c->given_share : 0.0f;
        c->forward = c->fillings == 1u ? NEAR : FAR;
    }
    if (!again) {
        if ((flags & PALP_LATTICE_FULL) != 0u) c->flags |= PALP_CONTACT_FULL;
        next_tool(c);
    }
    return c->filling < c->tool_count;
}

uint32_t palp_contact_points(palp_contact *contact) {
    palp_contact *c = contact;
    for (uint32_t i = 0; i < c->count; i++) linearise(c, i);
    return c->count;
}

/* ---- the complementarity problem ---- */

static void assemble_row(palp_contact *c, uint32_t i) {
    const palp_contact_point *p = &c->point[i];
    const float k = c->spring[p->tool].stiffness_N_per_m, give = k > 0.0f ? 1.0f / k : 0.0f;
    float *row = c->g + (size_t)i * c->room;
    palp_contact_compliance_row(c, i, i + 1u, row);
    for (uint32_t j = 0; j <= i; j++) {
        bool same = c->point[j].tool == p->tool;
        row[j] += same ? give * palp_dot(p->m, c->point[j].m) : 0.0f;
        c->g[(size_t)j * c->room + i] = row[j];
    }
}

bool palp_contact_assemble(palp_contact *contact) {
    palp_contact *c = contact;
    for (uint32_t k = 0; k < PALP_CONTACT_ROWS && c->row < c->count; k++) assemble_row(c, c->row++);
    return c->row < c->count;
}

/* Factors g over the points in contact; a point whose pivot vanishes is left out. */
static void factor_active(palp_contact *c) {
    c->active_count = 0;
    for (uint32_t i = 0; i < c->count; i++) {
        if (!c->point[i].active) continue;
        const uint32_t n = c->active_count;
        const float *row = c->g + (size_t)i * c->room;
        for (uint32_t a = 0; a < n; a++) c->scratch[a] = row[c->active[a]];
        c->scratch[n] = row[i];
        if (n == c->level.contacts) {
            c->point[i].active = false;
            c->point[i].left_out = true;
            c->flags |= PALP_CONTACT_FULL;
            continue;
        }
        if (palp_chol_append(c->factor, n, c->room, c->scratch) != PALP_OK) {
            c->point[i].active = false;
            c->point[i].left_out = true;
            c->flags |= PALP_CONTACT_REDUNDANT;
            continue;
        }
        c->lambda[n] = c->target[i];
        c->active[c->active_count++] = i;
    }
    palp_chol_solve(c->factor, c->active_count, c->room, c->lambda);
    uint64_t n = c->active_count;
    c->work_done += n * n * n / 6u + 2u * n * n + c->count;
}

/* Points that should leave (they would pull) or come in (the tool enters them); with `one`, only
 * the last of them. Returns how many changed. */
static uint32_t change_active(palp_contact *c, bool one) {
    uint32_t changed = 0, a = c->active_count;
    for (uint32_t i = c->count; i-- > 0u;) {
        palp_contact_point *p = &c->point[i];
        if (p->left_out) continue;
        bool wrong;
        if (p->active) {
            wrong = c->lambda[--a] < 0.0f;
        } else {
            const float *row = c->g + (size_t)i * c->room;
            float sum = 0.0f;
            for (uint32_t k = 0; k < c->active_count; k++) sum += row[c->active[k]] * c->lambda[k];
            wrong = c->target[i] - sum > CLEAR * palp_tool_size(&c->tools[p->tool]);
        }
        if (!wrong || (one && changed > 0u)) continue;
        p->active = !p->active;
        changed++;
    }
    c->work_done += (uint64_t)(c->count - c->active_count) * c->active_count;
    return changed;
}

bool palp_contact_iterate(palp_contact *contact) {
    palp_contact *c = contact;
    if (c->iterations == PALP_CONTACT_ITERATIONS) {
        c->flags |= PALP_CONTACT_SPENT;
        return false;
    }
    factor_active(c);
    if (c->active_count > c->most_active) c->most_active = c->active_count;
    return change_active(c, c->iterations++ >= BLOCK_CHANGES) > 0u;
}

/* The displacement by the modes around a tool's forces. */
static palp_given given_to(const palp_contact *c, uint32_t t) {
    palp_given_sums sums = {.weight = 0.0f};
    for (uint32_t a = 0; a < c->active_count; a++) {
        const uint32_t i = c->active[a];
        const palp_contact_point *p = &c->point[i];
        if (p->tool != t) continue;
        palp_vec3 h = {0};
        for (uint32_t k = 0; k < 3u; k++)
            h = palp_madd(h, p->at.weight[k], c->node_u_m[c->corner[i][k]]);
        palp_given_add(&sums, p->force_N, palp_sub(p->at.y, c->tool_m[t]), h, p->cell_m);
    }
    palp_given g = palp_given_fit(&sums, c->tool_m[t]);
    const float size = palp_tool_size(&c->tools[t]);
    if (!(sums.weight > 0.0f) && c->energy_J > 0.0f) /* other tools press: all is far from them */
        g.fade = 16.0f / (size * size);
    return g;
}

/*
 * How much of what the exact force has beyond - sum lambda m is believed at once. Near its limit
 * most_N it says more of the points than of the body, and may jump from tick to tick as the lattice
 * swings between two regions: there it is followed slowly. This force also enters the next tick's
 * solution as it is now, and moves a tool on a soft spring. Within a cell of the lattice the force
 * may turn round. So where it could move the tool by a cell, it is followed slowly as well.
 */
static float response(const palp_contact *c, uint32_t t, float most_N) {
    const float near = palp_norm(c->beyond_N[t]) / palp_max(most_N, 1e-30f);
    const float steady = 1.0f / (1.0f + STEADY * near * near);
    const float k = c->spring[t].stiffness_N_per_m;
    float cell = c->lattice[t].used.spacing;
    if (palp_lattice_is_central(&c->tools[t])) cell *= palp_tool_size(&c->tools[t]);
    if (!(k > 0.0f)) return steady;
    return steady * k * cell / (k * cell + SLOWLY * most_N);
}

/* v, or the vector along it of length `most` where it is longer. */
static palp_vec3 at_most(palp_vec3 v, float most) {
    const float length = palp_norm(v);
    return length > most ? palp_scale(most / length, v) : v;
}

static palp_vec3 blend(palp_vec3 from, palp_vec3 to, float share) {
    return palp_madd(from, share, palp_sub(to, from));
}

void palp_contact_finish(palp_contact *contact) {
    palp_contact *c = contact;
    palp_vec3 push[PALP_CONTACT_TOOLS] = {{0}};
    palp_vec3 before_N[PALP_CONTACT_TOOLS];
    for (uint32_t t = 0; t < c->tool_count; t++) {
        c->normal_N[t] = 0.0f;
        before_N[t] = c->beyond_N[t];
        c->beyond_N[t] = (palp_vec3){0};
    }
    for (uint32_t i = 0; i < c->count; i++) c->point[i].force_N = 0.0f;
    for (uint32_t a = 0; a < c->active_count; a++) {
        palp_contact_point *p = &c->point[c->active[a]];
        p->force_N = palp_max(c->lambda[a], 0.0f);
        c->normal_N[p->tool] += p->force_N;
        push[p->tool] = palp_madd(push[p->tool], -p->force_N, p->m);
    }
    c->solved = true;
    palp_contact_gather(c);
    for (uint32_t m = 0; m < far_modes(c); m++)
        c->far_load[m] = m < c->level.modes ? c->load[m] : 0.0f;
    for (uint32_t k = 0; k < c->nodes; k++)
        c->node_u_m[k] = palp_surface_corner(&c->surface, c->node[k], c->level.modes, c->load);
    c->work_done += 3u * (uint64_t)c->nodes * c->level.modes;
    c->energy_J = 0.0f;
    for (uint32_t i = 0; i < c->count; i++) {
        palp_contact_point *p = &c->point[i];
        p->u_m = palp_contact_displacement(c, i);
        c->energy_J += 0.5f * p->force_N * palp_dot(p->m, p->u_m);
    }
    for (uint32_t t = 0; t < c->tool_count; t++) c->given[t] = given_to(c, t);
    palp_contact_exact(c, c->beyond_N);
    for (uint32_t t = 0; t < c->tool_count; t++) {
        const palp_contact_spring *s = &c->spring[t];
        const float most = PALP_CONTACT_BEYOND * palp_norm(push[t]);
        const palp_vec3 before = at_most(before_N[t], most);
        c->beyond_N[t] = at_most(c->beyond_N[t], most);
        if (c->normal_N[t] > 0.0f)
            c->beyond_N[t] = blend(before, c->beyond_N[t], response(c, t, most));
        c->force_N[t] = palp_add(push[t], c->beyond_N[t]);
        c->rest_m[t] = s->held_m;
        if (s->stiffness_N_per_m > 0.0f)
            c->rest_m[t] = palp_madd(s->held_m, 1.0f / s->stiffness_N_per_m, c->force_N[t]);
    }
}

void palp_contact_solve(palp_contact *contact, const palp_vec3 *tool_m,
                        const palp_contact_spring *spring) {
    palp_contact_begin(contact, tool_m, spring);
    /* at most tools times PALP_LATTICE_FILLINGS */
    while (palp_contact_fill(contact)) {}
    if (palp_contact_points(contact) > 0u) {
        /* at most room / PALP_CONTACT_ROWS */
        while (palp_contact_assemble(contact)) {}
        /* at most PALP_CONTACT_ITERATIONS */
        while (palp_contact_iterate(contact)) {}
    }
    palp_contact_finish(contact);
}
