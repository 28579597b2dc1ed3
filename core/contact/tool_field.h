/* SPDX-License-Identifier: MIT */
/*
 * A rigid tool of any closed shape, as a signed distance field (palp tool bakes it).
 *
 * Samples c_ijk lie on a regular grid of spacing h from `origin` on. They are coefficients of
 * quadratic B-splines, chosen so that the sum meets the mesh's distance, inside below 0:
 *
 *     d(x) = unit sum_ijk c_ijk b(u - i) b(v - j) b(w - k),   (u, v, w) = (x - origin) / h
 *
 * so distance and direction are continuous, 27 samples each. The tool is what lies within `radius`
 * of the mesh: its tips and edges are rounded by that. Beyond the grid the distance to it is added.
 */
#ifndef PALP_CONTACT_TOOL_FIELD_H
#define PALP_CONTACT_TOOL_FIELD_H

#include "core/base/real.h"
#include "core/base/status.h"
#include <stddef.h>

/* A view of the blob, which stays where it is. */
typedef struct {
    const int16_t *sample; /* [count[2]][count[1]][count[0]] */
    uint32_t count[3];     /* each at least 4 */
    palp_vec3 origin_m;
    float step_m, unit_m;
    float radius_m; /* added around the mesh */
    float size_m;   /* radius of the largest ball inside */
    const float *
        extreme; /* [extremes][3] places of the mesh, of which one lies outermost in each direction,
                             but for little; none in files of before */
    uint32_t extremes;
    float extreme_off_m; /* the little */
} palp_tool_field;

/* A distance and its gradient, in the tool's own axes. */
typedef struct {
    float distance_m;
    palp_vec3 slope;
} palp_tool_distance;

/*
 * Opens a tool in place: data is aligned to 64 bytes and stays with the caller. Checks everything
 * that is relied on later. Errors: those of a blob (ALIGNMENT, TRUNCATED, MAGIC, VERSION, CRC,
 * TABLE), ABSENT when the blob is not a tool, RANGE and NOT_FINITE when its numbers make none.
 * Cost: once over the bytes.
 */
palp_status palp_tool_field_open(palp_tool_field *field, const void *data, size_t bytes);

/* Distance of a place from the tool, below 0 inside. Cost: 27 samples, about 200 operations. */
palp_tool_distance palp_tool_field_at(const palp_tool_field *field, palp_vec3 own);

/* The place of the mesh that lies outermost along a direction, in its own axes; the origin where
 * the file has none. 5 operations for each. */
palp_vec3 palp_tool_field_extreme(const palp_tool_field *field, palp_vec3 direction);

/* The corners of its grid, in its own axes. */
void palp_tool_field_box(const palp_tool_field *field, palp_vec3 *low_m, palp_vec3 *high_m);

#endif
