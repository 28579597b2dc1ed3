/* SPDX-License-Identifier: MIT */
/* What contact on the surface is compared with: a rigid ball held against all nodes near it, in
 * true geometry and in double, by the blob's Green's functions. Right where the mesh is fine
 * against the contact; below some two edges of contact radius it has the rhythm of the mesh. */
#ifndef PALP_TOOLS_NODAL_H
#define PALP_TOOLS_NODAL_H

#include "core/blob/blob.h"

typedef struct {
    double force_N[3]; /* on the ball */
    uint32_t near, touched;
    bool settled; /* false too when more nodes than fit are near */
} nodal_press;

nodal_press nodal_hold(const palp_blob *blob, const double at_m[3], double radius_m);

#endif
