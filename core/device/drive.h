/* SPDX-License-Identifier: MIT */
/*
 * The controller's side of one drive, whatever protocol it speaks: what it was last heard to say,
 * and what to send it next.
 *
 *     request    ODrive             CiA 402                  moteus      MIT        Palp
 *     PROBE      idle, zero torque  word 0, pre-op, SDO read stop        exit       off
 *     CONFIGURE  idle, zero torque  SDO steps, start, word 0 stop        exit       off
 *     IDLE       idle, zero torque  word 0 (disable voltage) stop        exit       off
 *     ENABLE     mode, clear, loop  walk of the states       torque 0    enter      clear, torque 0
 *     TORQUE     input torque       target torque            torque      torque     torque
 *
 * ODrive and Palp drives send estimates on their own; the others answer the controller's frames, so
 * that what a tick reads is one period old (palp_drive_delay). Fields of `palp_drive` that are not
 * documented as protocol internals may be read by anybody.
 */
#ifndef PALP_DEVICE_DRIVE_H
#define PALP_DEVICE_DRIVE_H

#include "core/device/mit.h"
#include "core/device/protect.h"

#define PALP_AXES 7u /* of one device: three to place, three to turn, one for a gripper */

typedef enum {
    PALP_PROTOCOL_ODRIVE,
    PALP_PROTOCOL_CIA402,
    PALP_PROTOCOL_MOTEUS,
    PALP_PROTOCOL_MIT,
    PALP_PROTOCOL_PALP
} palp_protocol;
#define PALP_PROTOCOL_NAMES "odrive", "cia402", "moteus", "mit", "palp" /* in that order */

typedef struct {
    palp_protocol protocol;
    bool fd;               /* CAN FD frames: always for moteus, never for ODrive and CiA 402 */
    float counts_per_rev;  /* encoder, per motor revolution; the unit of CiA 402 positions */
    float rated_torque_Nm; /* CiA 402: torques are in thousandths of it */
    float torque_max_Nm;   /* motor */
    float watchdog_s;      /* asked of drives that can be told: 0.01 to 0.1 */
    palp_mit_range range;  /* MIT */
    palp_mit_form form;    /* MIT: of answers of 8 bytes */
    uint32_t master_id;    /* MIT: the id of answers */
    float torque_lag_s;    /* time constant of the drive's torque; 0: at once */
    float rate_hz;         /* of the ticks */
} palp_drive_config;

typedef enum {
    PALP_REQUEST_PROBE,
    PALP_REQUEST_CONFIGURE,
    PALP_REQUEST_ENABLE,
    PALP_REQUEST_TORQUE,
    PALP_REQUEST_IDLE
} palp_drive_request;

/* What a frame was to a drive. */
typedef enum {
    PALP_RX_NONE,     /* not from this drive */
    PALP_RX_STATUS,   /* something else than an estimate */
    PALP_RX_ESTIMATE, /* a new position */
    PALP_RX_REPEATED, /* protected profile: an old frame again */
    PALP_RX_GAP,      /* protected profile: an estimate, but frames before it were lost */
    PALP_RX_BAD       /* from this drive, but malformed, corrupt or out of sequence */
} palp_rx_event;

/* What keeps a drive from working, for people to read. */
typedef enum {
    PALP_TROUBLE_NONE,
    PALP_TROUBLE_SILENT,    /* says nothing at all, or does not answer for the object */
    PALP_TROUBLE_REFUSED,   /* CiA 402: aborted the transfer of the object; `answer` is the code */
    PALP_TROUBLE_DIFFERENT, /* CiA 402: reads `answer` where `value` is needed */
    PALP_TROUBLE_ERROR      /* `answer` is the drive's own code */
} palp_trouble_kind;

typedef struct {
    uint8_t node;
    bool heard;         /* has said anything since the last probe */
    bool configured;    /* is set up and confirmed */
    bool enabled;       /* acts on torque */
    bool misconfigured; /* did not take its configuration, or is not the drive described */
    uint32_t error;     /* the drive's own code; 0: none */
    uint32_t answer;    /* CiA 402: abort code, or what was read where something else is needed */
    palp_trouble_kind stuck;            /* CiA 402: why the configuration does not go on */
    uint32_t status_age;                /* ticks since the last sign of life */
    float position_rev, velocity_rev_s; /* of the last estimate; NaN when there is no velocity */
    /* Protocol internals. */
    uint32_t step, waited, tries, phase, since_request;
    uint32_t statusword;
    palp_mit_form form;
    palp_drive_request request;
    palp_e2e sent, received;
} palp_drive;

#define PALP_DRIVE_FRAMES 3u  /* most that one drive is sent in a tick */
#define PALP_SHARED_FRAMES 2u /* most that go to all of them: SYNC, heartbeat */
#define PALP_DRIVE_NO_ERROR 0u
#define PALP_DRIVE_ERROR_SILENT 0xffff0001u /* configuration: no answer */
#define PALP_DRIVE_ERROR_MISCONFIGURED                                                             \
    0xffff0002u /* configuration: not the drive that is described */
#define PALP_DRIVE_ERROR_PARTS                                                                     \
    0xffff0100u /* ODrive 0.5: with 1 of the motor, 2 of the encoder, 4 of the controller */

typedef struct {
    palp_trouble_kind kind;
    uint8_t node;
    bool written; /* the object was written with `value`; else read */
    uint8_t sub;
    uint16_t index; /* of the object; 0: none */
    uint32_t value, answer;
} palp_drive_trouble;

/* Constant time. */
palp_drive_trouble palp_drive_trouble_of(const palp_drive *drive, const palp_drive_config *config);

/* Forgets all but the node number: the drive is to be probed anew. */
void palp_drive_init(palp_drive *drive, uint8_t node);

/* Most bytes of a received frame that are gone through one by one: moteus any of CAN FD, the
 * protected profile those of a status. */
uint32_t palp_drive_frame_bytes(const palp_drive_config *config);

/* One received frame. Constant time but for those bytes. */
palp_rx_event palp_drive_receive(palp_drive *drive, const palp_drive_config *config,
                                 const palp_can_frame *frame);

/* Called once per tick after receiving: what to send, at most PALP_DRIVE_FRAMES to `out`; returns
 * how many. commanded_Nm is used with the request TORQUE only and is limited to torque_max_Nm. */
uint32_t palp_drive_send(palp_drive *drive, const palp_drive_config *config,
                         palp_drive_request request, float commanded_Nm, palp_can_frame *out);

/* The same for a drive that has an encoder and no motor: it is never enabled, and one that sends
 * estimates on its own is seldom told to idle. */
uint32_t palp_drive_listen(palp_drive *drive, const palp_drive_config *config,
                           palp_drive_request request, palp_can_frame *out);

/* What goes to all drives after that, once per tick: `tick` paces it. */
uint32_t palp_drives_send_shared(const palp_drive_config *config, uint64_t tick,
                                 palp_can_frame *out);

/* Periods by which an estimate is old when a tick reads it, besides its way over the bus. */
uint32_t palp_drive_delay(palp_protocol protocol);

/* Longest silence between signs of life that is in order (s); 0: estimates are the sign. */
float palp_drive_heartbeat_s(palp_protocol protocol);

/* Whether protocol and frame kind go together and all that the protocol needs is given. */
bool palp_drive_config_is_sound(const palp_drive_config *config);

/* Which frames come from this drive: those with (id & mask) == id and `flags` in EXTENDED alike.
 * Returns how many patterns, at most PALP_DRIVE_FILTERS. */
#define PALP_DRIVE_FILTERS 4u
typedef struct {
    uint32_t id, mask;
    uint8_t flags;
} palp_can_filter;
uint32_t palp_drive_filters(const palp_drive_config *config, uint8_t node,
                            palp_can_filter filter[PALP_DRIVE_FILTERS]);

/* Most bytes of payload per tick and drive, each way, for the bus load. */
typedef struct {
    bool command_extended, answer_extended; /* 29-bit ids */
    uint32_t command_bytes, answer_bytes;   /* of the frames of a tick to and from one drive */
    uint32_t shared;                        /* empty frames per tick to all */
    float slow_hz;                          /* 8-byte frames per second and drive besides */
} palp_drive_traffic;
palp_drive_traffic palp_drive_traffic_of(const palp_drive_config *config, uint8_t highest_node);

#endif
