/* SPDX-License-Identifier: MIT */
/*
 * One servo tick, straight through: frames -> joint angles -> tool pose -> contact set -> contact
 * forces -> force -> limits -> joint torques -> frames.
 *
 * The tick does not fail. It clamps, counts and reports; faults latch and take the force to zero
 * (safety.h). All that it depends on comes in through palp_tick_input and the port's clock, so that
 * whoever records both can repeat it bit for bit.
 */
#ifndef PALP_SERVO_SERVO_H
#define PALP_SERVO_SERVO_H

#include "core/green/field.h"
#include "core/servo/bounded.h"
#include "core/servo/output.h"
#include "core/servo/safety.h"

/* Where the body is felt: x_model = origin + scale R x_device, R row-major and orthonormal. */
typedef struct {
    palp_vec3 origin_m;
    float rotation[9];
    float scale;
} palp_placement;

typedef struct {
    palp_device device; /* its drives.rate_hz is the rate of the ticks */
    palp_placement placement;
    palp_node_contact_limits limits;
    palp_cost_table cost;
    palp_port port;
    palp_tool tool; /* in the model */
    bool resume;    /* leave DAMPING without a reset when all is well again */
    /* For studies; 0 and false: as palp_device_coupling and the device say, and guarded. */
    float coupling_N_per_m, coupling_Ns_per_m; /* used when the first is above 0 */
    bool unguarded;                            /* without the passivity controller */
} palp_servo_config;

typedef struct {
    const palp_can_frame *frames; /* received since the last tick, oldest first */
    uint32_t count;
    uint32_t skipped; /* whole periods that the caller let pass without a tick before this one */
    uint32_t events;  /* PALP_EVENT_ bits */
    float feedforward_Nm[PALP_AXES]; /* motor torques of the integrator's own compensation */
} palp_tick_input;

typedef struct {
    uint64_t tick;
    palp_state state;
    uint32_t faults;       /* PALP_FAULT_ bits, latched */
    uint32_t level, outer; /* constraint levels of the answer, under the tool and around it */
    uint32_t aborted;      /* rungs of the ladder given up in this tick */
    uint32_t contact_flags, pivots, candidates, active, admitted, deferred;
    float bound_ns, elapsed_ns;
    float joint_rad[PALP_AXES], joint_rad_s[PALP_AXES];
    palp_vec3 tip_m, tip_velocity_m_s; /* device */
    palp_vec3 tool_m;                  /* model */
    palp_vec3 force_N;                 /* at the tip, as sent */
    float motor_torque_Nm[PALP_AXES];
    float stored_J;    /* contact and coupling, in device units */
    float absorbed_J;  /* net energy that the hand has put in since RUN */
    float unsettled_m; /* last move of the tool in its settling (model) */
    bool shortened, slipping, braked;
} palp_report;

typedef struct palp_servo palp_servo;

/* Stack that any call of this library takes at most (make size prints what the compilers report).
 */
#define PALP_SERVO_STACK 4096u

/* Memory for a servo on this blob; 0 if the limits are unsound. */
size_t palp_servo_memsize(const palp_blob *blob, palp_node_contact_limits limits);

/*
 * Opens a servo in `memory` (64-byte aligned, owned by the caller). Errors: LIMITS, ARGUMENT,
 * MEMORY, ALIGNMENT, and BUDGET when the least answer of the coarsest constraint level does not fit
 * the period; *bound_ns (may be NULL) then says how much time it needs.
 */
palp_status palp_servo_open(palp_servo **servo, const palp_blob *blob,
                            const palp_servo_config *config, void *memory, size_t bytes,
                            float *bound_ns);

/*
 * One tick: writes at most PALP_SERVO_FRAMES_OUT frames to `out`, returns how many. Cost at most
 * the bound that open checked, for up to 64 frames in.
 */
uint32_t palp_servo_tick(palp_servo *servo, const palp_tick_input *input, palp_can_frame *out,
                         palp_report *report);

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
