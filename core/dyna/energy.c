/* SPDX-License-Identifier: MIT */
#include "energy.h"

#define EXCESS 1.5f      /* of what is allowed, at which the monitor acts */
#define SETTLE_S 0.1f    /* in which it takes a loss for granted */
#define NOISE 1e-9f      /* of mu diagonal^3: less is not energy */
#define LEAST_KEPT 0.25f /* of the kinetic energy in one tick */

static float falling_J(const palp_dyna *d) {
    float sum = 0.0f;
    for (uint32_t i = 0; i < d->active_count; i++) {
        uint32_t n = d->active[i];
        palp_vec3 u = palp_vec3_at(d->u_m + 3u * (size_t)n);
        sum -= d->mass_kg[n] * palp_dot(u, d->config.gravity_m_s2);
    }
    return sum;
}

bool palp_energy_watch(palp_energy *e, palp_dyna *d, float work_J, bool changed) {
    float size = d->tets->meta->diagonal_m;
    float floor_J = NOISE * d->config.material.mu_Pa * size * size * size;
    e->kinetic_J = palp_dyna_kinetic_J(d);
    float lost = e->kinetic_J + d->stored_J, fallen = falling_J(d);
    e->total_J = lost + fallen;
    e->allowed_J += work_J;
    if (changed) e->allowed_J = palp_max(e->allowed_J, e->total_J);
    float gap = e->total_J - e->allowed_J;
    if (gap < 0.0f) {
        e->allowed_J += gap * palp_min(d->config.tick_s / SETTLE_S, 1.0f);
        return false;
    }
    float excess = gap - (EXCESS - 1.0f) * palp_max(lost, 0.0f) - floor_J;
    if (!(excess > 0.0f) || !(e->kinetic_J > 0.0f)) return false;
    float keep = palp_max(1.0f - excess / e->kinetic_J, LEAST_KEPT);
    float slower = palp_sqrt(keep);
    for (uint32_t i = 0; i < d->active_count; i++) {
        float *v = d->v_m_s + 3u * (size_t)d->active[i];
        for (uint32_t a = 0; a < 3u; a++) v[a] *= slower;
    }
    e->energy_limited++;
    return true;
}
