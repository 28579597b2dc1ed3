/* SPDX-License-Identifier: MIT */
/*
 * Bakes a rigid tool: a closed mesh into a signed distance field (core/contact/tool_field.h).
 *
 * Samples are exact distances; the coefficients of the quadratic B-spline that meets them follow by
 * one tridiagonal solution along each axis. Such a field is off where it has an edge of its own
 * within a step or so: at sharp edges and tips, and in the middle of parts thinner than two steps,
 * which it may not see at all. There a radius helps, by which the tool is made larger all around.
 */
#ifndef PALP_TOOLS_TOOLBAKE_H
#define PALP_TOOLS_TOOLBAKE_H

#include "core/blob/format.h"
#include "tools/mesh/mesh.h"

#define TOOL_ERROR 0.005 /* of its diagonal: what a field may be off by without a radius */
#define TOOL_BLIND 0.01  /* share of the surface over parts that a field may miss */
#define TOOL_BYTES 1e6   /* that a field takes by default */
#define TOOL_LEAST_CELLS 8
#define TOOL_MOST_CELLS 1000

typedef struct {
    uint32_t cells;    /* along its longest side; 0: as many as TOOL_BYTES hold */
    bool radius_given; /* else the least that makes it as exact as TOOL_ERROR */
    double radius_m;
    double reference[3]; /* what the device holds it by; m, in the mesh */
} tool_options;

typedef struct {
    uint32_t count[3];
    double diagonal_m, size[3];
    double step_m, radius_m, size_m;
    double error_mean_m, error_max_m; /* of the distance at the surface */
    double worst[3];                  /* where, in the mesh */
    double thin; /* share of the surface over parts that the field does not see */
} tool_report;

/* The finished bytes, to be freed; they pass palp_tool_field_open. `m` is closed, outward. */
uint8_t *tool_bake(const mesh *m, const tool_options *options, const uint8_t sha[32],
                   tool_report *report, size_t *bytes);

#endif
