/* SPDX-License-Identifier: MIT */
#include "hierarchy.h"
#include "core/base/apart.h"

float palp_child_share(const palp_blob *blob, uint32_t level, uint32_t slot, uint32_t child) {
    const palp_domain *d = &blob->domain[PALP_FREE];
    float weight = 0.0f;
    for (uint32_t k = 0; k < 2; k++) {
        if (d->parent[2u * child + k] == slot) weight += d->predict[2u * child + k];
    }
    return weight * blob->level[level + 1u].area_m2[child] / blob->level[level].area_m2[slot];
}

palp_child_range palp_children(const palp_domain *domain, uint32_t slot, uint32_t level) {
    palp_child_range r = {domain->child_offset[slot], domain->child_offset[slot + 1u]};
    /* at most children */
    while (r.first < r.end && domain->child[r.first] < domain->level_start[level]) r.first++;
    /* at most children */
    while (r.end > r.first && domain->child[r.end - 1u] >= domain->level_start[level + 1u]) r.end--;
    return r;
}

/* Spreads the marked weights of `level` over level + 1. */
static void distribute(const palp_blob *b, uint32_t level, palp_row_scratch *s) {
    const palp_domain *d = &b->domain[PALP_FREE];
    uint32_t end = d->level_start[level + 1u];
    for (uint32_t a = palp_row_next(s, 0, end); a < end; a = palp_row_next(s, a + 1u, end)) {
        float force = s->weight[a];
        palp_child_range r = palp_children(d, a, level + 1u);
        for (uint32_t c = r.first; c < r.end; c++) {
            palp_row_mark(s, d->child[c], force * palp_child_share(b, level, a, d->child[c]));
        }
        s->weight[a] = force * palp_own_share(b, level, a);
    }
}

PALP_APART static void mark_basis(const palp_blob *blob, palp_basis basis, palp_row_scratch *scratch) {
    palp_row_mark(scratch, basis.slot, 1.0f);
    for (uint32_t l = basis.level; l + 1u < blob->meta->levels; l++) distribute(blob, l, scratch);
}

bool palp_basis_weights(const palp_blob *blob, palp_basis basis, palp_row_scratch *scratch,
                        palp_row *row, uint32_t capacity) {
    mark_basis(blob, basis, scratch);
    return palp_row_collect(blob->domain[PALP_FREE].slots, scratch, row, capacity);
}

bool palp_basis_row(const palp_blob *blob, palp_basis basis, palp_row_scratch *scratch,
                    palp_row *row, uint32_t capacity) {
    mark_basis(blob, basis, scratch);
    return palp_row_finish(&blob->domain[PALP_FREE], scratch, row, capacity);
}
