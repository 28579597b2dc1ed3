/* SPDX-License-Identifier: MIT */
#include "cma_internal.h"

void palp_cma_restrict(palp_cma *c) {
    const palp_domain *d = &c->blob->domain[PALP_FREE];
    for (uint32_t i = 0; i < d->slots; i++) {
        for (uint32_t k = 0; k < 3; k++) c->carried[3u * i + k] = c->given[3u * d->node[i] + k];
    }
    for (uint32_t m = d->slots; m-- > c->blob->level[c->blob->meta->constraint_level].nodes;) {
        for (uint32_t side = 0; side < 2; side++) {
            float w = d->predict[2u * m + side];
            float *parent = c->carried + 3u * d->parent[2u * m + side];
            if (!(w > 0.0f)) continue;
            for (uint32_t k = 0; k < 3; k++) parent[k] += w * c->carried[3u * m + k];
        }
        for (uint32_t k = 0; k < 3; k++) c->carried[3u * m + k] = 0.0f;
    }
}

/* Forces on the basis functions of `level` become forces on those of level + 1. */
static void distribute_forces(const palp_blob *b, uint32_t level, float *force) {
    const palp_domain *d = &b->domain[PALP_FREE];
    const float *coarse = b->level[level].area_m2, *fine = b->level[level + 1u].area_m2;
    for (uint32_t m = b->level[level].nodes; m < b->level[level + 1u].nodes; m++) {
        for (uint32_t side = 0; side < 2; side++) {
            float w = d->predict[2u * m + side];
            uint32_t p = d->parent[2u * m + side];
            if (!(w > 0.0f)) continue;
            float share = w * fine[m] / coarse[p];
            for (uint32_t k = 0; k < 3; k++) force[3u * m + k] += share * force[3u * p + k];
        }
    }
    for (uint32_t i = 0; i < b->level[level].nodes; i++) {
        float share = fine[i] / coarse[i];
        for (uint32_t k = 0; k < 3; k++) force[3u * i + k] *= share;
    }
}

void palp_cma_carry(palp_cma *c) {
    const palp_blob *b = c->blob;
    for (uint32_t i = 0; i < 3u * b->domain[PALP_FREE].slots; i++) c->carried[i] = 0.0f;
    for (uint32_t l = 0; l <= b->meta->constraint_level; l++) {
        for (uint32_t k = 0; k < c->solved; k++) {
            const palp_switched_unknown *s = palp_cma_unknown(c, k);
            if (palp_node_is_fixed(b, s->node) || s->level != l) continue;
            float *f = c->carried + 3u * palp_node_slot(b, s->node);
            f[0] += s->value * s->direction.x;
            f[1] += s->value * s->direction.y;
            f[2] += s->value * s->direction.z;
        }
        if (l < b->meta->constraint_level) distribute_forces(b, l, c->carried);
    }
    for (uint32_t i = 0; i < b->domain[PALP_FREE].slots; i++) {
        for (uint32_t k = 0; k < 3; k++)
            c->given[3u * b->domain[PALP_FREE].node[i] + k] += c->carried[3u * i + k];
    }
    for (uint32_t k = 0; k < c->solved; k++) {
        const palp_switched_unknown *s = palp_cma_unknown(c, k);
        if (!palp_node_is_fixed(b, s->node)) continue;
        float *u = c->given + 3u * s->node;
        u[0] += s->value * s->direction.x;
        u[1] += s->value * s->direction.y;
        u[2] += s->value * s->direction.z;
    }
}

void palp_cma_nodal_forces(palp_cma *c) {
    const palp_blob *b = c->blob;
    const palp_domain *d = &b->domain[PALP_FREE];
    if (b->meta->constraint_level + 1u == d->levels) return;
    for (uint32_t l = b->meta->constraint_level; l + 1u < d->levels; l++)
        distribute_forces(b, l, c->carried);
    for (uint32_t i = 0; i < 3u * d->slots; i++)
        c->given[3u * d->node[i / 3u] + i % 3u] = c->carried[i];
}

/* Whether the chosen basis functions lie over a slot. */
static void find_covered(palp_cma *c, uint32_t hats) {
    const palp_blob *b = c->blob;
    const palp_domain *d = &b->domain[PALP_FREE];
    for (uint32_t i = 0; i < d->slots; i++) c->covered[i] = 0;
    for (uint32_t k = 0; k < c->count; k++) {
        const palp_switched_unknown *s = &c->switches[k];
        uint32_t slot = palp_node_slot(b, s->node);
        if (!palp_node_is_fixed(b, s->node) && slot < hats) c->covered[slot] = 1;
    }
    for (uint32_t m = hats; m < d->slots; m++) {
        for (uint32_t side = 0; side < 2; side++) {
            bool under = d->predict[2u * m + side] > 0.0f && c->covered[d->parent[2u * m + side]];
            if (under) c->covered[m] = 1;
        }
    }
}

palp_status palp_cma_choose(palp_cma *c) {
    const palp_blob *b = c->blob;
    const uint32_t stored = b->level[b->meta->constraint_level].nodes;
    const uint32_t hats = b->level[c->level].nodes;
    uint32_t kept = 0;
    find_covered(c, hats);
    c->solved = 0;
    for (uint32_t k = 0; k < c->count; k++) {
        palp_switched_unknown *s = &c->switches[k];
        const uint32_t slot = palp_node_slot(b, s->node);
        const bool fixed = palp_node_is_fixed(b, s->node);
        if (fixed && c->pairing == PALP_COLLOCATED && c->level + 1u < b->meta->levels)
            return PALP_ERR_ABSENT; /* reactions to hats come by reciprocity, which it lacks */
        if (!fixed && slot >= hats && c->covered[slot] != 0u) continue;
        if (!fixed && slot >= hats && slot >= stored) return PALP_ERR_ABSENT;
        s->level = slot < hats ? c->level : b->meta->constraint_level;
        c->chosen[kept++] = k;
    }
    c->solved = kept;
    return PALP_OK;
}
