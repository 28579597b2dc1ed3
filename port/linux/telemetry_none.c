/* SPDX-License-Identifier: MIT */
/* The build without Cyclone DDS. */
#include "port/linux/telemetry.h"
#include "port/host/util.h"

telemetry *telemetry_open(const palp_device *device, uint32_t number) {
    (void)device;
    (void)number;
    die(EXIT_USAGE, "--dds: built without DDS: install cyclonedds-dev and cyclonedds-tools, and "
                    "run make again");
}
void telemetry_publish(telemetry *t, const palp_report *r) {
    (void)t;
    (void)r;
}
void telemetry_close(telemetry *t) { (void)t; }
