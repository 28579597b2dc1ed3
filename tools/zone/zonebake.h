/* SPDX-License-Identifier: MIT */
/* Bakes a multizone model: each zone's RBVP with its bone and seam nodes held, condensed to the
 * modes of its seams. */
#ifndef PALP_TOOLS_ZONEBAKE_H
#define PALP_TOOLS_ZONEBAKE_H

#include "tools/zone/zonemodel.h"

/*
 * `common` is the whole body, where zones are cut from one mesh; `options` what is asked of each
 * zone's blob. Prints what was made on `f` (NULL: nothing). Meshes of the zones are written beside
 * `save_mesh` (NULL: not). Returns the finished bytes, to be freed.
 */
uint8_t *zone_bake(zone_model *z, const body_spec *common, const build_options *options,
                   const char *path, const char *save_mesh, FILE *f, size_t *bytes);

#endif
