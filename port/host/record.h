/* SPDX-License-Identifier: MIT */
/*
 * A run on record: everything that entered and left each tick, the clock's readings included, so
 * that `palp replay` can repeat it bit for bit.
 *
 * The file is a candump log. Frames on the bus stand in it under the bus's own name, and what else
 * a tick needs as CAN FD frames under the name `palp`, so that any tool for candump logs reads it:
 *
 *   1FFF0000  text of the session, 64 bytes at a time, until the first tick: the scene and the
 *             descriptions of its devices
 *   1FFF0001  a tick begins: tick u64, skipped u32, events u32, then u16: frames in, frames out,
 *             clock readings, wake-up lateness in us. The frames in follow.
 *   1FFF0006  the same of each further device: its number u32, events u32, u16: frames in, frames
 *             out. Its frames in follow.
 *   1FFF0002  clock readings, up to 16 u32 ns after the tick's first
 *   1FFF0003  the result: digest u64, state, level, points, held, faults u32, active u32, then
 *             f32: force N x3, tip m x3, stored J, absorbed J, duration of the tick ns, given
 *             J. The frames out follow.
 *   1FFF0007  the same of each further device, its number in place of the digest
 *   1FFF0008  of each body, where there is more than one or it is not elastostatic: number, kind, level,
 *             held, u16: points, active; flags u32, f32: stored J, doubt N
 *   1FFF0009  before the tick from which on bodies or tools are exchanged: replay ends here
 *   1FFF0004  ticks that were lost on the way to the file, u64: replay ends here
 *   1FFF0005  at the end of a run: its totals, u64 each, 8 to a frame (run_totals), of one device
 *             after the other
 */
#ifndef PALP_SIM_RECORD_H
#define PALP_SIM_RECORD_H

#include "port/host/openscene.h"
#include "core/servo/report.h"
#include <stdio.h>

#define RECORD_FRAMES 64u
#define RECORD_CLOCKS 256u
#define RECORD_LOADS PALP_SERVO_LOADS

/* What a device did in a tick. */
typedef struct {
    uint32_t in_count, out_count, events;
    palp_report report;
    palp_counters counters;
    double in_time_s[RECORD_FRAMES]; /* when each frame came in, by the kernel */
    palp_can_frame in[RECORD_FRAMES], out[PALP_SERVO_FRAMES_OUT];
    palp_drive_trouble trouble[PALP_AXES]; /* outside RUN; not on record */
} tick_hand;

/* One tick, as it goes from the real-time thread to everybody else. */
typedef struct {
    uint32_t hands, bodies, clock_count, load_count;
    uint32_t skipped;
    bool exchanged;  /* from here on bodies or tools are exchanged: replay ends */
    bool clock_full; /* more readings than there was room for: it cannot be replayed */
    float late_us;
    double time_s;
    uint64_t digest; /* of this tick and all before it */
    palp_body_kind kind[PALP_SCENE_BODIES];
    palp_body_report body[PALP_SCENE_BODIES];
    uint32_t clock_ns[RECORD_CLOCKS]; /* after the first */
    palp_load
        load[RECORD_LOADS]; /* forces on the first body, for the display; and, not on record, */
    palp_frame tool[PALP_CONTACT_TOOLS]; /* where each tool is, by the body that it presses most */
    uint32_t joint_count;                /* driven by frames */
    palp_setpoint joint[PALP_SCENE_DRIVES];
    tick_hand hand[]; /* [hands] */
} tick_record;

/* Bytes of one with so many devices. */
size_t record_bytes(uint32_t hands);

/* Goes on from `digest` with what a device sent and found in a tick: frames, state, faults, level,
 * force, torque and tool. Begin with 0; then of all devices in their order. */
uint64_t record_digest(uint64_t digest, const palp_can_frame *out, uint32_t count,
                       const palp_report *report);

/* What a run came to of a device, besides its ticks. */
typedef struct {
    palp_counters counters;
    uint64_t frames_sent, frames_lost; /* refused by the bus */
    uint64_t frames_dropped;           /* by the kernel's receive queue */
    uint64_t unrecorded;               /* ticks that found the ring to the log full */
    uint64_t minor_faults;             /* of the loop after its start */
} run_totals;

/* What the controller was told when the session was opened. */
typedef struct {
    scene_file *scene; /* as written in the log: its placements stated */
    palp_cost_table cost;
    palp_target target; /* of cost, when read */
    bool resume;
    uint32_t blob_crc[PALP_SCENE_BODIES], blob_bytes[PALP_SCENE_BODIES];
    uint32_t tool_crc[PALP_CONTACT_TOOLS], tool_bytes[PALP_CONTACT_TOOLS]; /* of files; 0: none */
} session_record;

void record_write_session(FILE *f, const scene_setup *setup);
void record_write_tick(FILE *f, const scene_file *scene, const tick_record *tick);
void record_write_gap(FILE *f, double time_s, uint64_t lost);
/* totals[devices] */
void record_write_totals(FILE *f, double time_s, const run_totals *totals, uint32_t devices);

typedef struct record_reader record_reader;

record_reader *record_open(const char *path, session_record *session);
/* The next tick, in record_bytes of the session's devices; false at the end. *lost: ticks missing before it, and then replay must end. Exits
 * 1, with the line named, when the log is damaged. A last tick that is cut off ends the log. */
bool record_next(record_reader *reader, tick_record *tick, uint64_t *lost);
/* After the last tick: totals[devices] of the run; false if the log ends without them. */
bool record_totals(const record_reader *reader, run_totals *totals);
void record_close(record_reader *reader);

#endif
