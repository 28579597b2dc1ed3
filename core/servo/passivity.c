/* SPDX-License-Identifier: MIT */
#include "passivity.h"

#define SHARE 0.5f /* s */
#define FORGIVE_S 0.5f
#define BEGINS 0.2f         /* of the largest deficit, at which gamma begins to fall */
#define ENDS 0.7f           /* and at which it is 0 */
#define CERTAINLY_M_S 0.01f /* along the force, from which a motion counts in full */
#define RISE_S 0.02f
#define CUT 0.4f        /* share of a fall of gamma that sigma follows for good */
#define LEAK 0.1f       /* of the largest deficit, that may leak */
#define LEAK_PER_E 0.1f /* of it, that lowers sigma by a factor of e */

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
    c.tail = lag_s / dt_s;
    c.prompt = 1.0f - c.tail * (1.0f - c.remains);
    return c;
}

static uint32_t back(uint32_t from, uint32_t periods) {
    return (from + PALP_PASSIVITY_HISTORY - periods) % PALP_PASSIVITY_HISTORY;
}

static float blend(float share, float from, float to) { return from + share * (to - from); }

static void push(palp_passivity *p, const float torque_Nm[PALP_AXES]) {
    p->newest = (p->newest + 1u) % PALP_PASSIVITY_HISTORY;
    for (uint32_t i = 0; i < PALP_AXES; i++) p->sent_Nm[p->newest][i] = torque_Nm[i];
}

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
    p->turned_rad[i] = turned;
    p->q_rad[i] = m->q_rad[i];
    p->before_rad_s[i] = p->certain_rad_s[i];
    p->certain_rad_s[i] = m->certain_rad_s[i];
    p->since[i] = 0;
    return work;
}

void palp_passivity_observe(palp_passivity *p, const palp_passivity_config *c,
                            const palp_passivity_motion *motion) {
    const uint32_t more = motion->periods - 1u;
    if (!p->begun) p->gamma = p->sigma = 1.0f;
    pass_period(p, c);
    for (uint32_t k = 0; k < more && k < PALP_PASSIVITY_HISTORY; k++) {
        push(p, p->sent_Nm[p->newest]);
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
    p->absorbed_J += motion->unfelt_J - sum;
    p->energy_J += motion->unfelt_J - sum;
    p->begun = true;
    p->counted = all && p->unseen == 1u;
    if (!all) return;
    const palp_vec3 v = motion->certain_m_s;
    const float swallowed =
        SHARE * c->damping_Ns_per_m * palp_dot(v, v) * c->dt_s * (float)p->unseen;
    p->energy_J += swallowed;
    p->worked_J = sum;
    p->swallowed_J = swallowed + p->damped_J;
    p->unseen = 0;
    p->before_m_s = p->velocity_m_s;
    p->velocity_m_s = v;
    p->turn_before_rad_s = p->turn_rad_s;
    p->turn_rad_s = motion->certain_turn_rad_s;
}

/* A velocity after so many periods of the same change. */
static float foreseen(float now, float before, uint32_t periods) {
    return now + (now - before) * (float)periods;
}

/* What the deficit will be once all that is on its way has acted. */
static float deficit_soon_J(const palp_passivity *p, const palp_passivity_config *c) {
    const palp_vec3 v = p->velocity_m_s;
    const float damped = SHARE * c->damping_Ns_per_m * palp_dot(v, v) * c->dt_s;
    float sum = p->energy_J + damped * (float)(c->delay + 1u);
    for (uint32_t i = 0; i < c->axes; i++) {
        const float now = p->certain_rad_s[i], before = p->before_rad_s[i];
        float impulse_rad = c->tail * p->acting_Nm[i] * foreseen(now, before, 1u);
        for (uint32_t k = 0; k < c->delay; k++)
            impulse_rad += p->sent_Nm[back(p->newest, k)][i] * foreseen(now, before, c->delay - k);
        sum -= impulse_rad * c->dt_s;
    }
    return -sum - p->doubt_J;
}

/* Gamma for a force, from what it will have done by the time it has acted. */
static float gamma_for(const palp_passivity *p, const palp_passivity_config *c,
                       const palp_wrench *w, float size) {
    if (!(size > 0.0f)) return 1.0f;
    const float now = palp_dot(w->force_N, p->velocity_m_s) + palp_dot(w->moment_Nm, p->turn_rad_s);
    const float before =
        palp_dot(w->force_N, p->before_m_s) + palp_dot(w->moment_Nm, p->turn_before_rad_s);
    const float along = foreseen(now / size, before / size, c->delay + 1u);
    const float gives = size * along * c->dt_s;
    if (!(gives > 0.0f)) return 1.0f;
    const float begins = BEGINS * c->deficit_max_J, ends = ENDS * c->deficit_max_J;
    const float soon = deficit_soon_J(p, c);
    const float over = palp_clamp((soon + gives - begins) / (ends - begins), 0.0f, 1.0f);
    const float soft = 1.0f - over * palp_clamp(along / CERTAINLY_M_S, 0.0f, 1.0f);
    return palp_min(soft, palp_clamp((ends - soon) / gives, 0.0f, 1.0f));
}

float palp_passivity_share(palp_passivity *p, const palp_passivity_config *c, const palp_wrench *w,
                           float stored_J, float damped_W, bool steady) {
    const float size = palp_norm(w->force_N); /* a moment comes with a force */
    p->energy_J = palp_min(p->energy_J, stored_J);
    p->counted = p->counted && steady;
    p->damped_J = damped_W * c->dt_s;
    if (!(size > 0.0f)) p->leak_J = 0.0f;
    if (stored_J > 0.0f || size > 0.0f) p->idle = 0;
    if ((float)p->idle * c->dt_s > FORGIVE_S) {
        p->energy_J = 0.0f;
        p->sigma = 1.0f;
    }
    p->given_J = palp_max(-p->energy_J - p->doubt_J, p->given_J);
    const float wanted = gamma_for(p, c, w, size);
    if (wanted < p->gamma) p->sigma *= 1.0f - CUT * (p->gamma - wanted);
    p->gamma = palp_min(wanted, p->gamma + c->dt_s / RISE_S);
    p->damped_J *= p->gamma * p->sigma;
    return p->gamma * p->sigma;
}

static float above(float a, float b) { return palp_max(a - b, 0.0f); }

void palp_passivity_bring(palp_passivity *p, float work_J) {
    if (palp_is_finite(work_J)) p->energy_J += work_J;
}

void palp_passivity_pass_on(palp_passivity *p, float stored_J, palp_passivity *other,
                            float other_stored_J) {
    const float spare =
        palp_min(above(p->energy_J, stored_J), above(other_stored_J, other->energy_J));
    const float missing = palp_min(above(0.0f, other->energy_J), above(p->energy_J, 0.0f));
    const float moved = palp_max(spare, missing);
    p->energy_J -= moved;
    other->energy_J += moved;
}

bool palp_passivity_exceeded(const palp_passivity *p, const palp_passivity_config *config) {
    return -p->energy_J > config->deficit_max_J + p->doubt_J;
}

/* Work of the motors in the last period beyond what the same force would have done continuously, by
 * the trapezoidal rule between the readings at its ends. */
static void lower_sigma(palp_passivity *p, const palp_passivity_config *c,
                        const float torque_Nm[PALP_AXES]) {
    const float *before = p->sent_Nm[p->newest];
    const float allowed = LEAK * c->deficit_max_J;
    float leak = p->worked_J - p->swallowed_J;
    for (uint32_t i = 0; i < c->axes; i++)
        leak -= 0.5f * (torque_Nm[i] + before[i]) * p->turned_rad[i];
    p->leak_J = palp_max(p->leak_J + leak, 0.0f);
    if (p->leak_J <= allowed) return;
    p->sigma /= 1.0f + (p->leak_J - allowed) / (LEAK_PER_E * c->deficit_max_J);
    p->leak_J = allowed;
}

void palp_passivity_sent(palp_passivity *p, const palp_passivity_config *config,
                         const float torque_Nm[PALP_AXES]) {
    if (config != NULL && p->counted) lower_sigma(p, config, torque_Nm);
    push(p, torque_Nm);
}
