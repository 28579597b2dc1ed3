/* SPDX-License-Identifier: MIT */
/* The virtual device and the hand on a SocketCAN interface, for a palpd in another process. */
#include "device.h"
#include "hand.h"
#include "port/linux/realtime.h"
#include "port/linux/socketcan.h"
#include "tools/args.h"
#include "tools/util.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

static const char help[] =
    "usage: palp-sim --bus vcan0 --device NAME|FILE [--hand SCRIPT] [--seconds S] [--rate HZ]\n"
    "\n"
    "Simulates a haptic device, its drives and the hand that holds it on a SocketCAN interface.\n"
    "\n"
    "  --hand SCRIPT  'touch' (default) or a file of lines t x y z, in device coordinates\n"
    "  --seconds S    default 10\n"
    "  --rate HZ      of the encoder estimates, default 1000\n";

static const option options[] = {{"--bus", 1},     {"--device", 1}, {"--hand", 1},
                                 {"--seconds", 1}, {"--rate", 1},   {NULL, 0}};

typedef struct {
    const char *bus, *device, *hand;
    double seconds, rate_hz;
} sim_spec;

static void set_option(void *context, const argument *a) {
    sim_spec *s = context;
    if (a->option == NULL) die(EXIT_USAGE, "unexpected word '%s'", a->value[0]);
    if (strcmp(a->option, "--bus") == 0) s->bus = a->value[0];
    if (strcmp(a->option, "--device") == 0) s->device = a->value[0];
    if (strcmp(a->option, "--hand") == 0) s->hand = a->value[0];
    if (strcmp(a->option, "--seconds") == 0) s->seconds = arg_between(a, 0, 1e7);
    if (strcmp(a->option, "--rate") == 0) s->rate_hz = arg_between(a, 49.9, 20000.1);
}

int main(int argc, char **argv) {
    sim_spec s = {.hand = "touch", .seconds = 10, .rate_hz = 1000};
    program_name = "palp-sim";
    args_parse(argc, argv, options, help, set_option, &s);
    if (s.bus == NULL) die(EXIT_USAGE, "no bus: add --bus INTERFACE");
    if (strcmp(s.bus, "loop") == 0)
        die(EXIT_USAGE, "--bus loop lives inside palpd: run 'palpd BLOB --bus loop --device NAME'");
    if (s.device == NULL) die(EXIT_USAGE, "no device: add --device NAME|FILE");
    device_file file = device_load(s.device);
    hand script = hand_load(s.hand);
    int fd = can_open(s.bus, NULL, 0, 0);
    sim_device device;
    double target[3];
    hand_target(&script, 0, target);
    sim_device_init(&device, &file, target);
    uint64_t period = (uint64_t)(1e9 / s.rate_hz), next = monotonic_ns(NULL), sent = 0, lost = 0,
             received = 0;
    can_health health = {0};
    for (double time_s = 0; time_s < s.seconds; time_s += 1 / s.rate_hz) {
        palp_can_frame frames[64];
        next += period;
        (void)sleep_until(next);
        uint32_t n = can_receive(fd, frames, 64, &health);
        for (uint32_t i = 0; i < n; i++) sim_device_receive(&device, &frames[i]);
        received += n;
        hand_target(&script, time_s, target);
        sim_device_move(&device, 1 / s.rate_hz, target, script.stiffness_N_per_m,
                        script.damping_Ns_per_m);
        n = sim_device_transmit(&device, frames);
        for (uint32_t i = 0; i < n; i++) {
            sent++;
            lost += can_send(fd, &frames[i]) ? 0 : 1;
        }
    }
    printf("palp-sim: %" PRIu64 " frames sent, %" PRIu64 " lost, %" PRIu64 " received\n", sent,
           lost, received);
    if (health.failed)
        warn("the bus failed: check the interface (ip -details link show %s)", s.bus);
    return health.failed ? EXIT_WORK : EXIT_SUCCESS;
}
