/* SPDX-License-Identifier: MIT */
#include "sim/peer.h"
#include "port/host/util.h"
#include <string.h>

#define CLASSIC_BYTES 8u

void sim_peer_init(sim_peer *p, const scene_file *scene, uint32_t device) {
    *p = (sim_peer){.count = 0};
    for (uint32_t i = 0; i < scene->follows; i++) {
        const scene_follow *f = &scene->follow[i];
        if (!f->listens || f->device != device) continue;
        const scene_track *track = scene_joint_track(&scene->body[f->body], f->joint);
        if (track == NULL) continue;
        sim_peer_joint *j = &p->joint[p->count++];
        *j = (sim_peer_joint){.id = f->id, .byte = f->byte, .track = {.count = track->count}};
        j->track.key = allocate(track->count, sizeof *track->key);
        memcpy(j->track.key, track->key, track->count * sizeof *track->key);
    }
}

/* The frame of an id, one more if it has none yet. */
static palp_can_frame *frame_of(palp_can_frame *frames, uint32_t *count, uint32_t id) {
    for (uint32_t i = 0; i < *count; i++) {
        if (frames[i].id == id) return &frames[i];
    }
    frames[*count] = (palp_can_frame){.id = id, .flags = palp_can_id_flags(id)};
    return &frames[(*count)++];
}

uint32_t sim_peer_send(sim_peer *p, double t_s, palp_can_frame frames[PALP_SCENE_DRIVES]) {
    uint32_t count = 0;
    if (t_s < p->next_s) return 0;
    p->next_s += SIM_PEER_PERIOD_S;
    for (uint32_t i = 0; i < p->count; i++) {
        const sim_peer_joint *j = &p->joint[i];
        palp_can_frame *f = frame_of(frames, &count, j->id);
        const uint32_t end = j->byte + 4u;
        double value[3];
        scene_at(&j->track, t_s, value);
        palp_put_f32(f->data + j->byte, (float)value[0]);
        if (end > f->length) f->length = palp_can_fd_length(end);
        if (f->length > CLASSIC_BYTES) f->flags |= PALP_CAN_FD;
    }
    return count;
}
