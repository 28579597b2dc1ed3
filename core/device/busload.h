/* SPDX-License-Identifier: MIT */
/*
 * How long frames hold the bus at worst, and so how full it is. With n bytes of payload, 11-bit id
 * and the most stuff bits that the coding allows:
 *
 *   classic   47 + 8 n + floor((34 + 8 n - 1) / 4) bits
 *   FD        nominal rate: 17 + 4 stuff + 12;  data rate: 5 + 8 n + floor((5 + 8 n) / 4) stuff
 *             + 4 stuff count + CRC 17 (21 beyond 16 bytes) + its 6 (7) fixed stuff bits + 1
 *   29 bits   20 more at the nominal rate, and 5 stuff
 */
#ifndef PALP_DEVICE_BUSLOAD_H
#define PALP_DEVICE_BUSLOAD_H

#include "core/device/device.h"

/* Seconds. data_rate_bps 0: a classic frame. */
float palp_frame_time_s(uint32_t bytes, bool extended, float bit_rate_bps, float data_rate_bps);

typedef struct {
    float cycle_s; /* bus time of all frames of a period */
    float load;    /* share of the bus at the configured rate; above 1 it cannot work */
} palp_bus_load;

#define PALP_BUS_LOAD_ADVISED 0.7f

/* Of all drives of a device at its rate. */
palp_bus_load palp_bus_load_of(const palp_device *device);

#endif
