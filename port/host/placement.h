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

/* A place of a surface, of a body of some size with edges of some length. */
typedef struct {
    palp_vec3 at_m, normal;
    float size_m, edge_m;
    uint32_t node;
} surface_spot;
surface_spot spot_of_blob(const palp_blob *blob, uint32_t node);

/* The highest flat place away from the fixed nodes, for a tool of this radius. */
uint32_t flat_high_node(const palp_blob *blob, float radius_m);

/* What a device holds, and where on its tip; without `tool` a ball of radius_m, 0: see touch_frame. */
typedef struct {
    const palp_tool *tool;
    float radius_m;
    palp_frame at;
} spot_tool;

/*
 * Puts the spot just below the tool at the workspace centre, its normal along +z, or the device turned
 * as `rotation` says. Bodies between a third of and twice the workspace in size keep their size; others
 * are scaled to it, or by `scale` if it is above 0.
 */
touch_frame place_under(const surface_spot *spot, const palp_device *device, const spot_tool *held,
                        const float rotation[9], double scale);

/* The same for one body and one tool on the tip, at `node` (UINT32_MAX: flat_high_node). The tool is
 * a ball of radius_m (0: see touch_frame), or `tool`, in the size that it has. */
touch_frame place_body(const palp_blob *blob, const palp_device *device, uint32_t node,
                       const palp_tool *tool, double radius_m);

#endif
