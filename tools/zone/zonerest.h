/* SPDX-License-Identifier: MIT */
/*
 * What contact needs of a multizone model: in the rest configuration all zones are one body, which
 * near a load is a half-space, at seams as well. The rest of its compliance,
 *
 *     H = G + P A^-1 P^T - B
 *
 * (G: the zones' own with their seams held, P: how the surface follows the seams, A: the seams'
 * balance) has few modes, common to all zones. B is that of the whole model's surface, which the
 * seams do not belong to.
 */
#ifndef PALP_TOOLS_ZONEREST_H
#define PALP_TOOLS_ZONEREST_H

#include "tools/bake/build.h"
#include "tools/mesh/cut_mesh.h"

/* One zone, with its seams held. */
typedef struct {
    const mesh *m;
    const uint32_t *seam_of; /* [vertices] PALP_NONE: on none */
    const greens *g;
    const domains *dom;
    const float *stiffness, *response; /* as in the file (core/zone/zones.h) */
    uint32_t seams, list[PALP_MAX_ZONE_SEAMS], first[PALP_MAX_ZONE_SEAMS], modes;
    half_space_material material;
} rest_zone;

typedef struct {
    uint32_t zones, seams;
    rest_zone zone[PALP_MAX_ZONES];
    const seam_list *seam;
    const palp_seam_entry *entry;
} rest_model;

/* The model's surface at rest. */
typedef struct {
    mesh m;
    uint32_t *vertex[PALP_MAX_ZONES]; /* [vertices] of each zone in it; PALP_NONE: inside */
    double *area;
    double (*normal)[3];
} rest_surface;

/* Whether a triangle of a zone lies on a seam. */
bool rest_is_inner(const rest_zone *zone, uint32_t triangle);

rest_surface rest_surface_build(const rest_model *model);
void rest_surface_free(rest_surface *surface, uint32_t zones);

/* The regular part of the whole model, at the vertices of its surface. Exits when A is not positive
 * definite. Threaded; the same bits on any number of threads. */
regular_data rest_regular(const rest_model *model, const rest_surface *surface, uint32_t modes);

/* What of it a zone's blob has. */
regular_data rest_share(const rest_model *model, const rest_surface *surface,
                        const regular_data *common, uint32_t zone);

#endif
