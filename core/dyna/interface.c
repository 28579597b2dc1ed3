/* SPDX-License-Identifier: MIT */
/* Interface nodes: their positions, and the nodes that forces on them go to. */
#include "dyna.h"

/* What a node follows: the corners of its container, or children of its family. */
typedef struct {
    const uint32_t *node;
    const float *weight;
    uint32_t count;
} sources;

static sources container_of(const palp_tets *t, uint32_t node) {
    return (sources){t->tet[t->container[node]].node, t->container_weight + 4u * (size_t)node, 4};
}

static sources children_of(const palp_tets *t, uint32_t node) {
    uint32_t first = t->mean_offset[node];
    return (sources){t->mean + first, t->mean_weight + first, t->mean_offset[node + 1u] - first};
}

static void interpolate(palp_dyna *d, uint32_t node, sources s) {
    for (uint32_t a = 0; a < 3u; a++) {
        float u = 0.0f, v = 0.0f;
        for (uint32_t k = 0; k < s.count; k++) {
            size_t at = 3u * (size_t)s.node[k] + a;
            u += s.weight[k] * d->u_m[at];
            v += s.weight[k] * d->v_m_s[at];
        }
        d->u_m[3u * (size_t)node + a] = u;
        d->v_m_s[3u * (size_t)node + a] = v;
    }
}

void palp_dyna_embed(palp_dyna *dyna, uint32_t node) {
    interpolate(dyna, node, container_of(dyna->tets, node));
}

void palp_dyna_mean(palp_dyna *dyna, uint32_t node) {
    interpolate(dyna, node, children_of(dyna->tets, node));
}

void palp_dyna_interpolate(palp_dyna *dyna) {
    for (uint32_t i = 0; i < dyna->up_count; i++) palp_dyna_mean(dyna, dyna->up[i]);
    for (uint32_t i = 0; i < dyna->down_count; i++) palp_dyna_embed(dyna, dyna->down[i]);
    dyna->interpolated += dyna->up_count + dyna->down_count;
}

/* The impulse on a node goes to what it follows, by the same weights. */
static void hand_back(palp_dyna *d, uint32_t node, sources s) {
    const float *from = d->impulse_Ns + 3u * (size_t)node;
    for (uint32_t k = 0; k < s.count; k++) {
        float *to = d->impulse_Ns + 3u * (size_t)s.node[k];
        for (uint32_t a = 0; a < 3u; a++) to[a] += s.weight[k] * from[a];
        d->stretch[s.node[k]] = palp_max(d->stretch[s.node[k]], d->stretch[node]);
    }
}

void palp_dyna_hand_back(palp_dyna *dyna) {
    const palp_tets *t = dyna->tets;
    for (uint32_t i = dyna->down_count; i-- > 0u;)
        hand_back(dyna, dyna->down[i], container_of(t, dyna->down[i]));
    for (uint32_t i = dyna->up_count; i-- > 0u;)
        hand_back(dyna, dyna->up[i], children_of(t, dyna->up[i]));
}

/* The diagonal of W^T J W. (Its row sums would be a bound, and are far too large.) */
static void lean(palp_dyna *d, uint32_t node, sources s) {
    for (uint32_t k = 0; k < s.count; k++)
        d->stiffness_ratio[s.node[k]] += s.weight[k] * s.weight[k] * d->stiffness_ratio[node];
}

void palp_dyna_stiffness_ratios(palp_dyna *d) {
    const palp_tets *t = d->tets;
    for (uint32_t i = 0; i < t->meta->nodes; i++) {
        bool bears = d->state[i] == PALP_ACTIVE || d->borders[i] != 0u;
        d->stiffness_ratio[i] = bears ? d->j_N_per_m[i] : 0.0f;
    }
    for (uint32_t i = d->down_count; i-- > 0u;) lean(d, d->down[i], container_of(t, d->down[i]));
    for (uint32_t i = d->up_count; i-- > 0u;) lean(d, d->up[i], children_of(t, d->up[i]));
    for (uint32_t i = 0; i < d->active_count; i++) {
        uint32_t n = d->active[i];
        d->stiffness_ratio[n] = palp_max(d->stiffness_ratio[n] / d->j_N_per_m[n], 1.0f);
    }
}
