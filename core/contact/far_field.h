/* SPDX-License-Identifier: MIT */
/*
 * How far the body as a whole has given way near a tool: the displacement by its modes, as an
 * affine field over the contact,
 *
 *     h(y) = mean + slope (y - at)
 *
 * A thin part that bends moves by many times the depth that a tool sinks in, and turns. Contact
 * points are laid where the tool overlaps the surface moved by h of the last tick, so they cover
 * the contact however far the body has bent. Beyond the reach of the contact, where a tool may lie
 * against another part of the body, h fades, and is nothing from twice the reach on. This only says
 * where points are wanted, not what they feel.
 */
#ifndef PALP_CONTACT_FAR_FIELD_H
#define PALP_CONTACT_FAR_FIELD_H

#include "core/base/real.h"

typedef struct {
    palp_vec3 at_m, mean_m;
    float slope[9]; /* row-major */
    float fade;     /* 1 / reach^2; 0: the field goes on for ever */
} palp_far_field;

/* h(y) - mean; *gone, 0 to 1: how far y is beyond the reach, so that h has faded. */
palp_vec3 palp_far_field_beside(const palp_far_field *far_field, palp_vec3 y, float *gone);
/* slope^T d */
palp_vec3 palp_far_field_turned_back(const palp_far_field *far_field, palp_vec3 d);

/* The field times a factor. */
palp_far_field palp_far_field_times(const palp_far_field *far_field, float factor);

/* Sums for the weighted least squares of places y and their displacements h. */
typedef struct {
    float weight, cell;
    palp_vec3 y, h;
    float yy[9], hy[9];
} palp_far_field_sums;

/* Takes one place in, y and h counted from near the others (for digits), and the size of the cell
 * that it stands for. Cost: 32. */
void palp_far_field_add(palp_far_field_sums *sums, float weight, palp_vec3 y, palp_vec3 h,
                        float cell_m);
/* The field, for places counted from `origin_m`. Slopes that few or straight places leave open are
 * held small. Its reach is three times the
 * places' RMS distance from their mean and a cell. Cost: 160. */
palp_far_field palp_far_field_fit(const palp_far_field_sums *sums, palp_vec3 origin_m);

#endif
