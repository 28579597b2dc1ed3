/* SPDX-License-Identifier: MIT */
/* Measures what an operation of the cost bounds takes on this machine, on the blob that will be
 * felt. */
#ifndef PALP_PORT_CALIBRATE_H
#define PALP_PORT_CALIBRATE_H

#include "core/servo/budget.h"

/* Upper estimate of ns per operation, from timing admissions and solves around `node`. */
float calibrate(const palp_blob *blob, palp_contact_limits limits, const palp_tool *tool,
                uint32_t node);

#endif
