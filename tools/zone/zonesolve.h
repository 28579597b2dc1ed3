/* SPDX-License-Identifier: MIT */
/* One boundary value problem of a posed multizone model, and opening such models. */
#ifndef PALP_TOOLS_ZONESOLVE_H
#define PALP_TOOLS_ZONESOLVE_H

#include "core/zone/seams.h"

typedef struct {
    const char *name;
    double value;
} zone_solve_joint;

typedef struct {
    const char *blob, *set, *output, *level;
    palp_vec3 gravity;
    bool gravity_given;
    uint32_t joints;
    zone_solve_joint joint[PALP_MAX_JOINTS];
} zone_solve_spec;

int zone_solve(const zone_solve_spec *s, const char *data, size_t bytes);

/* Opens a multizone model; exits 1 if it is not sound. To be freed. */
palp_zones *open_zones(const char *path, const char *data, size_t bytes);

/* Seams with memory for every level, in the rest configuration. Exits 1 if they cannot be. */
palp_seams *open_seams(const char *path, const palp_zones *zones);

/* Exits 1 if the closures of the configuration are open. */
void check_closures(const char *where, const palp_zones *zones,
                    const palp_configuration *configuration);

#endif
