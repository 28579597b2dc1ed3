/* SPDX-License-Identifier: MIT */
#include "sim/virtual_time.h"
#include "port/host/placement.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static uint64_t virtual_clock(void *context) {
    rig *r = context;
    return r->now_ns += r->clock_step_ns;
}

palp_servo_config rig_config(rig *r, const palp_blob *blob) {
    touch_frame t = place_body(blob, &r->file.device, UINT32_MAX, NULL, 0);
    return (palp_servo_config){
        .device = r->file.device,
        .placement = t.placement,
        .finest = PALP_CONTACT_FINEST,
        .cost = {.target = &palp_target_counted, .ns_per_instruction = 0.5f, .margin = 0.8f},
        .tool = palp_tool_sphere(t.tool_radius_m),
        .port = {.now_ns = virtual_clock, .context = r}};
}

void rig_open(rig *r, const palp_blob *blob, const palp_servo_config *config, const char *script,
              const char *faults, uint64_t seed) {
    fault_list f = faults != NULL ? faults_read(faults, seed) : (fault_list){.seed = seed};
    size_t bytes = palp_servo_memsize(blob, config->finest);
    r->memory = allocate_aligned(bytes, 1);
    r->clock_step_ns = 100;
    if (palp_servo_open(&r->servo, blob, config, r->memory, bytes, NULL) != PALP_OK)
        die(EXIT_WORK, "the servo does not open");
    sim_bus_init(&r->bus, &r->file, hand_load(script), f);
}

bool rig_opens(const palp_blob *blob, const palp_servo_config *config) {
    const size_t bytes = palp_servo_memsize(blob, config->finest);
    void *memory = allocate_aligned(bytes, 1);
    palp_servo *servo;
    const bool opens = palp_servo_open(&servo, blob, config, memory, bytes, NULL) == PALP_OK;
    free(memory);
    return opens;
}

void rig_lead(rig *r, const hand_key *keys, uint32_t count, double N_per_m, double Ns_per_m) {
    hand *h = &r->bus.script;
    free(h->key);
    *h = (hand){.count = count,
                .key = allocate(count, sizeof *keys),
                .stiffness_N_per_m = N_per_m,
                .damping_Ns_per_m = Ns_per_m};
    memcpy(h->key, keys, count * sizeof *keys);
}

void rig_start(rig *r, const palp_blob *blob, const char *device, float rate_hz, const char *script,
               const char *faults, uint64_t seed) {
    *r = (rig){.file = device_load(device)};
    r->file.device.drives.rate_hz = rate_hz;
    palp_servo_config config = rig_config(r, blob);
    rig_open(r, blob, &config, script, faults, seed);
}

void rig_tick(rig *r) {
    palp_can_frame in[64], out[PALP_SERVO_FRAMES_OUT];
    double dt = 1 / (double)r->file.device.drives.rate_hz;
    uint32_t skipped = sim_bus_overrun(&r->bus, dt), events;
    for (uint32_t i = 0; i < skipped; i++) (void)sim_bus_pass(&r->bus, dt, in, 64, &events);
    uint32_t n = sim_bus_pass(&r->bus, dt, in, 64, &events);
    r->events = events | r->more_events;
    r->more_events = 0;
    palp_tick_input input = {
        .frames = in, .count = r->silent ? 0 : n, .skipped = skipped, .events = r->events};
    n = palp_servo_tick(r->servo, &input, out, &r->report);
    for (uint32_t i = 0; i < n; i++) {
        if (!sim_bus_send(&r->bus, &out[i])) r->more_events |= PALP_EVENT_BUS_FULL;
    }
    r->largest_N = fmax(r->largest_N, (double)palp_norm(r->report.force_N));
}

void rig_run(rig *r, double seconds) {
    double end = r->bus.time_s + seconds;
    while (r->bus.time_s < end) rig_tick(r);
}

bool rig_is_sound(const rig *r) {
    const palp_device *d = &r->file.device;
    bool good = palp_vec3_is_finite(r->report.force_N) &&
                palp_norm(r->report.force_N) <= d->force_max_N * 1.0001f;
    for (int k = 0; k < 3; k++)
        good = good && fabsf(r->report.motor_torque_Nm[k]) <= d->drives.torque_max_Nm * 1.0001f;
    return good;
}

void rig_stop(rig *r) {
    free(r->bus.script.key);
    free(r->memory);
}
