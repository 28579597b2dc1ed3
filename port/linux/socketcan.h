/* SPDX-License-Identifier: MIT */
/* Raw SocketCAN, non-blocking. */
#ifndef PALP_PORT_SOCKETCAN_H
#define PALP_PORT_SOCKETCAN_H

#include "core/device/canframe.h"
#include <stdbool.h>

/*
 * Opens `interface`; exits 2 with a mend when the kernel has no CAN or no such interface. `ids`/`mask`: the
 * frames to receive are those with (id & mask) equal to one of ids; count 0 receives all.
 */
int can_open(const char *interface, const uint32_t *ids, uint32_t count, uint32_t mask);

/* Takes up to `capacity` frames that have arrived; returns how many. *error: an error frame or a dead link. */
uint32_t can_receive(int fd, palp_can_frame *frames, uint32_t capacity, bool *error);

/* False when the frame was not taken (queue full, link down); it is not retried. */
bool can_send(int fd, const palp_can_frame *frame);

#endif
