/* SPDX-License-Identifier: MIT */
#ifndef PALP_HOST_TROUBLE_H
#define PALP_HOST_TROUBLE_H

#include "core/device/drive.h"
#include <stddef.h>

/* What keeps a drive from working, with the object and the code where the protocol has them, and
 * what to do about it; "" for none. */
void trouble_text(const palp_drive_trouble *t, palp_protocol protocol, char *text, size_t size);

#endif
