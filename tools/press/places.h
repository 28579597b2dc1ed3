/* SPDX-License-Identifier: MIT */
/* Places of a body where contact is hard for a ball: tips, valleys, and where it comes to touch two
 * regions at once. */
#ifndef PALP_TOOLS_PLACES_H
#define PALP_TOOLS_PLACES_H

#include "core/base/real.h"
#include "core/blob/blob.h"

typedef enum { PLACE_TIP, PLACE_VALLEY, PLACE_TWO_REGIONS, PLACE_KINDS } place_kind;

typedef struct {
    palp_vec3 at_m; /* the ball, where it begins to touch */
    palp_vec3 push; /* unit, into the body */
} place;

/*
 * Up to `most` places of a kind for a ball of that radius, the most pronounced first, two radii
 * apart and away from fixed nodes. Two regions: pressed so deep, the nodes within the ball fall
 * apart into pieces. Returns how many there are.
 */
uint32_t places_find(const palp_blob *blob, place_kind kind, double radius_m, double depth_m,
                     place *out, uint32_t most);

#endif
