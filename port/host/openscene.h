/* SPDX-License-Identifier: MIT */
/* A scene file come to life: its bodies, tools and devices read, placed and checked, as the library
 * takes them. */
#ifndef PALP_HOST_OPENSCENE_H
#define PALP_HOST_OPENSCENE_H

#include "port/host/devfile.h"
#include "port/host/placement.h"
#include "port/host/scenefile.h"
#include "port/host/toolfile.h"

/* A body's file, by what is in it. */
typedef struct {
    palp_body_kind kind;
    uint32_t bytes, crc;
    void *data, *memory; /* of the file, of an assembly */
    palp_blob blob;
    palp_zones zones;
    palp_assembly assembly;
    palp_tets tets;
    const scene_track *joint[PALP_MAX_JOINTS]; /* that follow a track; NULL: at rest, or an axis */
} scene_part;

typedef struct {
    scene_file *file; /* what was chosen is stated in it */
    scene_part part[PALP_SCENE_BODIES];
    device_file device[PALP_SCENE_HANDS];
    touch_frame touch[PALP_SCENE_HANDS];
    const void *tool_data[PALP_CONTACT_TOOLS];
    uint32_t tool_bytes[PALP_CONTACT_TOOLS], tool_crc[PALP_CONTACT_TOOLS]; /* of files */
    palp_body_config body[PALP_SCENE_BODIES];
    palp_scene_tool tool[PALP_CONTACT_TOOLS];
    palp_hand_config hand[PALP_SCENE_HANDS];
    palp_scene_drive drive[PALP_SCENE_DRIVES];
    palp_scene_config config; /* of all this; the caller adds cost and port */
} scene_setup;

/* The track of each joint that follows one; exits 2 where the model has no such joint, or a value is out of
 * its limits. Of the others it leaves NULL. */
void scene_joints(const scene_body *body, const palp_zones *zones,
                  const scene_track *joint[PALP_MAX_JOINTS]);

/* Reads what the scene names; exits with what is wrong in it. Keeps the scene. */
scene_setup *scene_set_up(scene_file *file);

/* Opens it in memory of its own, all of it touched; exits where it does not fit the period. */
palp_scene *scene_open(const scene_setup *setup);
/* The same, but NULL, *status and one line of text in place of exiting. */
palp_scene *scene_try_open(const scene_setup *setup, palp_status *status, char *text, size_t room);

/* Gives back all of its memory, and that of a scene opened from it (may be NULL). */
void scene_tear_down(scene_setup *setup, palp_scene *scene);

/* Puts the joints that follow tracks where they are at time t, for the next tick. */
void scene_move(const scene_setup *setup, palp_scene *scene, double t_s);

/* The first body on which a machine's speed can be measured; NULL if there is none. */
const palp_blob *scene_blob(const scene_setup *setup);

#endif
