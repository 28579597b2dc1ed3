/* SPDX-License-Identifier: MIT */
#include "output.h"

/* v shortened to at most `limit`. */
static palp_vec3 shorten(palp_vec3 v, float limit, bool *hit) {
    float length = palp_norm(v);
    if (length <= limit) return v;
    *hit = true;
    return palp_scale(limit / length, v);
}

palp_output_result palp_output_apply(palp_output *output, const palp_device *device,
                                     const palp_arm_pose *pose, palp_vec3 wanted_N, float dt_s) {
    palp_output_result r = {0};
    float torque[PALP_AXES];
    if (!palp_vec3_is_finite(wanted_N) || !palp_is_finite(palp_norm(wanted_N))) {
        output->last_N = (palp_vec3){0};
        r.bad = true;
        return r;
    }
    palp_vec3 force = shorten(wanted_N, device->force_max_N, &r.limited);
    palp_vec3 change =
        shorten(palp_sub(force, output->last_N), device->slew_max_N_per_s * dt_s, &r.slewed);
    force = palp_add(output->last_N, change);
    palp_arm_torques(pose, force, torque);
    float worst = 1.0f; /* all axes shrink together, so that the direction stays */
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        torque[i] /= device->gear[i];
        worst = palp_max(worst, palp_abs(torque[i]) / device->motor_torque_max_Nm);
    }
    if (worst > 1.0f) r.limited = true;
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        r.motor_torque_Nm[i] = torque[i] / worst;
        r.bad = r.bad || !palp_is_finite(r.motor_torque_Nm[i]);
    }
    r.force_N = palp_scale(1.0f / worst, force);
    if (r.bad) r = (palp_output_result){.bad = true};
    output->last_N = r.force_N;
    return r;
}
