/* SPDX-License-Identifier: MIT */
/* Raw SocketCAN, non-blocking. */
#ifndef PALP_PORT_SOCKETCAN_H
#define PALP_PORT_SOCKETCAN_H

#include "core/device/canframe.h"
#include <stdbool.h>

/*
 * Opens `interface`; exits 2 with a mend when the kernel has no CAN or no such interface.
 * `ids`/`mask`: the frames to receive are those with (id & mask) equal to one of ids; count 0
 * receives all.
 */
int can_open(const char *interface, const uint32_t *ids, uint32_t count, uint32_t mask);

/* What has gone wrong on the interface since it was opened. */
typedef struct {
    bool failed;      /* bus-off, or the link went down */
    uint32_t dropped; /* frames that the kernel's receive queue had no room for */
} can_health;

/* Takes up to `capacity` frames that have arrived; returns how many. */
uint32_t can_receive(int fd, palp_can_frame *frames, uint32_t capacity, can_health *health);

/* Throws away what has queued up. */
void can_drain(int fd);

/* False when the frame was not taken (queue full, link down); it is not retried. */
bool can_send(int fd, const palp_can_frame *frame);

#endif
