/* SPDX-License-Identifier: MIT */
/*
 * One servo tick, straight through: frames -> joint angles -> tool pose -> contact set -> contact
 * forces -> force -> limits -> joint torques -> frames.
 *
 * The tick does not fail. It clamps, counts and reports; faults latch and take the force to zero.
 */
#ifndef PALP_SERVO_SERVO_H
#define PALP_SERVO_SERVO_H

#include "core/device/canframe.h"
#include "core/green/field.h"
#include "core/servo/bounded.h"
#include "core/servo/output.h"

/* Where the body is felt: x_model = origin + scale R x_device, R row-major and orthonormal. */
typedef struct {
    palp_vec3 origin_m;
    float rotation[9];
    float scale;
} palp_placement;

typedef struct {
    palp_device device;
    palp_placement placement;
    palp_contact_limits limits;
    palp_cost_table cost;
    palp_port port;
    float rate_hz;
    palp_tool tool; /* in the model */
} palp_servo_config;

typedef enum {
    PALP_STATE_INIT,     /* waiting for the drives' heartbeats; no torque */
    PALP_STATE_ENABLING, /* closing the drives' loops; no torque */
    PALP_STATE_RUN,
    PALP_STATE_FAULT /* latched; zero torque, drives sent to idle */
} palp_state;

#define PALP_FAULT_DRIVE 1u      /* a drive reports an error or left its loop */
#define PALP_FAULT_LOST 2u       /* no encoder value for PALP_LOST_S */
#define PALP_FAULT_INPUT 4u      /* several implausible encoder values in a row */
#define PALP_FAULT_OUTPUT 8u     /* a force or torque was not finite */
#define PALP_FAULT_HEARTBEAT 16u /* heartbeat missing */
#define PALP_FAULT_BUS 32u       /* bus-off or dead link, reported by the port */
#define PALP_FAULT_NAMES                                                                           \
    "drive lost-encoder bad-input bad-output heartbeat bus" /* in the order of the bits */

#define PALP_LATE_S 0.004f /* encoder age at which the force starts to fade */
#define PALP_LOST_S 0.024f /* age at which the fault latches; the force is zero by then */
#define PALP_HEARTBEAT_S 0.25f
#define PALP_SETTLE_S                                                                              \
    0.02f /* drives get this long to act on the enable sequence before they are believed */
#define PALP_RAMP_S 0.2f /* from enable to full force */
#define PALP_BAD_IN_A_ROW 3u
#define PALP_SERVO_FRAMES_OUT 12u

/* Totals since the start; they never go down. */
typedef struct {
    uint64_t ticks, accepted, rejected, repeated, late, implausible;
    uint64_t shortened; /* ticks that did less than the limits allow because time ran out */
    uint64_t limited, overruns;
    uint64_t dropped, climbed; /* changes of the constraint level */
    uint64_t skipped;          /* periods in which the caller did not tick */
} palp_counters;

typedef struct {
    uint64_t tick;
    palp_state state;
    uint32_t faults;       /* PALP_FAULT_ bits, latched */
    uint32_t level, outer; /* constraint levels of the answer, under the tool and around it */
    uint32_t aborted;      /* rungs of the ladder given up in this tick */
    uint32_t contact_flags, pivots, candidates, active, admitted, deferred;
    float bound_ns, elapsed_ns;
    float joint_rad[PALP_AXES];
    palp_vec3 tip_m, tip_velocity_m_s; /* device */
    palp_vec3 tool_m;                  /* model */
    palp_vec3 force_N;                 /* at the tip, as sent */
    float motor_torque_Nm[PALP_AXES];
    float stored_J;    /* contact and coupling, in device units */
    float absorbed_J;  /* net energy that the hand has put in since RUN */
    float unsettled_m; /* last move of the tool in its settling (model) */
    bool shortened, slipping;
} palp_report;

typedef struct palp_servo palp_servo;

/* Memory for a servo on this blob; 0 if the limits are unsound. */
size_t palp_servo_memsize(const palp_blob *blob, palp_contact_limits limits);

/*
 * Opens a servo in `memory` (64-byte aligned, owned by the caller). Errors: LIMITS, ARGUMENT,
 * MEMORY, ALIGNMENT, and BUDGET when the least answer of the coarsest constraint level does not fit
 * the period; *bound_ns (may be NULL) then says how much time it needs.
 */
palp_status palp_servo_open(palp_servo **servo, const palp_blob *blob,
                            const palp_servo_config *config, void *memory, size_t bytes,
                            float *bound_ns);

/*
 * Before a tick that comes `periods` periods late: everything ages by them, so that what was not
 * heard meanwhile fades the force and faults as it would have. Counted.
 */
void palp_servo_skip(palp_servo *servo, uint32_t periods);

/* Latches PALP_FAULT_BUS: the port has seen bus-off or lost the link. The next tick sends zero
 * torque. */
void palp_servo_bus_failed(palp_servo *servo);

/*
 * One tick: takes the frames received since the last one, writes at most PALP_SERVO_FRAMES_OUT
 * frames to `out`, returns how many. Cost at most the bound that open checked.
 */
uint32_t palp_servo_tick(palp_servo *servo, const palp_can_frame *in, uint32_t in_count,
                         palp_can_frame *out, palp_report *report);

/*
 * Work for the time left after the frames are sent: prepares and takes over a finer constraint
 * level when there is room for one. Looks at the clock before each step and returns in time.
 * Without it the level comes back only when the tool lets go.
 */
void palp_servo_spare(palp_servo *servo);

const palp_counters *palp_servo_counters(const palp_servo *servo);
/* For the display path: the forces of the last tick on the body, in load[max_active]; returns how
 * many. */
uint32_t palp_servo_loads(const palp_servo *servo, palp_load *load);

#endif
