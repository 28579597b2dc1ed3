/* SPDX-License-Identifier: MIT */
/* Logs in the format of can-utils' candump -L. */
#ifndef PALP_PORT_CANDUMP_H
#define PALP_PORT_CANDUMP_H

#include "core/device/canframe.h"
#include <stdio.h>

/* "(seconds.microseconds) interface id#data" */
void candump_line(FILE *f, double time_s, const char *interface, const palp_can_frame *frame);

#endif
