/* SPDX-License-Identifier: MIT */
#include "passivity.h"

#define SHARE 0.5f     /* s */
#define FORGIVE_S 0.5f /* without contact, after which what was given in excess is let go */

static palp_vec3 held(const palp_passivity *p, uint32_t back) {
    return p->sent_N[(p->newest + PALP_PASSIVITY_DELAYS - back) % PALP_PASSIVITY_DELAYS];
}

palp_passivity_config palp_passivity_configure(float damping_Ns_per_m, float damping_max_Ns_per_m,
                                               uint32_t delay, float dt_s, float lag_s) {
    palp_passivity_config c = {.damping_Ns_per_m = damping_Ns_per_m,
                               .damping_max_Ns_per_m = damping_max_Ns_per_m,
                               .delay = delay,
                               .dt_s = dt_s,
                               .prompt = 1.0f};
    if (!(lag_s > 0.0f)) return c;
    float x = dt_s / lag_s; /* the exponential to a few per cent */
    c.remains = 1.0f / (1.0f + x * (1.0f + x * (0.5f + x * (1.0f / 6.0f + x * (1.0f / 24.0f)))));
    c.prompt = 1.0f - lag_s / dt_s * (1.0f - c.remains);
    return c;
}

static palp_vec3 blend(float share, palp_vec3 from, palp_vec3 to) {
    return palp_madd(from, share, palp_sub(to, from));
}

void palp_passivity_observe(palp_passivity *p, const palp_passivity_config *config, palp_vec3 d_m) {
    palp_vec3 force = held(p, config->delay);
    float given = palp_dot(blend(config->prompt, p->acting_N, force), d_m);
    p->acting_N = blend(1.0f - config->remains, p->acting_N, force);
    p->absorbed_J -= given;
    p->energy_J += SHARE * config->damping_Ns_per_m / config->dt_s * palp_dot(d_m, d_m) - given;
    p->before_m = p->moved_m;
    p->moved_m = d_m;
}

palp_vec3 palp_passivity_limit(palp_passivity *p, const palp_passivity_config *config,
                               palp_vec3 force_N, float stored_J, bool *braked) {
    p->energy_J = palp_min(p->energy_J, stored_J);
    bool idle = !(stored_J > 0.0f) && !(palp_norm(force_N) > 0.0f);
    p->idle_ticks = idle ? p->idle_ticks + 1u : 0u;
    if ((float)p->idle_ticks * config->dt_s > FORGIVE_S) p->energy_J = 0.0f;
    *braked = false;
    palp_vec3 d = palp_sub(palp_scale(2.0f, p->moved_m), p->before_m);
    float d2 = palp_dot(d, d);
    if (!(d2 > 1e-20f) || idle) return force_N;
    float swallowed = SHARE * config->damping_Ns_per_m / config->dt_s * d2;
    float have = p->energy_J + swallowed;
    palp_vec3 acting = p->acting_N;
    /* What is on its way will have acted before this force does. */
    for (uint32_t i = config->delay; i-- > 0u;) {
        have += swallowed - palp_dot(blend(config->prompt, acting, held(p, i)), d);
        acting = blend(1.0f - config->remains, acting, held(p, i));
    }
    float excess = palp_dot(blend(config->prompt, acting, force_N), d) - have;
    if (!(excess > 0.0f)) return force_N;
    *braked = true;
    float alpha = palp_min(excess / d2 * config->dt_s, config->damping_max_Ns_per_m);
    return palp_madd(force_N, -alpha / config->dt_s, d);
}

void palp_passivity_sent(palp_passivity *p, palp_vec3 force_N) {
    p->newest = (p->newest + 1u) % PALP_PASSIVITY_DELAYS;
    p->sent_N[p->newest] = force_N;
}
