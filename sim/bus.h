/* SPDX-License-Identifier: MIT */
/*
 * The bus in memory: device and hand on one end, a controller on the other, with the same frames as
 * on a wire, and faults on the way. palp-sim joins it to a SocketCAN interface.
 */
#ifndef PALP_SIM_BUS_H
#define PALP_SIM_BUS_H

#include "sim/device.h"
#include "sim/faults.h"
#include "sim/hand.h"
#include "sim/peer.h"

#define SIM_BUS_QUEUE 256u

typedef struct {
    palp_can_frame frame;
    double due_s;
} sim_flight;

typedef struct {
    sim_flight flight[SIM_BUS_QUEUE];
    uint32_t count;
} sim_lane;

typedef struct {
    sim_device device;
    hand script;
    fault_list faults;
    sim_peer peer; /* nobody, unless its maker sets it */
    sim_lane to_controller, to_device;
    double time_s;
    uint64_t sent, lost; /* by the controller; frames that the bus did not take */
    bool was_off;
} sim_bus;

void sim_bus_init(sim_bus *b, const device_file *file, hand script, fault_list f);

/*
 * One period of `dt_s` passes: the device takes the frames that have reached it, moves, and
 * answers. Writes the frames that reach the controller, at most `capacity`; returns how many.
 * *events gets the PALP_EVENT_ bits of what the controller's bus goes through.
 */
uint32_t sim_bus_pass(sim_bus *b, double dt_s, palp_can_frame *frames, uint32_t capacity,
                      uint32_t *events);

/* A frame from the controller; false when the bus does not take it. */
bool sim_bus_send(sim_bus *b, const palp_can_frame *frame);

/* Periods that the controller is to miss now. */
uint32_t sim_bus_overrun(const sim_bus *b, double dt_s);

#endif
