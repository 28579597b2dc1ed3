/* SPDX-License-Identifier: MIT */
#include "device.h"
#include "core/device/busload.h"
#include <float.h>

#define HAND_RAD_S 60.0f           /* as fast as fingers spin a stylus, with room to spare */
#define PLAUSIBLE 2.0f             /* a joint may move this many times what its speed limit asks */
#define FRICTION_SPEED_RAD_S 0.05f /* below it friction is compensated in proportion */

static bool is_positive(float x) { return x > 0.0f && palp_is_finite(x); }

bool palp_device_is_sound(const palp_device *d) {
    bool sound = palp_kinematics_is_sound(&d->kinematics) &&
                 palp_drive_config_is_sound(&d->drives) && is_positive(d->force_max_N) &&
                 is_positive(d->slew_max_N_per_s) && is_positive(d->speed_max_m_s) &&
                 is_positive(d->workspace_radius_m) && is_positive(d->stiffness_max_N_per_m) &&
                 palp_is_finite(d->damping_max_Ns_per_m) && palp_is_finite(d->damping_Ns_per_m) &&
                 d->damping_max_Ns_per_m >= 0.0f && d->damping_Ns_per_m >= 0.0f &&
                 palp_vec3_is_finite(d->compensation.gravity_compensation_N);
    uint32_t most = d->drives.protocol == PALP_PROTOCOL_CIA402 ? 126u
                    : d->drives.protocol == PALP_PROTOCOL_MIT  ? 15u
                                                               : 63u;
    if (palp_device_turns(d))
        sound = sound && is_positive(d->moment_max_Nm) &&
                is_positive(d->stiffness_max_Nm_per_rad) && d->damping_max_Nms_per_rad >= 0.0f &&
                palp_is_finite(d->damping_max_Nms_per_rad);
    sound = sound && (d->passive & ((1u << palp_arm_axes(&d->kinematics)) - 1u)) == 0u;
    for (uint32_t i = 0; i < palp_axes(&d->kinematics); i++) {
        sound = sound && palp_abs(d->gear[i]) > 0.0f && palp_is_finite(d->gear[i]) &&
                d->node_id[i] <= most && d->joint_min_rad[i] < d->joint_max_rad[i] &&
                d->joint_min_rad[i] >= -PALP_JOINT_FARTHEST_RAD &&
                d->joint_max_rad[i] <= PALP_JOINT_FARTHEST_RAD &&
                palp_is_finite(d->joint_zero_rad[i]) && palp_is_finite(d->joint_home_rad[i]) &&
                (!d->homes || (d->joint_home_rad[i] >= d->joint_min_rad[i] &&
                               d->joint_home_rad[i] <= d->joint_max_rad[i]));
        bool zero_is_taken = d->drives.protocol == PALP_PROTOCOL_CIA402 ||
                             d->drives.protocol == PALP_PROTOCOL_MOTEUS;
        sound = sound && (d->node_id[i] > 0u || !zero_is_taken);
        /* answers under a motor's own id would be commands to it */
        if (d->drives.protocol == PALP_PROTOCOL_MIT)
            sound = sound && d->node_id[i] != d->drives.master_id;
        sound = sound && d->compensation.coulomb_Nm[i] >= 0.0f &&
                d->compensation.viscous_Nms[i] >= 0.0f &&
                palp_is_finite(d->compensation.coulomb_Nm[i]) &&
                palp_is_finite(d->compensation.viscous_Nms[i]);
        for (uint32_t k = 0; k < i; k++) sound = sound && d->node_id[i] != d->node_id[k];
    }
    return sound;
}

float palp_device_coupling(const palp_device *device) {
    const palp_drive_config *c = &device->drives;
    float period = 1.0f / c->rate_hz;
    float bus = device->bit_rate_bps > 0.0f ? palp_bus_load_of(device).cycle_s : 0.0f;
    float delay = palp_min(bus, period) + (float)palp_drive_delay(c->protocol) * period;
    float damping = device->damping_Ns_per_m + device->damping_max_Ns_per_m;
    float limit = damping / (0.5f * period + delay);
    return limit > 0.0f ? palp_min(device->stiffness_max_N_per_m, limit)
                        : device->stiffness_max_N_per_m;
}

float palp_device_stiffest(const palp_device *device) {
    float period = 1.0f / device->drives.rate_hz;
    float seen = period * (1.0f + (float)palp_drive_delay(device->drives.protocol));
    return device->mass_kg > 0.0f ? 0.5f * device->mass_kg / (seen * seen) : FLT_MAX;
}

uint32_t palp_device_motors(const palp_device *device) {
    return ((1u << palp_axes(&device->kinematics)) - 1u) & ~device->passive;
}

bool palp_device_turns(const palp_device *device) {
    const uint32_t wrist = 7u << palp_wrist_axis(&device->kinematics);
    return device->kinematics.wrist && (palp_device_motors(device) & wrist) != 0u;
}

float palp_device_joint_speed(const palp_device *device, uint32_t joint) {
    if (joint >= palp_arm_axes(&device->kinematics)) return HAND_RAD_S;
    float reach = palp_min(device->kinematics.upper_m, device->kinematics.fore_m);
    return PLAUSIBLE * device->speed_max_m_s / (0.5f * reach);
}

void palp_device_compensate(const palp_device *device, const palp_pose *pose,
                            const float dq_rad_s[PALP_AXES], float gravity_Nm[PALP_AXES],
                            float friction_Nm[PALP_AXES]) {
    const palp_compensation *c = &device->compensation;
    const palp_vec3 none = {0.0f, 0.0f, 0.0f};
    palp_pose_torques(pose, c->gravity_compensation_N, none, gravity_Nm);
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        friction_Nm[i] = 0.0f;
        if ((palp_device_motors(device) >> i & 1u) == 0u) continue;
        float direction = palp_clamp(dq_rad_s[i] / FRICTION_SPEED_RAD_S, -1.0f, 1.0f);
        friction_Nm[i] = c->coulomb_Nm[i] * direction + c->viscous_Nms[i] * dq_rad_s[i];
    }
}
