/* SPDX-License-Identifier: MIT */
/* How stiff a body is where. */
#ifndef PALP_HOST_STIFFNESS_H
#define PALP_HOST_STIFFNESS_H

#include "core/blob/blob.h"

/* stiffness[nodes], N/m: a force along the normal of a free node over its displacement along it; 0 at fixed nodes, and
 * where the blob's finest constraint level has no basis function. Cost: a column for each node. */
void node_stiffness(const palp_blob *blob, float *stiffness);

#endif
