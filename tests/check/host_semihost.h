/* SPDX-License-Identifier: MIT */
/* What an image of port/embedded prints, on this machine: included before anything else. */
#ifndef PALP_PORT_SEMIHOST_H
#define PALP_PORT_SEMIHOST_H

#include <stdint.h>
#include <stdio.h>

static inline void semihost_print(const char *text) { fputs(text, stdout); }

#endif
