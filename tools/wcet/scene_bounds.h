/* SPDX-License-Identifier: MIT */
/* palp wcet of a scene: what each of its bodies and devices takes at most, and all of them together. */
#ifndef PALP_TOOLS_SCENE_BOUNDS_H
#define PALP_TOOLS_SCENE_BOUNDS_H

#include "port/host/openscene.h"
#include "tools/wcet/wcet.h"

/* Adds its rows to the table: of each body by its name, then of the whole scene; the last is the least
 * answer of all. */
void scene_bounds(const scene_setup *setup, const machine *m, wcet_table *table);

#endif
