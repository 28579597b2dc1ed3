/* SPDX-License-Identifier: MIT */
/*
 * The smallest device there is: an arm on three protected drives whose joints follow a given path,
 * as frames. Stands on core alone, for targets without a host: demo images and counted ticks.
 */
#ifndef PALP_SIM_ORBIT_H
#define PALP_SIM_ORBIT_H

#include "core/palp.h"

#define TRAJECTORY_AXES 3u

typedef struct {
    palp_e2e sent[TRAJECTORY_AXES], received[TRAJECTORY_AXES];
    bool on[TRAJECTORY_AXES];
} test_trajectory;

palp_device trajectory_device(float rate_hz);

/* A servo over the blob's highest free node with a ball on the arm: all but cost and port. */
palp_servo_config trajectory_config(const palp_blob *blob, float rate_hz, float ball_m);

/* Joint angles of a tick: a slow figure over the body that goes in and out of it. */
void trajectory_path(uint32_t tick, float depth_rad, float q_rad[PALP_AXES]);

/* What the drives say in a tick: one frame each to out[TRAJECTORY_AXES]. */
void trajectory_speak(test_trajectory *o, const palp_device *device, const float q_rad[PALP_AXES],
                      palp_can_frame *out);
/* What they are told. */
void trajectory_listen(test_trajectory *o, const palp_device *device, const palp_can_frame *frames,
                       uint32_t count);

#endif
