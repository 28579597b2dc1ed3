/* SPDX-License-Identifier: MIT */
/* The virtual device and the hand on a SocketCAN interface, for a palpd in another process. */
#include "sim/bus.h"
#include "port/linux/loop.h"
#include "port/linux/realtime.h"
#include "port/host/args.h"
#include "port/host/util.h"
#include <errno.h>
#include <inttypes.h>
#include <net/if.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

static const char help[] =
    "usage: palp-sim --bus vcan0 --device NAME|FILE [--hand SCRIPT] [--seconds S] [--rate HZ]\n"
    "                [--fault LIST] [--seed N] [--lockstep]\n"
    "\n"
    "Simulates a haptic device, its drives and the hand that holds it on a SocketCAN interface.\n"
    "\n"
    "  --hand SCRIPT  'touch' (default) or a file of lines t x y z [rx ry rz [gripper]], of the "
    "device\n"
    "  --seconds S    default 10\n"
    "  --rate HZ      of the drives' frames, default 1000\n"
    "  --fault LIST   KIND[@T[+D]][=V],...: loss duplicate reorder corrupt delay stuck jump "
    "glitch\n"
    "                 nan drive refuse ignore mute busoff down, at T s for D s (0.01), V as in "
    "sim/README.md\n"
    "  --seed N       of what is random in them\n"
    "  --lockstep     take turns with a palpd --lockstep\n";

static const option options[] = {{"--bus", 1},     {"--device", 1},   {"--hand", 1},
                                 {"--seconds", 1}, {"--rate", 1},     {"--fault", 1},
                                 {"--seed", 1},    {"--lockstep", 0}, {NULL, 0}};

typedef struct {
    const char *bus, *device, *hand, *fault;
    double seconds, rate_hz;
    uint32_t seed;
    bool lockstep;
} sim_spec;

static void set_option(void *context, const argument *a) {
    sim_spec *s = context;
    if (a->option == NULL) die(EXIT_USAGE, "unexpected word '%s'", a->value[0]);
    if (strcmp(a->option, "--bus") == 0) s->bus = a->value[0];
    if (strcmp(a->option, "--device") == 0) s->device = a->value[0];
    if (strcmp(a->option, "--hand") == 0) s->hand = a->value[0];
    if (strcmp(a->option, "--fault") == 0) s->fault = a->value[0];
    if (strcmp(a->option, "--lockstep") == 0) s->lockstep = true;
    if (strcmp(a->option, "--seed") == 0) s->seed = arg_u32(a, 0, 0, UINT32_MAX);
    if (strcmp(a->option, "--seconds") == 0) s->seconds = arg_between(a, 0, 1e7);
    if (strcmp(a->option, "--rate") == 0) s->rate_hz = arg_between(a, 49.9, 20000.1);
}

static void check_faults(const fault_list *f) {
    for (uint32_t i = 0; i < f->count; i++) {
        if (f->list[i].kind == FAULT_ENOBUFS || f->list[i].kind == FAULT_OVERRUN)
            die(EXIT_USAGE, "--fault: enobufs and overrun happen in the controller: give them to "
                            "'palpd --bus loop'");
    }
}

/* What the interface itself does wrong: a link that goes down, an error frame of bus-off. */
typedef struct {
    can_port port;
    bool is_down, was_off;
} wire;

static void set_link(const wire *w, bool up) {
    struct ifreq r = {0};
    snprintf(r.ifr_name, sizeof r.ifr_name, "%s", w->port.name);
    if (ioctl(w->port.fd, SIOCGIFFLAGS, &r) != 0) return;
    r.ifr_flags = (short)(up ? r.ifr_flags | IFF_UP : r.ifr_flags & ~IFF_UP);
    if (ioctl(w->port.fd, SIOCSIFFLAGS, &r) != 0)
        die(EXIT_WORK, "--fault: the link cannot be set %s: %s", up ? "up" : "down",
            strerror(errno));
}

static void strike_wire(wire *w, const sim_bus *b) {
    bool down = fault_now(&b->faults, FAULT_DOWN, b->time_s) != NULL;
    bool off = fault_now(&b->faults, FAULT_BUS_OFF, b->time_s) != NULL;
    if (down != w->is_down) set_link(w, !down);
    if (off && !w->was_off) {
        palp_can_frame error = {.id = 0x40, .flags = PALP_CAN_ERROR, .length = 8};
        (void)can_send(&w->port, &error);
    }
    w->is_down = down;
    w->was_off = off;
}

static uint64_t run_paced(const sim_spec *s, sim_bus *b, wire *w) {
    uint64_t period = (uint64_t)(1e9 / s->rate_hz), next = monotonic_ns(NULL), received = 0;
    while (b->time_s < s->seconds) {
        palp_can_frame frames[SIM_FRAMES_OUT * 2];
        uint32_t events;
        next += period;
        (void)sleep_until(next);
        strike_wire(w, b);
        uint32_t n = can_receive(&w->port, frames, NULL, SIM_FRAMES_OUT * 2);
        for (uint32_t i = 0; i < n; i++) (void)sim_bus_send(b, &frames[i]);
        received += n;
        n = sim_bus_pass(b, 1 / s->rate_hz, frames, SIM_FRAMES_OUT * 2, &events);
        for (uint32_t i = 0; i < n && !w->is_down; i++) (void)can_send(&w->port, &frames[i]);
    }
    return received;
}

static uint64_t run_lockstep(const sim_spec *s, sim_bus *b, wire *w, uint64_t *lost) {
    palp_can_frame frames[RECORD_FRAMES];
    lockstep_turn turn = {0};
    uint64_t received = 0;
    while (lockstep_receive(&w->port, 20000, frames, RECORD_FRAMES, &turn, lost) &&
           turn.tick != LOCKSTEP_HELLO)
        continue;
    uint32_t ticks = (uint32_t)(s->seconds * s->rate_hz + 0.5);
    for (uint32_t tick = 0; tick < ticks; tick++) {
        uint32_t events;
        uint32_t n = sim_bus_pass(b, 1 / s->rate_hz, frames, RECORD_FRAMES, &events);
        palp_can_frame mark = lockstep_mark(tick, n);
        for (uint32_t i = 0; i < n; i++) (void)lockstep_send(&w->port, &frames[i]);
        (void)lockstep_send(&w->port, &mark);
        do {
            if (!lockstep_receive(&w->port, 3000, frames, RECORD_FRAMES, &turn, lost))
                return received;
        } while (turn.tick == LOCKSTEP_HELLO); /* said again while we began */
        if (turn.tick != tick) (*lost)++;
        for (uint32_t i = 0; i < turn.frames; i++) (void)sim_bus_send(b, &frames[i]);
        received += turn.frames;
    }
    return received;
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
    file.device.drives.rate_hz = (float)s.rate_hz;
    hand script = hand_load(s.hand);
    fault_list f = s.fault != NULL ? faults_read(s.fault, s.seed) : (fault_list){.seed = s.seed};
    check_faults(&f);
    wire w = {.port = can_open(s.bus, file.device.drives.fd, NULL, 0)};
    if (!can_listen(&w.port)) die(EXIT_WORK, "--bus: '%s' has gone", s.bus);
    sim_bus *b = allocate(1, sizeof *b);
    sim_bus_init(b, &file, script, f);
    uint64_t lost = 0;
    uint64_t received = s.lockstep ? run_lockstep(&s, b, &w, &lost) : run_paced(&s, b, &w);
    printf("palp-sim: %" PRIu64 " frames sent, %" PRIu64 " lost, %" PRIu64 " received\n",
           w.port.sent, w.port.lost + lost, received);
    bool failed = (w.port.events & (PALP_EVENT_BUS_OFF | PALP_EVENT_BUS_DOWN)) != 0;
    if (failed && s.fault == NULL)
        warn("the bus failed: check the interface (ip -details link show %s)", s.bus);
    free(b);
    return failed && s.fault == NULL ? EXIT_WORK : EXIT_SUCCESS;
}
