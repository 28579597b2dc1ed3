/* SPDX-License-Identifier: MIT */
#include "sphere.h"

#define BETA PALP_SPHERE_BETA
#define HEIGHT 0.6f      /* sqrt(1 - BETA^2) */
#define SLOPE 1.3333334f /* BETA / HEIGHT */

palp_sphere_contact palp_sphere_at(float radius_m, palp_vec3 center, palp_vec3 x, palp_vec3 n) {
    palp_vec3 r = palp_sub(x, center);
    float along = palp_dot(r, n);
    palp_vec3 tangential = palp_madd(r, -along, n);
    float t = palp_norm(tangential);
    float psi, slope_over_t; /* -psi'(t) / t */
    if (t <= BETA * radius_m) {
        psi = palp_sqrt(radius_m * radius_m - t * t);
        slope_over_t = 1.0f / psi;
    } else {
        psi = HEIGHT * radius_m - SLOPE * (t - BETA * radius_m);
        slope_over_t = SLOPE / t;
    }
    return (palp_sphere_contact){
        .depth_m = along + psi, .offset_m = t, .push = palp_madd(n, -slope_over_t, tangential)};
}
