/* SPDX-License-Identifier: MIT */
/*
 * The scene (scene.h) with one elastostatic body, one tool and one device, which most need: frames ->
 * joint angles -> tool pose -> contact points -> contact forces -> force -> limits -> joint torques ->
 * frames.
 *
 * The tick does not fail. It clamps, counts and reports; faults latch and take the force to zero
 * (safety.h). All that it depends on comes in through palp_tick_input and the port's clock, so that
 * whoever records both can repeat it bit for bit.
 */
#ifndef PALP_SERVO_SERVO_H
#define PALP_SERVO_SERVO_H

#include "core/servo/report.h"

/* Kept by value; what it points to stays with the caller. */
typedef struct {
    palp_device device; /* as palp_device_is_sound; its drives.rate_hz, 49 to 20,001, is the rate of
                           the ticks */
    palp_placement placement;
    uint32_t finest;      /* level of contact, 0 to PALP_CONTACT_LEVELS - 1 */
    palp_cost_table cost; /* of the processor that ticks: palp calibrate measures it */
    palp_port port;       /* its clock is read at most once for each step of a tick */
    palp_tool tool;       /* as palp_tool_is_sound, in model lengths */
    bool resume;          /* leave DAMPING without a reset when all is well again */
    /* For studies; 0 and false: as palp_device_coupling and the device say, and guarded. */
    float coupling_N_per_m, coupling_Ns_per_m; /* at the device, used when the first is above 0 */
    bool unguarded;                            /* without the passivity controller */
} palp_servo_config;

typedef struct palp_servo palp_servo;

/* Stack that any call of this library takes at most, besides the port's clock (make size prints
 * what the compilers report). */
#define PALP_SERVO_STACK 6144u

/* Bytes for a servo: on any blob, as a constant for static memory; and on this blob, 0 if it has no
 * regular part or `finest` is no level. */
#define PALP_SERVO_OBJECT 30720u
#define PALP_SERVO_BYTES(finest) (PALP_SERVO_OBJECT + PALP_CONTACT_BYTES(1u, finest))
size_t palp_servo_memsize(const palp_blob *blob, uint32_t finest);

/*
 * Opens a servo in `memory`, which is then the servo; it holds `blob` and cost.target by reference.
 * It begins in PALP_STATE_INIT. Errors: ABSENT (the blob has no regular part: bake it again),
 * LIMITS (finest), ARGUMENT (anything else in the config out of its range), MEMORY, ALIGNMENT, and
 * BUDGET when the coarsest level does not fit the period: *bound_ns (may be NULL) then says how
 * much time it needs.
 */
palp_status palp_servo_open(palp_servo **servo, const palp_blob *blob,
                            const palp_servo_config *config, void *memory, size_t bytes,
                            float *bound_ns);

/*
 * One tick, once a period; writes at most PALP_SERVO_FRAMES_OUT frames to `out`, to be sent at once
 * and in this order, and returns how many. The first ticks probe and configure the drives
 * (safety.h). Cost: at most report->bound_ns, for up to PALP_SERVO_FRAMES_IN frames in.
 */
uint32_t palp_servo_tick(palp_servo *servo, const palp_tick_input *input, palp_can_frame *out,
                         palp_report *report);

/* Totals since the servo was opened; the pointer holds as long as the servo. Constant time. */
const palp_counters *palp_servo_counters(const palp_servo *servo);

/* What keeps the drive of an axis from working; NONE for an axis that is not there. Constant time,
 * outside the bound of a tick. */
palp_drive_trouble palp_servo_trouble(const palp_servo *servo, uint32_t axis);

/* For the display path: the forces of the last tick on the body, in load[PALP_SERVO_LOADS]; returns
 * how many. */
uint32_t palp_servo_loads(const palp_servo *servo, palp_load *load);

#endif
