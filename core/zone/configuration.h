/* SPDX-License-Identifier: MIT */
/*
 * Joint values to where each zone is. Motions are those of the rest coordinates: with all values
 * zero every one of them is exactly the identity, so a model in its rest configuration is free of
 * mismatch to the last bit, and moving the whole (`root`) changes nothing between zones.
 */
#ifndef PALP_ZONE_CONFIGURATION_H
#define PALP_ZONE_CONFIGURATION_H

#include "core/base/frame.h"
#include "core/zone/zones.h"

typedef struct {
    float value[PALP_MAX_JOINTS];        /* rad or m, within the limits */
    palp_frame frame[PALP_MAX_ZONES];    /* zone -> zone 0 */
    palp_frame relative[PALP_MAX_SEAMS]; /* second zone of each seam -> first */
    palp_frame root;                     /* zone 0 -> world */
    float open_m, open_rad;              /* what the closures are off by, largest */
    uint32_t clamped;                    /* values out of their limits, of the last call */
} palp_configuration;

/*
 * Poses the model. Values out of their limits are clamped and counted; those that are not numbers
 * leave the joint where it was, as does a `root` that is no motion; so begin with
 * palp_configuration_rest. Values of fixed joints and of closures are ignored. Cost: about 200
 * operations a zone.
 */
void palp_configuration_set(palp_configuration *configuration, const palp_zones *zones,
                            const float *value, const palp_frame *root);

/* All values zero, the root at rest. */
void palp_configuration_rest(palp_configuration *configuration, const palp_zones *zones);

/* Zone -> world. */
palp_frame palp_configuration_world(const palp_configuration *configuration, uint32_t zone);

#endif
