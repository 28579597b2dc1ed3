/* SPDX-License-Identifier: MIT */
#include "core/haptic/proxy.h"

palp_frame palp_proxy_move(palp_proxy *p, const palp_frame *device, palp_vec3 contact_N,
                           float stiffness_N_per_m, float dt_s) {
    const float k = stiffness_N_per_m, m = PALP_PROXY_KG, b = 2.0f * palp_sqrt(k * m);
    const palp_vec3 none = {0.0f, 0.0f, 0.0f};
    const palp_vec3 moved = p->placed ? palp_sub(device->t, p->device_m) : none;
    const palp_vec3 device_m_s = palp_scale(1.0f / dt_s, moved);
    p->touching = palp_dot(contact_N, contact_N) > 0.0f;
    p->placed = true;
    p->device_m = device->t;
    if (p->touching) {
        palp_vec3 push = palp_madd(contact_N, k, palp_sub(device->t, p->at.t));
        push = palp_madd(push, b, device_m_s);
        const palp_vec3 momentum = palp_madd(palp_scale(m, p->velocity_m_s), dt_s, push);
        p->velocity_m_s = palp_scale(1.0f / (m + dt_s * b + dt_s * dt_s * k), momentum);
        const palp_vec3 at = palp_madd(p->at.t, dt_s, p->velocity_m_s);
        p->at = *device;
        p->at.t = at;
    } else {
        p->at = *device;
        p->velocity_m_s = device_m_s;
    }
    return p->at;
}

palp_vec3 palp_proxy_force(const palp_proxy *p, float stiffness_N_per_m, float *energy_J) {
    const palp_vec3 none = {0.0f, 0.0f, 0.0f};
    const palp_vec3 off = p->touching ? palp_sub(p->at.t, p->device_m) : none;
    *energy_J = 0.5f * (stiffness_N_per_m * palp_dot(off, off) +
                        PALP_PROXY_KG * palp_dot(p->velocity_m_s, p->velocity_m_s));
    return palp_scale(stiffness_N_per_m, off);
}
