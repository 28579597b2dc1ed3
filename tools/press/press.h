/* SPDX-License-Identifier: MIT */
/* Presses of a rigid ball on a body, solved until they are settled: what levels differ by. */
#ifndef PALP_TOOLS_PRESS_H
#define PALP_TOOLS_PRESS_H

#include "port/host/opencontact.h"

/* A node's entry of a blob's places or normals. */
static inline palp_vec3 at_node(const float *x, uint32_t node) {
    return palp_vec3_at(x + 3 * (size_t)node);
}

/* Holds the only tool rigidly at a place for so many ticks. */
void press_hold(palp_contact *contact, palp_vec3 at, int ticks);

/* The point of the smooth surface that a shot along -n from `from` meets; p->triangle is where to
 * begin. */
bool press_point(const palp_contact *contact, palp_vec3 from, palp_vec3 n, palp_surface_point *p);
/* The one next to a node. */
palp_surface_point press_start(const palp_contact *contact, uint32_t node);

/* Whether no node lies more than half as much again in a ball pressed so deep. */
bool press_is_clear(const palp_blob *blob, palp_vec3 at, double radius, double depth);

/* Force of each level against the finest: |F - F_finest| / |F_finest| over balls of 1, 2, 4 and 6
 * edges pressed a tenth of their radius deep at each place, where that is clear. */
typedef struct {
    double mean[PALP_CONTACT_LEVELS], worst[PALP_CONTACT_LEVELS];
    uint32_t count; /* presses */
} press_errors;
press_errors press_levels(const palp_blob *blob, const uint32_t *place, uint32_t places);

#endif
