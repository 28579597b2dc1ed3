/* SPDX-License-Identifier: MIT */
#include "kinematics.h"

palp_arm_pose palp_arm_forward(const palp_arm *arm, const float q_rad[PALP_AXES]) {
    float s[PALP_AXES], c[PALP_AXES];
    for (uint32_t i = 0; i < PALP_AXES; i++) palp_sincos(q_rad[i], &s[i], &c[i]);
    float a = arm->upper_m;
    float b = arm->fore_m;
    float rho = a * c[1] + b * s[2];
    palp_arm_pose pose = {
        .tip_m = {rho * c[0] - a, rho * s[0], a * s[1] - b * c[2] + b},
        .jacobian = {-rho * s[0], -a * s[1] * c[0], b * c[2] * c[0], rho * c[0], -a * s[1] * s[0],
                     b * c[2] * s[0], 0.0f, a * c[1], b * s[2]},
    };
    return pose;
}

void palp_arm_torques(const palp_arm_pose *pose, palp_vec3 force_N, float torque_Nm[PALP_AXES]) {
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        torque_Nm[i] = pose->jacobian[i] * force_N.x + pose->jacobian[PALP_AXES + i] * force_N.y +
                       pose->jacobian[2u * PALP_AXES + i] * force_N.z;
    }
}
