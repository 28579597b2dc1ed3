/* SPDX-License-Identifier: MIT */
#include "core/contact/facing.h"

bool palp_facing_find(const palp_facing_body *other, palp_vec3 x, palp_vec3 axis,
                      uint32_t *crossings, uint32_t hint[2], palp_surface_point *at) {
    const palp_vec3 from = palp_carry_back(other->frame, x);
    const palp_vec3 way = palp_scale(-1.0f, palp_rotate_back(other->frame->r, axis));
    for (uint32_t k = 0; k < 2u; k++) {
        at->triangle = hint[k];
        if (!palp_surface_shoot(other->surface, from, way, crossings, at)) continue;
        hint[0] = at->triangle;
        return true;
    }
    return false;
}

palp_gap palp_facing_gap(const palp_facing_body *other, palp_vec3 x, palp_vec3 axis,
                         uint32_t *crossings, uint32_t hint[2]) {
    palp_surface_point at;
    if (!palp_facing_find(other, x, axis, crossings, hint, &at))
        return (palp_gap){PALP_FACING_NOTHING, palp_scale(-1.0f, axis)};
    const palp_vec3 off = palp_sub(palp_carry_back(other->frame, x), at.y);
    return (palp_gap){palp_dot(off, at.n), palp_rotate(other->frame->r, at.n)};
}
