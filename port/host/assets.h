/* SPDX-License-Identifier: MIT */
/* Files that are built into the programs (assets.S): the parts of every page. */
#ifndef PALP_HOST_ASSETS_H
#define PALP_HOST_ASSETS_H

#include <stddef.h>

typedef enum { ASSET_STYLE, ASSET_PLOT, ASSET_BODY, ASSET_REPORT, ASSET_CARD, ASSETS } asset;

/* The text of a part, not terminated. */
const char *asset_text(asset which, size_t *bytes);

#endif
