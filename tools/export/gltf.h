/* SPDX-License-Identifier: MIT */
/*
 * glTF 2.0: the surfaces, coloured by what holds them, and the tools, on nodes of their own. A session is animated:
 * each surface moves by morph targets (shapes.h), each tool by its node. Lengths are metres; the root turns z up to
 * y up. One file: .glb, or .gltf with the bytes in it.
 */
#ifndef PALP_TOOLS_GLTF_H
#define PALP_TOOLS_GLTF_H

#include "tools/export/film.h"

/* What was left out to make it small: in m, of a surface's displacements. */
typedef struct {
    uint32_t shapes;
    double missed_m, largest_m;
} gltf_report;

gltf_report gltf_write(FILE *out, const film *f, bool binary);

#endif
