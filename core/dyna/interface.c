/* SPDX-License-Identifier: MIT */
/* Interface nodes: where they are, and to whom the forces on them go. */
#include "dyna.h"

void palp_dyna_hang(palp_dyna *dyna, uint32_t node) {
    const palp_tets *t = dyna->tets;
    const uint32_t *corner = t->tet[t->container[node]].node;
    const float *w = t->container_weight + 4u * (size_t)node;
    for (uint32_t a = 0; a < 3u; a++) {
        float u = 0.0f, v = 0.0f;
        for (uint32_t c = 0; c < 4u; c++) {
            u += w[c] * dyna->u_m[3u * (size_t)corner[c] + a];
            v += w[c] * dyna->v_m_s[3u * (size_t)corner[c] + a];
        }
        dyna->u_m[3u * (size_t)node + a] = u;
        dyna->v_m_s[3u * (size_t)node + a] = v;
    }
}

void palp_dyna_mean(palp_dyna *dyna, uint32_t node) {
    const palp_tets *t = dyna->tets;
    for (uint32_t a = 0; a < 3u; a++) {
        float u = 0.0f, v = 0.0f;
        for (uint32_t k = t->mean_offset[node]; k < t->mean_offset[node + 1u]; k++) {
            size_t at = 3u * (size_t)t->mean[k] + a;
            u += t->mean_weight[k] * dyna->u_m[at];
            v += t->mean_weight[k] * dyna->v_m_s[at];
        }
        dyna->u_m[3u * (size_t)node + a] = u;
        dyna->v_m_s[3u * (size_t)node + a] = v;
    }
}

void palp_dyna_follow(palp_dyna *dyna) {
    for (uint32_t i = 0; i < dyna->up_count; i++) palp_dyna_mean(dyna, dyna->up[i]);
    for (uint32_t i = 0; i < dyna->down_count; i++) palp_dyna_hang(dyna, dyna->down[i]);
    dyna->followed += dyna->up_count + dyna->down_count;
}

/* The impulse on a node goes to what it follows, by the same weights. */
static void hand_back(palp_dyna *d, uint32_t node, const uint32_t *source, const float *weight,
                      uint32_t count) {
    const float *from = d->impulse_Ns + 3u * (size_t)node;
    for (uint32_t k = 0; k < count; k++) {
        float *to = d->impulse_Ns + 3u * (size_t)source[k];
        for (uint32_t a = 0; a < 3u; a++) to[a] += weight[k] * from[a];
        d->stretch[source[k]] = palp_max(d->stretch[source[k]], d->stretch[node]);
    }
}

void palp_dyna_hand_back(palp_dyna *dyna) {
    const palp_tets *t = dyna->tets;
    for (uint32_t i = dyna->down_count; i-- > 0u;) {
        uint32_t n = dyna->down[i];
        hand_back(dyna, n, t->tet[t->container[n]].node, t->container_weight + 4u * (size_t)n, 4);
    }
    for (uint32_t i = dyna->up_count; i-- > 0u;) {
        uint32_t n = dyna->up[i], first = t->mean_offset[n];
        hand_back(dyna, n, t->mean + first, t->mean_weight + first, t->mean_offset[n + 1u] - first);
    }
}

/* The diagonal of W^T J W. (Its row sums would be a bound, and are far too large.) */
static void lean(palp_dyna *d, uint32_t node, const uint32_t *source, const float *weight,
                 uint32_t count) {
    for (uint32_t k = 0; k < count; k++)
        d->lever[source[k]] += weight[k] * weight[k] * d->lever[node];
}

void palp_dyna_levers(palp_dyna *dyna) {
    palp_dyna *d = dyna;
    const palp_tets *t = d->tets;
    for (uint32_t i = 0; i < t->meta->nodes; i++) {
        bool bears = d->state[i] == PALP_ACTIVE || d->borders[i] != 0u;
        d->lever[i] = bears ? d->j_N_per_m[i] : 0.0f;
    }
    for (uint32_t i = d->down_count; i-- > 0u;) {
        uint32_t n = d->down[i];
        lean(d, n, t->tet[t->container[n]].node, t->container_weight + 4u * (size_t)n, 4);
    }
    for (uint32_t i = d->up_count; i-- > 0u;) {
        uint32_t n = d->up[i], first = t->mean_offset[n];
        lean(d, n, t->mean + first, t->mean_weight + first, t->mean_offset[n + 1u] - first);
    }
    for (uint32_t i = 0; i < d->active_count; i++) {
        uint32_t n = d->active[i];
        d->lever[n] = palp_max(d->lever[n] / d->j_N_per_m[n], 1.0f);
    }
}
