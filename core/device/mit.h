/* SPDX-License-Identifier: MIT */
/*
 * MIT mode (mini-cheetah and its heirs): command p16 v12 kp12 kd12 t12, answer [id] p16 v12 t12,
 * big-endian bit fields over symmetric ranges that only the data sheet knows. Torque control sends
 * both gains as 0. The ranges have an even number of steps, so 0 is not on the grid: the nearest
 * torque is half a step away from it.
 *
 * Answers of 8 bytes have two forms. Damiao: the state beside the number of the motor in byte 0 (0
 * off, 1 on, 8 and above a fault), two temperatures at the end. AK series: byte 0 is the number, the
 * end a temperature and an error (0 none).
 */
#ifndef PALP_DEVICE_MIT_H
#define PALP_DEVICE_MIT_H

#include "core/device/canframe.h"

/* Full scale of each field, either side of 0. */
typedef struct {
    float position_rad, velocity_rad_s, torque_Nm;
} palp_mit_range;

typedef enum {
    PALP_MIT_COMMAND,
    PALP_MIT_ENTER = 0xfc, /* seven FF and this byte */
    PALP_MIT_EXIT = 0xfd,
    PALP_MIT_ZERO = 0xfe
} palp_mit_kind;

typedef struct {
    palp_mit_kind kind;
    float torque_Nm;
} palp_mit_command;

typedef enum {
    PALP_MIT_FORM_AUTO,  /* to be found from the first answers */
    PALP_MIT_FORM_STATE, /* Damiao */
    PALP_MIT_FORM_ERROR, /* AK series */
    PALP_MIT_FORM_SHORT  /* 6 bytes: neither */
} palp_mit_form;
#define PALP_MIT_FORM_NAMES "auto", "state", "error", "short" /* in that order */

typedef struct {
    uint8_t node;  /* low four bits where there are 8 bytes */
    uint8_t state; /* high four bits of byte 0; 0 of 6 bytes */
    uint8_t last;  /* byte 7; 0 of 6 bytes */
    bool is_long;  /* 8 bytes */
    float position_rad, velocity_rad_s, torque_Nm;
} palp_mit_answer;

/* Frames are classic, or FD when `flags` says so; 8 bytes, answers of 6 or 8. */
palp_can_frame palp_mit_encode_command(uint8_t node, uint8_t flags, const palp_mit_range *range,
                                       palp_mit_command command);
palp_can_frame palp_mit_encode_answer(uint32_t master_id, uint8_t flags,
                                      const palp_mit_range *range, const palp_mit_answer *answer);
/* Whose answer a frame of a motor is; PALP_MIT_NO_ANSWER: nobody's, by its length. */
#define PALP_MIT_NO_ANSWER 0x100u
uint32_t palp_mit_answer_node(const palp_can_frame *frame);

/* An answer of 8 bytes has node, state and last as they stand, and 30 in byte 6 (degrees). */

bool palp_mit_decode_command(const palp_can_frame *frame, uint8_t node, uint8_t flags,
                             const palp_mit_range *range, palp_mit_command *command);
bool palp_mit_decode_answer(const palp_can_frame *frame, uint32_t master_id, uint8_t flags,
                            const palp_mit_range *range, palp_mit_answer *answer);

#endif
