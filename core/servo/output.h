/* SPDX-License-Identifier: MIT */
/*
 * The output chain: finite -> norm limit -> slew limit -> joint torques -> per-axis limit ->
 * finite. Whatever comes in, what goes out is finite and within the device's limits.
 */
#ifndef PALP_SERVO_OUTPUT_H
#define PALP_SERVO_OUTPUT_H

#include "core/device/device.h"
#include <stdbool.h>

typedef struct {
    palp_vec3 last_N; /* force of the previous tick */
} palp_output;

typedef struct {
    palp_vec3 force_N; /* at the tip, after all limits */
    float motor_torque_Nm[PALP_AXES];
    bool limited, slewed, bad; /* bad: something was not finite; force and torques are zero */
} palp_output_result;

palp_output_result palp_output_apply(palp_output *output, const palp_device *device,
                                     const palp_arm_pose *pose, palp_vec3 wanted_N, float dt_s);

#endif
