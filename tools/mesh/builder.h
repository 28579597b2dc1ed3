/* SPDX-License-Identifier: MIT */
/* A mesh while its file is read: vertices and polygons in any order, then triangles. */
#ifndef PALP_TOOLS_BUILDER_H
#define PALP_TOOLS_BUILDER_H

#include "tools/mesh/mesh.h"

typedef struct {
    size_t first, corners; /* in builder.corner */
    size_t line;           /* where it stands in the file, or its number from 1 */
} polygon;

typedef struct {
    const char *path;
    double (*x)[3];
    size_t *x_line; /* where each vertex stands */
    int64_t *corner;
    polygon *face;
    size_t vertices, corners, faces;
    size_t x_capacity, line_capacity, corner_capacity, face_capacity;
    mesh_mended mended;
    int first_number; /* of a vertex, as the file counts */
    bool separate;    /* each triangle has vertices of its own (STL) */
} builder;

void builder_vertex(builder *b, const double x[3], size_t line);

/* A polygon begins; its corners follow, vertex numbers from 0. */
void builder_face(builder *b, size_t line);
void builder_corner(builder *b, int64_t vertex);

/*
 * The triangles of all polygons, by ear clipping, so that concave ones keep their shape. Corners
 * that are repeated are left out, and what has fewer than three then; so are vertices that no
 * polygon names, which may be anything. Exits 1 where a vertex that is named is absent or not finite. Frees what
 * the builder holds.
 */
mesh builder_finish(builder *b);

/* ---- readers: exit 1 on what they cannot read, with path and line ---- */

/* `text` ends in zero and has line ends of one kind, '\n'. */
void read_obj(builder *b, const char *text);
void read_stl(builder *b, const char *data, size_t bytes);
void read_ply(builder *b, const char *data, size_t bytes);

/* Makes line ends of one kind ('\r' alone becomes '\n') and leaves zeros at the end out; returns the
 * length that is left. */
size_t text_normalise(char *text, size_t bytes);
const char *skip_blanks(const char *p);

#endif
