/* SPDX-License-Identifier: MIT */
/*
 * A light mass between a device and a dynamic body, which takes its tool where it is and hands a
 * force back: so the device's limit of stiffness holds also where the body is stiffer.
 *
 *     m x'' = k (d - x) + b (d' - x') + F        F: what the body gave at x, in the last tick
 *     force on the hand = k (x - d)              while it touches, else 0
 *
 * Spring and damper are implicit, and b = 2 sqrt(k m) lets it swing nowhere. F is explicit, so the body
 * may be as stiff as m / T^2 near the tool. A proxy that touches nothing is at its device.
 */
#ifndef PALP_HAPTIC_PROXY_H
#define PALP_HAPTIC_PROXY_H

#include "core/base/frame.h"

#define PALP_PROXY_KG 0.005f

typedef struct {
    palp_frame at;
    palp_vec3 velocity_m_s, device_m;
    bool touching, placed;
} palp_proxy;

/* Where the tool is to be at the end of a tick of dt_s, after the body gave contact_N in the last one
 * (0: it touches nothing), on a spring of stiffness_N_per_m. Turns go with the device. */
palp_frame palp_proxy_move(palp_proxy *proxy, const palp_frame *device, palp_vec3 contact_N,
                           float stiffness_N_per_m, float dt_s);

/* The force on the hand, and the energy of spring and motion (J). */
palp_vec3 palp_proxy_force(const palp_proxy *proxy, float stiffness_N_per_m, float *energy_J);

#endif
