/* SPDX-License-Identifier: MIT */
/* A surface in motion on a page: turned with the mouse, coloured by the level that is active. */
#ifndef PALP_TOOLS_ANIMATION_H
#define PALP_TOOLS_ANIMATION_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

typedef struct {
    uint32_t vertices, triangles;
    const uint32_t *triangle; /* [triangles][3] */
    double frame_s, unit_m;   /* time between frames; length that coordinates count */
    double ball_m;            /* radius of the ball that is drawn; 0: none */
    size_t frames, room;
    int16_t *frame; /* [frames][vertices + 1][3], the ball last */
    uint8_t *level; /* [frames][vertices] */
    size_t level_room;
} animation;

/* An animation of a surface that stays within reach_m of the origin. */
animation animation_open(uint32_t vertices, uint32_t triangles, const uint32_t *triangle,
                         double frame_s, double reach_m, double ball_m);
void animation_add(animation *m, const float *position_m, const uint8_t *level,
                   const float ball_m[3]);
/* A canvas with its script, for the body of a page. */
void animation_write(FILE *f, const animation *m);
void animation_free(animation *m);

#endif
