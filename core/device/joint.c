/* SPDX-License-Identifier: MIT */
#include "joint.h"
#include "core/base/real.h"

#define AGE_LIMIT 0x3fffffffu
#define FORGET                                                                                     \
    0x100000u           /* periods after which older readings tell no velocity; times the window   \
                          within 32 bits */
#define AT_STOP 4.0f    /* steps beyond a limit that are believed */
#define ZERO_REACH 4.0f /* steps within which an exact 0 may be true */

void palp_joint_age(palp_joint *j, uint32_t periods, float dt_s) {
    const uint32_t p = periods < AGE_LIMIT ? periods : AGE_LIMIT;
    const uint32_t foreseen = j->age + p < PALP_JOINT_FORESEEN ? j->age + p : PALP_JOINT_FORESEEN;
    j->expected_rad = j->q_rad + j->shift_rad + j->dq_rad_s * dt_s * (float)foreseen;
    j->missed = j->age + p - 1u;
    j->age = j->age + p < AGE_LIMIT ? j->age + p : AGE_LIMIT;
    j->ticks += p;
    if (j->age >= FORGET) j->samples = 0;
}

static bool believable(const palp_joint *j, const palp_joint_limits *l, float q, float dt_s) {
    if (!palp_is_finite(q)) return false;
    const float stop = AT_STOP * l->step_rad; /* where it may rest and flicker */
    if (!(q >= l->min_rad - stop && q <= l->max_rad + stop)) return false;
    if (!j->known) return true;
    float elapsed = dt_s * (float)(j->age + 1u);
    float went = palp_abs(q - j->q_rad);
    if (went > l->speed_max_rad_s * elapsed + 2.0f * l->step_rad) return false;
    bool zero = !(palp_abs(q - l->zero_rad) > 0.0f);
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

/* Per tick; *span: ticks that the line goes over. */
static float windowed_slope(const palp_joint *j, float step, uint32_t *span) {
    float slope = 0.0f;
    for (uint32_t n = 1; n < j->samples; n++) {
        uint32_t at = before(j->newest, n);
        const uint32_t ticks = j->sample_tick[j->newest] - j->sample_tick[at];
        const float candidate = (j->sample_rad[j->newest] - j->sample_rad[at]) / (float)ticks;
        if (!line_fits(j, n, candidate, step)) break;
        slope = candidate;
        *span = ticks;
    }
    return slope;
}

/* Whether a reading is that of an earlier tick: it stands still while the joint moves, or is
 * farther from where the joint was expected than another of this tick. */
static bool is_stale(const palp_joint *j, const palp_joint_limits *l, float q, float dt_s) {
    if (!j->known) return false;
    if (j->age == 0u) return palp_abs(q - j->expected_rad) > palp_abs(j->q_rad - j->expected_rad);
    const float moved = palp_abs(j->certain_rad_s) * dt_s * (float)j->age;
    return palp_same_bits(q, j->q_rad) && moved > PALP_JOINT_STALE * l->step_rad &&
           (float)j->age * dt_s < PALP_JOINT_REPEATS_S;
}

palp_reading palp_joint_take(palp_joint *j, const palp_joint_limits *limits, float q_rad,
                             float dt_s) {
    if (!believable(j, limits, q_rad, dt_s)) {
        j->bad_in_a_row++;
        j->bad_history = j->bad_history << 1u | 1u;
        return PALP_READING_BAD;
    }
    if (is_stale(j, limits, q_rad, dt_s)) return PALP_READING_STALE;
    const bool again = j->samples > 0u && j->sample_tick[j->newest] == j->ticks;
    if (!again) {
        j->newest = (j->newest + 1u) % PALP_JOINT_WINDOW;
        if (j->samples < PALP_JOINT_WINDOW) j->samples++;
    }
    j->sample_rad[j->newest] = q_rad;
    j->sample_tick[j->newest] = j->ticks;
    if (!j->known) j->expected_rad = q_rad;
    j->q_rad = q_rad;
    j->age = 0;
    j->bad_in_a_row = 0;
    j->bad_history <<= 1u;
    j->known = true;
    return PALP_READING_TAKEN;
}

void palp_joint_update_belief(palp_joint *j, const palp_joint_limits *limits) {
    if (j->age > 0u) {
        j->believed_rad = palp_clamp(j->expected_rad, limits->min_rad, limits->max_rad);
        return;
    }
    if (j->missed > 0u && j->samples > 1u) {
        j->shift_rad = j->expected_rad - j->q_rad;
        j->approach_rad = palp_abs(j->shift_rad) / (float)(j->missed + 1u);
    }
    j->shift_rad -= palp_clamp(j->shift_rad, -j->approach_rad, j->approach_rad);
    j->believed_rad = j->q_rad + j->shift_rad;
}

void palp_joint_velocity(palp_joint *j, const palp_joint_limits *limits, float dt_s) {
    uint32_t span = 1;
    j->dq_rad_s = windowed_slope(j, limits->step_rad, &span) / dt_s;
    const float doubt = limits->step_rad / (dt_s * (float)span);
    j->certain_rad_s = j->dq_rad_s - palp_clamp(j->dq_rad_s, -doubt, doubt);
}
