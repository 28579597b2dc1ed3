/* SPDX-License-Identifier: MIT */
/*
 * CANopen (CiA 301) and the drive profile CiA 402 in cyclic synchronous torque mode: object
 * identifiers, frames of both ends, the state of a drive as its statusword tells it.
 *
 *     NMT        000 [command, node]          SYNC       080
 *     EMCY       080 + n                      heartbeat  700 + n [state]
 *     TPDO1      180 + n [statusword:16, position:32, torque:16]
 *     RPDO1      200 + n [controlword:16, target torque:16]
 *     SDO        580 + n from the drive, 600 + n to it, expedited transfers only
 */
#ifndef PALP_DEVICE_CIA402_H
#define PALP_DEVICE_CIA402_H

#include "core/device/canframe.h"

#define PALP_NMT_START 0x01u
#define PALP_NMT_PREOPERATIONAL 0x80u
#define PALP_NMT_STATE_OPERATIONAL 5u
#define PALP_NMT_STATE_PREOPERATIONAL 0x7fu

#define PALP_COB_NMT 0x000u
#define PALP_COB_SYNC 0x080u
#define PALP_COB_EMCY 0x080u
#define PALP_COB_TPDO1 0x180u
#define PALP_COB_RPDO1 0x200u
#define PALP_COB_SDO_ANSWER 0x580u
#define PALP_COB_SDO_REQUEST 0x600u
#define PALP_COB_HEARTBEAT 0x700u
#define PALP_CANOPEN_HOST 0x7fu /* node number of the controller */
#define PALP_CIA402_CST 10u     /* 0x6060: cyclic synchronous torque */

typedef enum {
    PALP_CIA402_NOT_READY,
    PALP_CIA402_DISABLED, /* switch-on disabled */
    PALP_CIA402_READY,
    PALP_CIA402_SWITCHED_ON,
    PALP_CIA402_ENABLED, /* operation enabled: acts on torque */
    PALP_CIA402_QUICK_STOP,
    PALP_CIA402_FAULT
} palp_cia402_state;

palp_cia402_state palp_cia402_state_of(uint32_t statusword);
/* Statusword bits of a state, for the simulated drive. */
uint32_t palp_cia402_statusword(palp_cia402_state state);

/* Controlword that takes a drive one step towards operation enabled. A fault is reset by a rising
 * edge of bit 7, so `phase` (0, 1, 0, ...) alternates it. */
uint32_t palp_cia402_controlword(palp_cia402_state state, uint32_t phase);

/* An expedited SDO transfer, either way. */
typedef struct {
    uint8_t command; /* first byte */
    uint16_t index;
    uint8_t sub;
    uint32_t value; /* data, or the abort code */
} palp_sdo;

#define PALP_SDO_READ 0x40u
#define PALP_SDO_WRITTEN 0x60u
#define PALP_SDO_ABORT 0x80u
/* First byte of a write of, or an answer with, `size` bytes (1 to 4). */
#define PALP_SDO_WRITE(size) ((uint8_t)(0x23u | (4u - (size)) << 2))
#define PALP_SDO_VALUE(size) ((uint8_t)(0x43u | (4u - (size)) << 2))

palp_can_frame palp_sdo_encode(uint32_t cob_id, palp_sdo sdo);
/* False unless it is a classic 8-byte data frame with this id. */
bool palp_sdo_decode(const palp_can_frame *frame, uint32_t cob_id, palp_sdo *sdo);

palp_can_frame palp_nmt_encode(uint8_t command, uint8_t node);
palp_can_frame palp_heartbeat_encode(uint8_t node, uint8_t state);
palp_can_frame palp_rpdo_encode(uint8_t node, uint32_t controlword, int32_t torque);
palp_can_frame palp_tpdo_encode(uint8_t node, uint32_t statusword, int32_t position,
                                int32_t torque);

/*
 * What makes a drive follow: heartbeats both ways, the reaction to silence, mode, mapping of the
 * first PDO pair, and read-backs.
 */
typedef struct {
    uint16_t index;
    uint8_t sub, size; /* 0: a read */
    uint32_t value;    /* to write, or what a read must give under `mask` */
    uint32_t mask;
    bool optional; /* an abort does no harm */
} palp_cia402_step;

#define PALP_CIA402_STEPS 30u
#define PALP_CIA402_HEARTBEAT_MS 50u
/* Step `i` for `node` at `rate_hz`, with rated torque in mNm as the drive must report it. */
palp_cia402_step palp_cia402_configure(uint32_t i, uint8_t node, float rate_hz,
                                       uint32_t rated_torque_mNm, uint32_t watchdog_ms);

#endif
