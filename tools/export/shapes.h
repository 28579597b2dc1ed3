/* SPDX-License-Identifier: MIT */
/* A motion as few shapes and how much of each there is at each time, found greedily: the frame that is missed most
 * gives the next shape, orthogonal to those before. */
#ifndef PALP_TOOLS_SHAPES_H
#define PALP_TOOLS_SHAPES_H

#include <stddef.h>
#include <stdint.h>

#define SHAPES_MOST 128u
#define SHAPES_GOAL 2e-3 /* of the largest displacement: what may be missed at any node */

typedef struct {
    uint32_t count;
    float *shape;   /* [count][values] */
    float *weight;  /* [frames][count], of each shape 1 at most */
    double missed;  /* largest difference of an entry */
    double largest; /* entry of the motion */
} shape_basis;

/* Of x[frames], each values long, less rest[values]. */
shape_basis shapes_of(const float *const *x, size_t frames, const float *rest, size_t values);
void shapes_free(shape_basis *b);

#endif
