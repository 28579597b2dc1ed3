/* SPDX-License-Identifier: MIT */
/* Tetrahedral meshes on the host: geometry, quality, files. Double precision, SI units. */
#ifndef PALP_TOOLS_TETMESH_H
#define PALP_TOOLS_TETMESH_H

#include "tools/mesh/bvh.h"

typedef struct {
    uint32_t nodes, tets;
    double (*x)[3];
    uint32_t (*t)[4]; /* of positive volume: (x1 - x0) x (x2 - x0) . (x3 - x0) > 0 */
} tetmesh;

void tetmesh_free(tetmesh *m);

/* A block of edges size[3] (m) from the origin, n[3] cells each cut into six tetrahedra; every
 * second cell the other way around with `mirrored`. */
tetmesh tetmesh_block(const double size[3], const uint32_t n[3], bool mirrored);

double tet_volume(const tetmesh *m, uint32_t tet);

/* Rest gradients of the hat functions of nodes 1 to 3 (AD 5); that of node 0 is minus their sum. */
void tet_gradients(const tetmesh *m, uint32_t tet, double b[3][3]);

/* Smallest and largest of the six dihedral angles, in degrees. */
void tet_dihedral_deg(double x[4][3], double *low, double *high);

/* A face of a tetrahedron: its corners outward, and ascending. */
typedef struct {
    uint32_t key[3], corner[3], tet;
} tet_face;
bool tet_face_same(const tet_face *a, const tet_face *b);
/* All 4 tets of them, the same ones side by side. To be freed. */
tet_face *tetmesh_faces(const tetmesh *m);

/* Faces of one tetrahedron only, outward, in the order of tetrahedra; as a mesh that shares its
 * vertices' numbers with m->x. To be freed; *count triangles. */
uint32_t (*tetmesh_boundary(const tetmesh *m, uint32_t *count))[3];

/* The tetrahedra of each node: list[offset[i]..offset[i+1]), ascending. */
void tetmesh_around(const tetmesh *m, uint32_t **offset, uint32_t **list);

/* What the makers of a mesh want to know of it. */
typedef struct {
    double low_deg, high_deg; /* worst dihedral angles */
    double volume_error;      /* relative to that of the surface */
    double mean_m, largest_m; /* distance of its boundary's corners and faces from the surface */
    double far_m;             /* furthest vertex of the surface from the boundary */
    double edge_m;            /* mean edge */
} tet_quality;
/* Without a tree on_surface of `surface` only angles and edges. */
tet_quality tetmesh_quality(const tetmesh *m, const mesh *surface, const bvh *on_surface);

/* Reads and writes Medit's text format (.mesh). Exits with the line on bad files. */
tetmesh tetmesh_load(const char *path);
void tetmesh_save(const tetmesh *m, const char *path);

#endif
