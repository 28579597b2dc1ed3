/* SPDX-License-Identifier: MIT */
/*
 * The controller of the web page: a scene with simulated devices whose hands follow a pointer, or a recorded
 * session again. It runs the library's own ticks in virtual time, so what it records replays anywhere bit for
 * bit. One scene for the life of the program: a page that opens another starts the program anew.
 *
 * The page calls, in this order: engine_open or engine_replay; then engine_tick as time goes on, with
 * engine_reach before it when a pointer moves, and engine_look before it draws.
 *
 * Files are those of the program: body and tool blobs, PAGE_SCENE, PAGE_LOG. What is wrong with one ends the
 * program with a message, as it ends `palp`.
 */
#ifndef PALP_SIM_ENGINE_H
#define PALP_SIM_ENGINE_H

#include <stdint.h>

/* Called by the page, by its own name. */
#ifdef __wasm__
#define PAGE(name) __attribute__((export_name(#name)))
#else
#define PAGE(name)
#endif

#define PAGE_SCENE "/page.scene"
#define PAGE_LOG "/page.log"
#define PAGE_HISTORY 4096u /* ticks that are kept for the plots */
#define PAGE_MEASURES 12u

/* Of a tick: what the plots show, in this order. */
typedef enum {
    PAGE_TIME_S,
    PAGE_FORCE_N, /* at the first hand, and its parts along the scene's axes */
    PAGE_FORCE_X,
    PAGE_FORCE_Y,
    PAGE_FORCE_Z,
    PAGE_STORED_MJ,
    PAGE_ABSORBED_MJ,
    PAGE_GIVEN_MJ,
    PAGE_LEVEL,
    PAGE_ACTIVE, /* points in contact */
    PAGE_BOUND_US,
    PAGE_DEPTH_MM /* of the first tool beyond where it is held */
} page_measure;

/* Runs `palp` with arguments that are lines of the text at `arguments`: bake and tool. Returns its exit code.
 */
PAGE(engine_command)
uint32_t engine_command(char *arguments);

/* Opens PAGE_SCENE for a controller that takes so many ns for an instruction. */
PAGE(engine_open)
void engine_open(double ns_per_instruction);
/* Opens PAGE_LOG, recorded with the files that PAGE_SCENE names. */
PAGE(engine_replay)
void engine_replay(void);

/* Runs up to `ticks` more; returns how many. Fewer than asked: a replay has come to its end. */
PAGE(engine_tick)
uint32_t engine_tick(uint32_t ticks);
/* 0: goes on; else why a replay ended (replay_end). */
PAGE(engine_ended)
uint32_t engine_ended(void);

/* Where the hand of a device wants its tip (scene, m), and how far a gripper is to be open (rad). */
PAGE(engine_reach)
void engine_reach(uint32_t device, double x, double y, double z, double gripper_rad);
/* The operator's reset after a fault. */
PAGE(engine_reset)
void engine_reset(void);

/*
 * Holds a node of the first body, an elastostatic one, displaced by so much (m), in the mean about it on a
 * constraint level of the paper's hierarchy; what follows shows that in place of the contact, until
 * engine_let_go. Returns 1, or 0 where the body does not take it.
 */
PAGE(engine_pull)
uint32_t engine_pull(uint32_t node, double x, double y, double z);
PAGE(engine_let_go)
void engine_let_go(void);

/* Joint value that a multizone model is to go to. */
PAGE(engine_joint)
void engine_joint(uint32_t joint, double value);

/* Records from now on into PAGE_LOG, from a scene opened anew; engine_stop_log ends it. */
PAGE(engine_log)
void engine_log(void);
PAGE(engine_stop_log)
void engine_stop_log(void);

/* Brings what is drawn up to date. */
PAGE(engine_look)
void engine_look(void);

/* What is drawn, by number: see engine.c. */
PAGE(engine_history)
const float *engine_history(void);
PAGE(engine_numbers)
const float *engine_numbers(void);
PAGE(engine_parts)
uint32_t engine_parts(void);
PAGE(engine_part_count)
uint32_t engine_part_count(uint32_t part, uint32_t what);
PAGE(engine_part_data)
const void *engine_part_data(uint32_t part, uint32_t what);
PAGE(engine_points)
uint32_t engine_points(void);
PAGE(engine_point_data)
const float *engine_point_data(void);
PAGE(engine_text)
const char *engine_text(uint32_t what, uint32_t which);

#endif
