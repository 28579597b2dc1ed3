/* SPDX-License-Identifier: MIT */
/* The device's axes: frames in, believed joint angles out; torques in, frames out. */
#ifndef PALP_SERVO_AXES_H
#define PALP_SERVO_AXES_H

#include "core/device/device.h"
#include "core/device/joint.h"
#include "core/servo/counters.h"

typedef struct {
    palp_drive drive[PALP_AXES];
    palp_joint joint[PALP_AXES];
    palp_joint_limits limits[PALP_AXES];
    float contact_torque_Nm[PALP_AXES]; /* motor torques of the contact alone, of the last tick */
    float zero_rad[PALP_AXES];          /* angle of a joint where its drive reads 0 */
    uint32_t count, motors;             /* joints; bit i: joint i has a motor */
    bool homed; /* it is known; else joints count from 0, and no reading is out of limits */
    bool fine;  /* encoders see a hand's tremor, so that one that stands still is broken */
} palp_device_axes;

/* What the safety state machine wants to know about all axes together. */
typedef struct {
    bool heard, configured, misconfigured, homed;
    bool healthy;        /* no drive reports an error */
    bool enabled;        /* all that have motors act on torque */
    uint32_t status_age; /* ticks, of the drive that was silent longest */
    uint32_t age;        /* ticks, of the oldest joint angle */
    uint32_t bad_in_a_row, bad_of_32, frozen;
} palp_axes_health;

/* Most frames out per tick. */
#define PALP_SERVO_FRAMES_OUT (PALP_AXES * PALP_DRIVE_FRAMES + PALP_SHARED_FRAMES)

void palp_axes_init(palp_device_axes *axes, const palp_device *device);

/* Forgets what the drives have said, to probe them anew. */
void palp_axes_forget(palp_device_axes *axes);

/* The joints stand at joint_home_rad now; and: they are no longer known to have stood there (does
 * nothing for a device without homing). */
void palp_axes_home(palp_device_axes *axes, const palp_device *device);
void palp_axes_unhome(palp_device_axes *axes, const palp_device *device);

/* What a tick that comes `periods` after the last has received. */
typedef struct {
    const palp_can_frame *frames;
    uint64_t heard; /* bit i: frame i is another's set-point, of no drive */
    uint32_t count, periods;
    bool strict; /* a joint that was believed is held to; else readings that keep disagreeing with
                    it are taken as new */
} palp_axes_input;

/* Cost: per frame and axis, one decoding and one velocity estimate. */
void palp_axes_take(palp_device_axes *axes, const palp_device *device, const palp_axes_input *input,
                    palp_counters *counters);

palp_axes_health palp_axes_check(const palp_device_axes *axes);

/* Frames of this tick; `commanded_Nm` of the motors is used with the request TORQUE only. */
uint32_t palp_axes_send(palp_device_axes *axes, const palp_device *device,
                        palp_drive_request request, const float commanded_Nm[PALP_AXES],
                        uint64_t tick, palp_can_frame *out);

#endif
