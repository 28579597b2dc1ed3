/* SPDX-License-Identifier: MIT */
#include "output.h"

/* v shortened to at most `limit`. */
static palp_vec3 shorten(palp_vec3 v, float limit, bool *hit) {
    float length = palp_norm(v);
    if (length <= limit) return v;
    *hit = true;
    return palp_scale(limit / length, v);
}

static bool demand_is_finite(const palp_output_demand *d) {
    bool good = palp_vec3_is_finite(d->force_N) && palp_is_finite(palp_norm(d->force_N)) &&
                palp_is_finite(d->stored_J);
    for (uint32_t i = 0; i < PALP_AXES; i++)
        good = good && palp_is_finite(d->dq_rad_s[i]) && palp_is_finite(d->feedforward_Nm[i]);
    return good;
}

/* What the mechanism asks for besides the touch, at motor i. */
static float extra_torque(const palp_device *device, const palp_output_demand *demand,
                          const float *lift, const float *friction, uint32_t i) {
    float limit = device->drives.torque_max_Nm;
    float joint = demand->lift * lift[i] + demand->friction * friction[i];
    float motor = joint / device->gear[i] + demand->lift * demand->feedforward_Nm[i];
    return palp_clamp(motor, -limit, limit);
}

/*
 * Motor torques for the force and the compensation, within the motors' limit. When they do not fit,
 * the force shrinks, all axes together, so that its direction stays; returns its share.
 */
static float motor_torques(const palp_device *device, const palp_pose *pose, palp_vec3 force,
                           const palp_output_demand *demand, palp_output_result *r) {
    float touch[PALP_AXES], lift[PALP_AXES], friction[PALP_AXES], extra[PALP_AXES];
    float share = 1.0f, limit = device->drives.torque_max_Nm;
    uint32_t axes = palp_axes(&device->kinematics);
    palp_pose_torques(pose, force, touch);
    palp_device_compensate(device, pose, demand->dq_rad_s, lift, friction);
    for (uint32_t i = 0; i < axes; i++) {
        touch[i] /= device->gear[i];
        extra[i] = extra_torque(device, demand, lift, friction, i);
        float room = touch[i] > 0.0f ? limit - extra[i] : limit + extra[i];
        if (palp_abs(touch[i]) > room) share = palp_min(share, room / palp_abs(touch[i]));
    }
    for (uint32_t i = 0; i < axes; i++) {
        r->touch_torque_Nm[i] = share * touch[i];
        r->motor_torque_Nm[i] = palp_clamp(share * touch[i] + extra[i], -limit, limit);
    }
    return share;
}

palp_output_result palp_output_apply(palp_output *output, const palp_device *device,
                                     const palp_passivity_config *passive, const palp_pose *pose,
                                     const palp_output_demand *demand, float dt_s) {
    palp_output_result r = {.bad = !demand_is_finite(demand)};
    if (!r.bad) {
        palp_vec3 force = shorten(demand->force_N, device->force_max_N, &r.limited);
        if (passive != NULL)
            force = palp_passivity_limit(&output->passivity, passive, force, demand->stored_J,
                                         &r.braked);
        force = shorten(force, device->force_max_N, &r.limited);
        palp_vec3 change =
            shorten(palp_sub(force, output->last_N), device->slew_max_N_per_s * dt_s, &r.slewed);
        force = palp_add(output->last_N, change);
        float share = motor_torques(device, pose, force, demand, &r);
        if (share < 1.0f) r.limited = true;
        r.force_N = palp_scale(share, force);
        for (uint32_t i = 0; i < PALP_AXES; i++)
            r.bad = r.bad || !palp_is_finite(r.motor_torque_Nm[i]);
        r.bad = r.bad || !palp_vec3_is_finite(r.force_N);
    }
    if (r.bad) r = (palp_output_result){.bad = true};
    output->last_N = r.force_N;
    palp_passivity_sent(&output->passivity, r.force_N);
    return r;
}
