/* SPDX-License-Identifier: MIT */
/* A blob's card: one page that says what it is, how stiff it is where, what its ticks may take, and how it will feel on
 * which device. */
#ifndef PALP_TOOLS_CARD_H
#define PALP_TOOLS_CARD_H

#include "port/host/page.h"

/* Writes it to `path`; describe(file, context) writes the lines of palp info, names in the first 22 columns. */
void card_write(const char *blob, const char *path, double rate_hz, page_writer *describe,
                const void *context);

#endif
