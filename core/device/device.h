/* SPDX-License-Identifier: MIT */
/* What the controller must know of a haptic device; hosts read it from sim/devices/NAME.dev. */
#ifndef PALP_DEVICE_DEVICE_H
#define PALP_DEVICE_DEVICE_H

#include "core/device/kinematics.h"

typedef struct {
    palp_arm arm;
    uint8_t node_id[PALP_AXES]; /* drive of each joint */
    float gear[PALP_AXES];      /* motor revolutions per joint revolution, sign = direction */
    float counts_per_rev;       /* encoder, per motor revolution */
    float joint_min_rad[PALP_AXES], joint_max_rad[PALP_AXES];
    float motor_torque_max_Nm;
    float force_max_N, slew_max_N_per_s, speed_max_m_s;
    float workspace_radius_m, tool_radius_m;
    float stiffness_max_N_per_m, damping_max_Ns_per_m; /* what the virtual coupling is set to */
    float bit_rate_bps;
} palp_device;

#endif
