/* SPDX-License-Identifier: MIT */
/*
 * Mending meshes as programs export them.
 *
 *   weld        vertices at open edges that lie at the same place become one, the first
 *   collapse    so do the ends of an edge without length
 *   facing      two triangles over the same vertices that face each other go, unless all do
 *   slivers     a triangle whose corners lie on a line goes; its longest edge is turned
 *   junctions   where a vertex of one open edge lies on another, that one's triangle is cut there
 *   touching    vertices are doubled where the surface touches itself (meshsplit.h)
 *
 * The same place, no length: within 1e-6 of the bounding box' diagonal.
 */
#ifndef PALP_TOOLS_MESHMEND_H
#define PALP_TOOLS_MESHMEND_H

#include "tools/mesh/mesh.h"

/* Adds what it does to `mended`. */
void mesh_mend(mesh *m, mesh_mended *mended);

/* Only triangles without area; returns how many were turned. */
uint32_t mesh_turn_slivers(mesh *m);

/* One line on stderr if anything was mended. */
void mesh_report_mended(const char *path, const mesh_mended *mended);

#endif
