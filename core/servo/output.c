/* SPDX-License-Identifier: MIT */
#include "output.h"

/* v shortened to at most `limit`. */
static palp_vec3 shorten(palp_vec3 v, float limit, bool *hit) {
    float length = palp_norm(v);
    if (length <= limit) return v;
    *hit = true;
    return palp_scale(limit / length, v);
}

static bool request_is_finite(const palp_output_request *d) {
    bool good = palp_vec3_is_finite(d->force_N) && palp_is_finite(palp_norm(d->force_N)) &&
                palp_is_finite(d->stored_J) && palp_vec3_is_finite(d->moment_Nm) &&
                palp_is_finite(palp_norm(d->moment_Nm)) && palp_is_finite(d->gripper_N);
    for (uint32_t i = 0; i < PALP_AXES; i++)
        good = good && palp_is_finite(d->dq_rad_s[i]) && palp_is_finite(d->feedforward_Nm[i]);
    return good;
}

/* The largest moment of a device; 0 where no motors turn the tool. */
static float most_moment_Nm(const palp_device *device) {
    return palp_device_turns(device) ? device->moment_max_Nm : 0.0f;
}

/* What force and moment, each within its slew limit, may change the torques of the motors by. A
 * moment rises in the time that the force takes. */
static void torque_slew(const palp_device *device, const palp_pose *pose, float dt_s,
                        float slew_Nm[PALP_AXES]) {
    const float step = device->slew_max_N_per_s * dt_s;
    const float step_Nm = step * most_moment_Nm(device) / device->force_max_N;
    const uint32_t gripper = palp_gripper_axis(&device->kinematics);
    for (uint32_t i = 0; i < palp_axes(&device->kinematics); i++) {
        float joint = step * palp_norm(pose->column_m[i]) + step_Nm * palp_norm(pose->turn[i]);
        if (i == gripper) joint = step * palp_abs(device->kinematics.gripper_m_per_rad);
        slew_Nm[i] = joint / palp_abs(device->gear[i]);
    }
}

/* Joint torques of the contact, on motors alone. */
static void contact_torques(const palp_device *device, const palp_pose *pose, const palp_wrench *w,
                            float gripper_N, float torque_Nm[PALP_AXES]) {
    const uint32_t motors = palp_device_motors(device),
                   gripper = palp_gripper_axis(&device->kinematics);
    palp_pose_torques(pose, w->force_N, w->moment_Nm, torque_Nm);
    for (uint32_t i = 0; i < palp_axes(&device->kinematics); i++) {
        if (i == gripper) torque_Nm[i] = gripper_N * device->kinematics.gripper_m_per_rad;
        if ((motors >> i & 1u) == 0u) torque_Nm[i] = 0.0f;
    }
}

/* At one motor (Nm): feed-forward that is wanted, and the share of it that is sent; what contact and
 * compensation ask for; the limits of the torque and of its change in a tick. */
typedef struct {
    float wanted, share, contact, compensation, limit, slew;
} motor_request;

/* Feed-forward torque at motor i. It follows `wanted` within what the contact leaves of the slew
 * limit, and within what the other torques leave of the motor's limit. `share` fades it at once. */
static float feed_forward(palp_output *output, uint32_t i, const motor_request *m, bool *slewed) {
    const float rest = m->contact + m->compensation;
    const float left =
        palp_max(m->slew - palp_abs(m->contact - output->contact_torque_Nm[i]), 0.0f);
    const float change = m->wanted - output->feedforward_Nm[i];
    *slewed = *slewed || palp_abs(change) > left;
    output->feedforward_Nm[i] += palp_clamp(change, -left, left);
    const float forward = m->share * output->feedforward_Nm[i];
    const float fits = palp_clamp(forward, -m->limit - rest, m->limit - rest);
    *slewed = *slewed || palp_abs(fits - forward) > 0.0f;
    return fits;
}

/*
 * Motor torques for the force, the compensation and feed-forward, within the motors' limit. When
 * force and compensation do not fit, the force shrinks, all axes together, so that its direction
 * stays; returns its share.
 */
static float motor_torques(palp_output *output, const palp_device *device, const palp_pose *pose,
                           const palp_wrench *w, float gripper_N,
                           const palp_output_request *request, float dt_s, palp_output_result *r) {
    float contact[PALP_AXES], gravity[PALP_AXES], friction[PALP_AXES], extra[PALP_AXES],
        slew[PALP_AXES] = {0.0f};
    float share = 1.0f, limit = device->drives.torque_max_Nm;
    uint32_t axes = palp_axes(&device->kinematics);
    const uint32_t motors = palp_device_motors(device);
    contact_torques(device, pose, w, gripper_N, contact);
    palp_device_compensate(device, pose, request->dq_rad_s, gravity, friction);
    torque_slew(device, pose, dt_s, slew);
    for (uint32_t i = 0; i < axes; i++) {
        contact[i] /= device->gear[i];
        extra[i] = request->gravity_share * gravity[i] + request->friction_share * friction[i];
        if ((motors >> i & 1u) == 0u) extra[i] = 0.0f;
        extra[i] = palp_clamp(extra[i] / device->gear[i], -limit, limit);
        float room = contact[i] > 0.0f ? limit - extra[i] : limit + extra[i];
        if (palp_abs(contact[i]) > room) share = palp_min(share, room / palp_abs(contact[i]));
    }
    for (uint32_t i = 0; i < axes; i++) {
        const bool motor = (motors >> i & 1u) != 0u;
        const float feedforward = motor ? request->feedforward_Nm[i] : 0.0f;
        const motor_request m = {.wanted = palp_clamp(feedforward, -limit, limit),
                                 .share = request->gravity_share,
                                 .contact = share * contact[i],
                                 .compensation = extra[i],
                                 .limit = limit,
                                 .slew = slew[i]};
        const float forward = feed_forward(output, i, &m, &r->slewed);
        r->contact_torque_Nm[i] = output->contact_torque_Nm[i] = m.contact;
        r->motor_torque_Nm[i] = palp_clamp(m.contact + m.compensation + forward, -limit, limit);
    }
    return share;
}

palp_output_result palp_output_apply(palp_output *output, const palp_device *device,
                                     const palp_passivity_config *passive, const palp_pose *pose,
                                     const palp_output_request *request, float dt_s) {
    palp_output_result r = {.bad = !request_is_finite(request)};
    if (!r.bad) {
        const float most_Nm = most_moment_Nm(device), step_N = device->slew_max_N_per_s * dt_s;
        palp_wrench w = {shorten(request->force_N, device->force_max_N, &r.limited),
                         palp_pose_transmits(pose, &device->kinematics, palp_device_motors(device),
                                             request->moment_Nm)};
        float gripper_N = palp_clamp(request->gripper_N, -device->force_max_N, device->force_max_N);
        if (most_Nm > 0.0f) w.moment_Nm = shorten(w.moment_Nm, most_Nm, &r.limited);
        if (passive != NULL) {
            const float share =
                palp_passivity_share(&output->passivity, passive, &w, request->stored_J,
                                     request->damped_W, request->steady);
            r.braked = share < 1.0f;
            w.force_N = palp_scale(share, w.force_N);
            w.moment_Nm = palp_scale(share, w.moment_Nm);
            gripper_N *= share;
        }
        palp_vec3 change = shorten(palp_sub(w.force_N, output->last_N), step_N, &r.slewed);
        w.force_N = palp_add(output->last_N, change);
        change = shorten(palp_sub(w.moment_Nm, output->last_Nm),
                         step_N * most_Nm / device->force_max_N, &r.slewed);
        w.moment_Nm = palp_add(output->last_Nm, change);
        float share = motor_torques(output, device, pose, &w, gripper_N, request, dt_s, &r);
        if (share < 1.0f) r.limited = true;
        r.force_N = palp_scale(share, w.force_N);
        r.moment_Nm = palp_scale(share, w.moment_Nm);
        for (uint32_t i = 0; i < PALP_AXES; i++)
            r.bad = r.bad || !palp_is_finite(r.motor_torque_Nm[i]);
        r.bad = r.bad || !palp_vec3_is_finite(r.force_N) || !palp_vec3_is_finite(r.moment_Nm);
    }
    if (r.bad) {
        r = (palp_output_result){.bad = true};
        for (uint32_t i = 0; i < PALP_AXES; i++)
            output->contact_torque_Nm[i] = output->feedforward_Nm[i] = 0.0f;
    }
    output->last_N = r.force_N;
    output->last_Nm = r.moment_Nm;
    float joint_Nm[PALP_AXES] = {0.0f};
    for (uint32_t i = 0; i < palp_axes(&device->kinematics); i++)
        joint_Nm[i] = r.contact_torque_Nm[i] * device->gear[i];
    palp_passivity_sent(&output->passivity, passive, joint_Nm);
    return r;
}
