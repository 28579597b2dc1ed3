/* SPDX-License-Identifier: MIT */
/* Brings a body of any size and pose under the tool of a device. */
#ifndef PALP_HOST_PLACEMENT_H
#define PALP_HOST_PLACEMENT_H

#include "core/servo/servo.h"

typedef struct {
    palp_placement placement;
    float
        tool_radius_m; /* in the model: what was asked for, or the device's, but at least half an edge
                            of the mesh; of another tool its size */
    uint32_t node;     /* the node that lies under the workspace centre */
} touch_frame;

/* The free node nearest to a place of the body. */
uint32_t nearest_free_node(const palp_blob *blob, const double place_m[3]);

/*
 * Puts the surface at `node` (UINT32_MAX: the highest flat place away from the fixed nodes) just
 * below the tool at the workspace centre, its normal along +z. Bodies between a third of and twice
 * the workspace in size keep their size; others are scaled to it. The tool is a ball of radius_m (0:
 * see touch_frame), or `tool`, as it is when the device is at home, in the size that it has.
 */
touch_frame place_body(const palp_blob *blob, const palp_device *device, uint32_t node,
                       const palp_tool *tool, double radius_m);

#endif
