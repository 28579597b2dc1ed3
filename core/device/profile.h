/* SPDX-License-Identifier: MIT */
/*
 * Palp's own drive profile, protected end to end (protect.h); palp.dbc and palp-fd.dbc describe it
 * for other tools.
 *
 *   command 100 + n   [crc][mode:4 counter:4][watchdog ms:16][torque f32 Nm]
 *   status  180 + n   [crc][state:4 counter:4][position f32 rev][velocity i16, 0.01 rev/s]
 *   status, FD        [crc][state:4 counter:4][error:16][position f32][velocity f32][torque f32]
 */
#ifndef PALP_DEVICE_PROFILE_H
#define PALP_DEVICE_PROFILE_H

#include "core/device/protect.h"

#define PALP_PROFILE_COMMAND 0x100u
#define PALP_PROFILE_STATUS 0x180u
#define PALP_PROFILE_FD_STATUS 16u /* bytes of a status over CAN FD */

typedef enum { PALP_MODE_OFF, PALP_MODE_TORQUE, PALP_MODE_CLEAR } palp_profile_mode;
typedef enum { PALP_DRIVE_IS_OFF, PALP_DRIVE_IS_ON, PALP_DRIVE_IS_FAULTED = 15 } palp_profile_state;

typedef struct {
    palp_profile_mode mode;
    uint32_t watchdog_ms; /* the drive lets go when no sound command comes for so long */
    float torque_Nm;
} palp_profile_command;

typedef struct {
    palp_profile_state state;
    uint32_t error; /* FD only */
    float position_rev, velocity_rev_s;
    float torque_Nm; /* FD only */
} palp_profile_status;

palp_can_frame palp_profile_encode_command(palp_e2e *e2e, uint8_t node, bool fd,
                                           const palp_profile_command *command);
palp_can_frame palp_profile_encode_status(palp_e2e *e2e, uint8_t node, bool fd,
                                          const palp_profile_status *status);

/* False unless id, kind and length are right; then *verdict says whether to believe the content. */
bool palp_profile_decode_command(palp_e2e *e2e, const palp_can_frame *frame, uint8_t node, bool fd,
                                 palp_profile_command *command, palp_e2e_verdict *verdict);
bool palp_profile_decode_status(palp_e2e *e2e, const palp_can_frame *frame, uint8_t node, bool fd,
                                palp_profile_status *status, palp_e2e_verdict *verdict);

#endif
