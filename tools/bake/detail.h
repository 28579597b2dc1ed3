/* SPDX-License-Identifier: MIT */
/* The display surface: Loop subdivision of the baked mesh, displaced onto a finer one (MR 9.2). */
#ifndef PALP_TOOLS_DETAIL_H
#define PALP_TOOLS_DETAIL_H

#include "tools/mesh/mesh.h"

typedef struct {
    uint32_t vertices, triangles;
    uint32_t *offset, *node, *near, *list;
    float *weight, *height;
    uint32_t (*t)[3];
    double mean, largest; /* distance from the displaced surface to the finer mesh */
} detail_data;

/* `levels` steps (1 to 3) over `m`, heights to `fine` along the normals. */
detail_data detail_build(const mesh *m, uint32_t levels, const mesh *fine);
void detail_free(detail_data *d);

#endif
