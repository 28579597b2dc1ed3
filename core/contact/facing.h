/* SPDX-License-Identifier: MIT */
/* Where the surface of another body lies before a place: what two zones that touch see of each
 * other. */
#ifndef PALP_CONTACT_FACING_H
#define PALP_CONTACT_FACING_H

#include "core/contact/tool.h"
#include "core/surface/surface.h"

/* Another body, and where it is. */
typedef struct {
    const palp_surface *surface;
    const palp_frame *frame;
} palp_facing_body;

#define PALP_FACING_NOTHING 1e3f /* gap before which there is no surface (m) */

/*
 * The point of `other` on the line through x along -axis, which enters it there. The
 * walk begins on hint[0], where it then leaves its end, or if that looks away from x on hint[1].
 * False if it finds none, or has used up *crossings. Cost: two of palp_surface_shoot.
 */
bool palp_facing_find(const palp_facing_body *other, palp_vec3 x, palp_vec3 axis,
                      uint32_t *crossings, uint32_t hint[2], palp_surface_point *at);

/* How far x is out of the other body along its normal where that point is, and that normal;
 * PALP_FACING_NOTHING if there is no such point. */
palp_gap palp_facing_gap(const palp_facing_body *other, palp_vec3 x, palp_vec3 axis,
                         uint32_t *crossings, uint32_t hint[2]);

#endif
