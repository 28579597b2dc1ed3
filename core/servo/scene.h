/* SPDX-License-Identifier: MIT */
/*
 * A scene at the devices: bodies of any engine, tools, and the hands that hold them, answered in one
 * bounded tick.
 *
 * Bodies lie in the scene's coordinates. Each tool belongs to one device: at its tip, at a place of
 * its own, or on a jaw of its gripper. A tool feels each body by a spring of its own, so what it feels of
 * all of them adds up, and several bodies, tools and hands need not know of each other; together the
 * springs of a device are as stiff as it renders. Hands that feel one body feel each other through it,
 * and what one puts in another may take out: the guards share what their hands have put in.
 *
 * Where others feel on, a device that begins or ends to feel does so over PALP_SCENE_FADE_S: its tools'
 * springs grow from nothing, or, held where they were, fade.
 *
 * The bodies answer one after the other. Each keeps back what those after it need at least, so an early
 * one may use what a late one does not.
 *
 * Bodies and tools are exchanged while devices go on: a second scene with the same devices is opened in
 * memory of its own, by another thread if need be. palp_scene_leave lets the springs of the first fade
 * over PALP_SCENE_FADE_S while they are felt, so that they only take from the hands; then
 * palp_scene_take_over gives its devices to the second. A tool that is deep in another body there must
 * not be pushed out, which would be a gift. So each is first led out, felt by nobody, the way that it was
 * pushed before or along the device's z, and is felt from there, off where it is held. It goes back as far
 * as nothing presses it: a hand that lets go is then where it should be, one that presses on feels the new
 * body from where it was.
 *
 * Order of calls: palp_scene_open; then once a period palp_scene_pose for each multizone model that is
 * moved by the caller, palp_scene_tick, and in time left over palp_scene_spare.
 */
#ifndef PALP_SERVO_SCENE_H
#define PALP_SERVO_SCENE_H

#include "core/contact/loads.h"
#include "core/servo/body.h"
#include "core/servo/setpoint.h"

#define PALP_SCENE_BODIES 4u
#define PALP_SCENE_HANDS 4u
#define PALP_SCENE_FADE_S 0.2f
#define PALP_SCENE_OUT_M_S 0.5f   /* at which tools are led out of a body after an exchange, */
#define PALP_SCENE_BACK_M_S 0.01f /* and back while no more than this is stored by them */
#define PALP_SCENE_BACK_J 1e-8f

/* A tool on a device. */
typedef struct {
    palp_tool tool; /* as palp_tool_is_sound, in the scene's lengths */
    uint32_t hand;
    palp_frame at; /* on the tip; a rotation */
    float
        jaw; /* share of the opening of a gripper by which it lies along the tip's y: -0.5 and 0.5 of
                      two jaws; 0: it does not follow the gripper */
} palp_scene_tool;

/* Pointers are kept, but for these arrays. */
typedef struct {
    const palp_body_config *body;  /* [bodies], 1 to PALP_SCENE_BODIES */
    const palp_scene_tool *tool;   /* [tools], 1 to PALP_CONTACT_TOOLS */
    const palp_hand_config *hand;  /* [hands], 1 to PALP_SCENE_HANDS; all at the same rate */
    const palp_scene_drive *drive; /* [drives], up to PALP_SCENE_DRIVES; NULL if none */
    uint32_t bodies, tools, hands, drives;
    palp_cost_table cost; /* of the processor that ticks: palp calibrate measures it */
    palp_port port;       /* its clock is read at most once for each step of a tick */
} palp_scene_config;

/* What came out of a tick. Pointers hold until the next. */
typedef struct {
    uint64_t tick;
    float bound_ns, elapsed_ns; /* all that the levels allow, within the share of the period; by the
                                   clock, since its first reading (palp_port) */
    const palp_hand_report *hand;                  /* [hands] */
    const palp_body_report *body;                  /* [bodies] */
    const palp_body_felt *felt[PALP_SCENE_BODIES]; /* [tools], of each body */
} palp_scene_report;

typedef struct palp_scene palp_scene;

/* What a scene takes besides its hands, tools and bodies, at most. */
#define PALP_SCENE_OBJECT 9984u

/* Bytes for a scene; 0 if its counts or a body are out of range. */
size_t palp_scene_memsize(const palp_scene_config *config);

/*
 * Opens a scene in `memory`, which is then the scene. Errors: ABSENT (a blob has no regular part: bake
 * it again), LIMITS (a level of contact), ARGUMENT (anything else out of its range), MEMORY, ALIGNMENT,
 * and BUDGET when the coarsest answers do not fit the period: *bound_ns (may be NULL) then says how
 * much time they need.
 */
palp_status palp_scene_open(palp_scene **scene, const palp_scene_config *config, void *memory,
                            size_t bytes, float *bound_ns);

/* Joint values and the place of zone 0 of a multizone model, for the next tick; joints with a drive take
 * theirs from it. Does nothing for another body. */
void palp_scene_pose(palp_scene *scene, uint32_t body, const float *value, const palp_frame *root);

/*
 * One tick, once a period: input[hands] in, at most PALP_SERVO_FRAMES_OUT frames for each device to
 * out[hand], their number to sent[hands]; to be sent at once and in this order. Cost: at most
 * report->bound_ns, for up to PALP_SERVO_FRAMES_IN frames of each device.
 */
void palp_scene_tick(palp_scene *scene, const palp_tick_input *input,
                     palp_can_frame out[][PALP_SERVO_FRAMES_OUT], uint32_t *sent,
                     palp_scene_report *report);

void palp_scene_spare(palp_scene *scene);

/* From the next tick on what is felt of the scene fades. */
void palp_scene_leave(palp_scene *scene);
/* Whether it has come to that. */
bool palp_scene_has_left(const palp_scene *scene);

/*
 * Between two ticks: the devices of `from`, which has left and is not to tick again, go on in `scene`, which
 * has not ticked yet: their states, drives, books and counters. ARGUMENT, and nothing has happened, when
 * `scene` has other devices (their number, rate or axes), or `from` has not left. Cost: a copy of each hand.
 */
palp_status palp_scene_take_over(palp_scene *scene, const palp_scene *from);

/* Totals since the scene was opened, of one hand; ticks, overruns and levels are those of the scene.
 * The pointer holds as long as the scene. Constant time. */
const palp_counters *palp_scene_counters(const palp_scene *scene, uint32_t hand);

/* What keeps the drive of an axis from working; NONE for an axis that is not there. Constant time,
 * outside the bound of a tick. */
palp_drive_trouble palp_scene_trouble(const palp_scene *scene, uint32_t hand, uint32_t axis);

/* What is in the scene, to look at. */
uint32_t palp_scene_bodies(const palp_scene *scene);
uint32_t palp_scene_tools(const palp_scene *scene);
const palp_scene_tool *palp_scene_mount(const palp_scene *scene, uint32_t tool);
const palp_body *palp_scene_body(const palp_scene *scene, uint32_t body);
const palp_hand *palp_scene_hand(const palp_scene *scene, uint32_t hand);
uint32_t palp_scene_drives(const palp_scene *scene);
/* What a drive by frames has come to; one by an axis stays as it was opened. */
const palp_setpoint *palp_scene_setpoint(const palp_scene *scene, uint32_t drive);

#endif
