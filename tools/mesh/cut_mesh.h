/* SPDX-License-Identifier: MIT */
/*
 * Cuts a closed mesh into zones: a label for each triangle, from planes or from a file, and new
 * surface between zones, the same triangles on both sides.
 */
#ifndef PALP_TOOLS_CUT_MESH_H
#define PALP_TOOLS_CUT_MESH_H

#include "tools/mesh/mesh.h"

/* Two ordered lists of nodes, one in each zone, that are bonded pairwise. */
typedef struct {
    uint32_t zone[2];
    uint32_t nodes;
    uint32_t (*node)[2]; /* [nodes]: in zone[0], in zone[1] */
} seam_list;

/* A mesh under the knife. */
typedef struct {
    mesh m;
    uint32_t *label; /* [triangles] zone */
    size_t vertex_room, triangle_room, label_room;
    double snapped_m; /* farthest that a vertex was moved along an edge onto a plane */
} cutting;

/* Takes the mesh over; all of it belongs to zone 0. */
cutting cut_begin(mesh m);

/*
 * What of zone `from` lies beyond the plane through `point` with that normal becomes zone `to`.
 * Vertices less than a quarter of an edge from the plane are moved along it onto the plane, so that
 * no slivers arise. `where` names the cut in messages; exits when nothing, or all, lies beyond.
 */
void cut_plane(cutting *c, uint32_t from, uint32_t to, const double point[3],
               const double normal[3], const char *where);

/* Zones by label: one name per line, a line per triangle. `find` gives the zone of a name. */
void cut_labels(cutting *c, const char *path, uint32_t (*find)(const void *context, const char *),
                const void *context);

/*
 * Closes each zone: zone[zones] get their meshes (vertices renumbered, those of the surface in the
 * order of the whole mesh, then those of the cuts), *seams the list of seams, to be freed. Exits
 * when a zone is empty or three zones meet.
 */
uint32_t cut_finish(const cutting *c, uint32_t zones, const char *const *name, mesh *zone,
                    seam_list **seams);

#endif
