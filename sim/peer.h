/* SPDX-License-Identifier: MIT */
/* Another controller on the bus: it sends the set-points of the joints that a scene has `listen` lines
 * for, along their tracks, as the controller of a robot's hand would. */
#ifndef PALP_SIM_PEER_H
#define PALP_SIM_PEER_H

#include "port/host/scenefile.h"

#define SIM_PEER_PERIOD_S 0.01

typedef struct {
    uint32_t id, byte;
    scene_track track; /* a copy */
} sim_peer_joint;

typedef struct {
    uint32_t count;
    sim_peer_joint joint[PALP_SCENE_DRIVES];
    double next_s;
} sim_peer;

/* The one on the bus of a device of the scene, which is not kept; without tracks it sends nothing. */
void sim_peer_init(sim_peer *peer, const scene_file *scene, uint32_t device);

/* Its frames that are due at time t_s: a frame for each id. Returns how many. */
uint32_t sim_peer_send(sim_peer *peer, double t_s, palp_can_frame frames[PALP_SCENE_DRIVES]);

#endif
