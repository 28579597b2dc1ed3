/* SPDX-License-Identifier: MIT */
#include "axes.h"

#define RAD_PER_REV 6.28318530718f
#define RESOLVED 1.2e-7f /* step of a float, over it */
#define BAD_BEFORE_RESTART 3u
#define TREMOR_M 1e-4f
#define FROZEN_TORQUE 0.005f /* share of the motor's limit above which a hand would move */

/* What a reading of the motor of joint i is rounded to: the encoder's step, the wire's, or what a
 * float resolves at the farthest end of the joint. */
static float reading_step(const palp_device *device, uint32_t i) {
    float turned = palp_max(palp_abs(device->joint_min_rad[i]), palp_abs(device->joint_max_rad[i]));
    float resolved = RESOLVED * turned * palp_abs(device->gear[i]);
    float encoder = RAD_PER_REV / device->drives.counts_per_rev;
    bool coarse = device->drives.protocol == PALP_PROTOCOL_MIT;
    float wire = coarse ? 2.0f * device->drives.range.position_rad / 65535.0f : 0.0f;
    return palp_max(palp_max(encoder, wire), resolved);
}

/* Where a joint's angles count from; what it was believed to be before is forgotten. */
static void set_zero(palp_device_axes *axes, const palp_device *device, uint32_t i,
                     float zero_rad) {
    palp_joint_limits *l = &axes->limits[i];
    l->min_rad = device->joint_min_rad[i];
    l->max_rad = device->joint_max_rad[i];
    l->zero_rad = axes->zero_rad[i] = zero_rad;
    axes->joint[i] = (palp_joint){.age = 0};
}

void palp_axes_init(palp_device_axes *axes, const palp_device *device) {
    *axes = (palp_device_axes){.count = palp_axes(&device->kinematics),
                               .motors = palp_device_motors(device)};
    for (uint32_t i = 0; i < axes->count; i++) {
        axes->drive[i].node = device->node_id[i];
        axes->limits[i] =
            (palp_joint_limits){.speed_max_rad_s = palp_device_joint_speed(device, i),
                                .step_rad = reading_step(device, i) / palp_abs(device->gear[i])};
        set_zero(axes, device, i, device->joint_zero_rad[i]);
    }
    axes->homed = true;
    float reach = device->kinematics.upper_m + device->kinematics.fore_m;
    axes->fine = reach * axes->limits[0].step_rad < TREMOR_M;
    palp_axes_forget(axes);
    palp_axes_unhome(axes, device);
}

void palp_axes_home(palp_device_axes *axes, const palp_device *device) {
    if (axes->homed) return;
    for (uint32_t i = 0; i < axes->count; i++)
        set_zero(axes, device, i, device->joint_home_rad[i] - axes->joint[i].q_rad);
    axes->homed = true;
}

void palp_axes_unhome(palp_device_axes *axes, const palp_device *device) {
    if (!device->homes) return;
    for (uint32_t i = 0; i < axes->count; i++) {
        set_zero(axes, device, i, 0.0f);
        axes->limits[i].min_rad = -PALP_JOINT_FARTHEST_RAD;
        axes->limits[i].max_rad = PALP_JOINT_FARTHEST_RAD;
    }
    axes->homed = false;
}

void palp_axes_forget(palp_device_axes *axes) {
    for (uint32_t i = 0; i < axes->count; i++) {
        palp_drive_init(&axes->drive[i], axes->drive[i].node);
        axes->joint[i] = (palp_joint){.age = 0};
        axes->contact_torque_Nm[i] = 0.0f;
    }
}

static void take_estimate(palp_device_axes *axes, const palp_device *device, uint32_t i,
                          bool strict, palp_counters *counters) {
    palp_joint *j = &axes->joint[i];
    float q = axes->drive[i].position_rev / device->gear[i] * RAD_PER_REV + axes->zero_rad[i];
    const float last = j->q_rad;
    const bool second = j->known && j->age == 0u;
    const palp_reading reading =
        palp_joint_take(j, &axes->limits[i], q, 1.0f / device->drives.rate_hz);
    if (reading == PALP_READING_BAD) {
        counters->implausible++;
        if (!strict && j->bad_in_a_row >= BAD_BEFORE_RESTART) *j = (palp_joint){.age = 0};
        return;
    }
    if (second || reading == PALP_READING_STALE) {
        counters->repeated++;
        return;
    }
    bool pushed = axes->fine && palp_abs(axes->contact_torque_Nm[i]) >
                                    FROZEN_TORQUE * device->drives.torque_max_Nm;
    j->frozen = pushed && palp_same_bits(q, last) ? j->frozen + 1u : 0u;
}

static void take_frame(palp_device_axes *axes, const palp_device *device,
                       const palp_can_frame *frame, bool strict, palp_counters *counters) {
    for (uint32_t i = 0; i < axes->count; i++) {
        palp_rx_event event = palp_drive_receive(&axes->drive[i], &device->drives, frame);
        if (event == PALP_RX_NONE) continue;
        if (event == PALP_RX_BAD) {
            counters->corrupt++;
            counters->rejected++;
            return;
        }
        counters->accepted++;
        if (event == PALP_RX_REPEATED) counters->repeated++;
        if (event == PALP_RX_GAP) counters->gaps++;
        if (event == PALP_RX_ESTIMATE || event == PALP_RX_GAP)
            take_estimate(axes, device, i, strict, counters);
        return;
    }
    counters->rejected++;
}

void palp_axes_take(palp_device_axes *axes, const palp_device *device, const palp_axes_input *input,
                    palp_counters *counters) {
    const float dt_s = 1.0f / device->drives.rate_hz;
    for (uint32_t i = 0; i < axes->count; i++) {
        palp_joint_age(&axes->joint[i], input->periods, dt_s);
        axes->drive[i].status_age += input->periods - 1u;
    }
    for (uint32_t f = 0; f < input->count; f++) {
        if ((input->heard >> f & 1u) != 0u)
            counters->accepted++;
        else
            take_frame(axes, device, &input->frames[f], input->strict, counters);
    }
    for (uint32_t i = 0; i < axes->count; i++) {
        if (axes->joint[i].age == 0u) palp_joint_velocity(&axes->joint[i], &axes->limits[i], dt_s);
        palp_joint_update_belief(&axes->joint[i], &axes->limits[i]);
        if (input->strict && axes->joint[i].age > 0u) counters->late++;
    }
}

palp_axes_health palp_axes_check(const palp_device_axes *axes) {
    palp_axes_health h = {
        .heard = true, .configured = true, .healthy = true, .enabled = true, .homed = axes->homed};
    for (uint32_t i = 0; i < axes->count; i++) {
        const palp_drive *d = &axes->drive[i];
        const palp_joint *j = &axes->joint[i];
        uint32_t age = j->known ? j->age : UINT32_MAX;
        h.heard = h.heard && d->heard;
        h.configured = h.configured && d->configured;
        h.misconfigured = h.misconfigured || d->misconfigured;
        h.healthy = h.healthy && d->error == PALP_DRIVE_NO_ERROR;
        h.enabled = h.enabled && (d->enabled || (axes->motors >> i & 1u) == 0u);
        h.status_age = d->status_age > h.status_age ? d->status_age : h.status_age;
        h.age = age > h.age ? age : h.age;
        h.bad_in_a_row = j->bad_in_a_row > h.bad_in_a_row ? j->bad_in_a_row : h.bad_in_a_row;
        const uint32_t bad = palp_bits(j->bad_history);
        h.bad_of_32 = bad > h.bad_of_32 ? bad : h.bad_of_32;
        h.frozen = j->frozen > h.frozen ? j->frozen : h.frozen;
    }
    return h;
}

uint32_t palp_axes_send(palp_device_axes *axes, const palp_device *device,
                        palp_drive_request request, const float commanded_Nm[PALP_AXES],
                        uint64_t tick, palp_can_frame *out) {
    uint32_t n = 0;
    for (uint32_t i = 0; i < axes->count; i++) {
        const bool motor = (axes->motors >> i & 1u) != 0u;
        n += motor ? palp_drive_send(&axes->drive[i], &device->drives, request, commanded_Nm[i],
                                     out + n)
                   : palp_drive_listen(&axes->drive[i], &device->drives, request, out + n);
    }
    return n + palp_drives_send_shared(&device->drives, tick, out + n);
}
