/* SPDX-License-Identifier: MIT */
/*
 * Scene files: which bodies lie where, which devices feel them with which tools, and what moves by
 * itself. One key per line; what follows a `body`, `device` or `tool` line belongs to it (the table is
 * in sim/README.md). The same files serve palpd, palp-sim, palp play, wcet and replay.
 */
#ifndef PALP_HOST_SCENEFILE_H
#define PALP_HOST_SCENEFILE_H

#include "core/servo/scene.h"
#include <stddef.h>
#include <stdio.h>

#define SCENE_OBJECT 0 /* of palp play: the rigid cylinder */
#define SCENE_PROBE 1  /* a ball */
#define SCENE_TRACKS 2
#define SCENE_WORD 256u

/* Values at ascending times, with a smooth step (no velocity) at each. */
typedef struct {
    double t_s, value[3];
} scene_key;

typedef struct {
    size_t count, room;
    scene_key *key;
} scene_track;

/* A joint, by name, along a track. */
typedef struct {
    char joint[SCENE_WORD], where[SCENE_WORD]; /* for messages */
    scene_track track;
} scene_motion;

/* Place, and turn as its axis times its angle in degrees. */
typedef struct {
    double place_m[3], turn_deg[3];
} scene_place;

typedef struct {
    char path[SCENE_WORD]; /* "": the blob of the command line */
    char name[SCENE_WORD]; /* by which others call it: the file's, without folder and ending */
    scene_place at;
    uint32_t finest; /* level of contact */
    bool alone;      /* its zones do not touch each other */
    double gravity_m_s2[3], young_Pa, poisson, damping_s,
        drag_per_s; /* of materials -1: the blob's */
    scene_motion *motion;
    size_t motions, room;
} scene_body;

typedef enum { SCENE_CHOSEN, SCENE_NEAR, SCENE_AT_NODE, SCENE_STATED } scene_where;

typedef struct {
    char name[SCENE_WORD]; /* or path of its description */
    char *text;            /* the description itself, where it is known; else NULL */
    char bus[32];          /* "": the command line's, or loop */
    char hand[SCENE_WORD]; /* its script in simulation; "": touch */
    /* What lies under the tool at the device's origin: */
    scene_where where;
    char body[SCENE_WORD]; /* "": the first */
    double place_m[3]; /* NEAR: the point of the surface nearest to it, in the body's coordinates */
    uint32_t node;     /* AT_NODE */
    double turn_deg[3]; /* of the device's axes in the scene, where turned */
    bool turned;
    palp_placement stated; /* STATED */
    double scale;          /* 0: chosen */
} scene_device;

typedef struct {
    palp_tool tool; /* but for a field */
    bool sized;     /* false: a ball of the device's radius */
    char path[SCENE_WORD];
    uint32_t device;
    scene_place at; /* on the tip */
    double jaw;
} scene_mount;

/* A joint that follows an axis of a device, or set-points in frames on its bus. */
typedef struct {
    char joint[SCENE_WORD], where[SCENE_WORD];
    uint32_t body, device;
    bool listens; /* to frames */
    uint32_t axis;
    double scale, offset;
    uint32_t id, byte;
    double fastest; /* rad/s or m/s */
} scene_follow;

typedef struct {
    const char *name; /* of the file, for messages */
    double seconds, rate_hz;
    uint32_t bodies, devices, tools, follows;
    scene_body body[PALP_SCENE_BODIES];
    scene_device device[PALP_SCENE_HANDS];
    scene_mount tool[PALP_CONTACT_TOOLS];
    scene_follow follow[PALP_SCENE_DRIVES];
    /* of palp play alone: tools without a device */
    double stiffness_N_per_m;
    bool has[SCENE_TRACKS]; /* shapes that were described */
    double cylinder[5];     /* radius, half length, axis */
    double probe_radius_m;
    scene_track track[SCENE_TRACKS];
} scene_file;

/* Reads a scene; paths in it are relative to the file. Exits 2 with the offending line. */
scene_file *scene_read(const char *path);
/* The same from text; `name` is what messages call it, `folder` what paths are relative to (NULL: as
 * they are). */
scene_file *scene_read_text(const char *name, const char *folder, const char *text);
void scene_free(scene_file *s);

/* Whether a file is a scene and not a blob: by its ending, .scene. */
bool scene_is_here(const char *path);

/* A scene of nothing yet, with what holds where nothing is said. */
scene_file *scene_empty(const char *name);
/* One more of each; exits 2 when there are too many. */
scene_body *scene_add_body(scene_file *s, const char *where, const char *path);
scene_device *scene_add_device(scene_file *s, const char *where, const char *name);
scene_mount *scene_add_tool(scene_file *s, const char *where);

/* Writes what palpd needs of it as a scene that stands for itself, so that reading it gives the same
 * bits. */
void scene_write(FILE *f, const scene_file *s);

/* The track of a joint of a body; NULL if it has none. */
const scene_track *scene_joint_track(const scene_body *body, const char *joint);

/* A place and a turn as a frame. */
palp_frame scene_frame(const scene_place *place);

/* The tools of palp play, and the track of each; without any a small ball on track SCENE_TRACKS, to
 * be put far away. */
void scene_tools(const scene_file *s, palp_tool tool[SCENE_TRACKS], uint32_t which[SCENE_TRACKS],
                 uint32_t *count);

/* Where they are at time t. */
void scene_tools_at(const scene_file *s, const uint32_t *which, uint32_t count, double t_s,
                    palp_frame *at);

/* The track at time t; its first value before that, zero if it has none. */
void scene_at(const scene_track *track, double t_s, double value[3]);

#endif
