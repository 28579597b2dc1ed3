/* SPDX-License-Identifier: MIT */
/*
 * One servo tick, straight through: frames -> joint angles -> tool pose -> contact points ->
 * contact forces -> force -> limits -> joint torques -> frames.
 *
 * The tick does not fail. It clamps, counts and reports; faults latch and take the force to zero
 * (safety.h). All that it depends on comes in through palp_tick_input and the port's clock, so that
 * whoever records both can repeat it bit for bit.
 */
#ifndef PALP_SERVO_SERVO_H
#define PALP_SERVO_SERVO_H

#include "core/contact/loads.h"
#include "core/servo/answer.h"
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
    uint32_t finest; /* level of contact, below PALP_CONTACT_LEVELS */
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
    uint32_t count;   /* of the first ones beyond PALP_SERVO_FRAMES_IN nothing is read */
    uint32_t skipped; /* whole periods that the caller let pass without a tick before this one */
    uint32_t events;  /* PALP_EVENT_ bits */
    float feedforward_Nm[PALP_AXES]; /* motor torques of the integrator's own compensation */
} palp_tick_input;

typedef struct {
    uint64_t tick;
    palp_state state;
    uint32_t faults;         /* PALP_FAULT_ bits, latched */
    uint32_t level, limit;   /* of the contact; the finest that always fits the period */
    uint32_t points, active; /* contact points; those of them in contact */
    uint32_t iterations;     /* of the active set */
    uint32_t contact_flags;  /* PALP_CONTACT_ flags */
    float bound_ns,
        elapsed_ns; /* of the whole tick: all that the limit level allows; by the clock */
    float joint_rad[PALP_AXES], joint_rad_s[PALP_AXES];
    palp_vec3 tip_m, tip_velocity_m_s; /* device */
    palp_vec3 tool_m;                  /* model */
    palp_vec3 force_N;                 /* at the tip, as sent */
    float motor_torque_Nm[PALP_AXES];
    float stored_J;     /* contact and coupling, in device units */
    float absorbed_J;   /* net energy that the hand has put in since RUN */
    float given_J;      /* most energy that it was given beyond that (passivity.h) since RUN */
    float doubt_N;      /* by how much the force may be off (answer.h); device units */
    float unforeseen_m; /* how far the tool came to rest from where it was foreseen (model) */
    bool held;      /* went on as foreseen: no time for a contact, none found, or none settled */
    bool shortened; /* did less than it would have with more time */
    bool slipping, braked;
} palp_report;

typedef struct palp_servo palp_servo;

/* Stack that any call of this library takes at most (make size prints what the compilers report).
 */
#define PALP_SERVO_STACK 4096u

/* Frames that a tick takes in at most: what its bound is for. */
#define PALP_SERVO_FRAMES_IN 64u

/* Loads that palp_servo_loads makes at most. */
#define PALP_SERVO_LOADS 192u

/* Memory for a servo on this blob; 0 if it has no regular part or `finest` is no level. */
size_t palp_servo_memsize(const palp_blob *blob, uint32_t finest);

/*
 * Opens a servo in `memory` (64-byte aligned, owned by the caller). Errors: ABSENT
 * (the blob has no regular part: bake it again), LIMITS (finest), ARGUMENT, MEMORY, ALIGNMENT, and
 * BUDGET when the coarsest level does not fit the period; *bound_ns (may be NULL) then says how
 * much time it needs.
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

/* What a tick takes at most before its answer (SERVO / 2 + 64 FRAME), and after it (SERVO / 2), in
 * the unit of the prices. */
float palp_servo_cost_before(const palp_prices *price);
float palp_servo_cost_after(const palp_prices *price);

const palp_counters *palp_servo_counters(const palp_servo *servo);
/* For the display path: the forces of the last tick on the body, in load[PALP_SERVO_LOADS]; returns
 * how many. */
uint32_t palp_servo_loads(const palp_servo *servo, palp_load *load);

#endif
