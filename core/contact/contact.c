/* SPDX-License-Identifier: MIT */
#include "core/contact/contact.h"
#include "core/base/apart.h"
#include "core/base/linalg.h"
#include "core/contact/contact_internal.h"
#include "core/contact/repay.h"

#define CLEAR 1e-6f      /* violation that lets a point in, over the tool's size */
#define LEAST_SHARE 0.3f /* of what the body gave way in the last tick, and most */
#define MOST_SHARE 2.0f
#define STEADY 30.0f /* ticks that a force beyond at its limit takes to come through */
#define SLOWLY 4.0f  /* a step of the force beyond counts so many times against a cell */
/* How far a tool whose contact was missed is put forward, over its size: first, and then. */
#define NEAR 0.02f
#define FAR 0.1f
#define PAIR_SIZE 2.0f    /* of zones that touch, in place of a tool's: edges */
#define LARGEST_TURN 1.0f /* rad, of a tool on its spring */
#define CROWDED 0.9f      /* share of the room for points from which fewer are asked for */
#define FOLLOWS 0.05f     /* share of a change in a tick */
#define TOGETHER 0.5f     /* share of a change of what several tools have moved, in a tick */
#define BLOCK_CHANGES 6u  /* iterations that change many points at once; then one at a time */

/* ---- filling ---- */

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

float palp_contact_energy(const palp_contact *c, float normal_N) {
    float all = 0.0f;
    for (uint32_t k = 0; k < c->patches; k++) all += c->patch[k].normal_N;
    return normal_N > 0.0f ? c->energy_J * normal_N / all : 0.0f;
}

/* Whether other tools press as well. */
static bool others_press(const palp_contact *c, const palp_contact_patch *patch) {
    for (uint32_t t = 0; t < c->tool_count; t++) {
        if (&c->patch[t] != patch && c->normal_N[t] > 0.0f) return patch->tool < c->tool_count;
    }
    return false;
}

/* What the body as a whole gives way grows with the force, and the force with the depth as in
 * Hertz' law: by 3/2 F dx / (work F dx is done against), from where the tool came to rest. */
static float foreseen_share(const palp_contact *c, const palp_contact_patch *patch) {
    const float energy = palp_contact_energy(c, patch->normal_N);
    if (!(energy > 0.0f)) return others_press(c, patch) ? 1.0f : 0.0f;
    if (patch->tool == PALP_CONTACT_TOOLS) return 1.0f; /* where zones meet goes with them */
    const uint32_t t = patch->tool;
    palp_vec3 moved = palp_sub(patch->at.t, c->rest[t].t);
    moved = palp_sub(moved, palp_contact_carried(c, t));
    const palp_vec3 force = palp_add(patch->push_N, c->beyond_N[t]);
    const palp_vec3 moment = palp_add(patch->push_Nm, c->beyond_Nm[t]);
    const float work =
        palp_dot(force, moved) + palp_dot(moment, palp_turn_between(c->rest[t].r, patch->at.r));
    return palp_clamp(1.0f - 0.6f * work / energy, LEAST_SHARE, MOST_SHARE);
}

/* Share of the cells that is asked for, so that there is room for the points of a deep contact:
 * what would need CROWDED of it with so many. It follows slowly, since a step of the spacing is
 * felt, and back by the same way, since what is stored depends on it. */
static float crowd_of(const palp_contact *c) {
    const bool full = (c->flags & PALP_CONTACT_FULL) != 0u;
    /* of flat zones that meet, points come and go by whole rows: their number says nothing ahead */
    if (c->pairs) return full ? palp_max(0.9f * c->crowd, 0.2f) : palp_min(1.002f * c->crowd, 1.0f);
    const float used = palp_max((float)c->most_active / (float)c->level.contacts,
                                (float)c->count / (float)c->level.points);
    if (full) return palp_max(0.9f * c->crowd, 0.2f);
    const float wanted = palp_min(CROWDED * c->crowd / palp_max(used, CROWDED * c->crowd), 1.0f);
    return palp_clamp(c->crowd + FOLLOWS * (wanted - c->crowd), 0.2f, 1.0f);
}

/* What each patch had in the last tick, and how much of the points in contact it may have: at least
 * what the others do not need. So one that comes to touch takes none from one that presses. */
static void find_shares(palp_contact *c) {
    uint32_t all = 0;
    for (uint32_t k = 0; k < c->patches; k++)
        c->patch[k].points_before = c->patch[k].pressed_before = 0;
    for (uint32_t i = 0; i < c->count_before; i++) {
        palp_contact_patch *p = &c->patch[c->before[i].patch];
        p->points_before++;
        if (!(c->before[i].force_N > 0.0f)) continue;
        p->pressed_before++;
        all++;
    }
    for (uint32_t k = 0; k < c->patches; k++) {
        palp_contact_patch *p = &c->patch[k];
        const uint32_t others = all - p->pressed_before;
        const uint32_t rest = c->level.contacts > others ? c->level.contacts - others : 0u;
        p->most_pressed = rest > p->pressed_before ? rest : p->pressed_before;
    }
}

void palp_contact_begin(palp_contact *c, const palp_frame *at, const palp_contact_spring *spring) {
    const float cells = (float)c->level.cells;
    c->crowd = crowd_of(c);
    c->level = palp_contact_level_at(c, c->now);
    for (uint32_t k = 0; k < c->patches && cells > 0.0f; k++)
        c->patch[k].lattice.at.spacing *= palp_sqrt(cells / (float)c->level.cells);
    swap_ticks(c);
    palp_contact_forget_nodes(c);
    c->flags = c->row = c->iterations = c->most_active = c->active_count = 0;
    c->filled = (palp_lattice_counts){.fillings = 0};
    c->filling = c->fillings = c->first = c->runs = c->sides = 0;
    c->approached = false;
    for (uint32_t t = 0; t < c->tool_count; t++) {
        c->patch[t].at = at[t];
        c->spring[t] = spring[t];
    }
    palp_contact_choose_patches(c);
    find_shares(c);
    c->filling = palp_contact_next(c);
    if (c->filling < c->patches) c->far_share = foreseen_share(c, &c->patch[c->filling]);
    c->forward = 0.0f;
}

/* The present patch's lattice is as it should be. */
static void next_patch(palp_contact *c) {
    c->filling = palp_contact_next(c);
    c->fillings = 0;
    c->first = c->count;
    if (c->filling < c->patches) c->far_share = foreseen_share(c, &c->patch[c->filling]);
    c->forward = 0.0f;
}

bool palp_contact_may_skip(const palp_contact *contact) {
    const bool presses = contact->patch[contact->filling].normal_N > 0.0f;
    if (contact->fillings == 0u) return contact->assembly != NULL && !presses;
    return contact->count > contact->first || !presses;
}

void palp_contact_skip(palp_contact *contact) { next_patch(contact); }

static palp_lattice_counts sum_of(palp_lattice_counts a, palp_lattice_counts b) {
    return (palp_lattice_counts){.fillings = a.fillings + b.fillings,
                                 .around = a.around + b.around,
                                 .nodes = a.nodes + b.nodes,
                                 .evaluations = a.evaluations + b.evaluations,
                                 .feet = a.feet + b.feet,
                                 .shots = a.shots + b.shots,
                                 .crossings = a.crossings + b.crossings,
                                 .kept = a.kept + b.kept,
                                 .followed = a.followed + b.followed,
                                 .bent = a.bent + b.bent};
}

/* Both fields about the place of the first. */
static palp_far_field together(palp_far_field a, const palp_far_field *b) {
    float gone;
    if (!(b->fade > 0.0f)) return a;
    if (!(a.fade > 0.0f)) return *b;
    a.mean_m = palp_add(a.mean_m, palp_add(b->mean_m, palp_far_field_beside(b, a.at_m, &gone)));
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
static palp_far_field far_field_for(const palp_contact *c, const palp_contact_patch *patch) {
    palp_far_field g = palp_far_field_times(&patch->far_field, c->far_share);
    if (c->assembly != NULL) g = together(g, &patch->bent);
    if (!(c->forward > 0.0f) || patch->tool == PALP_CONTACT_TOOLS) return g;
    palp_vec3 pull = palp_sub(c->spring[patch->tool].held.t, patch->at.t);
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

/* Where the points of the present pair of zones end at most: such points have two sides, so no more
 * than half of all are. */
static uint32_t pair_room(const palp_contact *c) {
    uint32_t others = 0;
    for (uint32_t i = 0; i < c->first; i++)
        others += c->patch[c->point[i].patch].tool == PALP_CONTACT_TOOLS ? 1u : 0u;
    const uint32_t end = c->first + c->level.points / 2u - others;
    return end < c->level.points ? end : c->level.points;
}

/* And those of the present tool: what the tools after it had is kept for them, so that one which
 * comes to touch with many does not take them from one that presses. */
static uint32_t tool_room(const palp_contact *c) {
    uint32_t kept = 0;
    for (uint32_t k = 0; k < c->patches; k++) {
        if (c->patch[k].used && !c->patch[k].filled) kept += c->patch[k].points_before;
    }
    return kept < c->level.points ? c->level.points - kept : 0u;
}

bool palp_contact_fill(palp_contact *c) {
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
        .other = {pair ? &c->surface[patch->other] : NULL, pair ? &c->frame[patch->other] : NULL},
        .facing = pair ? palp_contact_other_triangle(c, patch) : 0u,
        .size_m = size_of(c, patch),
        .reach_m = pair ? PALP_CONTACT_PAIR_REACH / PAIR_SIZE * size_of(c, patch)
                        : c->reach_m[patch->tool],
        .number = c->filling,
        .at = patch->at,
        .cells = (float)c->level.cells * c->crowd,
        .far_field = far_field_for(c, patch),
        .load = c->far_load,
        .far_modes = far_modes(c),
        .share = patch->normal_N > 0.0f ? c->far_share : 1.0f,
        .point = c->point,
        .count = &c->count,
        .most = pair ? pair_room(c) : tool_room(c),
        .before = c->before,
        .count_before = c->count_before,
        .table = patch->table,
        .done = &c->done};
    patch->bent_field_used = patch->bent;
    c->done = (palp_lattice_counts){.fillings = 0};
    uint32_t flags = palp_lattice_fill(&patch->lattice, &room, c->first);
    c->filled = sum_of(c->filled, c->done);
    c->approached = c->approached || (!pair && c->done.bent > 0u);
    c->work_done += 400u * (uint64_t)c->done.fillings + 10u * c->done.around +
                    72u * c->done.evaluations + 240u * (uint64_t)c->done.shots +
                    960u * (uint64_t)c->done.feet + 45u * (uint64_t)c->done.crossings +
                    3u * PALP_LATTICE_WATCHED * PALP_LATTICE_FAR_MODES;
    if (!(patch->normal_N > 0.0f) && !patch->lattice.placed) patch->bent = patch->lattice.bent;
    const bool begun = (flags & PALP_LATTICE_BEGUN) != 0u;
    /* what others have moved the body by is not taken back */
    const bool missed =
        c->count == c->first && !begun && patch->normal_N > 0.0f && !others_press(c, patch);
    bool again = ((flags & PALP_LATTICE_MOVED) != 0u || begun || missed) &&
                 ++c->fillings < PALP_LATTICE_FILLINGS;
    if (missed) {
        c->far_share = c->fillings == 1u ? 0.5f * c->far_share : 0.0f;
        c->forward = c->fillings == 1u ? NEAR : FAR;
    }
    if (!again) {
        if ((flags & PALP_LATTICE_FULL) != 0u) c->flags |= PALP_CONTACT_FULL;
        if ((flags & PALP_LATTICE_LOST) != 0u) c->flags |= PALP_CONTACT_LOST;
        next_patch(c);
    }
    return c->filling < c->patches;
}

/* ---- the complementarity problem ---- */

static void assemble_row(palp_contact *c, uint32_t i) {
    const palp_contact_point *p = &c->point[i];
    const palp_contact_patch *patch = &c->patch[p->patch];
    float give = 0.0f, turn = 0.0f;
    if (patch->tool < c->tool_count) {
        const palp_contact_spring *s = &c->spring[patch->tool];
        if (s->stiffness_N_per_m > 0.0f) give = 1.0f / s->stiffness_N_per_m;
        if (s->stiffness_Nm_per_rad > 0.0f) turn = 1.0f / s->stiffness_Nm_per_rad;
    }
    float *row = c->g + (size_t)i * c->room;
    palp_contact_compliance_row(c, i, row);
    for (uint32_t j = 0; j <= i; j++) {
        const palp_contact_point *q = &c->point[j];
        const palp_contact_patch *of = &c->patch[q->patch];
        const bool same = of->tool == patch->tool;
        if (same && give > 0.0f) row[j] += give * palp_dot(p->out, q->out);
        if (same && turn > 0.0f) row[j] += turn * palp_dot(p->arm_m, q->arm_m);
        c->g[(size_t)j * c->room + i] = row[j];
    }
}

bool palp_contact_assemble(palp_contact *c) {
    for (uint32_t k = 0; k < PALP_CONTACT_ROWS && c->row < c->count; k++) assemble_row(c, c->row++);
    return c->row < c->count;
}

/* Factors g over the points in contact; a point whose pivot vanishes is left out. */
static void factor_active(palp_contact *c) {
    c->active_count = 0;
    for (uint32_t k = 0; k < c->patches; k++) c->patch[k].pressed = 0;
    for (uint32_t i = 0; i < c->count; i++) {
        if (!c->point[i].active) continue;
        palp_contact_patch *of = &c->patch[c->point[i].patch];
        const uint32_t n = c->active_count;
        const float *row = c->g + (size_t)i * c->room;
        for (uint32_t a = 0; a < n; a++) c->scratch[a] = row[c->active[a]];
        c->scratch[n] = row[i];
        if (n == c->level.contacts || of->pressed == of->most_pressed) {
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
        of->pressed++;
        c->lambda[n] = c->target[i];
        c->active[c->active_count++] = i;
    }
    palp_chol_solve(c->factor, c->active_count, c->room, c->lambda);
    uint64_t n = c->active_count;
    c->work_done += n * n * n / 6u + 2u * n * n + c->count;
}

/* What the forces of the points in contact move a point by, whose row of g this is. */
static float moved_by(const palp_contact *c, const float *row) {
    const size_t n = c->active_count, whole = n / PALP_BESIDE;
    float sum = 0.0f;
    for (size_t q = 0; q < whole; q++) {
        for (size_t e = 0; e < PALP_BESIDE; e++)
            sum += row[c->active[PALP_BESIDE * q + e]] * c->lambda[PALP_BESIDE * q + e];
    }
    for (size_t k = PALP_BESIDE * whole; k < n; k++) /* at most 3 */
        sum += row[c->active[k]] * c->lambda[k];
    return sum;
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
            wrong = c->target[i] - moved_by(c, c->g + (size_t)i * c->room) >
                    CLEAR * size_of(c, &c->patch[p->patch]);
        }
        if (!wrong || (one && changed > 0u)) continue;
        p->active = !p->active;
        changed++;
    }
    c->work_done += (uint64_t)(c->count - c->active_count) * c->active_count;
    return changed;
}

bool palp_contact_iterate(palp_contact *c) {
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

/* Of several tools each sees the body where all of them had moved it: where it is thin, each answer
 * would turn the last one round. Half way there they agree. */
static void follow_slowly(palp_far_field *f, const palp_far_field *before) {
    f->mean_m = palp_madd(before->mean_m, TOGETHER, palp_sub(f->mean_m, before->mean_m));
    for (uint32_t e = 0; e < 9u; e++)
        f->slope[e] = before->slope[e] + TOGETHER * (f->slope[e] - before->slope[e]);
}

/* The displacements around a patch's forces: by the modes and seams, and as its body is bent; of
 * one zone against the other. */
static void find_far_field(palp_contact *c, palp_contact_patch *patch, uint32_t k) {
    palp_far_field_sums far_field = {.weight = 0.0f}, bent = {.weight = 0.0f};
    for (uint32_t a = 0; a < c->active_count; a++) {
        const uint32_t i = c->active[a], other = c->other_side[i];
        const palp_contact_point *p = &c->point[i];
        if (p->patch != k) continue;
        palp_vec3 y = palp_sub(p->y, patch->at.t);
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
        palp_far_field_add(&far_field, p->force_N, y, h, p->cell_m);
        palp_far_field_add(&bent, p->force_N, y, b, p->cell_m);
    }
    const palp_far_field before = patch->far_field;
    patch->far_field = palp_far_field_fit(&far_field, patch->at.t);
    if (far_field.weight > 0.0f && before.fade > 0.0f && others_press(c, patch))
        follow_slowly(&patch->far_field, &before);
    if (!(far_field.weight > 0.0f) && c->energy_J > 0.0f && patch->tool < c->tool_count)
        palp_contact_idle(c, patch);
    if (far_field.weight > 0.0f && c->assembly != NULL)
        patch->bent = palp_far_field_fit(&bent, patch->at.t);
}

/*
 * How much of what the exact force has beyond - sum lambda m is believed at once. Near its limit
 * most_N it says more of the points than of the body, and may jump from tick to tick as the lattice
 * swings between two regions: there it is followed slowly. This force also enters the next tick's
 * solution as it is now, and moves a tool on a soft spring. Within a cell of the lattice the force
 * may turn round. So where it could move the tool by a cell, it is followed slowly as well.
 */
static float response(const palp_contact *c, uint32_t t, palp_vec3 beyond_N, float most_N) {
    const float near = palp_norm(beyond_N) / palp_max(most_N, 1e-30f);
    const float steady = 1.0f / (1.0f + STEADY * near * near);
    const float k = c->spring[t].stiffness_N_per_m;
    const float cell = palp_contact_cell(c, t);
    if (!(k > 0.0f)) return steady;
    return steady * k * cell / (k * cell + SLOWLY * most_N);
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
        c->patch[k].push_Nm = c->patch[k].beyond_Nm = (palp_vec3){0};
    }
    for (uint32_t i = 0; i < c->count; i++) c->point[i].force_N = 0.0f;
    for (uint32_t a = 0; a < c->active_count; a++) {
        palp_contact_point *p = &c->point[c->active[a]];
        palp_contact_patch *patch = &c->patch[p->patch];
        p->force_N = palp_max(c->lambda[a], 0.0f);
        patch->normal_N += p->force_N;
        patch->push_N = palp_madd(patch->push_N, -p->force_N, p->out);
        patch->push_Nm = palp_madd(patch->push_Nm, -p->force_N, p->arm_m);
        if (patch->tool < c->tool_count) c->normal_N[patch->tool] += p->force_N;
    }
}

/* Of a point between zones; returns how far along its force. */
PALP_APART static float displace_other_side(palp_contact *c, uint32_t i) {
    palp_contact_facing *z = &c->facing[i];
    z->u_m = palp_contact_displacement(c, c->other_side[i]);
    return palp_dot(z->m, z->u_m);
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
        if (c->other_side[i] > 0u) along += displace_other_side(c, i);
        c->energy_J += 0.5f * p->force_N * along;
    }
}

/* Where the force on a tool acts, from its reference point: the middle of its points. */
static palp_vec3 middle_of(const palp_contact *c, uint32_t t) {
    palp_vec3 sum = {0};
    for (uint32_t a = 0; a < c->active_count; a++) {
        const palp_contact_point *p = &c->point[c->active[a]];
        if (p->patch == t) sum = palp_madd(sum, p->force_N, palp_sub(p->y, c->patch[t].at.t));
    }
    return palp_scale(1.0f / palp_max(c->normal_N[t], 1e-30f), sum);
}

/* What of the moment beyond - sum lambda r is believed: that of the force that is believed, and of
 * the rest no more than of the force, at the arm of the tool's size. */
static palp_vec3 moment_beyond(const palp_contact *c, uint32_t t, palp_vec3 believed_N,
                               float most_N) {
    const palp_vec3 at = middle_of(c, t);
    const palp_vec3 couple = palp_sub(c->patch[t].beyond_Nm, palp_cross(at, c->patch[t].beyond_N));
    return palp_add(palp_cross(at, believed_N),
                    palp_at_most(couple, most_N * palp_tool_size(&c->tools[t])));
}

void palp_contact_rest(palp_contact *c, uint32_t t) {
    const palp_contact_spring *s = &c->spring[t];
    c->rest[t] = s->held;
    if (s->stiffness_N_per_m > 0.0f)
        c->rest[t].t = palp_madd(s->held.t, 1.0f / s->stiffness_N_per_m, c->force_N[t]);
    if (s->stiffness_Nm_per_rad > 0.0f) {
        const palp_vec3 turn = palp_scale(1.0f / s->stiffness_Nm_per_rad, c->moment_Nm[t]);
        palp_turn_by(palp_at_most(turn, LARGEST_TURN), s->held.r, c->rest[t].r);
    }
}

/* The force and the moment on a tool, and where it comes to rest. */
static void end_tool(palp_contact *c, uint32_t t) {
    const palp_contact_patch *patch = &c->patch[t];
    const float most = PALP_CONTACT_BEYOND * palp_norm(patch->push_N);
    const palp_vec3 before = palp_at_most(c->beyond_N[t], most);
    palp_vec3 beyond = palp_at_most(patch->beyond_N, most), turning = {0};
    if (c->normal_N[t] > 0.0f) {
        const float share = response(c, t, beyond, most);
        turning = blend(c->beyond_Nm[t], moment_beyond(c, t, beyond, most), share);
        beyond = blend(before, beyond, share);
    }
    c->beyond_N[t] = beyond;
    c->beyond_Nm[t] = turning;
    c->force_N[t] = palp_add(patch->push_N, beyond);
    c->moment_Nm[t] = palp_add(patch->push_Nm, turning);
    palp_contact_rest(c, t);
}

void palp_contact_finish(palp_contact *c) {
    const palp_contact_past past = palp_contact_past_of(c);
    take_forces(c);
    c->solved = true;
    take_displacements(c);
    for (uint32_t k = 0; k < c->patches; k++) {
        if (c->patch[k].used) find_far_field(c, &c->patch[k], k);
    }
    palp_contact_exact(c);
    for (uint32_t t = 0; t < c->tool_count; t++) end_tool(c, t);
    palp_contact_repay(c, &past);
    for (uint32_t b = 0; b < c->bodies && c->frame != NULL; b++) c->frame_before[b] = c->frame[b];
}

void palp_contact_solve(palp_contact *contact, const palp_frame *at,
                        const palp_contact_spring *spring) {
    palp_contact_begin(contact, at, spring);
    /* at most patches * PALP_LATTICE_FILLINGS */
    while (palp_contact_fill(contact)) {}
    if (palp_contact_points(contact) > 0u) {
        /* at most points / PALP_CONTACT_ROWS + 1 */
        while (palp_contact_assemble(contact)) {}
        /* at most PALP_CONTACT_ITERATIONS */
        while (palp_contact_iterate(contact)) {}
    }
    palp_contact_finish(contact);
}
