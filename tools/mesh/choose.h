/* SPDX-License-Identifier: MIT */
/* Which part of a mesh file is meant, and in what unit it is. */
#ifndef PALP_TOOLS_CHOOSE_H
#define PALP_TOOLS_CHOOSE_H

#include "port/host/args.h"
#include "tools/mesh/mesh.h"

typedef struct {
    double unit_m; /* 0: metres */
    bool one;      /* only one component, the n-th by size */
    uint32_t component;
    bool holes_given;
    double holes_m; /* longest rim that is closed */
} mesh_choice;

/* For option tables. */
#define MESH_OPTIONS                                                                               \
    {"--units", 1}, {"--largest", 0}, {"--component", 1}, { "--holes", 1 }
#define MESH_HELP                                                                                  \
    "  --units mm|cm|m|inch    of the mesh file (default m)\n"                                     \
    "  --largest               keep the largest of several components\n"                           \
    "  --component N           keep component N, 0-based, the largest first\n"                     \
    "  --holes LENGTH          close holes with a rim of at most this many metres (default: "      \
    "what\n"                                                                                       \
    "                          is remeshed, those of at most the diagonal; a mesh as is, none)\n"

/* Takes one of MESH_OPTIONS; false if it is another. */
bool mesh_option(mesh_choice *c, const argument *a);

/*
 * mesh_load, in metres, with its holes closed: those that were asked for, or else with a rim of at
 * most `usual` bounding box diagonals of the file; then the component that was chosen.
 */
mesh mesh_load_as(const char *path, const mesh_choice *c, double usual);
#define HOLES_REMESHED 1.0
#define HOLES_AS_IS 0.0

/* Vertices of a file in its unit (0: metres), from another origin in metres. */
void mesh_place(mesh *m, double unit_m, const double origin[3]);

/* Warns of sizes that no body has. */
void mesh_warn_of_size(const mesh *m, const char *path);

#endif
