/* SPDX-License-Identifier: MIT */
/* Who is active, which elements are at work, and which interface nodes they need. */
#include "dyna.h"

static bool family_is_split(const palp_dyna *d, uint32_t family) {
    return family != PALP_NONE && d->split[family] != 0u;
}

static void set_states(palp_dyna *d) {
    const palp_tets *t = d->tets;
    d->active_count = 0;
    for (uint32_t i = 0; i < t->meta->nodes; i++) {
        uint32_t up = t->family[2u * (size_t)i], down = t->family[2u * (size_t)i + 1u];
        palp_node_state s = PALP_ACTIVE;
        if (up != PALP_NONE && d->split[up] == 0u) {
            s = PALP_INACTIVE;
        } else if (family_is_split(d, down)) {
            s = PALP_SPLIT;
        }
        d->state[i] = (uint8_t)s;
        d->active_flag[i] = s == PALP_ACTIVE ? 1u : 0u;
        d->needed[i] = 0;
        bool works = s == PALP_ACTIVE && !palp_dyna_pinned(d, i);
        d->duty[i] = works ? 1u : 0u;
        if (s == PALP_ACTIVE) d->active[d->active_count++] = i;
    }
}

/* The most that any corner has. */
static uint32_t most_of(const uint8_t *x, const uint32_t n[static 4]) {
    uint32_t a = x[n[0]], b = x[n[1]], c = x[n[2]], e = x[n[3]];
    a = a > b ? a : b;
    c = c > e ? c : e;
    return a > c ? a : c;
}

/* 1 + step class; finer where interface nodes stiffen: a half step bears four times the stiffness.
 */
static void set_duties(palp_dyna *d) {
    for (uint32_t k = 0; k < d->active_count; k++) {
        uint32_t i = d->active[k], most = d->config.most_class;
        if (d->duty[i] == 0u) continue;
        float stiffness_ratio = d->stiffness_ratio[i];
        uint32_t c = d->step_class[i] + (stiffness_ratio > 1.2f ? 1u : 0u) +
                     (stiffness_ratio > 4.0f ? 1u : 0u);
        d->duty[i] = (uint8_t)(1u + (c < most ? c : most));
    }
}

/* Elements by class, each class in the order of the blob. */
static void list_elements(palp_dyna *d) {
    const palp_tets *t = d->tets;
    uint32_t count[PALP_STEP_CLASSES + 1u] = {0}; /* the last: not at work */
    for (uint32_t i = 0; i < t->meta->tets; i++) {
        uint32_t duty = most_of(d->duty, t->tet[i].node);
        d->element_class[i] = (uint8_t)(duty > 0u ? duty - 1u : PALP_STEP_CLASSES);
        count[d->element_class[i]]++;
    }
    uint32_t next[PALP_STEP_CLASSES + 1u];
    d->class_start[0] = d->top_class = 0;
    for (uint32_t c = 0; c < PALP_STEP_CLASSES; c++) {
        d->class_start[c + 1u] = d->class_start[c] + count[c];
        next[c] = d->class_start[c];
        if (count[c] > 0u) d->top_class = c;
    }
    d->element_count = d->class_start[PALP_STEP_CLASSES];
    for (uint32_t i = 0; i < t->meta->tets; i++) {
        uint32_t c = d->element_class[i];
        if (c < PALP_STEP_CLASSES) d->element[next[c]++] = i;
    }
}

static void need(palp_dyna *d, uint32_t tet) {
    for (uint32_t c = 0; c < 4u; c++) d->needed[d->tets->tet[tet].node[c]] = 1;
}

/* Each skin vertex is embedded on the level on which the region of its node is active. */
static void embed_skin(palp_dyna *d) {
    const palp_tets *t = d->tets;
    uint32_t levels = t->meta->levels;
    for (uint32_t i = 0; i < t->meta->skin; i++) {
        uint32_t n = t->skin_node[i], level = levels - 1u;
        /* at most levels */
        while (d->state[n] == PALP_INACTIVE && level > 0u) { /* ends: level 0 is never inactive */
            n = t->parent[t->parent_offset[t->family[2u * (size_t)n]]];
            level--;
        }
        d->skin_level[i] = (uint8_t)level;
        need(d, t->skin_tet[i * levels + level]);
    }
}

/* Containers of the children of active nodes: what a split would begin from. */
static void need_for_splits(palp_dyna *d) {
    const palp_tets *t = d->tets;
    for (uint32_t f = 0; f < t->meta->families; f++) {
        bool ready = d->split[f] == 0u && d->state[t->parent[t->parent_offset[f]]] == PALP_ACTIVE;
        for (uint32_t k = t->child_offset[f]; ready && k < t->child_offset[f + 1u]; k++)
            need(d, t->container[t->child[k]]);
    }
}

/* What needed interface nodes need: containers from fine to coarse, then children from coarse to
 * fine. Evaluated the other way around, each finds its sources ready. */
static void list_interface(palp_dyna *d) {
    const palp_tets *t = d->tets;
    d->up_count = d->down_count = d->interpolation_terms = 0;
    for (uint32_t i = t->meta->nodes; i-- > 0u;) {
        if (d->needed[i] != 0u && d->state[i] == PALP_INACTIVE) need(d, t->container[i]);
    }
    for (uint32_t i = 0; i < t->meta->nodes; i++) {
        if (d->needed[i] == 0u) continue;
        for (uint32_t k = t->mean_offset[i];
             d->state[i] == PALP_SPLIT && k < t->mean_offset[i + 1u]; k++)
            d->needed[t->mean[k]] = 1;
        if (d->state[i] == PALP_INACTIVE && !palp_dyna_pinned(d, i)) d->down[d->down_count++] = i;
    }
    for (uint32_t i = t->meta->nodes; i-- > 0u;) {
        if (d->needed[i] == 0u || d->state[i] != PALP_SPLIT || palp_dyna_pinned(d, i)) continue;
        d->up[d->up_count++] = i;
        d->interpolation_terms += t->mean_offset[i + 1u] - t->mean_offset[i];
    }
    d->interpolation_terms += 4u * d->down_count;
}

void palp_dyna_relist(palp_dyna *dyna) {
    set_states(dyna);
    for (uint32_t i = 0; i < dyna->tets->meta->tets; i++) {
        if (most_of(dyna->duty, dyna->tets->tet[i].node) > 0u) need(dyna, i);
    }
    for (uint32_t i = 0; i < dyna->tets->meta->nodes; i++) dyna->borders[i] = dyna->needed[i];
    embed_skin(dyna);
    need_for_splits(dyna);
    dyna->lists++;
    list_interface(dyna);
    palp_dyna_stiffness_ratios(dyna);
    set_duties(dyna);
    list_elements(dyna);
    palp_dyna_interpolate(dyna);
}

void palp_dyna_collapse(palp_dyna *d) {
    for (uint32_t i = d->tets->meta->nodes; i-- > 0u;) { /* from fine to coarse */
        if (d->state[i] == PALP_SPLIT && !palp_dyna_pinned(d, i)) palp_dyna_mean(d, i);
    }
    for (uint32_t f = 0; f < d->tets->meta->families; f++) d->split[f] = 0;
    palp_dyna_relist(d);
}
