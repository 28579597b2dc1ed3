/* SPDX-License-Identifier: MIT */
/* What a model file says of zones, joints and seams. Coordinates are those of the model at rest. */
#ifndef PALP_TOOLS_ZONEMODEL_H
#define PALP_TOOLS_ZONEMODEL_H

#include "tools/bake/body.h"
#include "core/zone/zones.h"

#define MAX_CUTS 64

typedef struct {
    char name[PALP_NAME_BYTES];
    body_spec body;  /* what the file said of all zones before, and of this one behind its line */
    double place[6]; /* frame: origin, and rotation vector (rad) */
    bool own_mesh;
    uint32_t joint; /* that carries it, PALP_NONE */
} zone_spec;

typedef struct {
    char name[PALP_NAME_BYTES];
    palp_joint_kind kind;
    uint32_t parent, child;
    bool closure, has_limits;
    double axis[3], origin[3], low, high;
    const char *where;
} joint_spec;

typedef struct {
    uint32_t from, to;
    double point[3], normal[3];
    const char *where;
} cut_spec;

typedef struct {
    uint32_t zone[2];
    const char *list[2]; /* files of nodes in order; NULL: nodes that coincide */
    const char *where;
} seam_spec;

typedef struct {
    uint32_t zones, joints, cuts, seams, seam_modes;
    zone_spec *zone; /* [PALP_MAX_ZONES] */
    joint_spec joint[PALP_MAX_JOINTS];
    cut_spec cut[MAX_CUTS];
    seam_spec seam[PALP_MAX_SEAMS];
    const char *labels;
} zone_model;

/* For option tables of model files. */
#define ZONE_OPTIONS                                                                               \
    {"--zone", 1}, {"--frame", 6}, {"--labels", 1}, {"--cut", 8}, {"--joint", 4},                  \
        {"--closure", 4}, {"--axis", 3}, {"--origin", 3}, {"--limits", 2}, {"--seam", -4}, {       \
        "--seam-modes", 1                                                                          \
    }

/* Takes one of ZONE_OPTIONS; false if it is another. `common` is what was said of the body so far.
 */
bool zone_option(zone_model *z, body_spec *common, const argument *a);

/* The body that keys speak of now: that of the last zone, or the common one. */
body_spec *zone_body(zone_model *z, body_spec *common);

/*
 * Puts zones in an order in which parents come first and checks that joints make a tree; exits with
 * the offending line. `path` names the file.
 */
void zone_model_check(zone_model *z, const char *path);

/* How many joints lie between a zone and the root; exits when they run in a circle. */
uint32_t zone_depth(const zone_model *z, uint32_t zone);

/* The zone of that name, PALP_NONE. */
uint32_t zone_find(const zone_model *z, const char *name);

#endif
