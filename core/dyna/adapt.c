/* SPDX-License-Identifier: MIT */
#include "adapt.h"
#include "core/base/arena.h"

#define MOST_CHANGES 64u
#define NOT_NOW (-1.0f)

palp_adapt_config palp_adapt_defaults(const palp_tets *tets) {
    float refine_m = 0.008f * tets->meta->diagonal_m;
    return (palp_adapt_config){.refine_m = refine_m,
                               .merge_m = 0.1f * refine_m,
                               .dwell_ticks = 50,
                               .max_changes = 8,
                               .max_element_tests = 2000};
}

static void lay_out(palp_adapt *s, const palp_tets *t, palp_arena *a) {
    s->gamma_m = palp_take(a, t->meta->families + 1u, sizeof(float));
    s->held = palp_take(a, t->meta->families + 1u, 1);
    s->age = palp_take(a, t->meta->families + 1u, sizeof(uint32_t));
}

size_t palp_adapt_memsize(const palp_tets *tets) {
    palp_adapt s = {.dyna = NULL};
    palp_arena a = {NULL, 0};
    lay_out(&s, tets, &a);
    return a.used;
}

static uint32_t elements_around(const palp_tets *t, const uint32_t *list, uint32_t count) {
    uint32_t sum = 0;
    for (uint32_t i = 0; i < count; i++)
        sum += t->around_offset[list[i] + 1u] - t->around_offset[list[i]];
    return sum;
}

/* Of a family: its parents (which == 1) or its children. */
static const uint32_t *members(const palp_tets *t, uint32_t f, uint32_t which, uint32_t *count) {
    const uint32_t *offset = which == 1u ? t->parent_offset : t->child_offset;
    *count = offset[f + 1u] - offset[f];
    return (which == 1u ? t->parent : t->child) + offset[f];
}

/* What so many parents follow when their family merges. */
static uint32_t means(const palp_tets *t, const uint32_t *list, uint32_t count) {
    uint32_t sum = 0;
    for (uint32_t i = 0; i < count; i++)
        sum += t->mean_offset[list[i] + 1u] - t->mean_offset[list[i]];
    return sum;
}

palp_status palp_adapt_init(palp_adapt *adapt, palp_dyna *dyna, const palp_adapt_config *config,
                            void *memory, size_t bytes) {
    palp_adapt s = {.dyna = dyna, .config = *config};
    palp_arena a = {memory, 0};
    bool sound = config->merge_m > 0.0f && config->refine_m > config->merge_m &&
                 palp_is_finite(config->refine_m) && config->max_changes > 0u &&
                 config->max_changes <= MOST_CHANGES;
    if (!sound) return PALP_ERR_ARGUMENT;
    const palp_status status = palp_check_block(memory, bytes, palp_adapt_memsize(dyna->tets));
    if (status != PALP_OK) return status;
    lay_out(&s, dyna->tets, &a);
    for (uint32_t f = 0; f < dyna->tets->meta->families; f++) {
        for (uint32_t which = 0; which < 2u; which++) {
            uint32_t count;
            const uint32_t *list = members(dyna->tets, f, which, &count);
            uint32_t element_tests = elements_around(dyna->tets, list, count);
            if (element_tests > s.config.max_element_tests)
                s.config.max_element_tests = element_tests;
            const uint32_t terms = which == 1u ? means(dyna->tets, list, count) : 4u * count;
            if (which == 1u && count > s.most_parents) s.most_parents = count;
            s.most_nodes = count > s.most_nodes ? count : s.most_nodes;
            s.most_terms = terms > s.most_terms ? terms : s.most_terms;
        }
    }
    *adapt = s;
    palp_adapt_reset(adapt);
    return PALP_OK;
}

void palp_adapt_reset(palp_adapt *adapt) {
    palp_dyna_reset(adapt->dyna);
    for (uint32_t f = 0; f < adapt->dyna->tets->meta->families; f++) {
        adapt->held[f] = 0;
        adapt->age[f] = 0;
    }
}

void palp_adapt_hold(palp_adapt *adapt, uint32_t skin) {
    const palp_tets *t = adapt->dyna->tets;
    uint32_t n = t->skin_node[skin];
    for (uint32_t l = t->meta->levels - 1u; l > 0u; l--) {
        uint32_t f = t->family[2u * (size_t)n];
        adapt->held[f] = 1;
        n = t->parent[t->parent_offset[f]];
        for (uint32_t k = t->parent_offset[f]; l > 1u && k < t->parent_offset[f + 1u]; k++)
            adapt->held[t->family[2u * (size_t)t->parent[k]]] = 1;
    }
}

/* ---- measures ---- */

static void raise(float *gamma, float value) {
    if (*gamma >= 0.0f && value > *gamma) *gamma = value;
}

static void measure(palp_adapt *s) {
    const palp_dyna *d = s->dyna;
    const palp_tets *t = d->tets;
    for (uint32_t f = 0; f < t->meta->families; f++) s->gamma_m[f] = 0.0f;
    for (uint32_t i = 0; i < t->meta->nodes; i++) {
        if (d->state[i] == PALP_ACTIVE) continue;
        uint32_t up = t->family[2u * (size_t)i], down = t->family[2u * (size_t)i + 1u];
        if (up != PALP_NONE && d->split[up] != 0u) s->gamma_m[up] = NOT_NOW;
        if (down != PALP_NONE && d->split[down] == 0u) s->gamma_m[down] = NOT_NOW;
    }
    float per_mu = 1.0f / d->config.material.mu_Pa;
    for (uint32_t k = 0; k < d->active_count; k++) {
        uint32_t i = d->active[k];
        if (palp_dyna_pinned(d, i)) continue;
        uint32_t up = t->family[2u * (size_t)i], down = t->family[2u * (size_t)i + 1u];
        float f = palp_norm(palp_vec3_at(d->force_N + 3u * (size_t)i));
        float gamma = f * per_mu / t->node[i].near_m;
        if (up != PALP_NONE) raise(&s->gamma_m[up], gamma);
        if (down != PALP_NONE) raise(&s->gamma_m[down], gamma);
    }
}

/* ---- neighbours ---- */

typedef enum { CLEAR, MET, NO_TESTS_LEFT } clearance;

/* Whether a node in the state `bad` is among the elements of a family's parents or children, and
 * the first one. */
static clearance neighbour_in(palp_adapt *s, uint32_t f, uint32_t which, palp_node_state bad,
                              uint32_t *found) {
    const palp_dyna *d = s->dyna;
    const palp_tets *t = d->tets;
    uint32_t count;
    const uint32_t *list = members(t, f, which, &count);
    uint32_t element_tests = elements_around(t, list, count);
    if (element_tests > s->element_tests) return NO_TESTS_LEFT;
    s->element_tests -= element_tests;
    for (uint32_t i = 0; i < count; i++) {
        for (uint32_t e = t->around_offset[list[i]]; e < t->around_offset[list[i] + 1u]; e++) {
            for (uint32_t c = 0; c < 4u; c++) {
                *found = t->tet[t->around[e]].node[c];
                if (d->state[*found] == bad) return MET;
            }
        }
    }
    return CLEAR;
}

/* ---- changes ---- */

static void split(palp_adapt *s, uint32_t f) {
    palp_dyna *d = s->dyna;
    const palp_tets *t = d->tets;
    for (uint32_t k = t->child_offset[f]; k < t->child_offset[f + 1u]; k++) {
        if (!palp_dyna_pinned(d, t->child[k])) palp_dyna_embed(d, t->child[k]);
    }
    d->split[f] = 1;
    s->age[f] = 0;
    s->gamma_m[f] = NOT_NOW;
}

static void merge(palp_adapt *s, uint32_t f) {
    palp_dyna *d = s->dyna;
    const palp_tets *t = d->tets;
    for (uint32_t k = t->parent_offset[f]; k < t->parent_offset[f + 1u]; k++) {
        if (!palp_dyna_pinned(d, t->parent[k])) palp_dyna_mean(d, t->parent[k]);
    }
    d->split[f] = 0;
    s->gamma_m[f] = NOT_NOW;
}

/* Which families may merge: calm ones that have been split for a while, to make room any that is
 * not under a tool, or, when the budget is exceeded, those too, after all others. */
typedef enum { CALM, OTHERS, ANY } mergers;

/* The one with the smallest measure; PALP_NONE. */
static uint32_t calmest(const palp_adapt *s, mergers who) {
    const palp_dyna *d = s->dyna;
    uint32_t best = PALP_NONE;
    for (uint32_t f = 0; f < d->tets->meta->families; f++) {
        if (d->split[f] == 0u || s->gamma_m[f] < 0.0f) continue;
        if (who != ANY && s->held[f] != 0u) continue;
        bool calm = s->gamma_m[f] < s->config.merge_m && s->age[f] >= s->config.dwell_ticks;
        if (who == CALM && !calm) continue;
        bool calmer = best == PALP_NONE || s->held[f] < s->held[best] ||
                      (s->held[f] == s->held[best] && s->gamma_m[f] < s->gamma_m[best]);
        if (calmer) best = f;
    }
    return best;
}

static void merge_some(palp_adapt *s, uint32_t count, mergers who, palp_adapt_report *r) {
    for (uint32_t k = 0; k < count; k++) {
        uint32_t f = calmest(s, who);
        if (f == PALP_NONE) return;
        uint32_t met;
        clearance l = neighbour_in(s, f, 0, PALP_SPLIT, &met);
        if (l == NO_TESTS_LEFT) return;
        if (l == MET) {
            s->gamma_m[f] = NOT_NOW;
            continue;
        }
        merge(s, f);
        r->merges++;
        r->forced += who == CALM ? 0u : 1u;
    }
}

/* The family that wants most to split; under a tool before all others. */
static uint32_t keenest(const palp_adapt *s) {
    const palp_dyna *d = s->dyna;
    uint32_t best = PALP_NONE;
    for (uint32_t f = 0; f < d->tets->meta->families; f++) {
        bool wants = d->split[f] == 0u && s->gamma_m[f] >= 0.0f &&
                     (s->held[f] != 0u || s->gamma_m[f] > s->config.refine_m);
        if (!wants) continue;
        bool keener = best == PALP_NONE || s->held[f] > s->held[best] ||
                      (s->held[f] == s->held[best] && s->gamma_m[f] > s->gamma_m[best]);
        if (keener) best = f;
    }
    return best;
}

/* What has to split before f can, which may be f itself; PALP_NONE if that is not possible now. */
static uint32_t first_to_split(palp_adapt *s, uint32_t f) {
    const palp_dyna *d = s->dyna;
    for (uint32_t l = 0; l < PALP_TET_LEVELS; l++) {
        uint32_t inactive;
        clearance met = neighbour_in(s, f, 1, PALP_INACTIVE, &inactive);
        if (met == CLEAR) return f;
        if (met == NO_TESTS_LEFT) return PALP_NONE;
        f = d->tets->family[2u * (size_t)inactive];
        if (d->split[f] != 0u || s->gamma_m[f] < 0.0f) return PALP_NONE;
    }
    return PALP_NONE;
}

/* What splitting f costs, about, when a tick has 2^top steps. */
static float price(const palp_dyna *d, uint32_t f, uint32_t top, palp_adapt_room room) {
    uint32_t own = d->family_class[f];
    float steps = own > top ? (float)((1u << own) - (1u << top)) : 0.0f;
    return room.per_evaluation * (float)d->cost[f] + room.per_step * steps;
}

/* A family under a tool that has no room makes others wait, and the calmest of them merge. */
static void split_some(palp_adapt *s, palp_adapt_room room, palp_adapt_report *r) {
    uint32_t top = s->dyna->top_class;
    for (uint32_t k = 0; k < s->config.max_changes; k++) {
        uint32_t f = keenest(s);
        if (f == PALP_NONE) return;
        bool held = s->held[f] != 0u;
        uint32_t first = first_to_split(s, f);
        if (first == PALP_NONE) {
            s->gamma_m[f] = NOT_NOW;
        } else if (price(s->dyna, first, top, room) > room.spare) {
            s->gamma_m[f] = NOT_NOW;
            r->refused++;
            if (!held) continue;
            if (r->splits == 0u) merge_some(s, s->config.max_changes - k, OTHERS, r);
            return;
        } else {
            room.spare -= price(s->dyna, first, top, room);
            if (s->dyna->family_class[first] > top) top = s->dyna->family_class[first];
            split(s, first);
            r->splits++;
        }
    }
}

palp_adapt_report palp_adapt_tick(palp_adapt *s, palp_adapt_room room) {
    palp_dyna *d = s->dyna;
    palp_adapt_report r = {0, 0, 0, 0};
    s->element_tests = s->config.max_element_tests;
    measure(s);
    if (room.spare < 0.0f) {
        merge_some(s, s->config.max_changes, ANY, &r);
    } else {
        /* not both: states are those from before either */
        merge_some(s, s->config.max_changes, CALM, &r);
        if (r.merges == 0u) split_some(s, room, &r);
    }
    for (uint32_t f = 0; f < d->tets->meta->families; f++) {
        s->held[f] = 0;
        if (s->age[f] < UINT32_MAX) s->age[f]++;
    }
    if (r.splits + r.merges > 0u) palp_dyna_relist(d);
    return r;
}
