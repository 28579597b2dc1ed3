/* SPDX-License-Identifier: MIT */
#include "contact.h"
#include "core/base/linalg.h"

#define MARGIN 0.35f          /* candidates are taken in this far before they touch, over r */
#define FACING 0.2f           /* least cosine between a new node's normal and the contact axis */
#define PENETRATION_MIN 2e-5f /* violation that lets a node in, over r */
#define REFACTOR_AFTER 64u    /* changes of the factor before it is made afresh */
#define DESCENT_STEPS 32u     /* moves of the nearest node per search */

static void lay_out(palp_contact *c, const palp_blob *b, palp_contact_limits l, palp_arena *arena) {
    uint32_t slots = b->domain[PALP_FREE].slots;
    *c = (palp_contact){.blob = b, .limits = l};
    c->candidate = palp_take(arena, l.max_candidates, sizeof *c->candidate);
    c->row = palp_take(arena, l.max_candidates, sizeof *c->row);
    c->compliance = palp_take(arena, (size_t)l.max_candidates * l.max_candidates, sizeof(float));
    c->factor = palp_take(arena, (size_t)l.max_active * l.max_active, sizeof(float));
    c->active = palp_take(arena, l.max_active, sizeof(uint32_t));
    c->target = palp_take(arena, l.max_active + 1u, sizeof(float));
    c->work = palp_take(arena, l.max_active + 1u, sizeof(float));
    for (uint32_t k = 0; k < 3; k++) c->jacobian[k] = palp_take(arena, l.max_active, sizeof(float));
    c->place = palp_take(arena, b->meta->nodes, sizeof(uint16_t));
    c->scratch.weight = palp_take(arena, slots, sizeof(float));
    c->scratch.mark = palp_take(arena, (slots + 31u) / 32u, sizeof(uint32_t));
    for (uint32_t i = 0; i < l.max_candidates; i++) {
        uint16_t *index = palp_take(arena, b->meta->max_row, sizeof(uint16_t));
        float *weight = palp_take(arena, b->meta->max_row, sizeof(float));
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
                              float radius_m, palp_contact_limits limits, void *memory,
                              size_t bytes) {
    palp_arena arena = {.base = memory};
    if (!palp_contact_limits_sound(limits)) return PALP_ERR_LIMITS;
    if (!(radius_m > 0.0f) || !palp_is_finite(radius_m)) return PALP_ERR_ARGUMENT;
    if (memory == NULL || ((uintptr_t)memory & (PALP_ALIGN - 1u)) != 0u) return PALP_ERR_ALIGNMENT;
    if (bytes < palp_contact_memsize(blob, limits)) return PALP_ERR_MEMORY;
    lay_out(contact, blob, limits, &arena);
    uint32_t slots = blob->domain[PALP_FREE].slots;
    contact->position_m = position_m;
    contact->radius_m = radius_m;
    contact->margin_m = MARGIN * radius_m;
    for (uint32_t i = 0; i < blob->meta->nodes; i++) contact->place[i] = 0;
    for (uint32_t i = 0; i < slots; i++) contact->scratch.weight[i] = 0.0f;
    for (uint32_t i = 0; i < (slots + 31u) / 32u; i++) contact->scratch.mark[i] = 0u;
    return PALP_OK;
}

void palp_contact_clear(palp_contact *contact) {
    for (uint32_t i = 0; i < contact->count; i++) contact->place[contact->candidate[i].node] = 0;
    contact->count = contact->active_count = contact->changes = 0;
}

static palp_vec3 position(const palp_contact *c, uint32_t node) {
    return palp_vec3_at(c->position_m + 3u * node);
}
static palp_vec3 normal(const palp_contact *c, uint32_t node) {
    return palp_vec3_at(c->blob->normal + 3u * node);
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
static void find_nearest(palp_contact *c, palp_vec3 p) {
    const palp_meta *m = c->blob->meta;
    const float x[3] = {p.x, p.y, p.z};
    uint32_t low[3], high[3];
    for (uint32_t k = 0; k < 3; k++) {
        uint32_t cell = cell_of(m, k, x[k]);
        low[k] = cell > 0u ? cell - 1u : 0u;
        high[k] = cell + 1u < m->cells[k] ? cell + 1u : cell;
    }
    float best = distance2(c, c->nearest, p);
    for (uint32_t z = low[2]; z <= high[2]; z++) {
        for (uint32_t y = low[1]; y <= high[1]; y++) {
            uint32_t row = (z * m->cells[1] + y) * m->cells[0];
            for (uint32_t i = c->blob->cell_offset[row + low[0]];
                 i < c->blob->cell_offset[row + high[0] + 1u]; i++) {
                float d = distance2(c, c->blob->cell_node[i], p);
                if (d >= best) continue;
                best = d;
                c->nearest = c->blob->cell_node[i];
            }
        }
    }
    for (uint32_t step = 0; step < DESCENT_STEPS; step++) {
        uint32_t from = c->nearest;
        for (uint32_t i = c->blob->ring_offset[from]; i < c->blob->ring_offset[from + 1u]; i++) {
            float d = distance2(c, c->blob->ring[i], p);
            if (d >= best) continue;
            best = d;
            c->nearest = c->blob->ring[i];
        }
        if (c->nearest == from) break;
    }
}

/* Keeps the `max_new` deepest proposals in `fresh`, deepest first. */
static uint32_t propose(palp_contact *c, uint32_t node, palp_vec3 center, uint32_t *fresh,
                        float *depth, uint32_t found) {
    if (palp_node_is_fixed(c->blob, node) || c->place[node] != 0u) return found;
    palp_vec3 n = normal(c, node);
    if (palp_dot(n, c->axis) < FACING) return found;
    palp_sphere_contact at = palp_sphere_at(c->radius_m, center, position(c, node), n);
    if (at.depth_m < -c->margin_m || at.offset_m > PALP_SPHERE_REACH * c->radius_m) return found;
    for (uint32_t i = 0; i < found; i++) {
        if (fresh[i] == node) return found;
    }
    if (found == c->limits.max_new) c->flags |= PALP_CONTACT_DEFERRED;
    uint32_t at_place = found;
    while (at_place > 0u && depth[at_place - 1u] < at.depth_m) at_place--;
    if (at_place == c->limits.max_new) return found;
    uint32_t last = found < c->limits.max_new ? found : found - 1u;
    for (uint32_t i = last; i > at_place; i--) {
        fresh[i] = fresh[i - 1u];
        depth[i] = depth[i - 1u];
    }
    fresh[at_place] = node;
    depth[at_place] = at.depth_m;
    return last + 1u;
}

/* The last candidate takes the place of candidate i, which carries no force. */
static void drop(palp_contact *c, uint32_t i) {
    uint32_t last = --c->count;
    uint32_t stride = c->limits.max_candidates;
    c->place[c->candidate[i].node] = 0;
    if (i == last) return;
    palp_row spare = c->row[i];
    c->candidate[i] = c->candidate[last];
    c->row[i] = c->row[last];
    c->row[last] = spare;
    c->place[c->candidate[i].node] = (uint16_t)(i + 1u);
    for (uint32_t k = 0; k < last; k++) {
        c->compliance[(size_t)i * stride + k] = c->compliance[(size_t)last * stride + k];
    }
    c->compliance[(size_t)i * stride + i] = c->compliance[(size_t)last * stride + last];
    for (uint32_t k = 0; k < last; k++) {
        c->compliance[(size_t)k * stride + i] = c->compliance[(size_t)i * stride + k];
    }
    for (uint32_t a = 0; a < c->active_count; a++) {
        if (c->active[a] == last) c->active[a] = i;
    }
}

static bool is_active(const palp_contact *c, uint32_t candidate) {
    for (uint32_t a = 0; a < c->active_count; a++) {
        if (c->active[a] == candidate) return true;
    }
    return false;
}

static float compliance(const palp_contact *c, uint32_t i, uint32_t j) {
    return c->compliance[(size_t)i * c->limits.max_candidates + j];
}

/* g lambda at candidate i */
static float indentation(const palp_contact *c, uint32_t i) {
    float sum = 0.0f;
    for (uint32_t a = 0; a < c->active_count; a++) {
        sum += compliance(c, i, c->active[a]) * c->candidate[c->active[a]].force_N;
    }
    return sum;
}

/* How far the tool would have to press node i down, were there no node i. */
static float violation(const palp_contact *c, uint32_t i) {
    return c->candidate[i].at.depth_m - indentation(c, i);
}

static palp_vec3 force_on_tool(const palp_contact *c) {
    palp_vec3 force = {0};
    for (uint32_t a = 0; a < c->active_count; a++) {
        const palp_candidate *k = &c->candidate[c->active[a]];
        force = palp_madd(force, k->force_N, k->at.push);
    }
    return force;
}

/*
 * Backing out shrinks the relief of idle nodes: what the tool of the last solve, where its grip let
 * it rest, still asked of them, with the forces of that solve.
 */
static void shrink_relief(palp_contact *c) {
    palp_vec3 moved = {0};
    if (c->stiffness_N_per_m > 0.0f) {
        moved = palp_scale(1.0f / c->stiffness_N_per_m, force_on_tool(c));
    }
    for (uint32_t i = 0; i < c->count; i++) {
        palp_candidate *k = &c->candidate[i];
        if (!(k->relief_m > 0.0f) || is_active(c, i)) continue;
        float missing = k->target_m - palp_dot(k->at.push, moved) - indentation(c, i);
        if (missing < 0.0f) k->relief_m = palp_max(k->relief_m + missing, 0.0f);
    }
}

static void drop_idle(palp_contact *c, palp_vec3 center) {
    for (uint32_t i = c->count; i-- > 0u;) {
        palp_candidate *k = &c->candidate[i];
        k->at = palp_sphere_at(c->radius_m, center, k->x, k->n);
        bool near = k->at.depth_m > -2.0f * c->margin_m &&
                    k->at.offset_m < 1.25f * PALP_SPHERE_REACH * c->radius_m;
        if (!near && !is_active(c, i)) drop(c, i);
    }
}

uint32_t palp_contact_search(palp_contact *contact, palp_vec3 center, uint32_t *fresh) {
    float depth[PALP_MAX_CANDIDATES];
    uint32_t found = 0;
    contact->flags = 0;
    contact->pivots = 0;
    contact->center = center;
    shrink_relief(contact);
    drop_idle(contact, center);
    if (contact->active_count == 0u) {
        find_nearest(contact, center);
        contact->axis = normal(contact, contact->nearest);
        palp_vec3 out = palp_sub(center, position(contact, contact->nearest));
        bool outside = palp_dot(out, contact->axis) > 0.0f;
        if (outside) found = propose(contact, contact->nearest, center, fresh, depth, found);
    }
    for (uint32_t i = 0; i < contact->count; i++) {
        uint32_t node = contact->candidate[i].node;
        for (uint32_t k = contact->blob->ring_offset[node];
             k < contact->blob->ring_offset[node + 1u]; k++) {
            found = propose(contact, contact->blob->ring[k], center, fresh, depth, found);
        }
    }
    return found;
}

/* n_i^T G_ij n_j from column j at row i */
static float normal_compliance(const palp_contact *c, uint32_t i, uint32_t j) {
    float block[9];
    uint32_t slot = palp_node_slot(c->blob, c->candidate[j].node);
    palp_columns_extract(&c->blob->columns[PALP_FREE][PALP_FREE], slot, &c->row[i], block);
    palp_vec3 n = c->candidate[j].n;
    palp_vec3 u = {palp_dot(palp_vec3_at(block), n), palp_dot(palp_vec3_at(block + 3), n),
                   palp_dot(palp_vec3_at(block + 6), n)};
    return palp_dot(c->candidate[i].n, u);
}

void palp_contact_admit(palp_contact *contact, uint32_t node) {
    palp_contact *c = contact;
    uint32_t i = c->count;
    size_t stride = c->limits.max_candidates;
    if (c->place[node] != 0u) return;
    if (i == c->limits.max_candidates) {
        c->flags |= PALP_CONTACT_CANDIDATES_FULL;
        return;
    }
    c->candidate[i] = (palp_candidate){.node = node, .x = position(c, node), .n = normal(c, node)};
    bool fits = palp_wavelet_row(&c->blob->domain[PALP_FREE], palp_node_slot(c->blob, node),
                                 &c->scratch, &c->row[i], c->blob->meta->max_row);
    if (!fits) { /* a blob that understates max_row */
        c->flags |= PALP_CONTACT_CANDIDATES_FULL;
        return;
    }
    c->place[node] = (uint16_t)(i + 1u);
    c->compliance[i * stride + i] = normal_compliance(c, i, i) + c->blob->softening[node];
    for (uint32_t k = 0; k < i; k++) {
        float g = 0.5f * (normal_compliance(c, i, k) + normal_compliance(c, k, i));
        c->compliance[i * stride + k] = g;
        c->compliance[k * stride + i] = g;
    }
    c->count++;
    c->candidate[i].at =
        palp_sphere_at(c->radius_m, c->center, c->candidate[i].x, c->candidate[i].n);
    c->candidate[i].relief_m = palp_max(violation(c, i), 0.0f);
    c->candidate[i].target_m = c->candidate[i].at.depth_m - c->candidate[i].relief_m;
}

/* ---- active set ---- */

static void let_out(palp_contact *c, uint32_t a) {
    palp_chol_remove(c->factor, c->active_count, c->limits.max_active, a);
    c->candidate[c->active[a]].force_N = 0.0f;
    c->active_count--;
    for (uint32_t k = a; k < c->active_count; k++) c->active[k] = c->active[k + 1u];
    c->changes++;
}

static bool let_in(palp_contact *c, uint32_t i) {
    uint32_t n = c->active_count;
    for (uint32_t a = 0; a < n; a++) c->work[a] = compliance(c, i, c->active[a]);
    c->work[n] = compliance(c, i, i);
    if (palp_chol_append(c->factor, n, c->limits.max_active, c->work) != PALP_OK) return false;
    c->active[n] = i;
    c->active_count++;
    c->changes++;
    return true;
}

/* Every so often the factor is made afresh, so that rounding in its updates does not build up. */
static void refactor(palp_contact *c) {
    uint32_t n = c->active_count;
    if (c->changes < REFACTOR_AFTER) return;
    c->active_count = 0;
    c->changes = 0;
    for (uint32_t a = 0; a < n; a++) {
        uint32_t candidate = c->active[a];
        if (!let_in(c, candidate)) c->candidate[candidate].force_N = 0.0f;
    }
    c->changes = 0;
}

/* t -= Y (k I + Y^T Y)^-1 Y^T t with Y = R^-T J: what the spring's give takes from the forward
 * solution t. */
static void give_way(palp_contact *c, float *t, float stiffness_N_per_m) {
    uint32_t n = c->active_count;
    float m[9], s[3];
    for (uint32_t axis = 0; axis < 3; axis++) {
        for (uint32_t a = 0; a < n; a++) {
            palp_vec3 push = c->candidate[c->active[a]].at.push;
            c->jacobian[axis][a] = axis == 0u ? push.x : axis == 1u ? push.y : push.z;
        }
        palp_chol_forward(c->factor, n, c->limits.max_active, c->jacobian[axis]);
    }
    for (uint32_t i = 0; i < 3; i++) {
        s[i] = 0.0f;
        for (uint32_t a = 0; a < n; a++) s[i] += c->jacobian[i][a] * t[a];
        for (uint32_t k = 0; k < 3; k++) {
            m[3u * i + k] = i == k ? stiffness_N_per_m : 0.0f;
            for (uint32_t a = 0; a < n; a++) m[3u * i + k] += c->jacobian[i][a] * c->jacobian[k][a];
        }
    }
    if (palp_chol_factor(m, 3, 3) != PALP_OK) return;
    palp_chol_solve(m, 3, 3, s);
    for (uint32_t a = 0; a < n; a++) {
        t[a] -= c->jacobian[0][a] * s[0] + c->jacobian[1][a] * s[1] + c->jacobian[2][a] * s[2];
    }
}

/*
 * One step towards the solution on the active set. Either all of it is reached (true), or forces
 * move until the first one vanishes and that node is let out.
 */
static bool step_or_let_out(palp_contact *c, float stiffness_N_per_m) {
    uint32_t n = c->active_count;
    float *z = c->target;
    float reach = 1.0f;
    uint32_t first = n;
    for (uint32_t a = 0; a < n; a++) z[a] = c->candidate[c->active[a]].target_m;
    palp_chol_forward(c->factor, n, c->limits.max_active, z);
    if (stiffness_N_per_m > 0.0f) give_way(c, z, stiffness_N_per_m);
    palp_chol_backward(c->factor, n, c->limits.max_active, z);
    for (uint32_t a = 0; a < n; a++) {
        float old = c->candidate[c->active[a]].force_N;
        if (z[a] > 0.0f) continue;
        float share = old > 0.0f ? old / (old - z[a]) : 0.0f;
        if (first == n || share < reach) {
            reach = share;
            first = a;
        }
    }
    for (uint32_t a = 0; a < n; a++) {
        float *force = &c->candidate[c->active[a]].force_N;
        *force = first == n ? z[a] : palp_max(*force + reach * (z[a] - *force), 0.0f);
    }
    if (first < n) let_out(c, first);
    return first == n;
}

/* The idle candidate that the tool violates most, or `count` if none is violated. */
static uint32_t most_violated(const palp_contact *c, float stiffness_N_per_m) {
    float worst = PENETRATION_MIN * c->radius_m;
    uint32_t best = c->count;
    palp_vec3 moved = {0};
    if (stiffness_N_per_m > 0.0f) moved = palp_scale(1.0f / stiffness_N_per_m, force_on_tool(c));
    for (uint32_t i = 0; i < c->count; i++) {
        const palp_candidate *k = &c->candidate[i];
        float wanted = k->target_m - palp_dot(k->at.push, moved);
        if (k->blocked == c->solves || is_active(c, i)) continue;
        float missing = wanted - indentation(c, i);
        if (missing <= worst) continue;
        worst = missing;
        best = i;
    }
    return best;
}

/* Without room for them, violated nodes are relieved, so that room found later cannot push the
 * tool. */
static void relieve_idle(palp_contact *c) {
    for (uint32_t i = 0; i < c->count; i++) {
        if (!is_active(c, i))
            c->candidate[i].relief_m = palp_max(violation(c, i), c->candidate[i].relief_m);
    }
}

static void find_axis(palp_contact *c) {
    palp_vec3 axis = {0};
    for (uint32_t a = 0; a < c->active_count; a++) {
        const palp_candidate *k = &c->candidate[c->active[a]];
        axis = palp_madd(axis, k->force_N, k->n);
    }
    float length = palp_norm(axis);
    if (length > 0.0f) c->axis = palp_scale(1.0f / length, axis);
}

palp_vec3 palp_contact_solve(palp_contact *contact, palp_vec3 about, palp_grip grip) {
    palp_contact *c = contact;
    palp_vec3 off = palp_sub(grip.held_m, about);
    c->solves++;
    c->stiffness_N_per_m = grip.stiffness_N_per_m;
    refactor(c);
    for (uint32_t i = 0; i < c->count; i++) {
        palp_candidate *k = &c->candidate[i];
        k->at = palp_sphere_at(c->radius_m, about, k->x, k->n);
        k->target_m = k->at.depth_m - k->relief_m - palp_dot(k->at.push, off);
    }
    uint32_t pivots = 0;
    for (; pivots < c->limits.max_pivots; pivots++) {
        if (!step_or_let_out(c, grip.stiffness_N_per_m)) continue;
        uint32_t next = most_violated(c, grip.stiffness_N_per_m);
        if (next == c->count) break;
        if (c->active_count == c->limits.max_active) {
            c->flags |= PALP_CONTACT_ACTIVE_FULL;
            relieve_idle(c);
            break;
        }
        if (!let_in(c, next)) {
            c->candidate[next].blocked = c->solves;
            c->flags |= PALP_CONTACT_REDUNDANT;
        }
    }
    if (pivots == c->limits.max_pivots) c->flags |= PALP_CONTACT_PIVOTS_SPENT;
    c->pivots += pivots;
    find_axis(c);
    return force_on_tool(c);
}

float palp_contact_energy(const palp_contact *contact) {
    float sum = 0.0f;
    for (uint32_t a = 0; a < contact->active_count; a++) {
        uint32_t i = contact->active[a];
        sum += contact->candidate[i].force_N * indentation(contact, i);
    }
    return 0.5f * sum;
}
