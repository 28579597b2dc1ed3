/* SPDX-License-Identifier: MIT */
#include "core/contact/loads.h"

static void add(palp_load_list *l, const palp_blob *blob, uint32_t slot, palp_vec3 force) {
    uint32_t i = 0;
    /* at most capacity */
    while (i < l->count && l->load[i].at.slot != slot) i++;
    if (i == l->count && l->count == l->capacity) {
        if (l->capacity == 0u) return;
        i--;
    }
    if (i == l->count)
        l->load[l->count++] =
            (palp_load){.at = {blob->meta->constraint_level, slot}, .force_N = {0}};
    l->load[i].force_N = palp_add(l->load[i].force_N, force);
}

/* Replaces the loads from `first` on that are finer than the constraint level by their parents'.
 * A parent has a lower slot than its child, so each pass takes them up by a level at least. */
static void raise(palp_load_list *l, const palp_blob *blob, uint32_t first) {
    const palp_domain *d = &blob->domain[PALP_FREE];
    const uint32_t nodes = blob->level[blob->meta->constraint_level].nodes;
    uint32_t i = first;
    /* at most (levels + 1) * loads */
    while (i < l->count) {
        palp_load fine = l->load[i];
        if (fine.at.slot < nodes) {
            i++;
            continue;
        }
        l->load[i] = l->load[--l->count];
        for (uint32_t k = 0; k < 2u; k++) {
            if (d->predict[2u * fine.at.slot + k] > 0.0f)
                add(l, blob, d->parent[2u * fine.at.slot + k], palp_scale(0.5f, fine.force_N));
        }
    }
}

void palp_contact_loads(const palp_contact *c, uint32_t patch, uint32_t body, palp_vec3 friction_N,
                        palp_load_list *list) {
    const palp_contact_patch *of = &c->patch[patch];
    const palp_blob *b = c->surface[body].blob;
    const uint32_t first = list->count;
    const palp_contact_point *point = c->solved ? c->point : c->before;
    const palp_contact_facing *facing = c->solved ? c->facing : c->facing_before;
    const uint32_t points = c->solved ? c->count : c->count_before;
    for (uint32_t k = 0; k < points && of->used; k++) {
        const palp_contact_point *p = &point[k];
        if (p->patch != patch || !(p->force_N > 0.0f)) continue;
        const bool here = p->at.body == body;
        if (!here && (of->tool < PALP_CONTACT_TOOLS || of->other != body)) continue;
        const palp_surface_point *at = here ? &p->at : &facing[k].at;
        palp_vec3 force = palp_scale(p->force_N, here ? p->m : facing[k].m);
        force = palp_madd(force, -p->force_N / of->normal_N, friction_N);
        for (uint32_t q = 0; q < 3u; q++) {
            uint32_t node = b->triangle[3u * at->triangle + q];
            if (palp_node_is_fixed(b, node)) continue;
            add(list, b, palp_node_slot(b, node), palp_scale(at->weight[q], force));
        }
    }
    raise(list, b, first);
}
