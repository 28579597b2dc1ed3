/* SPDX-License-Identifier: MIT */
/* Lines in the format of can-utils' candump -L: "(seconds.microseconds) interface id#data", with ##
 * and a digit of flags for CAN FD. */
#ifndef PALP_SIM_CANDUMP_H
#define PALP_SIM_CANDUMP_H

#include "core/device/canframe.h"
#include <stdio.h>

#define CANDUMP_LINE 256
#define CANDUMP_NAME 32

void candump_write(FILE *f, double time_s, const char *interface, const palp_can_frame *frame);

/* False when the line is not in the format. */
bool candump_read(const char *line, double *time_s, char interface[CANDUMP_NAME],
                  palp_can_frame *frame);

#endif
