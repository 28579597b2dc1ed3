/* SPDX-License-Identifier: MIT */
/*
 * The safety state machine. It never goes on by itself after it has taken the force away:
 *
 *   INIT          until every drive has been heard; no torque
 *   CONFIG_CHECK  drives are configured and read back, estimates must come in every period; no
 *                 torque
 *   HOMING        zero torque, until the operator says that the mechanism stands at its home pose;
 *                 only where drives do not know their zero (palp_device.homes)
 *   READY         zero torque, until the operator lets go of HOLD
 *   ENABLING      drives begin to act on torque, which is zero
 *   RUN           force, growing from zero in PALP_RAMP_S
 *   DAMPING       after sustained loss, repeated lateness, HOLD, or energy given to the hand: force
 *                 falls to zero in PALP_FADE_S, then only damping; until a reset (or, if so
 *                 configured and no fault is latched, until all is well for PALP_HEALTHY_S; then
 *                 RUN begins with its ramp)
 *   FAULT         latched: zero torque, drives idle; until a reset
 *   ESTOP         from any state while the operator's stop is pressed, then until a reset
 *
 * A reset goes back to INIT, and through HOMING again after a fault in which a drive may have lost
 * its zero: all but those of PALP_FAULTS_KEEP_HOME. This is software: it is no substitute for a
 * hardware stop.
 */
#ifndef PALP_SERVO_SAFETY_H
#define PALP_SERVO_SAFETY_H

#include "core/servo/axes.h"

typedef enum {
    PALP_STATE_INIT,
    PALP_STATE_CONFIG_CHECK,
    PALP_STATE_READY,
    PALP_STATE_ENABLING,
    PALP_STATE_RUN,
    PALP_STATE_DAMPING,
    PALP_STATE_FAULT,
    PALP_STATE_ESTOP,
    PALP_STATE_HOMING /* last, since logs hold these numbers */
} palp_state;
#define PALP_STATE_NAMES                                                                           \
    "INIT", "CONFIG_CHECK", "READY", "ENABLING", "RUN", "DAMPING", "FAULT", "ESTOP", "HOMING"

/* Whether it stays so until a reset. */
static inline bool palp_state_is_stopped(palp_state state) {
    return state == PALP_STATE_DAMPING || state == PALP_STATE_FAULT || state == PALP_STATE_ESTOP;
}

#define PALP_FAULT_DRIVE 1u      /* a drive reports an error or has left its loop */
#define PALP_FAULT_LOST 2u       /* no encoder value for PALP_LOST_S */
#define PALP_FAULT_INPUT 4u      /* several implausible encoder values in a row, or many */
#define PALP_FAULT_OUTPUT 8u     /* a force or torque was not finite */
#define PALP_FAULT_HEARTBEAT 16u /* heartbeat missing */
#define PALP_FAULT_BUS 32u       /* bus-off, dead link, or frames not taken */
#define PALP_FAULT_CONFIG 64u    /* a drive is not the one described, or estimates are too slow */
#define PALP_FAULT_ENABLE 128u   /* a drive did not begin to act on torque */
#define PALP_FAULT_FROZEN 256u   /* an encoder stands still under torque */
#define PALP_FAULT_ENERGY 512u   /* the hand was given energy; latched in DAMPING */
#define PALP_FAULT_NAMES                                                                           \
    "drive lost-encoder bad-input bad-output heartbeat bus config enable frozen-encoder "          \
    "energy-given" /* in the order of the bits */

#define PALP_FAULTS_KEEP_HOME (PALP_FAULT_OUTPUT | PALP_FAULT_ENERGY)

/* What enters a tick besides frames. */
#define PALP_EVENT_LATE 1u         /* began more than half a period late */
#define PALP_EVENT_BUS_OFF 2u      /* the controller has gone bus-off */
#define PALP_EVENT_BUS_FULL 4u     /* a frame was not taken: what is queued is old */
#define PALP_EVENT_BUS_DOWN 8u     /* the link is gone */
#define PALP_EVENT_BUS_WARNING 16u /* error-passive, or errors above the warning level */
#define PALP_EVENT_OVERFLOW 32u    /* received frames were dropped for want of room */
#define PALP_EVENT_ESTOP 64u       /* held while the operator's stop is pressed */
#define PALP_EVENT_RESET 128u      /* the operator lets it start again */
#define PALP_EVENT_HOLD 256u       /* held while the operator does not want force */
#define PALP_EVENT_HOME 512u       /* the mechanism stands at its home pose (in HOMING) */

#define PALP_RAMP_S 0.2f     /* from RUN to full force */
#define PALP_LATE_S 0.005f   /* encoder age beyond which DAMPING begins */
#define PALP_FADE_S 0.010f   /* from there to zero force */
#define PALP_LOST_S 0.024f   /* encoder age at which the fault latches */
#define PALP_CHECK_S 0.02f   /* estimates must come every period for so long */
#define PALP_PATIENCE_S 5.0f /* for configuring and enabling */
#define PALP_MEND_S 0.5f     /* for a drive's error to go when it is cleared */
#define PALP_HEALTHY_S 0.05f
#define PALP_SETTLE_S                                                                              \
    0.02f                  /* drives get this to act on the enable sequence before being believed */
#define PALP_FROZEN_S 0.5f /* half of it is counted, all of it is a fault */
#define PALP_BAD_IN_A_ROW 3u
#define PALP_BAD_OF_32 6u    /* of the last 32 readings of an axis */
#define PALP_HEARTBEATS 2.5f /* periods */
#define PALP_TARDY 3u        /* late ticks of the last 32 that are one too many */

typedef struct {
    palp_state state;
    uint32_t faults;        /* latched */
    uint32_t state_ticks;   /* since it was entered */
    uint32_t blind_ticks;   /* that the force has been without an estimate, or without a tick */
    uint32_t healthy_ticks; /* in a row, with an estimate of every axis */
    uint32_t tardy_history; /* bit per tick, newest lowest */
    float entry_gain;       /* of the force when DAMPING began */
    bool resume;            /* leave DAMPING without a reset */
    float dt_s;
    float heartbeat_s; /* longest good silence; 0: none to wait for */
} palp_safety;

void palp_safety_init(palp_safety *safety, float dt_s, float heartbeat_s, bool resume);

/* What a tick asks of the axes. */
typedef enum {
    PALP_SAFETY_NOTHING,
    PALP_SAFETY_PROBE,        /* drives anew (a reset) */
    PALP_SAFETY_PROBE_UNHOME, /* the same, and their zero is not known any more */
    PALP_SAFETY_HOME          /* they stand at the home pose */
} palp_safety_step;

/* One tick: events (PALP_EVENT_ bits) and the axes as they are after the frames were taken. */
palp_safety_step palp_safety_tick(palp_safety *safety, uint32_t events, uint32_t periods,
                                  const palp_axes_health *axes);

/* Latches faults found later in the tick. */
void palp_safety_latch(palp_safety *safety, uint32_t faults);

/* Share of the force that may be sent: 0 but in RUN and the beginning of DAMPING. */
float palp_safety_gain(const palp_safety *safety);

palp_drive_request palp_safety_request(palp_state state);

#endif
