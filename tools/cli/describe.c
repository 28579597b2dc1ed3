/* SPDX-License-Identifier: MIT */
/* palp info --device: what a device is to the controller, and how full its bus is. */
#include "core/device/busload.h"
#include "sim/device.h"
#include "tools/cli/commands.h"
#include "port/host/util.h"

static const char *const mechanisms[] = {PALP_MECHANISM_NAMES};
static const char *const protocols[] = {PALP_PROTOCOL_NAMES};

void describe_device(const char *name, double rate_hz, bool json) {
    device_file f = device_load(name);
    const palp_device *d = &f.device;
    f.device.drives.rate_hz = (float)rate_hz;
    uint32_t axes = palp_axes(&d->kinematics);
    palp_bus_load load = palp_bus_load_of(d);
    const char *mechanism = mechanisms[d->kinematics.mechanism];
    const char *protocol = protocols[d->drives.protocol];
    if (json) {
        printf(
            "{\"device\": \"%s\", \"kinematics\": \"%s\", \"axes\": %u, \"protocol\": \"%s\", "
            "\"fd\": %s, \"rate_hz\": %.9g,\n \"bus_load\": %.9g, \"bus_cycle_us\": %.9g, "
            "\"rate_at_full_bus_hz\": %.9g, \"coupling_N_per_m\": %.9g, \"force_max_N\": %.9g}\n",
            name, mechanism, axes, protocol, d->drives.fd ? "true" : "false", rate_hz,
            (double)load.load, 1e6 * (double)load.cycle_s, rate_hz / (double)load.load,
            (double)palp_device_coupling(d), (double)d->force_max_N);
    } else {
        printf("device                %s: %s with %u axes, %s drives over %s\n", name, mechanism,
               axes, protocol, d->drives.fd ? "CAN FD" : "classic CAN");
        printf("virtual coupling      %.4g N/m at %g Hz (the device's limit: %.4g)\n",
               (double)palp_device_coupling(d), rate_hz, (double)d->stiffness_max_N_per_m);
        printf("rate at a full bus    %.0f Hz\n", rate_hz / (double)load.load);
    }
    char text[128];
    device_check_load(&f, text, sizeof text);
    if (!json) printf("bus load              %s\n", text);
}
