/* SPDX-License-Identifier: MIT */
#include "joint.h"
#include "core/base/real.h"

#define AGE_LIMIT 0x3fffffffu
#define AT_STOP 4.0f    /* steps beyond a limit that are believed */
#define ZERO_REACH 4.0f /* steps within which an exact 0 may be true */

void palp_joint_age(palp_joint *joint, uint32_t periods) {
    uint32_t p = periods < AGE_LIMIT ? periods : AGE_LIMIT;
    joint->age = joint->age + p < AGE_LIMIT ? joint->age + p : AGE_LIMIT;
    joint->ticks += p;
}

static bool believable(const palp_joint *j, const palp_joint_limits *l, float q, float dt_s) {
    if (!palp_is_finite(q)) return false;
    const float stop = AT_STOP * l->step_rad; /* where it may rest and flicker */
    if (!(q >= l->min_rad - stop && q <= l->max_rad + stop)) return false;
    if (!j->known) return true;
    float elapsed = dt_s * (float)(j->age + 1u);
    float went = palp_abs(q - j->q_rad);
    if (went > l->speed_max_rad_s * elapsed + 2.0f * l->step_rad) return false;
    bool zero = !(palp_abs(q) > 0.0f);
    float near = 2.0f * palp_abs(j->dq_rad_s) * elapsed + ZERO_REACH * l->step_rad;
    return !zero || went <= near;
}

static uint32_t before(uint32_t at, uint32_t steps) {
    return (at + PALP_JOINT_WINDOW - steps) % PALP_JOINT_WINDOW;
}

/* Whether the line over the last `n` intervals passes all samples between within a step. */
static bool line_fits(const palp_joint *j, uint32_t n, float slope, float step) {
    for (uint32_t i = 1; i < n; i++) {
        uint32_t at = before(j->newest, i);
        float line = j->sample_rad[j->newest] -
                     slope * (float)(j->sample_tick[j->newest] - j->sample_tick[at]);
        if (palp_abs(line - j->sample_rad[at]) > step) return false;
    }
    return true;
}

/* Per tick. */
static float windowed_slope(const palp_joint *j, float step) {
    float slope = 0.0f;
    for (uint32_t n = 1; n < j->samples; n++) {
        uint32_t at = before(j->newest, n);
        uint32_t span = j->sample_tick[j->newest] - j->sample_tick[at];
        float candidate = (j->sample_rad[j->newest] - j->sample_rad[at]) / (float)span;
        if (!line_fits(j, n, candidate, step)) break;
        slope = candidate;
    }
    return slope;
}

bool palp_joint_take(palp_joint *joint, const palp_joint_limits *limits, float q_rad, float dt_s) {
    palp_joint *j = joint;
    if (!believable(j, limits, q_rad, dt_s)) {
        j->bad_in_a_row++;
        j->bad_history = j->bad_history << 1u | 1u;
        return false;
    }
    bool again = j->samples > 0u && j->sample_tick[j->newest] == j->ticks;
    if (!again) {
        j->newest = (j->newest + 1u) % PALP_JOINT_WINDOW;
        if (j->samples < PALP_JOINT_WINDOW) j->samples++;
    }
    j->sample_rad[j->newest] = q_rad;
    j->sample_tick[j->newest] = j->ticks;
    j->q_rad = q_rad;
    j->age = 0;
    j->bad_in_a_row = 0;
    j->bad_history <<= 1u;
    j->known = true;
    return true;
}

void palp_joint_velocity(palp_joint *joint, const palp_joint_limits *limits, float dt_s) {
    joint->dq_rad_s = windowed_slope(joint, limits->step_rad) / dt_s;
}
