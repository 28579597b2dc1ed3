/* SPDX-License-Identifier: MIT */
#include "passivity.h"

#define SHARE 0.5f          /* s */
#define FORGIVE_S 0.5f      /* without contact, after which what was given in excess is let go */
#define BEGINS 0.2f         /* of the largest deficit, at which the force begins to be taken away */
#define ENDS 0.7f           /* and at which it is gone */
#define CERTAINLY_M_S 0.01f /* along the force, from which a motion counts in full */
#define RISE_S 0.02f

palp_passivity_config palp_passivity_configure(uint32_t axes, float damping_Ns_per_m,
                                               uint32_t delay, float dt_s, float lag_s) {
    palp_passivity_config c = {.axes = axes,
                               .damping_Ns_per_m = damping_Ns_per_m,
                               .delay = delay,
                               .dt_s = dt_s,
                               .prompt = 1.0f,
                               .deficit_max_J = PALP_PASSIVITY_DEFICIT_J};
    if (!(lag_s > 0.0f)) return c;
    float x = dt_s / lag_s; /* the exponential to a few per cent */
    c.remains = 1.0f / (1.0f + x * (1.0f + x * (0.5f + x * (1.0f / 6.0f + x * (1.0f / 24.0f)))));
    c.prompt = 1.0f - lag_s / dt_s * (1.0f - c.remains);
    return c;
}

static uint32_t back(uint32_t from, uint32_t periods) {
    return (from + PALP_PASSIVITY_HISTORY - periods) % PALP_PASSIVITY_HISTORY;
}

static float blend(float share, float from, float to) { return from + share * (to - from); }

/* A period has passed in which nothing was sent anew. */
static void pass_period(palp_passivity *p, const palp_passivity_config *c) {
    const float *held = p->sent_Nm[back(p->newest, c->delay)];
    p->latest = (p->latest + 1u) % PALP_PASSIVITY_HISTORY;
    for (uint32_t i = 0; i < c->axes; i++) {
        p->mean_Nm[p->latest][i] = blend(c->prompt, p->acting_Nm[i], held[i]);
        p->acting_Nm[i] = blend(1.0f - c->remains, p->acting_Nm[i], held[i]);
    }
}

static float mean_Nm(const palp_passivity *p, uint32_t joint, uint32_t periods) {
    const uint32_t n = periods < PALP_PASSIVITY_HISTORY ? periods : PALP_PASSIVITY_HISTORY;
    float sum = 0.0f;
    for (uint32_t k = 0; k < n; k++) sum += p->mean_Nm[back(p->latest, k)][joint];
    return sum / (float)n;
}

/* What the motor of a joint has given since its last reading. */
static float given(palp_passivity *p, const palp_passivity_motion *m, uint32_t i) {
    const float turned = p->begun ? m->q_rad[i] - p->q_rad[i] : 0.0f;
    const float work = turned * mean_Nm(p, i, p->since[i]);
    p->q_rad[i] = m->q_rad[i];
    p->certain_rad_s[i] = m->certain_rad_s[i];
    p->since[i] = 0;
    return work;
}

void palp_passivity_observe(palp_passivity *p, const palp_passivity_config *config,
                            const palp_passivity_motion *motion) {
    const palp_passivity_config *c = config;
    const uint32_t more = motion->periods - 1u;
    if (!p->begun) p->gamma = 1.0f;
    pass_period(p, c);
    for (uint32_t k = 0; k < more && k < PALP_PASSIVITY_HISTORY; k++) {
        palp_passivity_sent(p, p->sent_Nm[p->newest]);
        pass_period(p, c);
    }
    bool all = true;
    float sum = 0.0f;
    for (uint32_t i = 0; i < c->axes; i++) {
        p->since[i] += motion->periods;
        if (motion->fresh[i]) sum += given(p, motion, i);
        all = all && motion->fresh[i];
    }
    p->unseen += motion->periods;
    p->idle += motion->periods;
    p->doubt_J = 0.0f;
    for (uint32_t i = 0; i < c->axes; i++) p->doubt_J += palp_abs(p->acting_Nm[i]) * c->step_rad[i];
    p->absorbed_J -= sum;
    p->energy_J -= sum;
    p->begun = true;
    if (!all) return;
    const palp_vec3 v = motion->certain_m_s;
    p->energy_J += SHARE * c->damping_Ns_per_m * palp_dot(v, v) * c->dt_s * (float)p->unseen;
    p->unseen = 0;
    p->before_m_s = p->velocity_m_s;
    p->velocity_m_s = v;
}

/* E once `force_N` has acted for a period while the tip goes with v. */
static float foreseen_J(const palp_passivity *p, const palp_passivity_config *c, palp_vec3 force_N,
                        palp_vec3 v) {
    const float damped = SHARE * c->damping_Ns_per_m * palp_dot(v, v) * c->dt_s;
    float sum = p->energy_J + damped * (float)(c->delay + 1u);
    for (uint32_t i = 0; i < c->axes; i++) {
        /* what is on its way will have acted before this force does */
        float acting = p->acting_Nm[i], on_its_way = 0.0f;
        for (uint32_t k = c->delay; k-- > 0u;) {
            const float held = p->sent_Nm[back(p->newest, k)][i];
            on_its_way += blend(c->prompt, acting, held);
            acting = blend(1.0f - c->remains, acting, held);
        }
        on_its_way += (1.0f - c->prompt) * acting;
        sum -= on_its_way * p->certain_rad_s[i] * c->dt_s;
    }
    return sum - c->prompt * palp_dot(force_N, v) * c->dt_s;
}

float palp_passivity_share(palp_passivity *p, const palp_passivity_config *config,
                           palp_vec3 force_N, float stored_J) {
    const palp_passivity_config *c = config;
    const float force = palp_norm(force_N);
    p->energy_J = palp_min(p->energy_J, stored_J);
    if (stored_J > 0.0f || force > 0.0f) p->idle = 0;
    if ((float)p->idle * c->dt_s > FORGIVE_S) p->energy_J = 0.0f;
    p->given_J = palp_max(p->given_J, -p->energy_J - p->doubt_J);
    /* the velocity of the period that comes, where it is sure not to have turned */
    palp_vec3 v = palp_sub(palp_scale(2.0f, p->velocity_m_s), p->before_m_s);
    if (!(palp_dot(v, p->velocity_m_s) > 0.0f)) v = (palp_vec3){0};
    const float along = force > 0.0f ? palp_dot(force_N, v) / force : 0.0f;
    const float allowed = c->deficit_max_J;
    const float deficit = -foreseen_J(p, c, force_N, v) - p->doubt_J;
    const float soft = palp_clamp((deficit / allowed - BEGINS) / (ENDS - BEGINS), 0.0f, 1.0f);
    const float wanted = 1.0f - soft * palp_clamp(along / CERTAINLY_M_S, 0.0f, 1.0f);
    p->gamma = palp_min(wanted, p->gamma + c->dt_s / RISE_S);
    return p->gamma;
}

bool palp_passivity_exceeded(const palp_passivity *p, const palp_passivity_config *config) {
    return -p->energy_J > config->deficit_max_J + p->doubt_J;
}

void palp_passivity_sent(palp_passivity *p, const float torque_Nm[PALP_AXES]) {
    p->newest = (p->newest + 1u) % PALP_PASSIVITY_HISTORY;
    for (uint32_t i = 0; i < PALP_AXES; i++) p->sent_Nm[p->newest][i] = torque_Nm[i];
}
