/* SPDX-License-Identifier: MIT */
/*
 * Faults on demand: what goes wrong, when, for how long and how badly.
 *
 *   LIST = KIND[@T[+D]][=V],...      T, D in seconds; without @ the whole run, without + 10 ms
 *
 *   loss, duplicate, reorder, corrupt   frames, each with probability V (default 1)
 *   delay                               frames come V seconds later (0.003)
 *   stuck                               the encoders stand still
 *   jump                                the first encoder reads V motor turns more (5)
 *   glitch                              reads 5 turns more now and then: probability V (0.3)
 *   nan                                 the first encoder gives no number
 *   drive                               the first drive reports an error and lets go
 *   refuse, ignore, mute                the first drive, CiA 402: aborts transfers of object V
 *                                       (0x6502); takes what is written to it, and keeps its own;
 *                                       does not answer for it
 *   busoff, enobufs, down               what the controller's bus does
 *   overrun                             the controller misses V periods (10)
 */
#ifndef PALP_SIM_FAULTS_H
#define PALP_SIM_FAULTS_H

#include <stdbool.h>
#include <stdint.h>

typedef enum {
    FAULT_LOSS,
    FAULT_DUPLICATE,
    FAULT_REORDER,
    FAULT_CORRUPT,
    FAULT_DELAY,
    FAULT_STUCK,
    FAULT_JUMP,
    FAULT_GLITCH,
    FAULT_NAN,
    FAULT_DRIVE,
    FAULT_REFUSE,
    FAULT_IGNORE,
    FAULT_MUTE,
    FAULT_BUS_OFF,
    FAULT_ENOBUFS,
    FAULT_DOWN,
    FAULT_OVERRUN,
    FAULT_KINDS
} fault_kind;
#define FAULT_NAMES                                                                                \
    "loss", "duplicate", "reorder", "corrupt", "delay", "stuck", "jump", "glitch", "nan", "drive", \
        "refuse", "ignore", "mute", "busoff", "enobufs", "down", "overrun"

typedef struct {
    fault_kind kind;
    double from_s, to_s, value;
} fault;

#define MAX_FAULTS 64
typedef struct {
    fault list[MAX_FAULTS];
    uint32_t count;
    uint64_t seed;
} fault_list;

/* Reads a LIST; exits 2 with the part named that is wrong. */
fault_list faults_read(const char *list, uint64_t seed);

/* The fault of this kind that is on at `time_s`, or NULL. */
const fault *fault_now(const fault_list *f, fault_kind kind, double time_s);

/* Whether one of this kind, decided frame by frame, strikes now. */
bool fault_strikes(fault_list *f, fault_kind kind, double time_s);

/* In [0, 1). */
double faults_random(fault_list *f);

#endif
