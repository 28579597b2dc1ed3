/* SPDX-License-Identifier: MIT */
/* A servo on a simulated device in virtual time: for studies and tests. */
#ifndef PALP_SIM_RIG_H
#define PALP_SIM_RIG_H

#include "core/palp.h"
#include "sim/bus.h"

typedef struct {
    palp_servo *servo;
    void *memory;
    sim_bus bus;
    device_file file;
    palp_report report;
    uint64_t now_ns, clock_step_ns; /* every look at the clock takes a step */
    double largest_N;
    uint32_t events, more_events; /* of the last tick; to be added to the next */
    bool silent;                  /* nothing reaches the controller */
} rig;

/* The config that palpd would use on this blob; the clock is the rig's. */
palp_servo_config rig_config(rig *r, const palp_blob *blob);

/* A built-in device at `rate_hz` with a hand script and a fault list (NULL: none). rig_stop frees.
 */
void rig_start(rig *r, const palp_blob *blob, const char *device, float rate_hz, const char *script,
               const char *faults, uint64_t seed);
/* The same with a config that the caller has changed; r->file is set. */
void rig_open(rig *r, const palp_blob *blob, const palp_servo_config *config, const char *script,
              const char *faults, uint64_t seed);
/* Whether the servo takes this body and config. */
bool rig_opens(const palp_blob *blob, const palp_servo_config *config);
/* Lets a hand of this stiffness and damping lead the device along its own keys, without tremor. */
void rig_lead(rig *r, const hand_key *keys, uint32_t count, double N_per_m, double Ns_per_m);
void rig_tick(rig *r);
/* Ticks for `seconds` of virtual time. */
void rig_run(rig *r, double seconds);
/* Whether the force and torques of the last tick are finite and within the device's limits. */
bool rig_is_sound(const rig *r);
void rig_stop(rig *r);

#endif
