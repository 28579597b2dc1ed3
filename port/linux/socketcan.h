/* SPDX-License-Identifier: MIT */
/* Raw SocketCAN, classic and FD, non-blocking. */
#ifndef PALP_PORT_SOCKETCAN_H
#define PALP_PORT_SOCKETCAN_H

#include "core/device/drive.h"

/* An interface, and what has happened on it since the last look. */
typedef struct {
    int fd, index; /* of the socket, of the interface */
    const char *name;
    uint32_t events;     /* PALP_EVENT_BUS_ bits and OVERFLOW; the reader clears them */
    uint32_t dropped;    /* frames that the kernel's receive queue had no room for, in total */
    uint64_t sent, lost; /* frames given to the interface, and refused by it */
} can_port;

/*
 * Opens `interface`, for CAN FD too if `fd` is set; exits 2 with a mend when the kernel has no CAN,
 * no such interface, or one that cannot carry FD. `count` 0 receives all frames. Nothing is
 * received or can be sent before can_listen().
 */
can_port can_open(const char *interface, bool fd, const palp_can_filter *filter, uint32_t count);

/* Lets through only what comes from there; false when the kernel does not take it, and then nothing has
 * changed. Any thread, at any time. */
bool can_filter_to(const can_port *port, const palp_can_filter *filter, uint32_t count);

/* From now on frames are received: called when somebody reads them, so that none queue up and drop
 * before. False, and an event, when the interface has gone. */
bool can_listen(can_port *port);

/* Takes up to `capacity` frames that have arrived, in their order, with one system call per
 * CAN_BATCH; returns how many. time_s[capacity], or NULL, gets the kernel's time stamps
 * (CLOCK_REALTIME). Error frames become events. */
#define CAN_BATCH 16u
uint32_t can_receive(can_port *port, palp_can_frame *frames, double *time_s, uint32_t capacity);

/* Throws away what has queued up. */
void can_drain(can_port *port);

/* False when the frame was not taken (queue full, link down), which is also an event; it is not
 * retried: a set-point that waits is an old one. */
bool can_send(can_port *port, const palp_can_frame *frame);

/* Waits until a frame can be read; false after `timeout_ms`. */
bool can_wait(const can_port *port, int timeout_ms);

#endif
