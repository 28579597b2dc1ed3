/* SPDX-License-Identifier: MIT */
/* Contact, second half: the complementarity problem on the Cholesky factor. */
#include "contact.h"
#include "core/base/linalg.h"

#define PENETRATION_MIN 2e-5f /* violation that lets a candidate in, over the tool's size */

/* g lambda at a candidate */
float palp_node_contact_indentation(const palp_node_contact *contact, uint32_t candidate) {
    const palp_node_contact *c = contact;
    float sum = 0.0f;
    for (uint32_t a = 0; a < c->active_count; a++) {
        sum += palp_node_contact_g(c, candidate, c->active[a]) * c->candidate[c->active[a]].force_N;
    }
    return sum;
}

palp_vec3 palp_node_contact_force(const palp_node_contact *contact, uint32_t tool) {
    palp_vec3 force = {0};
    for (uint32_t a = 0; a < contact->active_count; a++) {
        const palp_candidate *k = &contact->candidate[contact->active[a]];
        if (k->tool == tool) force = palp_madd(force, k->force_N, k->at.push);
    }
    return force;
}

float palp_node_contact_normal_force(const palp_node_contact *contact, uint32_t tool,
                                     palp_vec3 *axis) {
    palp_vec3 sum = {0};
    float total = 0.0f;
    for (uint32_t a = 0; a < contact->active_count; a++) {
        const palp_candidate *k = &contact->candidate[contact->active[a]];
        if (k->tool != tool) continue;
        sum = palp_madd(sum, k->force_N, k->n);
        total += k->force_N;
    }
    float length = palp_norm(sum);
    *axis = length > 0.0f ? palp_scale(1.0f / length, sum) : (palp_vec3){0.0f, 0.0f, 1.0f};
    return total;
}

float palp_node_contact_energy(const palp_node_contact *contact) {
    float sum = 0.0f;
    for (uint32_t a = 0; a < contact->active_count; a++) {
        uint32_t i = contact->active[a];
        sum += contact->candidate[i].force_N * palp_node_contact_indentation(contact, i);
    }
    return 0.5f * sum;
}

/* ---- the factor ---- */

static void let_out(palp_node_contact *c, uint32_t a) {
    palp_chol_remove(c->factor, c->active_count, c->limits.max_active, a);
    c->work_done += (uint64_t)c->active_count * c->active_count * 5u / 2u;
    c->candidate[c->active[a]].force_N = 0.0f;
    c->candidate[c->active[a]].active = false;
    c->active_count--;
    for (uint32_t k = a; k < c->active_count; k++) c->active[k] = c->active[k + 1u];
    c->changes++;
}

bool palp_node_contact_let_in(palp_node_contact *contact, uint32_t candidate) {
    palp_node_contact *c = contact;
    uint32_t n = c->active_count;
    for (uint32_t a = 0; a < n; a++) c->work[a] = palp_node_contact_g(c, candidate, c->active[a]);
    c->work[n] = palp_node_contact_g(c, candidate, candidate);
    c->work_done += (uint64_t)n * n / 2u + n;
    if (palp_chol_append(c->factor, n, c->limits.max_active, c->work) != PALP_OK) return false;
    c->active[n] = candidate;
    c->candidate[candidate].active = true;
    c->active_count++;
    c->changes++;
    return true;
}

/* Every so often the factor is made afresh, so that rounding in its updates does not build up. */
static void refactor(palp_node_contact *c) {
    uint32_t n = c->active_count;
    if (c->changes < PALP_NODE_CONTACT_REFACTOR) return;
    c->active_count = 0;
    c->changes = 0;
    for (uint32_t a = 0; a < n; a++) {
        uint32_t candidate = c->active[a];
        c->candidate[candidate].active = false;
        if (!palp_node_contact_let_in(c, candidate)) c->candidate[candidate].force_N = 0.0f;
    }
    c->changes = 0;
}

/* ---- one step ---- */

/* Columns of R^-T J for every axis of every tool on a spring; returns how many, with the spring of
 * each. */
static uint32_t give_columns(palp_node_contact *c, float spring[3u * PALP_MAX_TOOLS]) {
    uint32_t columns = 0;
    for (uint32_t t = 0; t < c->tool_count; t++) {
        if (!(c->grip[t].stiffness_N_per_m > 0.0f)) continue;
        for (uint32_t axis = 0; axis < 3; axis++) {
            float *y = c->jacobian + (size_t)columns * c->limits.max_active;
            for (uint32_t a = 0; a < c->active_count; a++) {
                const palp_candidate *k = &c->candidate[c->active[a]];
                palp_vec3 push = k->at.push;
                float entry = axis == 0u ? push.x : axis == 1u ? push.y : push.z;
                y[a] = k->tool == t ? entry : 0.0f;
            }
            palp_chol_forward(c->factor, c->active_count, c->limits.max_active, y);
            spring[columns++] = c->grip[t].stiffness_N_per_m;
        }
    }
    c->work_done += (uint64_t)columns * c->active_count * c->active_count / 2u;
    return columns;
}

static float product(const float *x, const float *y, uint32_t n) {
    float sum = 0.0f;
    for (uint32_t i = 0; i < n; i++) sum += x[i] * y[i];
    return sum;
}

/* t -= Y (K + Y^T Y)^-1 Y^T t with Y = R^-T J: what the springs' give takes from the forward
 * solution t. */
static void give_way(palp_node_contact *c, float *t) {
    float spring[3u * PALP_MAX_TOOLS], s[3u * PALP_MAX_TOOLS];
    float m[9u * PALP_MAX_TOOLS * PALP_MAX_TOOLS];
    uint32_t n = c->active_count, columns = give_columns(c, spring);
    size_t stride = c->limits.max_active;
    for (uint32_t i = 0; i < columns; i++) {
        s[i] = product(c->jacobian + i * stride, t, n);
        for (uint32_t k = 0; k < columns; k++) {
            m[i * columns + k] = product(c->jacobian + i * stride, c->jacobian + k * stride, n);
            if (i == k) m[i * columns + k] += spring[i];
        }
    }
    c->work_done += (uint64_t)columns * (columns + 2u) * n;
    if (columns == 0u || palp_chol_factor(m, columns, columns) != PALP_OK) return;
    palp_chol_solve(m, columns, columns, s);
    for (uint32_t i = 0; i < columns; i++) {
        for (uint32_t a = 0; a < n; a++) t[a] -= c->jacobian[i * stride + a] * s[i];
    }
}

/*
 * One step towards the solution on the active set. Either all of it is reached (true), or forces
 * move until the first one vanishes and that candidate is let out.
 */
static bool step_or_let_out(palp_node_contact *c) {
    uint32_t n = c->active_count;
    float *z = c->target;
    float reach = 1.0f;
    uint32_t first = n;
    for (uint32_t a = 0; a < n; a++) z[a] = c->candidate[c->active[a]].target_m;
    palp_chol_forward(c->factor, n, c->limits.max_active, z);
    give_way(c, z);
    palp_chol_backward(c->factor, n, c->limits.max_active, z);
    c->work_done += (uint64_t)n * n;
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

/* The idle candidate that its tool violates most, or `count` if none is violated. */
static uint32_t most_violated(palp_node_contact *c) {
    palp_vec3 moved[PALP_MAX_TOOLS + 1u] = {{0}};
    float worst[PALP_MAX_TOOLS + 1u], most = 0.0f;
    worst[PALP_ZONE_TOOL] = PENETRATION_MIN * c->size_m[PALP_ZONE_TOOL];
    uint32_t best = c->count;
    for (uint32_t t = 0; t < c->tool_count; t++) {
        worst[t] = PENETRATION_MIN * c->size_m[t];
        if (c->grip[t].stiffness_N_per_m > 0.0f)
            moved[t] =
                palp_scale(1.0f / c->grip[t].stiffness_N_per_m, palp_node_contact_force(c, t));
    }
    for (uint32_t i = 0; i < c->count; i++) {
        const palp_candidate *k = &c->candidate[i];
        float wanted = k->target_m - palp_dot(k->at.push, moved[k->tool]);
        if (k->blocked == c->solves || k->active) continue;
        float missing = wanted - palp_node_contact_indentation(c, i);
        if (missing <= worst[k->tool] || missing <= most) continue;
        most = missing;
        best = i;
    }
    c->work_done += (uint64_t)(c->count - c->active_count) * 2u * c->active_count + 6u * c->count;
    return best;
}

/* Without room for them, violated candidates are relieved, so that room found later cannot push the
 * tool. */
static void relieve_idle(palp_node_contact *c) {
    for (uint32_t i = 0; i < c->count; i++) {
        palp_candidate *k = &c->candidate[i];
        if (k->active) continue;
        k->relief_m = palp_max(k->at.depth_m - palp_node_contact_indentation(c, i), k->relief_m);
        c->work_done += 2u * c->active_count;
    }
}

void palp_node_contact_begin(palp_node_contact *contact, const palp_vec3 *about,
                             const palp_grip *grip) {
    palp_node_contact *c = contact;
    c->solves++;
    c->pivots_now = 0;
    refactor(c);
    for (uint32_t t = 0; t < c->tool_count; t++) {
        c->about[t] = about[t];
        c->grip[t] = grip[t];
    }
    for (uint32_t i = 0; i < c->count; i++) {
        palp_candidate *k = &c->candidate[i];
        palp_vec3 off = palp_sub(c->grip[k->tool].held_m, c->about[k->tool]);
        k->at = palp_node_contact_see(c, k, c->about);
        k->target_m = k->at.depth_m - k->relief_m - palp_dot(k->at.push, off);
    }
    c->work_done += 60u * (uint64_t)c->count;
}

bool palp_node_contact_step(palp_node_contact *contact) {
    palp_node_contact *c = contact;
    if (c->pivots_now == c->limits.max_pivots) {
        c->flags |= PALP_NODE_CONTACT_PIVOTS_SPENT;
        return false;
    }
    c->pivots_now++;
    c->pivots++;
    if (!step_or_let_out(c)) return true;
    uint32_t next = most_violated(c);
    if (next == c->count) return false;
    if (c->active_count == c->limits.max_active) {
        c->flags |= PALP_NODE_CONTACT_ACTIVE_FULL;
        relieve_idle(c);
        return false;
    }
    if (!palp_node_contact_let_in(c, next)) {
        c->candidate[next].blocked = c->solves;
        c->flags |= PALP_NODE_CONTACT_REDUNDANT;
    }
    return true;
}

palp_vec3 palp_node_contact_solve(palp_node_contact *contact, palp_vec3 about, palp_grip grip) {
    palp_node_contact_begin(contact, &about, &grip);
    /* at most max_pivots */
    while (palp_node_contact_step(contact)) {}
    return palp_node_contact_force(contact, 0);
}
