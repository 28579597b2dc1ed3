/* SPDX-License-Identifier: MIT */
#include "core/contact/contact.h"
#include "core/base/linalg.h"
#include "core/contact/contact_internal.h"
#include "core/contact/facing.h"

#define CLEAR 1e-6f      /* violation that lets a point in, over the tool's size */
#define LEAST_SHARE 0.3f /* of what the body gave way in the last tick, and most */
#define MOST_SHARE 2.0f
#define ZONE_CELLS 16u /* on the coarse levels of multizone models */
#define STEADY 30.0f   /* ticks that a force beyond at its limit takes to come through */
#define SLOWLY 4.0f    /* a step of the force beyond counts so many times against a cell */
/* How far a tool whose contact was missed is put forward, over its size: first, and then. */
#define NEAR 0.02f
#define FAR 0.1f
#define OTHER_LATTICE 0.15f /* change of the spacing from which places are others */
#define PAIR_SIZE 2.0f      /* of zones that touch, in place of a tool's: edges */
#define BLOCK_CHANGES 6u    /* iterations that change many points at once; then one at a time */

/* ---- life ---- */

palp_contact_level palp_contact_level_of(uint32_t level, uint32_t modes) {
    static const uint32_t cells[PALP_CONTACT_LEVELS] = {6, 6, 6, 20, 40};
    static const uint32_t share[PALP_CONTACT_LEVELS] = {4, 2, 1, 1, 1};
    static const uint32_t contacts[PALP_CONTACT_LEVELS] = {12, 12, 12, 36, 72};
    uint32_t m = (modes / share[level] + PALP_MODE_LANES - 1u) / PALP_MODE_LANES * PALP_MODE_LANES;
    return (palp_contact_level){level, cells[level], 3u * cells[level] + 2u, contacts[level], m};
}

palp_contact_level palp_contact_level_of_zones(uint32_t level, uint32_t modes) {
    palp_contact_level l = palp_contact_level_of(level, modes);
    if (level >= PALP_CONTACT_FINEST) return l;
    return (palp_contact_level){level, ZONE_CELLS, 3u * ZONE_CELLS + 2u, 2u * ZONE_CELLS, l.modes};
}

static palp_contact_level level_of(const palp_contact *c, uint32_t level) {
    return c->assembly != NULL ? palp_contact_level_of_zones(level, c->modes)
                               : palp_contact_level_of(level, c->modes);
}

static uint32_t room_of(const palp_contact *c, uint32_t finest) {
    uint32_t most = 0;
    for (uint32_t l = 0; l <= finest; l++) {
        uint32_t points = level_of(c, l).points;
        if (points > most) most = points;
    }
    return most;
}

static uint32_t zone_modes(const palp_assembly *a) {
    uint32_t most = 0;
    for (uint32_t z = 0; z < a->zones->meta->zones; z++)
        most = a->zones->zone[z].modes > most ? a->zones->zone[z].modes : most;
    return most;
}

static void lay_out(palp_contact *c, palp_arena *arena) {
    const uint32_t modes = c->modes;
    c->side_room = ((c->pairs ? 2u * c->room : c->room) + LANES - 1u) / LANES * LANES;
    const uint32_t room = c->room, sides = c->side_room;
    const uint32_t padded = sides / LANES * LANES + LANES * c->bodies;
    c->surface = palp_take(arena, c->bodies, sizeof *c->surface);
    c->frame_before = palp_take(arena, c->assembly != NULL ? c->bodies : 0u, sizeof(palp_frame));
    c->closest =
        palp_take(arena, c->pairs ? c->bodies * (c->bodies - 1u) / 2u : 0u, sizeof *c->closest);
    c->beyond = palp_take(arena, c->assembly != NULL ? c->bodies : 0u, sizeof *c->beyond);
    for (uint32_t b = 0; b < c->bodies && c->assembly != NULL; b++) {
        const size_t triangles = c->assembly->zones->blob[b].meta->triangles;
        uint32_t *table = palp_take(arena, 3u * triangles, sizeof *table);
        if (arena->base != NULL) c->beyond[b] = table;
    }
    c->patch = palp_take(arena, c->patches, sizeof *c->patch);
    c->point = palp_take(arena, room, sizeof *c->point);
    c->before = palp_take(arena, room, sizeof *c->before);
    c->facing = palp_take(arena, c->pairs ? room : 0u, sizeof *c->facing);
    c->facing_before = palp_take(arena, c->pairs ? room : 0u, sizeof *c->facing);
    for (uint32_t k = 0; k < c->patches; k++) {
        palp_lattice_table *table = palp_take(arena, 2u, sizeof *table);
        if (arena->base == NULL) continue;
        c->patch[k].table = table;
        c->patch[k].table_before = table + 1u;
    }
    c->side_point = palp_take(arena, sides, sizeof *c->side_point);
    c->other_side = palp_take(arena, room, sizeof *c->other_side);
    c->node = palp_take(arena, 3u * sides, sizeof *c->node);
    c->node_body = palp_take(arena, 3u * sides, sizeof *c->node_body);
    c->node_u_m = palp_take(arena, 3u * sides, sizeof *c->node_u_m);
    c->node_bent_m = palp_take(arena, 3u * sides, sizeof *c->node_bent_m);
    c->node_slot = palp_take(arena, PALP_CONTACT_NODE_SLOTS, sizeof *c->node_slot);
    c->corner = palp_take(arena, sides, sizeof *c->corner);
    c->run = palp_take(arena, sides, sizeof *c->run); /* no more than there are sides */
    for (uint32_t k = 0; k < 11u; k++) c->column[k] = palp_take(arena, sides, sizeof(float));
    for (uint32_t k = 0; k < 11u; k++) c->pressed[k] = palp_take(arena, padded, sizeof(float));
    c->pressed_side = palp_take(arena, padded, sizeof(uint16_t));
    c->pressed_of = palp_take(arena, c->bodies, sizeof *c->pressed_of);
    c->mode = palp_take(arena, (size_t)modes * sides, sizeof(float));
    c->load = palp_take(arena, modes, sizeof(float));
    for (uint32_t k = 0; k < 2u; k++) c->side_row[k] = palp_take(arena, sides, sizeof(float));
    c->g = palp_take(arena, (size_t)room * room, sizeof(float));
    c->factor = palp_take(arena, (size_t)room * room, sizeof(float));
    c->target = palp_take(arena, room, sizeof(float));
    c->lambda = palp_take(arena, room, sizeof(float));
    c->scratch = palp_take(arena, room + 1u, sizeof(float));
    c->active = palp_take(arena, room, sizeof(uint32_t));
    if (c->assembly == NULL) return;
    const size_t width = 3u * (size_t)c->assembly->seams.modes;
    c->seam = palp_take(arena, 2u * width * sides, sizeof(float));
    c->felt = palp_take(arena, 3u * (size_t)zone_modes(c->assembly), sizeof(float));
    c->answer = palp_take(arena, 2u * width, sizeof(float));
}

size_t palp_contact_memsize(const palp_blob *blob, uint32_t tool_count, uint32_t finest) {
    palp_arena arena = {0};
    palp_contact c = {.bodies = 1u,
                      .patches = tool_count,
                      .tool_count = tool_count,
                      .modes = blob->regular.modes};
    if (finest >= PALP_CONTACT_LEVELS || tool_count > PALP_CONTACT_TOOLS) return 0;
    c.room = room_of(&c, finest);
    lay_out(&c, &arena);
    return arena.used;
}

size_t palp_contact_memsize_zones(const palp_assembly *assembly, bool pairs, uint32_t tool_count,
                                  uint32_t finest) {
    palp_arena arena = {0};
    const palp_zones *z = assembly->zones;
    palp_contact c = {.assembly = (palp_assembly *)(uintptr_t)assembly,
                      .pairs = pairs,
                      .bodies = z->meta->zones,
                      .patches = tool_count + (pairs ? PALP_CONTACT_PAIRS : 0u),
                      .tool_count = tool_count,
                      .modes = z->blob[0].regular.modes};
    if (finest >= PALP_CONTACT_LEVELS || tool_count > PALP_CONTACT_TOOLS) return 0;
    c.room = room_of(&c, finest);
    lay_out(&c, &arena);
    return arena.used;
}

static palp_status check(const palp_tool *tools, uint32_t tool_count, const void *memory,
                         size_t bytes, size_t need) {
    if (tool_count < 1u || tool_count > PALP_CONTACT_TOOLS) return PALP_ERR_ARGUMENT;
    for (uint32_t t = 0; t < tool_count; t++) {
        if (!palp_tool_is_sound(&tools[t])) return PALP_ERR_ARGUMENT;
    }
    if (memory == NULL || ((uintptr_t)memory & (PALP_ALIGN - 1u)) != 0u) return PALP_ERR_ALIGNMENT;
    return bytes < need ? PALP_ERR_MEMORY : PALP_OK;
}

static void start(palp_contact *c) {
    for (uint32_t k = 0; k < PALP_CONTACT_NODE_SLOTS; k++) c->node_slot[k] = 0;
    c->nodes = 0;
    palp_contact_clear(c);
}

palp_status palp_contact_init(palp_contact *contact, const palp_blob *blob, const palp_tool *tools,
                              uint32_t tool_count, uint32_t finest, void *memory, size_t bytes) {
    palp_arena arena = {.base = memory};
    palp_surface surface;
    if (finest >= PALP_CONTACT_LEVELS) return PALP_ERR_LIMITS;
    palp_status status = palp_surface_open(&surface, blob);
    if (status != PALP_OK) return status;
    status =
        check(tools, tool_count, memory, bytes, palp_contact_memsize(blob, tool_count, finest));
    if (status != PALP_OK) return status;
    palp_contact *c = contact;
    *c = (palp_contact){.tools = tools,
                        .tool_count = tool_count,
                        .bodies = 1u,
                        .patches = tool_count,
                        .modes = blob->regular.modes,
                        .now = finest};
    c->room = room_of(c, finest);
    c->level = level_of(c, finest);
    lay_out(c, &arena);
    c->surface[0] = surface;
    start(c);
    return PALP_OK;
}

palp_status palp_contact_init_zones(palp_contact *contact, palp_assembly *assembly, bool pairs,
                                    const palp_tool *tools, uint32_t tool_count, uint32_t finest,
                                    void *memory, size_t bytes) {
    palp_arena arena = {.base = memory};
    palp_contact *c = contact;
    const palp_zones *z = assembly->zones;
    if (finest >= PALP_CONTACT_LEVELS) return PALP_ERR_LIMITS;
    for (uint32_t i = 0; i < z->meta->zones; i++) {
        palp_surface surface;
        palp_status status = palp_surface_open_zone(&surface, assembly, i);
        if (status != PALP_OK) return status;
        if (surface.blob->regular.modes != z->blob[0].regular.modes) return PALP_ERR_ARGUMENT;
    }
    palp_status status = check(tools, tool_count, memory, bytes,
                               palp_contact_memsize_zones(assembly, pairs, tool_count, finest));
    if (status != PALP_OK) return status;
    *c = (palp_contact){.assembly = assembly,
                        .pairs = pairs,
                        .tools = tools,
                        .tool_count = tool_count,
                        .bodies = z->meta->zones,
                        .patches = tool_count + (pairs ? PALP_CONTACT_PAIRS : 0u),
                        .modes = z->blob[0].regular.modes,
                        .now = finest};
    c->room = room_of(c, finest);
    lay_out(c, &arena);
    for (uint32_t i = 0; i < c->bodies; i++)
        (void)palp_surface_open_zone(&c->surface[i], assembly, i);
    c->frame = assembly->world;
    palp_contact_open_patches(c);
    c->level = level_of(c, finest);
    start(c);
    return PALP_OK;
}

void palp_contact_clear(palp_contact *contact) {
    palp_contact *c = contact;
    for (uint32_t k = 0; k < c->patches; k++) {
        palp_contact_patch *p = &c->patch[k];
        palp_lattice_table *table = p->table, *before = p->table_before;
        *p = (palp_contact_patch){.table = table, .table_before = before};
        palp_lattice_clear(table);
        palp_lattice_clear(before);
    }
    for (uint32_t t = 0; t < c->tool_count; t++) {
        c->force_N[t] = c->beyond_N[t] = (palp_vec3){0};
        c->normal_N[t] = 0.0f;
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
    const palp_contact_patch *patch = &c->patch[p->patch];
    const float before = patch->spacing_before;
    float scale = before > 0.0f ? patch->lattice.used.spacing / before : 1.0f;
    const bool changed = palp_abs(scale - 1.0f) > OTHER_LATTICE;
    if (!changed) scale = 1.0f;
    const int16_t i = nearest(scale * (float)p->i), j = nearest(scale * (float)p->j);
    for (uint32_t k = 0; k < 7u; k++) {
        uint32_t at = palp_lattice_find(patch->table_before, (int16_t)(i + step[k][0]),
                                        (int16_t)(j + step[k][1]));
        *same = k == 0u && !changed;
        if (at >= c->count_before) continue;
        const palp_contact_point *q = &c->before[at];
        /* the table of a patch that was left out is an older one */
        if (q->patch == p->patch && q->i == (int16_t)(i + step[k][0]) &&
            q->j == (int16_t)(j + step[k][1]))
            return q;
    }
    return NULL;
}

/* ---- corners ---- */

static uint32_t slot_of_node(const palp_contact *c, uint32_t body, uint32_t node) {
    uint32_t slot = ((node + 65536u * body) * 2654435761u) >> 22u;
    for (uint32_t k = 0; k < PALP_CONTACT_NODE_SLOTS; k++) {
        uint32_t at = (slot + k) & (PALP_CONTACT_NODE_SLOTS - 1u), n = c->node_slot[at];
        if (n == 0u || (c->node[n - 1u] == node && c->node_body[n - 1u] == body)) return at;
    }
    return 0u;
}

static void forget_nodes(palp_contact *c) {
    for (uint32_t k = 0; k < PALP_CONTACT_NODE_SLOTS; k++) c->node_slot[k] = 0;
    c->nodes = 0;
}

/* Lists the corners of a side; returns how its place is bent. */
static palp_vec3 list_corners(palp_contact *c, uint32_t side, uint32_t body,
                              const palp_surface_point *at) {
    const palp_surface *surface = &c->surface[body];
    const uint32_t *v = surface->blob->triangle + 3u * (size_t)at->triangle;
    palp_vec3 bent = {0};
    for (uint32_t k = 0; k < 3u; k++) {
        uint32_t slot = slot_of_node(c, body, v[k]);
        if (c->node_slot[slot] == 0u) {
            c->node_bent_m[c->nodes] = palp_surface_bent(surface, v[k]);
            c->node_body[c->nodes] = body;
            c->node[c->nodes++] = v[k];
            c->node_slot[slot] = (uint16_t)c->nodes;
        }
        c->corner[side][k] = (uint16_t)(c->node_slot[slot] - 1u);
        if (surface->assembly != NULL)
            bent = palp_madd(bent, at->weight[k], c->node_bent_m[c->corner[side][k]]);
    }
    return bent;
}

/* A tick that was given up before its end leaves nothing to go on from. */
static void swap_ticks(palp_contact *c) {
    if (!c->solved) {
        c->count = 0;
        return;
    }
    c->solved = false;
    palp_contact_point *point = c->point;
    palp_contact_facing *facing = c->facing;
    c->point = c->before;
    c->before = point;
    c->facing = c->facing_before;
    c->facing_before = facing;
    c->count_before = c->count;
    c->count = 0;
    for (uint32_t k = 0; k < c->patches; k++) {
        palp_contact_patch *p = &c->patch[k];
        palp_lattice_table *table = p->table;
        p->table = p->table_before;
        p->table_before = table;
        p->spacing_before = p->lattice.used.spacing;
    }
}

/* ---- sides ---- */

/* The sides of one body that come one behind the other. */
static void add_to_run(palp_contact *c, uint32_t body, uint32_t side) {
    if (c->runs > 0u && side != c->count) { /* where those of points end */
        palp_contact_run *last = &c->run[c->runs - 1u];
        if (last->body == body && last->end == side) {
            last->end = side + 1u;
            return;
        }
    }
    c->run[c->runs++] = (palp_contact_run){body, side, side + 1u};
}

/* Puts one side of a point among the others, with the unit load along m on its body. */
static void add_side(palp_contact *c, uint32_t point, uint32_t side, uint32_t body,
                     const palp_surface_point *at, palp_vec3 m) {
    const palp_contact_point *p = &c->point[point];
    const float of[11] = {at->y.x, at->y.y, at->y.z, at->n.x,   at->n.y,        at->n.z,
                          m.x,     m.y,     m.z,     p->cell_m, (float)p->patch};
    const uint32_t modes = c->level.modes;
    for (uint32_t k = 0; k < 11u; k++) c->column[k][side] = of[k];
    c->side_point[side] = (uint16_t)point;
    add_to_run(c, body, side);
    palp_surface_modes(&c->surface[body], at, m, modes, c->mode + side, c->side_room);
    c->work_done += 120u + 9u * modes;
}

/* A triangle of the other zone near where a pair meets. */
static uint32_t facing_of(const palp_contact *c, const palp_contact_patch *patch) {
    return c->surface[patch->other].blob->regular.triangle[patch->before];
}

/* The direction and the place that a point of one zone meets another one in, where both have gone
 * together. */
static void meet(palp_contact *c, uint32_t i) {
    palp_contact_point *p = &c->point[i];
    palp_contact_patch *patch = &c->patch[p->patch];
    palp_contact_facing *z = &c->facing[i];
    const palp_given *given = &patch->lattice.used.given;
    uint32_t crossings = PALP_SURFACE_CROSSINGS;
    uint32_t hint[2] = {patch->lattice.facing, facing_of(c, patch)};
    float gone;
    palp_vec3 beside = palp_given_beside(given, p->y, &gone);
    palp_vec3 x = palp_add(p->y, palp_add(given->mean_m, beside));
    palp_vec3 m = palp_scale(-1.0f, p->n);
    z->at.body = patch->other;
    z->found = palp_facing_find(&c->surface[patch->other], &c->frame[patch->other], x,
                                patch->lattice.used.axis, &crossings, hint, &z->at);
    if (z->found) m = palp_add(m, palp_contact_outward(c, patch->other, z->at.n));
    p->out = palp_scale(1.0f / palp_max(palp_norm(m), 1e-6f), m);
    z->m = palp_scale(-1.0f, palp_contact_inward(c, patch->other, p->out));
    if (z->found) return;
    const palp_frame *there = &c->frame[patch->other];
    z->at.y = z->at.q = palp_carry_back(there, x);
    z->at.n = palp_scale(-1.0f, z->m);
    for (uint32_t k = 0; k < 3u; k++) z->at.weight[k] = 0.0f;
    p->left_out = true;
    p->active = false;
    c->flags |= PALP_CONTACT_LOST;
}

/* The tool as a point sees it, about its last displacement. */
static void face(palp_contact *c, uint32_t i, palp_vec3 y) {
    palp_contact_point *p = &c->point[i];
    const palp_contact_patch *patch = &c->patch[p->patch];
    const float stiffness = c->spring[patch->tool].stiffness_N_per_m;
    palp_gap gap = palp_tool_gap(&c->tools[patch->tool], patch->tool_m, y);
    palp_vec3 held = patch->held_m;
    if (stiffness > 0.0f) held = palp_madd(held, 1.0f / stiffness, c->beyond_N[patch->tool]);
    p->out = gap.normal;
    c->target[i] = -gap.gap_m + palp_dot(p->out, palp_sub(held, patch->tool_m));
}

/* What is asked of a point. */
static void linearise(palp_contact *c, uint32_t i) {
    palp_contact_point *p = &c->point[i];
    const palp_contact_patch *patch = &c->patch[p->patch];
    const uint32_t body = p->at.body;
    const bool pair = patch->tool == PALP_CONTACT_TOOLS;
    bool same;
    const palp_contact_point *last = last_of(c, p, &same);
    const bool here = last != NULL && last->at.body == body;
    p->u_m = here ? last->u_m : (palp_vec3){0};
    p->active = last != NULL ? same && last->active : true;
    p->left_out = false;
    c->other_side[i] = 0;
    palp_vec3 moved = list_corners(c, i, body, &p->at);
    if (!pair) moved = palp_add(moved, p->u_m);
    const palp_vec3 y = palp_add(p->y, palp_contact_outward(c, body, moved));
    if (pair) {
        meet(c, i);
        c->target[i] = -palp_dot(p->out, y);
    } else {
        face(c, i, y);
    }
    p->m = palp_contact_inward(c, body, p->out);
    if (!pair) c->target[i] += palp_dot(p->m, p->u_m);
    add_side(c, i, i, body, &p->at, p->m);
}

/* The other side of a point between zones; it is asked that the two do not pass each other. */
static void add_other_side(palp_contact *c, uint32_t i) {
    const palp_contact_patch *patch = &c->patch[c->point[i].patch];
    const palp_contact_facing *z = &c->facing[i];
    const uint32_t side = c->sides++;
    c->other_side[i] = (uint16_t)side;
    palp_vec3 bent = list_corners(c, side, patch->other, &z->at);
    add_side(c, i, side, patch->other, &z->at, z->m);
    palp_vec3 there = palp_carry(&c->frame[patch->other], palp_add(z->at.y, bent));
    c->target[i] += palp_dot(c->point[i].out, there);
}

float palp_contact_energy(const palp_contact *contact, float normal_N) {
    const palp_contact *c = contact;
    float all = 0.0f;
    for (uint32_t k = 0; k < c->patches; k++) all += c->patch[k].normal_N;
    return normal_N > 0.0f ? c->energy_J * normal_N / all : 0.0f;
}

/* What the body as a whole gives way grows with the force, and the force with the depth as in
 * Hertz' law: by 3/2 F dx / (work F dx is done against), from where the tool came to rest. */
static float foreseen_share(const palp_contact *c, const palp_contact_patch *patch) {
    const float energy = palp_contact_energy(c, patch->normal_N);
    if (!(energy > 0.0f)) return 0.0f;
    if (patch->tool == PALP_CONTACT_TOOLS) return 1.0f; /* where zones meet goes with them */
    palp_vec3 moved = palp_sub(patch->tool_m, patch->rest_m);
    moved = palp_sub(moved, palp_contact_carried(c, patch->tool));
    palp_vec3 force = palp_add(patch->push_N, c->beyond_N[patch->tool]);
    return palp_clamp(1.0f - 0.6f * palp_dot(force, moved) / energy, LEAST_SHARE, MOST_SHARE);
}

void palp_contact_begin(palp_contact *contact, const palp_vec3 *tool_m,
                        const palp_contact_spring *spring) {
    palp_contact *c = contact;
    const float cells = (float)c->level.cells;
    c->level = level_of(c, c->now);
    for (uint32_t k = 0; k < c->patches && cells > 0.0f; k++)
        c->patch[k].lattice.at.spacing *= palp_sqrt(cells / (float)c->level.cells);
    swap_ticks(c);
    forget_nodes(c);
    bool full = (c->flags & PALP_CONTACT_FULL) != 0u;
    c->crowd = full ? palp_max(0.9f * c->crowd, 0.2f) : palp_min(1.002f * c->crowd, 1.0f);
    c->flags = c->row = c->iterations = c->most_active = c->active_count = 0;
    c->filled = (palp_lattice_counts){.fillings = 0};
    c->filling = c->fillings = c->first = c->runs = c->sides = 0;
    c->approached = false;
    for (uint32_t t = 0; t < c->tool_count; t++) {
        c->tool_m[t] = tool_m[t];
        c->spring[t] = spring[t];
    }
    palp_contact_place(c);
    c->filling = palp_contact_next(c);
    if (c->filling < c->patches) c->given_share = foreseen_share(c, &c->patch[c->filling]);
    c->forward = 0.0f;
}

/* The present patch's lattice is as it should be. */
static void next_patch(palp_contact *c) {
    c->filling = palp_contact_next(c);
    c->fillings = 0;
    c->first = c->count;
    if (c->filling < c->patches) c->given_share = foreseen_share(c, &c->patch[c->filling]);
    c->forward = 0.0f;
}

bool palp_contact_may_skip(const palp_contact *contact) {
    const bool presses = contact->patch[contact->filling].normal_N > 0.0f;
    if (contact->fillings == 0u) return contact->assembly != NULL && !presses;
    return contact->count > contact->first || !presses;
}

void palp_contact_skip(palp_contact *contact) { next_patch(contact); }

static palp_lattice_counts sum_of(palp_lattice_counts a, palp_lattice_counts b) {
    return (palp_lattice_counts){a.fillings + b.fillings,       a.around + b.around,
                                 a.evaluations + b.evaluations, a.shots + b.shots,
                                 a.crossings + b.crossings,     a.bent + b.bent};
}

/* Both fields about the place of the first. */
static palp_given together(palp_given a, const palp_given *b) {
    float gone;
    if (!(b->fade > 0.0f)) return a;
    if (!(a.fade > 0.0f)) return *b;
    a.mean_m = palp_add(a.mean_m, palp_add(b->mean_m, palp_given_beside(b, a.at_m, &gone)));
    for (uint32_t k = 0; k < 9u; k++) a.slope[k] += b->slope[k];
    a.fade = palp_min(a.fade, b->fade);
    return a;
}

/*
 * The displacement by the body as a whole that a filling is to meet: as foreseen; and when a
 * contact is missed there, less of it, with the tool put forward towards where its spring pulls it.
 * So a contact is not lost because the tool was foreseen a little above a surface that gives hardly
 * way.
 */
static palp_given given_for(const palp_contact *c, const palp_contact_patch *patch) {
    palp_given g = palp_given_times(&patch->given, c->given_share);
    if (c->assembly != NULL) g = together(g, &patch->bent);
    if (!(c->forward > 0.0f) || patch->tool == PALP_CONTACT_TOOLS) return g;
    palp_vec3 pull = palp_sub(patch->held_m, patch->tool_m);
    float most = c->forward * palp_tool_size(&c->tools[patch->tool]), length = palp_norm(pull);
    if (length > most) pull = palp_scale(most / length, pull);
    g.mean_m = palp_sub(g.mean_m, pull);
    return g;
}

static uint32_t far_modes(const palp_contact *c) {
    return c->modes < PALP_LATTICE_FAR_MODES ? c->modes : PALP_LATTICE_FAR_MODES;
}

/* The scale of what presses. */
static float size_of(const palp_contact *c, const palp_contact_patch *patch) {
    if (patch->tool < PALP_CONTACT_TOOLS) return palp_tool_size(&c->tools[patch->tool]);
    return PAIR_SIZE * c->surface[patch->body].blob->meta->mean_edge_m;
}

/* palp_lattice_reach on the body that asks for most. */
static float reach_of(const palp_contact *c, const palp_tool *tool) {
    float reach = 0.0f;
    for (uint32_t b = 0; b < c->bodies; b++)
        reach = palp_max(reach, palp_lattice_reach(tool, c->surface[b].blob));
    return reach;
}

/* Where the points of the present pair of zones end at most: such points have two sides, so no more
 * than half of all are. */
static uint32_t pair_room(const palp_contact *c) {
    uint32_t others = 0;
    for (uint32_t i = 0; i < c->first; i++)
        others += c->patch[c->point[i].patch].tool == PALP_CONTACT_TOOLS ? 1u : 0u;
    const uint32_t end = c->first + c->level.points / 2u - others;
    return end < c->level.points ? end : c->level.points;
}

bool palp_contact_fill(palp_contact *contact) {
    palp_contact *c = contact;
    if (c->filling >= c->patches) return false;
    palp_contact_patch *patch = &c->patch[c->filling];
    const bool pair = patch->tool == PALP_CONTACT_TOOLS;
    const uint32_t first = pair ? patch->body : 0u;
    const palp_tool *tool = pair ? NULL : &c->tools[patch->tool];
    const palp_lattice_room room = {
        .surface = c->surface + first,
        .bodies = pair ? 1u : c->bodies,
        .first_body = first,
        .frame = c->frame != NULL ? c->frame + first : NULL,
        .beyond = pair || c->assembly == NULL ? NULL : (const uint32_t *const *)c->beyond,
        .tool = tool,
        .other = pair ? &c->surface[patch->other] : NULL,
        .other_frame = pair ? &c->frame[patch->other] : NULL,
        .facing = pair ? facing_of(c, patch) : 0u,
        .size_m = size_of(c, patch),
        .reach_m =
            pair ? PALP_CONTACT_PAIR_REACH / PAIR_SIZE * size_of(c, patch) : reach_of(c, tool),
        .number = c->filling,
        .tool_m = patch->tool_m,
        .cells = (float)c->level.cells * c->crowd,
        .given = given_for(c, patch),
        .load = c->far_load,
        .far_modes = far_modes(c),
        .share = patch->normal_N > 0.0f ? c->given_share : 1.0f,
        .point = c->point,
        .count = &c->count,
        .most = pair ? pair_room(c) : c->level.points,
        .before = c->before,
        .count_before = c->count_before,
        .table = patch->table,
        .done = &c->done};
    patch->bent_used = patch->bent;
    c->done = (palp_lattice_counts){.fillings = 0};
    uint32_t flags = palp_lattice_fill(&patch->lattice, &room, c->first);
    c->filled = sum_of(c->filled, c->done);
    c->approached = c->approached || (!pair && c->done.bent > 0u);
    c->work_done += 400u * (uint64_t)c->done.fillings + 10u * c->done.around +
                    72u * c->done.evaluations + 240u * (uint64_t)c->done.shots +
                    45u * (uint64_t)c->done.crossings +
                    3u * PALP_LATTICE_WATCHED * PALP_LATTICE_FAR_MODES;
    if (!(patch->normal_N > 0.0f) && !patch->lattice.placed) patch->bent = patch->lattice.bent;
    const bool begun = (flags & PALP_LATTICE_BEGUN) != 0u;
    const bool missed = c->count == c->first && !begun && patch->normal_N > 0.0f;
    bool again = ((flags & PALP_LATTICE_MOVED) != 0u || begun || missed) &&
                 ++c->fillings < PALP_LATTICE_FILLINGS;
    if (missed) {
        c->given_share = c->fillings == 1u ? 0.5f * c->given_share : 0.0f;
        c->forward = c->fillings == 1u ? NEAR : FAR;
    }
    if (!again) {
        if ((flags & PALP_LATTICE_FULL) != 0u) c->flags |= PALP_CONTACT_FULL;
        if ((flags & PALP_LATTICE_LOST) != 0u) c->flags |= PALP_CONTACT_LOST;
        next_patch(c);
    }
    return c->filling < c->patches;
}

uint32_t palp_contact_points(palp_contact *contact) {
    palp_contact *c = contact;
    c->sides = c->count;
    for (uint32_t i = 0; i < c->count; i++) linearise(c, i);
    for (uint32_t i = 0; i < c->count && c->pairs; i++) {
        if (c->patch[c->point[i].patch].tool == PALP_CONTACT_TOOLS) add_other_side(c, i);
    }
    if (c->assembly != NULL) palp_contact_bond(c);
    return c->count;
}

/* ---- the complementarity problem ---- */

static void assemble_row(palp_contact *c, uint32_t i) {
    const palp_contact_point *p = &c->point[i];
    const palp_contact_patch *patch = &c->patch[p->patch];
    float give = 0.0f;
    if (patch->tool < c->tool_count && c->spring[patch->tool].stiffness_N_per_m > 0.0f)
        give = 1.0f / c->spring[patch->tool].stiffness_N_per_m;
    float *row = c->g + (size_t)i * c->room;
    palp_contact_compliance_row(c, i, row);
    for (uint32_t j = 0; j <= i; j++) {
        const palp_contact_point *q = &c->point[j];
        const palp_contact_patch *of = &c->patch[q->patch];
        if (of->tool == patch->tool && give > 0.0f) row[j] += give * palp_dot(p->out, q->out);
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
            wrong = c->target[i] - sum > CLEAR * size_of(c, &c->patch[p->patch]);
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

/* A place's displacement by the corners' `u`. */
static palp_vec3 at_corners(const palp_contact *c, uint32_t side, const palp_surface_point *at,
                            const palp_vec3 *u) {
    palp_vec3 h = {0};
    for (uint32_t k = 0; k < 3u; k++) h = palp_madd(h, at->weight[k], u[c->corner[side][k]]);
    return h;
}

/* The displacements around a patch's forces: by the modes and seams, and as its body is bent; of
 * one zone against the other. */
static void find_given(palp_contact *c, palp_contact_patch *patch, uint32_t k) {
    palp_given_sums given = {.weight = 0.0f}, bent = {.weight = 0.0f};
    for (uint32_t a = 0; a < c->active_count; a++) {
        const uint32_t i = c->active[a], other = c->other_side[i];
        const palp_contact_point *p = &c->point[i];
        if (p->patch != k) continue;
        palp_vec3 y = palp_sub(p->y, patch->tool_m);
        palp_vec3 h = at_corners(c, i, &p->at, c->node_u_m), b = {0};
        if (c->assembly != NULL) b = at_corners(c, i, &p->at, c->node_bent_m);
        h = palp_contact_outward(c, p->at.body, h);
        b = palp_contact_outward(c, p->at.body, b);
        if (other > 0u) {
            const palp_surface_point *z = &c->facing[i].at;
            palp_vec3 u = at_corners(c, other, z, c->node_u_m);
            h = palp_sub(h, palp_contact_outward(c, z->body, u));
            u = at_corners(c, other, z, c->node_bent_m);
            b = palp_sub(b, palp_contact_outward(c, z->body, u));
        }
        palp_given_add(&given, p->force_N, y, h, p->cell_m);
        palp_given_add(&bent, p->force_N, y, b, p->cell_m);
    }
    patch->given = palp_given_fit(&given, patch->tool_m);
    const float size = size_of(c, patch);
    if (!(given.weight > 0.0f) && c->energy_J > 0.0f) /* others press: all is far from them */
        patch->given.fade = 16.0f / (size * size);
    if (given.weight > 0.0f && c->assembly != NULL)
        patch->bent = palp_given_fit(&bent, patch->tool_m);
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
    float cell = c->patch[t].lattice.used.spacing;
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

/* Forces of the points, patches and tools. */
static void take_forces(palp_contact *c) {
    for (uint32_t t = 0; t < c->tool_count; t++) c->normal_N[t] = 0.0f;
    for (uint32_t k = 0; k < c->patches; k++) {
        c->patch[k].normal_N = 0.0f;
        c->patch[k].push_N = c->patch[k].beyond_N = (palp_vec3){0};
    }
    for (uint32_t i = 0; i < c->count; i++) c->point[i].force_N = 0.0f;
    for (uint32_t a = 0; a < c->active_count; a++) {
        palp_contact_point *p = &c->point[c->active[a]];
        palp_contact_patch *patch = &c->patch[p->patch];
        p->force_N = palp_max(c->lambda[a], 0.0f);
        patch->normal_N += p->force_N;
        patch->push_N = palp_madd(patch->push_N, -p->force_N, p->out);
        if (patch->tool < c->tool_count) c->normal_N[patch->tool] += p->force_N;
    }
}

/* What the forces displace all sides by, and the energy. */
static void take_displacements(palp_contact *c) {
    palp_contact_gather(c);
    for (uint32_t m = 0; m < far_modes(c); m++)
        c->far_load[m] = m < c->level.modes ? c->load[m] : 0.0f;
    palp_contact_displace_corners(c);
    c->energy_J = 0.0f;
    for (uint32_t i = 0; i < c->count; i++) {
        palp_contact_point *p = &c->point[i];
        p->u_m = palp_contact_displacement(c, i);
        float along = palp_dot(p->m, p->u_m);
        if (c->other_side[i] > 0u) {
            palp_contact_facing *z = &c->facing[i];
            z->u_m = palp_contact_displacement(c, c->other_side[i]);
            along += palp_dot(z->m, z->u_m);
        }
        c->energy_J += 0.5f * p->force_N * along;
    }
}

/* The force on a tool, and where it comes to rest. */
static void end_tool(palp_contact *c, uint32_t t, palp_vec3 before_N) {
    const palp_contact_spring *s = &c->spring[t];
    const palp_vec3 push = c->patch[t].push_N, beyond = c->patch[t].beyond_N;
    const float most = PALP_CONTACT_BEYOND * palp_norm(push);
    const palp_vec3 before = at_most(before_N, most);
    c->beyond_N[t] = at_most(beyond, most);
    if (c->normal_N[t] > 0.0f) c->beyond_N[t] = blend(before, c->beyond_N[t], response(c, t, most));
    c->force_N[t] = palp_add(push, c->beyond_N[t]);
    c->rest_m[t] = s->held_m;
    if (s->stiffness_N_per_m > 0.0f)
        c->rest_m[t] = palp_madd(s->held_m, 1.0f / s->stiffness_N_per_m, c->force_N[t]);
}

void palp_contact_finish(palp_contact *contact) {
    palp_contact *c = contact;
    palp_vec3 before_N[PALP_CONTACT_TOOLS];
    for (uint32_t t = 0; t < c->tool_count; t++) before_N[t] = c->beyond_N[t];
    take_forces(c);
    c->solved = true;
    take_displacements(c);
    for (uint32_t k = 0; k < c->patches; k++) {
        if (c->patch[k].used) find_given(c, &c->patch[k], k);
    }
    palp_contact_exact(c);
    for (uint32_t t = 0; t < c->tool_count; t++) {
        end_tool(c, t, before_N[t]);
        c->patch[t].rest_m = c->rest_m[t];
    }
    for (uint32_t b = 0; b < c->bodies && c->frame != NULL; b++) c->frame_before[b] = c->frame[b];
}

void palp_contact_solve(palp_contact *contact, const palp_vec3 *tool_m,
                        const palp_contact_spring *spring) {
    palp_contact_begin(contact, tool_m, spring);
    /* at most patches times PALP_LATTICE_FILLINGS */
    while (palp_contact_fill(contact)) {}
    if (palp_contact_points(contact) > 0u) {
        /* at most room / PALP_CONTACT_ROWS */
        while (palp_contact_assemble(contact)) {}
        /* at most PALP_CONTACT_ITERATIONS */
        while (palp_contact_iterate(contact)) {}
    }
    palp_contact_finish(contact);
}
