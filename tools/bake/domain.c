/* SPDX-License-Identifier: MIT */
#include "tools/bake/domain.h"
#include "tools/bake/butterfly.h"
#include "core/green/wavelet.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static void order_slots(domain_data *d, const mesh *m, const semireg *s, const uint8_t *fixed,
                        uint32_t which, uint32_t *slot_of) {
    uint32_t n = 0;
    for (uint32_t l = 0; l < s->levels; l++) {
        d->level_start[l] = n;
        for (uint32_t i = 0; i < m->vertices; i++) {
            if (s->level[i] != l || (fixed[i] != 0) != (which == PALP_FIXED)) continue;
            slot_of[i] = n;
            d->node[n++] = i;
        }
    }
    d->level_start[s->levels] = n;
}

static void predict_weights(domain_data *d, const semireg *s, const uint32_t *slot_of,
                            bool renormalise) {
    for (uint32_t m = d->level_start[1 % (s->levels + 1)]; s->levels > 1 && m < d->view.slots;
         m++) {
        const uint32_t *parent = s->parent[d->node[m]];
        bool present[2] = {slot_of[parent[0]] != NO_PARENT, slot_of[parent[1]] != NO_PARENT};
        float weight = renormalise && present[0] != present[1] ? 1.0f : 0.5f;
        for (uint32_t k = 0; k < 2; k++) {
            d->parent[2 * m + k] = present[k] ? slot_of[parent[k]] : 0;
            d->predict[2 * m + k] = present[k] ? weight : 0.0f;
        }
    }
}

typedef struct {
    domain_data *d;
    const uint32_t *slot_of;
    bool renormalise;
    butterfly_stencil *list; /* [slots] members renamed to slots */
} stencil_collector;

/* Keeps the members in the domain; without an edge parent among them there is no prediction. */
static void keep_stencil(void *context, uint32_t vertex, const butterfly_stencil *s) {
    const stencil_collector *c = context;
    uint32_t m = c->slot_of[vertex];
    if (m == NO_PARENT || !(c->d->predict[2 * m] + c->d->predict[2 * m + 1] > 0)) return;
    butterfly_stencil *own = &c->list[m];
    double sum = 0;
    for (uint32_t i = 0; i < s->count; i++) {
        uint32_t slot = c->slot_of[s->node[i]];
        if (slot == NO_PARENT || !(fabs(s->weight[i]) > 0)) continue;
        own->node[own->count] = slot;
        own->weight[own->count++] = s->weight[i];
        sum += s->weight[i];
    }
    for (uint32_t i = 0; c->renormalise && i < own->count; i++) own->weight[i] /= sum;
}

static void stencil_weights(domain_data *d, const mesh *m, const semireg *s,
                            const uint32_t *slot_of, bool renormalise) {
    uint32_t n = d->view.slots;
    stencil_collector c = {d, slot_of, renormalise, allocate(n, sizeof *c.list)};
    butterfly_stencils(m, s, keep_stencil, &c);
    d->stencil_offset = allocate(n + 1u, sizeof *d->stencil_offset);
    for (uint32_t i = 0; i < n; i++)
        d->stencil_offset[i + 1] = d->stencil_offset[i] + c.list[i].count;
    d->stencil = allocate(d->stencil_offset[n], sizeof *d->stencil);
    d->stencil_weight = allocate(d->stencil_offset[n], sizeof *d->stencil_weight);
    for (uint32_t i = 0; i < n; i++) {
        for (uint32_t k = 0; k < c.list[i].count; k++) {
            d->stencil[d->stencil_offset[i] + k] = c.list[i].node[k];
            d->stencil_weight[d->stencil_offset[i] + k] = (float)c.list[i].weight[k];
        }
    }
    free(c.list);
}

/* I_a += sum_m w_ma I_m over the odd slots of one level */
static void gather_integrals(const domain_data *d, uint32_t first, uint32_t last,
                             double *integral) {
    for (uint32_t m = first; m < last; m++) {
        if (d->stencil_offset != NULL) {
            for (uint32_t k = d->stencil_offset[m]; k < d->stencil_offset[m + 1]; k++)
                integral[d->stencil[k]] += (double)d->stencil_weight[k] * integral[m];
            continue;
        }
        for (uint32_t k = 0; k < 2; k++)
            integral[d->parent[2 * m + k]] += (double)d->predict[2 * m + k] * integral[m];
    }
}

/* I is carried from fine to coarse with the same predictor, so that each wavelet's integral
 * vanishes. */
static void update_weights(domain_data *d, const double *area) {
    double *integral = allocate(d->view.slots, sizeof *integral);
    for (uint32_t i = 0; i < d->view.slots; i++) integral[i] = area[d->node[i]];
    for (uint32_t l = d->view.levels - 1; l > 0; l--) {
        uint32_t first = d->level_start[l], last = d->level_start[l + 1];
        gather_integrals(d, first, last, integral);
        for (uint32_t m = first; m < last; m++) {
            int parents = (d->predict[2 * m] > 0) + (d->predict[2 * m + 1] > 0);
            for (uint32_t k = 0; k < 2; k++) {
                if (!(d->predict[2 * m + k] > 0) || !(integral[d->parent[2 * m + k]] > 0)) continue;
                if (!(integral[m] > 0)) continue;
                d->update[2 * m + k] =
                    (float)(integral[m] / (parents * integral[d->parent[2 * m + k]]));
            }
        }
    }
    free(integral);
}

static void list_children(domain_data *d) {
    uint32_t n = d->view.slots;
    for (int pass = 0; pass < 2; pass++) {
        uint32_t *at = allocate(n, sizeof *at);
        for (uint32_t m = 0; m < n; m++) {
            for (uint32_t k = 0; k < 2; k++) {
                if (!(d->predict[2 * m + k] > 0)) continue;
                uint32_t a = d->parent[2 * m + k];
                if (pass == 0) d->child_offset[a + 1]++;
                if (pass == 0) continue;
                d->child_weight[d->child_offset[a] + at[a]] = d->update[2 * m + k];
                d->child[d->child_offset[a] + at[a]++] = m;
            }
        }
        free(at);
        if (pass == 1) break;
        for (uint32_t i = 0; i < n; i++) d->child_offset[i + 1] += d->child_offset[i];
        d->child = allocate(d->child_offset[n], sizeof *d->child);
        d->child_weight = allocate(d->child_offset[n], sizeof *d->child_weight);
    }
}

static uint32_t longest_row(const palp_domain *view) {
    palp_row_scratch scratch = {allocate(view->slots, sizeof(float)),
                                allocate((view->slots + 31) / 32, sizeof(uint32_t))};
    palp_row row = {.index = allocate(view->slots, sizeof(uint16_t)),
                    .weight = allocate(view->slots, sizeof(float))};
    uint32_t longest = 1;
    for (uint32_t i = 0; i < view->slots; i++) {
        (void)palp_wavelet_row(view, i, &scratch, &row, view->slots);
        if (row.count > longest) longest = row.count;
    }
    free(scratch.weight);
    free(scratch.mark);
    free(row.index);
    free(row.weight);
    return longest;
}

domain_data domain_build(const mesh *m, const semireg *s, const uint8_t *fixed, uint32_t which,
                         const double *area, wavelet w) {
    domain_data d = {.view.levels = s->levels};
    uint32_t *slot_of = allocate(m->vertices, sizeof *slot_of);
    memset(slot_of, 0xff, m->vertices * sizeof *slot_of);
    for (uint32_t i = 0; i < m->vertices; i++)
        d.view.slots += (fixed[i] != 0) == (which == PALP_FIXED);
    uint32_t n = d.view.slots;
    d.node = allocate(n, sizeof *d.node);
    d.level_start = allocate(s->levels + 1u, sizeof *d.level_start);
    d.parent = allocate(2 * (size_t)n, sizeof *d.parent);
    d.predict = allocate(2 * (size_t)n, sizeof *d.predict);
    d.update = allocate(2 * (size_t)n, sizeof *d.update);
    d.child_offset = allocate(n + 1u, sizeof *d.child_offset);
    order_slots(&d, m, s, fixed, which, slot_of);
    predict_weights(&d, s, slot_of, which == PALP_FIXED);
    if (w.kind == WAVELET_BUTTERFLY && s->levels > 1)
        stencil_weights(&d, m, s, slot_of, which == PALP_FIXED);
    if (w.lifted) update_weights(&d, area);
    list_children(&d);
    d.view = (palp_domain){.slots = n,
                           .levels = s->levels,
                           .node = d.node,
                           .level_start = d.level_start,
                           .parent = d.parent,
                           .predict = d.predict,
                           .update = d.update,
                           .child_offset = d.child_offset,
                           .child = d.child,
                           .child_weight = d.child_weight,
                           .stencil_offset = d.stencil_offset,
                           .stencil = d.stencil,
                           .stencil_weight = d.stencil_weight};
    d.max_row = longest_row(&d.view);
    free(slot_of);
    return d;
}

void domain_free(domain_data *d) {
    void *owned[] = {d->node,    d->level_start,    d->parent,      d->child_offset,
                     d->child,   d->predict,        d->update,      d->stencil_offset,
                     d->stencil, d->stencil_weight, d->child_weight};
    for (size_t i = 0; i < sizeof owned / sizeof owned[0]; i++) free(owned[i]);
}
