/* SPDX-License-Identifier: MIT */
/* Triangle meshes on the host: loading, checking, connectivity, geometry. Double precision, SI
 * units. */
#ifndef PALP_TOOLS_MESH_H
#define PALP_TOOLS_MESH_H

#include "port/host/vec3.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct {
    uint32_t vertices, triangles;
    double (*x)[3];
    uint32_t (*t)[3];
} mesh;

/* What was mended in a mesh that a program exported. */
typedef struct {
    uint32_t corners;   /* repeated ones, left out */
    uint32_t wires;     /* faces of fewer than three corners, left out */
    uint32_t unused;    /* vertices that no face names, left out */
    uint32_t welded;    /* vertices at the place of another */
    uint32_t collapsed; /* edges without length */
    uint32_t facing;    /* pairs of triangles over the same vertices that face each other */
    uint32_t slivers;   /* triangles without area */
    uint32_t junctions; /* vertices that lie on an edge of another triangle */
    uint32_t split;     /* vertices added where the surface touches itself */
    double within_m;    /* how near counts as the same place */
} mesh_mended;

/* Undirected edge a < b with its two triangles, in the order in which triangles name it. */
typedef struct {
    uint32_t a, b;
    uint32_t triangle[2];
} mesh_edge;

/* Reads OBJ, STL or PLY by content and extension; polygons are triangulated, open edges mended where
 * their ends lie at the same place (meshmend.h), which is reported on stderr. Exits on bad files. */
mesh mesh_load(const char *path);
void mesh_save_obj(const mesh *m, const char *path);
mesh mesh_copy(const mesh *m);
void mesh_free(mesh *m);

/* A side of a triangle, from its `corner` to the next. */
typedef struct {
    uint32_t low, high, triangle, corner;
    bool forward; /* the triangle runs low -> high */
} half_edge;

/* All sides, sorted so that those of one edge stand together; the caller frees them. */
half_edge *mesh_half_edges(const mesh *m);
/* The first of `count` sides behind those of the edge that begins at i. */
size_t half_edge_run_end(const half_edge *h, size_t i, size_t count);

/* Whether two vertices have an edge among all sides of a mesh, sorted. */
bool half_edge_exists(const half_edge *h, size_t count, uint32_t a, uint32_t b);

/* The corner of its triangle that a side faces. */
uint32_t half_edge_facing(const mesh *m, const half_edge *side);

/* A vertex in the middle of an edge; m->x has room for `room`. */
uint32_t mesh_add_middle(mesh *m, size_t *room, const half_edge *side);

/* Makes neighbours over edges of two triangles run alike, each part like its first triangle (a
 * one-sided part stays so somewhere); returns how many parts those edges join the mesh to. */
uint32_t mesh_orient(mesh *m);

/* Cuts a triangle at vertex `at` on its side from `corner` to the next; the half behind it is added
 * at the end of m->t, which has room for `room`. */
void mesh_cut_side(mesh *m, size_t *room, const half_edge *side, uint32_t at);

/* Removes vertices that no triangle names; returns how many. */
uint32_t mesh_drop_unused(mesh *m);

/*
 * Makes triangles consistently oriented, outward, and exits with the offending element unless the
 * mesh is one closed, edge- and vertex-manifold component of non-degenerate triangles without
 * unused vertices.
 */
void mesh_require_closed(mesh *m, const char *path);

/* All edges of a closed manifold mesh, sorted by (a, b); *count = 3 triangles / 2. */
mesh_edge *mesh_edges(const mesh *m, uint32_t *count);

/* [triangles][3]: the triangle beyond the edge that faces each corner; to be freed. */
uint32_t *mesh_across(const mesh *m);

/* Neighbours of each vertex: ring[offset[i]..offset[i+1]), ascending. */
void mesh_rings(const mesh *m, uint32_t **offset, uint32_t **ring);

/* Triangles around each vertex: triangle[offset[i]..offset[i+1]), ascending. To be freed. */
void mesh_stars(const mesh *m, uint32_t **offset, uint32_t **triangle);

/*
 * A blob holds places in single precision, from the origin of the file: the error says so where
 * their rounding is more than 1e-4 of the points' extent, and a warning above 1e-5.
 */
void require_near_origin(double (*x)[3], uint32_t count, const char *path);

/* So far from the origin that the digits of a file may have run out. */
bool mesh_is_far(const mesh *m);

double mesh_volume(const mesh *m);
void mesh_bounds(const mesh *m, double low[3], double high[3]);
void mesh_extent(const mesh *m, double size[3]); /* of the bounding box */
double mesh_diagonal(const mesh *m);
double mesh_mean_edge(const mesh *m);
double mesh_longest_edge(const mesh *m, uint32_t triangle);
/* Integral of each vertex' hat function (MR 4) and the angle-weighted outward unit normals. */
void mesh_nodal(const mesh *m, double *area, double (*normal)[3]);
void mesh_unit_normal(const mesh *m, uint32_t triangle, double n[3]);
double mesh_triangle_angle_deg(const mesh *m, uint32_t triangle); /* its smallest */
double mesh_smallest_angle_deg(const mesh *m);

#endif
