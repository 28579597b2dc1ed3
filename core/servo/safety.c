/* SPDX-License-Identifier: MIT */
#include "safety.h"

#define TICKS_LIMIT 0x3fffffffu

void palp_safety_init(palp_safety *safety, float dt_s, float heartbeat_s, bool resume) {
    *safety = (palp_safety){.dt_s = dt_s, .heartbeat_s = heartbeat_s, .resume = resume};
}

static void enter(palp_safety *s, palp_state state) {
    if (state == PALP_STATE_DAMPING) s->entry_gain = palp_safety_gain(s);
    s->state = state;
    s->state_ticks = 0;
}

static bool force_is_on(palp_state state) {
    return state == PALP_STATE_RUN || state == PALP_STATE_DAMPING;
}

static float seconds(const palp_safety *s, uint32_t ticks) { return (float)ticks * s->dt_s; }

static bool repeatedly_late(const palp_safety *s) {
    return palp_bits(s->tardy_history) >= PALP_TARDY;
}

/* What is a fault in any state. A full queue before any drive has been heard is not a fault. */
static uint32_t bus_faults(const palp_safety *s, uint32_t events) {
    uint32_t bad = PALP_EVENT_BUS_OFF | PALP_EVENT_BUS_DOWN;
    if (s->state != PALP_STATE_INIT) bad |= PALP_EVENT_BUS_FULL;
    return (events & bad) != 0u ? PALP_FAULT_BUS : 0u;
}

static uint32_t run_faults(const palp_safety *s, const palp_axes_health *a) {
    uint32_t faults = 0;
    if (!a->healthy || !a->enabled || !a->configured) faults |= PALP_FAULT_DRIVE;
    if (s->heartbeat_s > 0.0f && seconds(s, a->status_age) > PALP_HEARTBEATS * s->heartbeat_s)
        faults |= PALP_FAULT_HEARTBEAT;
    if (seconds(s, s->blind_ticks) >= PALP_LOST_S) faults |= PALP_FAULT_LOST;
    if (a->bad_in_a_row >= PALP_BAD_IN_A_ROW || a->bad_of_32 >= PALP_BAD_OF_32)
        faults |= PALP_FAULT_INPUT;
    if (seconds(s, a->frozen) >= PALP_FROZEN_S) faults |= PALP_FAULT_FROZEN;
    return faults;
}

static void before_run(palp_safety *s, uint32_t events, const palp_axes_health *a) {
    bool steady = seconds(s, s->healthy_ticks) >= PALP_CHECK_S;
    bool impatient = seconds(s, s->state_ticks) > PALP_PATIENCE_S;
    /* Drives may be found in any state: only answers younger than the enable sequence count.
     */
    uint32_t settle = (uint32_t)(PALP_SETTLE_S / s->dt_s);
    bool acting = a->enabled && a->healthy && a->status_age + settle < s->state_ticks;
    switch (s->state) {
    case PALP_STATE_INIT:
        if (a->heard) enter(s, PALP_STATE_CONFIG_CHECK);
        break;
    case PALP_STATE_CONFIG_CHECK:
        if (a->configured && steady)
            enter(s, a->homed ? PALP_STATE_READY : PALP_STATE_HOMING);
        else if (a->misconfigured || impatient)
            s->faults |= PALP_FAULT_CONFIG;
        break;
    case PALP_STATE_HOMING:
        if (!a->configured || a->homed) enter(s, PALP_STATE_CONFIG_CHECK);
        break;
    case PALP_STATE_READY:
        if (!a->configured)
            enter(s, PALP_STATE_CONFIG_CHECK);
        else if (steady && (events & PALP_EVENT_HOLD) == 0u)
            enter(s, PALP_STATE_ENABLING);
        break;
    case PALP_STATE_ENABLING:
        if (acting && s->healthy_ticks > 0u)
            enter(s, PALP_STATE_RUN);
        else if (impatient || (!a->healthy && seconds(s, s->state_ticks) > PALP_MEND_S))
            s->faults |= PALP_FAULT_ENABLE; /* an error that one clearing does not mend */
        break;
    default:
        break;
    }
}

palp_safety_step palp_safety_tick(palp_safety *s, uint32_t events, uint32_t periods,
                                  const palp_axes_health *axes) {
    bool reset = (events & PALP_EVENT_RESET) != 0u && (events & PALP_EVENT_ESTOP) == 0u &&
                 palp_state_is_stopped(s->state);
    if (s->state_ticks < TICKS_LIMIT) s->state_ticks += periods;
    /* A skipped tick counts as a missed estimate. */
    s->blind_ticks = axes->age > periods - 1u ? axes->age : periods - 1u;
    s->healthy_ticks = axes->age == 0u && periods == 1u ? s->healthy_ticks + 1u : 0u;
    s->tardy_history = (periods > 31u ? 0u : s->tardy_history << periods) |
                       ((events & PALP_EVENT_LATE) != 0u || periods > 1u ? 1u : 0u);
    if (reset) {
        const bool lost = (s->faults & ~PALP_FAULTS_KEEP_HOME) != 0u;
        s->faults = 0;
        s->tardy_history = 0;
        enter(s, PALP_STATE_INIT);
        return lost ? PALP_SAFETY_PROBE_UNHOME : PALP_SAFETY_PROBE;
    }
    if ((events & PALP_EVENT_ESTOP) != 0u) {
        if (s->state != PALP_STATE_ESTOP) enter(s, PALP_STATE_ESTOP);
        return PALP_SAFETY_NOTHING;
    }
    s->faults |= bus_faults(s, events);
    if (s->faults == 0u) before_run(s, events, axes);
    if (force_is_on(s->state)) s->faults |= run_faults(s, axes);
    if (s->state == PALP_STATE_RUN && s->faults == 0u &&
        (seconds(s, s->blind_ticks) > PALP_LATE_S + 0.5f * s->dt_s || repeatedly_late(s) ||
         (events & PALP_EVENT_HOLD) != 0u))
        enter(s, PALP_STATE_DAMPING);
    if (s->state == PALP_STATE_DAMPING && s->resume && (events & PALP_EVENT_HOLD) == 0u &&
        s->faults == 0u && s->tardy_history == 0u && seconds(s, s->healthy_ticks) >= PALP_HEALTHY_S)
        enter(s, PALP_STATE_RUN);
    palp_safety_latch(s, 0u);
    const bool home = s->state == PALP_STATE_HOMING && (events & PALP_EVENT_HOME) != 0u &&
                      axes->age == 0u && s->faults == 0u;
    return home ? PALP_SAFETY_HOME : PALP_SAFETY_NOTHING;
}

void palp_safety_latch(palp_safety *safety, uint32_t faults) {
    safety->faults |= faults;
    const bool stopped = safety->state == PALP_STATE_FAULT || safety->state == PALP_STATE_ESTOP;
    const bool worse = (safety->faults & ~PALP_FAULT_ENERGY) != 0u;
    if (worse && !stopped) enter(safety, PALP_STATE_FAULT);
    if (safety->faults != 0u && safety->state == PALP_STATE_RUN) enter(safety, PALP_STATE_DAMPING);
}

float palp_safety_gain(const palp_safety *safety) {
    float t = seconds(safety, safety->state_ticks);
    if (safety->state == PALP_STATE_RUN) return palp_min(t / PALP_RAMP_S, 1.0f);
    if (safety->state != PALP_STATE_DAMPING) return 0.0f;
    return safety->entry_gain * palp_max(1.0f - t / PALP_FADE_S, 0.0f);
}

palp_drive_request palp_safety_request(palp_state state) {
    switch (state) {
    case PALP_STATE_INIT:
        return PALP_REQUEST_PROBE;
    case PALP_STATE_CONFIG_CHECK:
        return PALP_REQUEST_CONFIGURE;
    case PALP_STATE_HOMING:
    case PALP_STATE_READY:
        return PALP_REQUEST_IDLE;
    case PALP_STATE_ENABLING:
        return PALP_REQUEST_ENABLE;
    case PALP_STATE_RUN:
    case PALP_STATE_DAMPING:
        return PALP_REQUEST_TORQUE;
    case PALP_STATE_FAULT:
    case PALP_STATE_ESTOP:
        break;
    }
    return PALP_REQUEST_IDLE;
}
