/* SPDX-License-Identifier: MIT */
/* What the first body of a run, an elastostatic one, looks like while it is felt: from the forces that the loop
 * tells, beside the loop. Frames for the page, and the moment of the largest force. */
#ifndef PALP_PORT_PICTURE_H
#define PALP_PORT_PICTURE_H

#include "port/host/motion.h"
#include "port/host/record.h"

typedef struct {
    const palp_blob *blob;
    palp_frame at; /* of the body in the scene */
    palp_field field;
    void *field_memory;
    float *rest_m, *at_m; /* [nodes][3], scene */
    uint8_t *fixed;
    motion motion;
    double peak_s;
    float peak_N;
    uint32_t peak_loads;
    palp_load peak_load[RECORD_LOADS];
    palp_frame peak_tool[PALP_CONTACT_TOOLS];
} picture;

/* NULL where the first body is not elastostatic. */
picture *picture_open(const scene_setup *setup);
void picture_take(picture *p, double t_s, const tick_record *tick);
/* Adds the moment of the largest force; displacement_m[nodes][3], in the body's coordinates, is that then. */
void picture_end(picture *p, float *displacement_m);

#endif
