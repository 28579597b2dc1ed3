/* SPDX-License-Identifier: MIT */
/* How fast this machine does what the cost bounds count, measured on the blob that will be felt. */
#ifndef PALP_TOOLS_CALIBRATE_H
#define PALP_TOOLS_CALIBRATE_H

#include "core/contact/tool.h"
#include "core/blob/blob.h"
#include "port/host/machine.h"

/*
 * The target that this program was built for, with its speed here: time over the bound in
 * instructions of the steps of contact around `node`, warm. With `cold` also ns_per_byte, from the
 * same after the caches were filled with other data: for the first ticks after a rest; a loop that
 * runs keeps its caches. Upper estimates, CALIBRATE_SAFETY times what was typical of the slowest
 * kind, each sample the least of several repeats. Runs in the caller's thread: on its processor and
 * with its priority.
 */
#define CALIBRATE_SAFETY 2.0
void calibrate(machine *m, const palp_blob *blob, const palp_tool *tool, uint32_t node, bool cold);

#endif
