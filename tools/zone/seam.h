/* SPDX-License-Identifier: MIT */
/* Seams between zones: lists of nodes that must match in length, order and triangulation, and the
 * modes in which their displacements are described. */
#ifndef PALP_TOOLS_SEAM_H
#define PALP_TOOLS_SEAM_H

#include "core/zone/zones.h"
#include "tools/mesh/cut_mesh.h"
#include "tools/zone/zonemodel.h"

#define SEAM_TOLERANCE 1e-6 /* of the model's diagonal, between bonded nodes */

/* The seam that a model file asks for between two meshes in the model's coordinates; exits with the
 * first node or triangle that does not match. */
seam_list seam_match(const seam_spec *s, const zone_model *z, const mesh *zone, double diagonal);

/* mode[nodes][modes] orthonormal, at most `limit`; `entry` gets counts, levels and affine parts. To
 * be freed. */
double *seam_modes(const seam_list *s, const mesh *first, uint32_t limit, palp_seam_entry *entry);

#endif
