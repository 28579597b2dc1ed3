/* SPDX-License-Identifier: MIT */
/* The measures of felt quality that need a device. */
#ifndef PALP_SIM_FEEL_DEVICE_H
#define PALP_SIM_FEEL_DEVICE_H

#include "tools/feel/bench.h"

void feel_device(bench *b);

#endif
