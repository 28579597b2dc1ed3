/* SPDX-License-Identifier: MIT */
/*
 * End-to-end protection in the manner of AUTOSAR's profile 1: byte 0 holds a CRC-8 over the data id
 * and all bytes behind it, the low nibble of byte 1 a counter 0..14. The data id is the frame's
 * id, so that a frame under a wrong id does not pass.
 */
#ifndef PALP_DEVICE_PROTECT_H
#define PALP_DEVICE_PROTECT_H

#include "core/device/canframe.h"
#include <stddef.h>

typedef enum {
    PALP_E2E_OK,
    PALP_E2E_REPEATED,       /* the counter stands still */
    PALP_E2E_SOME_LOST,      /* the counter went on by 2 to PALP_E2E_MAX_GAP: usable, counted */
    PALP_E2E_WRONG_SEQUENCE, /* by more */
    PALP_E2E_WRONG_CRC,
    PALP_E2E_NO_NEW_DATA
} palp_e2e_verdict;

#define PALP_E2E_MAX_GAP 4u

typedef struct {
    uint8_t counter;
    bool synchronised; /* has seen one */
} palp_e2e;

/* CRC-8 SAE J1850 (polynomial 1D, initial value and final exclusive-or FF) of `bytes` bytes, going
 * on from `crc`: start with 0. Of "123456789" it is 4B. */
uint8_t palp_crc8(uint8_t crc, const uint8_t *data, uint32_t bytes);

/* Completes a frame whose payload is in place: next counter, then CRC. */
void palp_e2e_protect(palp_e2e *e2e, palp_can_frame *frame);

/* What a received frame of the right id and length is worth; `frame` NULL: nothing came. A wrong
 * sequence is refused once, and the next frame counts from it. */
palp_e2e_verdict palp_e2e_check(palp_e2e *e2e, const palp_can_frame *frame);

#endif
