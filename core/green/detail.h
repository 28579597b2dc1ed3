/* SPDX-License-Identifier: MIT */
/*
 * Display on a displaced subdivision surface (MR 9.2): geometric detail finer than the elastic
 * model rides on the deformed surface. On the display path.
 */
#ifndef PALP_GREEN_DETAIL_H
#define PALP_GREEN_DETAIL_H

#include "core/base/real.h"
#include "core/blob/blob.h"

/*
 * vertex[detail vertices][3] and normal[detail vertices][3] (unit, of the displaced surface) for
 * nodes at position[nodes][3]. Cost: 3 multiply-adds per stored weight, two passes over the
 * triangles. Does nothing without a detail surface.
 */
void palp_detail_surface(const palp_blob *blob, const float *position_m, float *vertex_m,
                         float *normal);

/*
 * The detail's normal near x, from the vertices around `node` and its neighbours: their mean under
 * (1 - |v - x|^2 / radius^2)^2. The normal of the node if there is no detail within the radius. For
 * palp_force_shade. Cost: the vertices around one ring of nodes.
 */
palp_vec3 palp_detail_normal(const palp_blob *blob, const float *vertex_m, const float *normal,
                             uint32_t node, palp_vec3 x, float radius_m);

#endif
