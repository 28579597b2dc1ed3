/* SPDX-License-Identifier: MIT */
/*
 * The output chain: finite -> what a wrist's motors can make -> norm limit -> energy limit (passivity.h) -> slew limit -> joint
 * torques, with the mechanism's compensation -> per-axis limit -> finite. Whatever comes in, what
 * goes out is finite and within the device's limits. Feed-forward takes what the
 * contact leaves of the slew limit, so that their sum keeps to it.
 */
#ifndef PALP_SERVO_OUTPUT_H
#define PALP_SERVO_OUTPUT_H

#include "core/device/device.h"
#include "core/servo/passivity.h"

typedef struct {
    palp_vec3 last_N, last_Nm;                                     /* of the previous tick */
    float contact_torque_Nm[PALP_AXES], feedforward_Nm[PALP_AXES]; /* its motor torques */
    palp_passivity passivity;
} palp_output;

typedef struct {
    palp_vec3 force_N, moment_Nm;    /* wanted at the tip */
    float gripper_N;                 /* that opens the jaws */
    float stored_J;                  /* in what makes it */
    float damped_W;                  /* taken up by its damper */
    bool steady;                     /* see palp_passivity_share */
    float dq_rad_s[PALP_AXES];       /* of the joints, for the compensation */
    float feedforward_Nm[PALP_AXES]; /* motor torques of the integrator's own */
    float gravity_share;             /* of gravity compensation and feed-forward, 0..1 */
    float friction_share;            /* of friction compensation, 0..1 */
} palp_output_request;

typedef struct {
    palp_vec3 force_N, moment_Nm; /* at the tip, after all limits, without compensation */
    float motor_torque_Nm[PALP_AXES];
    float contact_torque_Nm[PALP_AXES]; /* of these, for the contact alone */
    bool limited, slewed, braked;
    bool bad; /* something was not finite; force and torques are zero */
} palp_output_result;

/* `passive` NULL: without the energy limit. */
palp_output_result palp_output_apply(palp_output *output, const palp_device *device,
                                     const palp_passivity_config *passive, const palp_pose *pose,
                                     const palp_output_request *request, float dt_s);

#endif
