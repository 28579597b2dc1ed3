/* SPDX-License-Identifier: MIT */
/* The virtual device and the hand on a SocketCAN interface, for a palpd in another process. */
#include "sim/bus.h"
#include "port/linux/loop.h"
#include "port/linux/realtime.h"
#include "port/host/args.h"
#include "port/host/scenefile.h"
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
    "       palp-sim SCENE [--hand SCRIPT] [--seconds S] [--rate HZ] [--fault LIST] [--seed N] "
    "[--lockstep]\n"
    "\n"
    "Simulates a haptic device, its drives and the hand that holds it on a SocketCAN interface; of "
    "a\n"
    "scene all devices, on their buses.\n"
    "\n"
    "  --hand SCRIPT  'touch' (default) or a file of lines t x y z [rx ry rz [gripper]], of the "
    "device\n"
    "  --seconds S    default 10, or as the scene says\n"
    "  --rate HZ      of the drives' frames, default 1000, or as the scene says\n"
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
    const char *scene, *bus, *device, *hand, *fault;
    double seconds, rate_hz;
    uint32_t seed;
    bool lockstep;
} sim_spec;

static void set_option(void *context, const argument *a) {
    sim_spec *s = context;
    if (a->option == NULL) {
        if (!scene_is_here(a->value[0]) || s->scene != NULL)
            die(EXIT_USAGE, "unexpected word '%s'", a->value[0]);
        s->scene = a->value[0];
        return;
    }
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

/* A device on its interface, and what that itself does wrong: a link that goes down, an error frame of
 * bus-off. */
typedef struct {
    sim_bus bus;
    device_file file;
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

static void strike_wire(wire *w) {
    const sim_bus *b = &w->bus;
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

static uint64_t run_paced(const sim_spec *s, wire *w, uint32_t count) {
    uint64_t period = (uint64_t)(1e9 / s->rate_hz), next = monotonic_ns(NULL), received = 0;
    while (w[0].bus.time_s < s->seconds) {
        palp_can_frame frames[SIM_FRAMES_OUT * 2];
        uint32_t events;
        next += period;
        (void)sleep_until(next);
        for (wire *of = w; of < w + count; of++) {
            strike_wire(of);
            uint32_t n = can_receive(&of->port, frames, NULL, SIM_FRAMES_OUT * 2);
            for (uint32_t i = 0; i < n; i++) (void)sim_bus_send(&of->bus, &frames[i]);
            received += n;
            n = sim_bus_pass(&of->bus, 1 / s->rate_hz, frames, SIM_FRAMES_OUT * 2, &events);
            for (uint32_t i = 0; i < n && !of->is_down; i++) (void)can_send(&of->port, &frames[i]);
        }
    }
    return received;
}

/* The controller's frames of a tick; false when it has gone. */
static bool take_turn(wire *w, uint32_t tick, uint64_t *received, uint64_t *lost) {
    palp_can_frame frames[RECORD_FRAMES];
    lockstep_turn turn = {0};
    do {
        if (!lockstep_receive(&w->port, 3000, frames, RECORD_FRAMES, &turn, lost)) return false;
    } while (turn.tick == LOCKSTEP_HELLO); /* said again while we began */
    if (turn.tick != tick) (*lost)++;
    for (uint32_t i = 0; i < turn.frames; i++) (void)sim_bus_send(&w->bus, &frames[i]);
    *received += turn.frames;
    return true;
}

static uint64_t run_lockstep(const sim_spec *s, wire *w, uint32_t count, uint64_t *lost) {
    palp_can_frame frames[RECORD_FRAMES];
    uint64_t received = 0;
    for (wire *of = w; of < w + count; of++) {
        lockstep_turn turn = {0};
        while (lockstep_receive(&of->port, 20000, frames, RECORD_FRAMES, &turn, lost) &&
               turn.tick != LOCKSTEP_HELLO)
            continue;
        /* says hello in turn, so that the controller goes on to the next bus */
        palp_can_frame hello = lockstep_mark(LOCKSTEP_HELLO, 0);
        if (count > 1) (void)lockstep_send(&of->port, &hello);
    }
    uint32_t ticks = (uint32_t)(s->seconds * s->rate_hz + 0.5);
    for (uint32_t tick = 0; tick < ticks; tick++) {
        uint32_t events;
        for (wire *of = w; of < w + count; of++) {
            uint32_t n = sim_bus_pass(&of->bus, 1 / s->rate_hz, frames, RECORD_FRAMES, &events);
            palp_can_frame mark = lockstep_mark(tick, n);
            for (uint32_t i = 0; i < n; i++) (void)lockstep_send(&of->port, &frames[i]);
            (void)lockstep_send(&of->port, &mark);
        }
        for (wire *of = w; of < w + count; of++) {
            if (!take_turn(of, tick, &received, lost)) return received;
        }
    }
    return received;
}

/* One device as the options say, or those of the scene. */
static scene_file *describe(sim_spec *s) {
    if (s->scene != NULL && (s->bus != NULL || s->device != NULL))
        die(EXIT_USAGE, "--bus and --device: the scene names them");
    if (s->scene == NULL && s->bus == NULL) die(EXIT_USAGE, "no bus: add --bus INTERFACE");
    scene_file *f = s->scene != NULL ? scene_read(s->scene) : scene_empty("palp-sim");
    if (s->scene == NULL) {
        if (strcmp(s->bus, "loop") == 0)
            die(EXIT_USAGE,
                "--bus loop lives inside palpd: run 'palpd BLOB --bus loop --device NAME'");
        if (s->device == NULL) die(EXIT_USAGE, "no device: add --device NAME|FILE");
        scene_device *d = scene_add_device(f, "--device", s->device);
        if (strlen(s->bus) >= sizeof d->bus) die(EXIT_USAGE, "--bus: '%s' is no name", s->bus);
        snprintf(d->bus, sizeof d->bus, "%s", s->bus);
        f->seconds = 10;
    }
    if (!(s->seconds > 0)) s->seconds = f->seconds;
    if (!(s->rate_hz > 0)) s->rate_hz = f->rate_hz;
    if (f->devices == 0) die(EXIT_USAGE, "%s: no device to simulate", f->name);
    for (uint32_t d = 0; d < f->devices; d++) {
        if (f->device[d].bus[0] == '\0' || strncmp(f->device[d].bus, "loop", 4) == 0)
            die(EXIT_USAGE,
                "%s: device %s has no bus of its own: add 'bus INTERFACE' (palpd --bus loop "
                "simulates in its own process)",
                f->name, f->device[d].name);
    }
    return f;
}

static void open_wire(wire *w, const sim_spec *s, const scene_file *scene, uint32_t number) {
    const scene_device *d = &scene->device[number];
    const uint64_t seed = s->seed + number;
    w->file = device_load(d->name);
    w->file.device.drives.rate_hz = (float)s->rate_hz;
    hand script = hand_load(d->hand[0] != '\0' ? d->hand : s->hand);
    fault_list f = s->fault != NULL ? faults_read(s->fault, seed) : (fault_list){.seed = seed};
    check_faults(&f);
    w->port = can_open(d->bus, w->file.device.drives.fd, NULL, 0);
    if (!can_listen(&w->port)) die(EXIT_WORK, "--bus: '%s' has gone", d->bus);
    sim_bus_init(&w->bus, &w->file, script, f);
    sim_peer_init(&w->bus.peer, scene, number);
}

int main(int argc, char **argv) {
    sim_spec s = {.hand = "touch"};
    program_name = "palp-sim";
    args_parse(argc, argv, options, help, set_option, &s);
    scene_file *f = describe(&s);
    wire *w = allocate(f->devices, sizeof *w);
    for (uint32_t d = 0; d < f->devices; d++) open_wire(&w[d], &s, f, d);
    uint64_t lost = 0, sent = 0;
    uint64_t received =
        s.lockstep ? run_lockstep(&s, w, f->devices, &lost) : run_paced(&s, w, f->devices);
    bool failed = false;
    for (uint32_t d = 0; d < f->devices; d++) {
        const can_port *port = &w[d].port;
        const bool gone = (port->events & (PALP_EVENT_BUS_OFF | PALP_EVENT_BUS_DOWN)) != 0;
        sent += port->sent;
        lost += port->lost;
        failed = failed || gone;
        if (gone && s.fault == NULL)
            warn("the bus failed: check the interface (ip -details link show %s)",
                 f->device[d].bus);
    }
    printf("palp-sim: %" PRIu64 " frames sent, %" PRIu64 " lost, %" PRIu64 " received\n", sent,
           lost, received);
    free(w);
    scene_free(f);
    return failed && s.fault == NULL ? EXIT_WORK : EXIT_SUCCESS;
}
