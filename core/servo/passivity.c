/* SPDX-License-Identifier: MIT */
#include "passivity.h"

#define FORGIVE_S 0.5f /* without contact, after which what was given in excess is let go */

static palp_vec3 held(const palp_passivity *p, uint32_t back) {
    return p->sent_N[(p->newest + PALP_PASSIVITY_DELAYS - back) % PALP_PASSIVITY_DELAYS];
}

void palp_passivity_observe(palp_passivity *p, const palp_passivity_config *config, palp_vec3 d_m) {
    float given = palp_dot(held(p, config->delay), d_m);
    p->absorbed_J -= given;
    p->energy_J += config->damping_Ns_per_m / config->dt_s * palp_dot(d_m, d_m) - given;
}

palp_vec3 palp_passivity_limit(palp_passivity *p, const palp_passivity_config *config,
                               palp_vec3 force_N, palp_vec3 velocity_m_s, float stored_J,
                               bool *braked) {
    p->energy_J = palp_min(p->energy_J, stored_J);
    bool idle = !(stored_J > 0.0f) && !(palp_norm(force_N) > 0.0f);
    p->idle_ticks = idle ? p->idle_ticks + 1u : 0u;
    if ((float)p->idle_ticks * config->dt_s > FORGIVE_S) p->energy_J = 0.0f;
    *braked = false;
    palp_vec3 d = palp_scale(config->dt_s, velocity_m_s);
    float d2 = palp_dot(d, d);
    if (!(d2 > 1e-20f) || idle) return force_N;
    float swallowed = config->damping_Ns_per_m / config->dt_s * d2;
    float have = p->energy_J + swallowed;
    /* What is on its way will have acted before this force does. */
    for (uint32_t i = 0; i < config->delay; i++) have += swallowed - palp_dot(held(p, i), d);
    float most = palp_max(have, -config->damping_max_Ns_per_m / config->dt_s * d2);
    float give = palp_dot(force_N, d);
    if (give <= most) return force_N;
    *braked = true;
    return palp_madd(force_N, -(give - most) / d2, d);
}

void palp_passivity_sent(palp_passivity *p, palp_vec3 force_N) {
    p->newest = (p->newest + 1u) % PALP_PASSIVITY_DELAYS;
    p->sent_N[p->newest] = force_N;
}
