/* SPDX-License-Identifier: MIT */
/*
 * The regions in which a tool touches a surface: its contact points that are connected as
 * neighbours in the lattice. A ball in a groove lies on two.
 *
 * Regions are followed from tick to tick. Those that have grown together stay two, each with the
 * points that are nearest to where it was, until they face the same way: what each holds lies in a
 * plane of its own. One that has come apart goes on in all its parts.
 */
#ifndef PALP_CONTACT_REGIONS_H
#define PALP_CONTACT_REGIONS_H

#include "core/contact/contact.h"

#define PALP_CONTACT_REGIONS 4u /* what lies apart from so many counts to the nearest of them */

typedef struct {
    palp_vec3 axis;       /* - sum lambda m, normalised: direction of the force on the tool */
    palp_vec3 tangent[2]; /* orthonormal with it */
    palp_vec3 centre_m;   /* from the tool's reference point; by the forces */
    float normal_N;       /* sum lambda */
    float gyration_m2;    /* mean square of the distance from the centre, by the forces */
    float shear_Pa;       /* G of the body that carries the most */
    uint32_t parents;     /* bits: the regions of before that go on in it */
} palp_contact_region;

/* The regions of a tool of a solved contact, after those of the last tick, and for each of its
 * points in contact which one it belongs to (palp_contact_point.region). Cost: 500 per point. */
uint32_t palp_contact_regions(palp_contact *contact, uint32_t tool,
                              const palp_contact_region *before, uint32_t count_before,
                              palp_contact_region region[PALP_CONTACT_REGIONS]);

/* Square of the radius that it has (m^2), as that of a Hertz contact. */
static inline float palp_contact_reach2(const palp_contact_region *region) {
    return 2.5f * region->gyration_m2;
}

#endif
