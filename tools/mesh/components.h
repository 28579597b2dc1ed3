/* SPDX-License-Identifier: MIT */
/* The parts of a mesh that no triangle joins. */
#ifndef PALP_TOOLS_COMPONENTS_H
#define PALP_TOOLS_COMPONENTS_H

#include "tools/mesh/mesh.h"

typedef struct {
    uint32_t count;
    uint32_t *of;        /* [triangles]: the component, 0 the one of most area */
    uint32_t *triangles; /* [count] */
} mesh_components;

/* Triangles that share a vertex belong together. To be freed by mesh_components_free. */
mesh_components mesh_find_components(const mesh *m);
void mesh_components_free(mesh_components *c);

/* Exits 1 where one component lies inside another: a hollow body, which is not baked. */
void mesh_refuse_cavities(const mesh *m, const mesh_components *c, const char *path);

/* Leaves the one component, which there is, and no vertex that it does not use. */
void mesh_take_component(mesh *m, const mesh_components *c, uint32_t component);

/* The same, by number; says so, and exits 2 where there is none. */
void mesh_keep_component(mesh *m, const char *path, uint32_t component);

#endif
