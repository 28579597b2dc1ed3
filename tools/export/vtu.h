/* SPDX-License-Identifier: MIT */
/* ParaView's files: a VTU (unstructured grid of triangles, values appended as raw bytes), and a PVD that lists one for
 * each frame of a session. */
#ifndef PALP_TOOLS_VTU_H
#define PALP_TOOLS_VTU_H

#include "tools/export/film.h"

/* A blob at rest, with what is known of its nodes: normal, area, fixed, stiffness. */
void vtu_write_rest(FILE *out, const film *f);
/* A frame: displacement, pressure, fixed. */
void vtu_write_frame(FILE *out, const film *f, size_t frame);
/* The list; frames are files NAME_0000.vtu beside it. */
void pvd_write(FILE *out, const film *f, const char *name);

#endif
