/* SPDX-License-Identifier: MIT */
/*
 * The regular part of a body's compliance, for contact on its surface.
 *
 * Near its load a body is a half-space. With B_kl what of node l's force a half-space would show at
 * node k (half_space.h),
 * the rest H = G - B has no singularity and few modes: its eigenpairs of largest magnitude,
 * weighted by nodal areas, are what the blob stores. Zero at fixed nodes.
 */
#ifndef PALP_TOOLS_REGULAR_H
#define PALP_TOOLS_REGULAR_H

#include "tools/bake/half_space.h"
#include "tools/bake/hierarchy.h"

typedef struct {
    uint32_t modes;
    uint32_t *across;   /* [triangles][3] */
    uint32_t *triangle; /* [nodes] */
    float *value;       /* [modes] */
    int16_t *vector;    /* [nodes][3][modes] */
    double left_over;   /* |H - U S U^T|_F / |G|_F, by nodal areas */
} regular_data;

typedef struct {
    const mesh *m;
    const double *area;
    double (*normal)[3];
    half_space_material material;
    const hierarchy *h;
    uint32_t level; /* of the columns */
    bool averaged;  /* displacements are means under the hats */
} regular_body;

/*
 * `x`: the columns of `level`, [3 nodes][3 n_level], symmetric where both nodes are free;
 * destroyed. `modes` wanted; fewer where the body has fewer unknowns. Threaded; the same bits on
 * any number of threads.
 */
regular_data regular_build(const regular_body *body, double *x, uint32_t modes);

/*
 * The same of a body whose compliance is given at some of its nodes: `g`, [3 nodes][3 nodes],
 * symmetric, destroyed. Materials may differ from node to node; B is that of the mean of both. Of
 * the body there are needed m, area and normal. Without `across` and `triangle`.
 */
typedef struct {
    const uint32_t *node; /* [nodes] in the body's mesh */
    uint32_t nodes;
    const half_space_material *material; /* [nodes] */
} regular_nodes;
regular_data regular_build_nodes(const regular_body *body, const regular_nodes *nodes, double *g,
                                 uint32_t modes);

/* across and triangle of a zone's mesh, whose triangles inner[t] != 0 are not to be touched. */
void regular_close_borders(regular_data *r, const mesh *m, const uint8_t *inner);

void regular_free(regular_data *r);

#endif
