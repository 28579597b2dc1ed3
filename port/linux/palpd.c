/* SPDX-License-Identifier: MIT */
/* The controller daemon: a blob, a device, a bus, and the servo tick between them. */
#include "calibrate.h"
#include "candump.h"
#include "core/palp.h"
#include "realtime.h"
#include "sim/device.h"
#include "sim/hand.h"
#include "sim/placement.h"
#include "sim/report.h"
#include "sim/view.h"
#include "socketcan.h"
#include "tools/args.h"
#include "tools/commands.h"
#include "tools/util.h"
#include <inttypes.h>
#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>

static const char help[] =
    "usage: palpd BLOB --bus can0|vcan0|loop --device NAME|FILE [OPTIONS]\n"
    "\n"
    "Feels a body through a haptic device: reads the drives' frames, solves the contact, sends "
    "torques.\n"
    "\n"
    "  --bus NAME          a SocketCAN interface, or 'loop': device and hand simulated in this "
    "process\n"
    "  --device NAME|FILE  arm3, desk3, or a device file\n"
    "  --rate HZ           default 1000\n"
    "  --seconds S         default 10; 0 runs until interrupted\n"
    "  --hand SCRIPT       with loop: 'touch' (default) or a file of lines t x y z\n"
    "  --touch NODE        the node to bring under the tool (default: a high flat place)\n"
    "  --friction MU       Coulomb friction of the tool, 0 to 10 (default 0)\n"
    "  --no-wait           with loop: do not wait for the clock between ticks\n"
    "  --cpu N             run on this processor\n"
    "  --priority P        SCHED_FIFO priority\n"
    "  --strict-rt         refuse to run without real-time guarantees\n"
    "  --log FILE          all frames, in candump format\n"
    "  --report FILE.html  a page with force, latency and energy\n"
    "  --view FILE.svg     the body at the largest force\n"
    "\n"
    "Exit 0 only when the run reached its working state and no fault is latched.\n";

static const option options[] = {
    {"--bus", 1},    {"--device", 1},   {"--rate", 1},      {"--seconds", 1},
    {"--hand", 1},   {"--touch", 1},    {"--friction", 1},  {"--no-wait", 0},
    {"--cpu", 1},    {"--priority", 1}, {"--strict-rt", 0}, {"--log", 1},
    {"--report", 1}, {"--view", 1},     {"--dds", 0},       {NULL, 0}};

#define MAX_FRAMES 64
#define MAX_RECORDED 2000000u
#define TICK_SHARE 0.8f /* of the period; the rest is for the bus and for waking up */

typedef struct {
    const char *blob, *bus, *device, *hand, *log, *report, *view;
    double rate_hz, seconds;
    uint32_t touch;
    double friction;
    int cpu, priority;
    bool no_wait, strict;
} daemon_spec;

static volatile sig_atomic_t interrupted;
static void on_interrupt(int number) {
    (void)number;
    interrupted = 1;
}

static void set_option(void *context, const argument *a) {
    daemon_spec *s = context;
    const char *o = a->option;
    if (o == NULL) {
        if (s->blob != NULL) die(EXIT_USAGE, "one blob, not also '%s'", a->value[0]);
        s->blob = a->value[0];
    } else if (strcmp(o, "--bus") == 0) {
        s->bus = a->value[0];
    } else if (strcmp(o, "--device") == 0) {
        s->device = a->value[0];
    } else if (strcmp(o, "--rate") == 0) {
        s->rate_hz = arg_between(a, 49.9, 20000.1);
    } else if (strcmp(o, "--seconds") == 0) {
        s->seconds = arg_between(a, -1e-9, 1e7);
    } else if (strcmp(o, "--hand") == 0) {
        s->hand = a->value[0];
    } else if (strcmp(o, "--friction") == 0) {
        s->friction = arg_double(a, 0);
        if (!(s->friction >= 0 && s->friction <= 10))
            die(EXIT_USAGE, "%s: %s is out of range: need 0 to 10", a->where, a->value[0]);
    } else if (strcmp(o, "--touch") == 0) {
        s->touch = arg_u32(a, 0, 0, PALP_MAX_NODES);
    } else if (strcmp(o, "--no-wait") == 0) {
        s->no_wait = true;
    } else if (strcmp(o, "--cpu") == 0) {
        s->cpu = (int)arg_u32(a, 0, 0, 1023);
    } else if (strcmp(o, "--priority") == 0) {
        s->priority = (int)arg_u32(a, 0, 1, 98);
    } else if (strcmp(o, "--strict-rt") == 0) {
        s->strict = true;
    } else if (strcmp(o, "--log") == 0) {
        s->log = a->value[0];
    } else if (strcmp(o, "--report") == 0) {
        s->report = a->value[0];
    } else if (strcmp(o, "--view") == 0) {
        s->view = a->value[0];
    } else if (strcmp(o, "--dds") == 0) {
        die(EXIT_USAGE, "--dds: this build has no DDS telemetry");
    }
}

/* One end of a bus: either SocketCAN or the simulated device in this process. */
typedef struct {
    bool loop;
    int fd;
    sim_device device;
    hand script;
    uint64_t sent, lost;
    can_health health;
} bus;

static bus bus_open(const daemon_spec *s, const device_file *file) {
    bus b = {.loop = strcmp(s->bus, "loop") == 0, .fd = -1};
    if (!b.loop) {
        uint32_t ids[PALP_AXES];
        for (uint32_t i = 0; i < PALP_AXES; i++) ids[i] = (uint32_t)file->device.node_id[i] << 5;
        b.fd = can_open(s->bus, ids, PALP_AXES, 0x7e0u);
        return b;
    }
    double start[3];
    b.script = hand_load(s->hand);
    hand_target(&b.script, 0, start);
    sim_device_init(&b.device, file, start);
    return b;
}

static uint32_t bus_receive(bus *b, double time_s, double dt_s, palp_can_frame *frames) {
    if (!b->loop) return can_receive(b->fd, frames, MAX_FRAMES, &b->health);
    double target[3];
    hand_target(&b->script, time_s, target);
    sim_device_move(&b->device, dt_s, target, b->script.stiffness_N_per_m,
                    b->script.damping_Ns_per_m);
    return sim_device_transmit(&b->device, frames);
}

static void bus_send(bus *b, const palp_can_frame *frame) {
    b->sent++;
    if (b->loop) {
        sim_device_receive(&b->device, frame);
    } else if (!can_send(b->fd, frame)) {
        b->lost++;
        b->health.failed = true; /* what is queued would act late: fault, never send again */
    }
}

/* Torques to zero and drives to idle, whatever the state was. */
static void stop_drives(bus *b, const palp_device *device) {
    for (uint32_t i = 0; i < PALP_AXES; i++) {
        palp_odrive_message zero = {.node = device->node_id[i],
                                    .command = PALP_ODRIVE_SET_INPUT_TORQUE};
        palp_odrive_message idle = {.node = device->node_id[i],
                                    .command = PALP_ODRIVE_SET_AXIS_STATE,
                                    .state = PALP_ODRIVE_IDLE};
        palp_can_frame frame = palp_odrive_encode(&zero);
        bus_send(b, &frame);
        frame = palp_odrive_encode(&idle);
        bus_send(b, &frame);
    }
}

/* The contacts at the largest force so far, kept for the picture. */
typedef struct {
    palp_load *load;
    uint32_t count;
    float force_N;
    palp_vec3 tool_m;
} peak;

static void keep_peak(peak *p, const palp_servo *servo, const palp_report *r) {
    float force = palp_norm(r->force_N);
    if (force <= p->force_N) return;
    p->force_N = force;
    p->tool_m = r->tool_m;
    p->count = palp_servo_loads(servo, p->load);
}

static float *peak_displacement(const palp_blob *blob, const peak *p) {
    palp_field field;
    size_t bytes = palp_field_memsize(blob);
    void *memory = allocate_aligned(bytes, 1);
    float *u = allocate(3 * (size_t)blob->meta->nodes, sizeof *u);
    if (palp_field_init(&field, blob, memory, bytes) != PALP_OK)
        die(EXIT_WORK, "the field does not open");
    palp_field_update(&field, p->load, p->count);
    const float *x = palp_field_reconstruct(&field, blob->meta->levels - 1);
    for (uint32_t s = 0; s < blob->domain[PALP_FREE].slots; s++) {
        for (uint32_t k = 0; k < 3; k++)
            u[3 * blob->domain[PALP_FREE].node[s] + k] = x[PALP_FIELD_LANES * s + k];
    }
    free(memory);
    return u;
}

static palp_servo *open_servo(const palp_blob *blob, const palp_servo_config *config) {
    size_t bytes = palp_servo_memsize(blob, config->limits);
    void *memory = allocate_aligned(bytes, 1);
    palp_servo *servo;
    float bound_ns = 0;
    palp_status status = palp_servo_open(&servo, blob, config, memory, bytes, &bound_ns);
    if (status == PALP_ERR_BUDGET) {
        float have = config->cost.margin * 1e6f / config->rate_hz;
        die(EXIT_WORK,
            "the coarsest answer may take %.0f us, %.0f us more than the %.0f us that %.0f Hz "
            "leave: lower --rate",
            (double)bound_ns * 1e-3, (double)bound_ns * 1e-3 - (double)have, (double)have,
            (double)config->rate_hz);
    }
    if (status != PALP_OK) die(EXIT_WORK, "cannot open the servo: %s", palp_status_text(status));
    return servo;
}

typedef struct {
    const daemon_spec *spec;
    palp_servo *servo;
    bus *bus;
    FILE *log;
    peak peak;
    run_record record;
    size_t capacity;
    const palp_device *device;
    palp_state last_state;
    bool state_shown;
} session;

static void log_frames(const session *s, double time_s, const palp_can_frame *frames,
                       uint32_t count) {
    const char *name = s->bus->loop ? "loop" : s->spec->bus;
    for (uint32_t i = 0; s->log != NULL && i < count; i++)
        candump_line(s->log, time_s, name, &frames[i]);
}

/* Says at once when the state changes, so that nobody waits for a device that is not there. */
static void announce(session *s, const palp_report *r) {
    if (s->state_shown && r->state == s->last_state) return;
    s->state_shown = true;
    s->last_state = r->state;
    char faults[128];
    report_faults(r->faults, faults, sizeof faults);
    if (s->bus->loop && r->state != PALP_STATE_FAULT) return;
    if (r->state == PALP_STATE_INIT) {
        warn("waiting for heartbeats of nodes %d %d %d on %s", s->device->node_id[0],
             s->device->node_id[1], s->device->node_id[2], s->spec->bus);
    } else {
        warn("%s%s%s", report_state(r->state), r->faults != 0 ? ": " : "", faults);
    }
}

static void run_tick(session *s, uint64_t tick, float late_us) {
    palp_can_frame in[MAX_FRAMES], out[PALP_SERVO_FRAMES_OUT];
    palp_report report;
    double dt = 1 / s->spec->rate_hz;
    double time_s = (double)tick * dt;
    uint32_t n_in = bus_receive(s->bus, time_s, dt, in);
    if (s->bus->health.failed) palp_servo_bus_failed(s->servo);
    uint32_t n_out = palp_servo_tick(s->servo, in, n_in, out, &report);
    for (uint32_t i = 0; i < n_out; i++) bus_send(s->bus, &out[i]);
    palp_servo_spare(s->servo);
    keep_peak(&s->peak, s->servo, &report);
    log_frames(s, time_s, in, n_in);
    log_frames(s, time_s, out, n_out);
    size_t at = report.tick % s->capacity; /* a longer run keeps its last ticks */
    s->record.tick[at] = report;
    if (s->record.late_us != NULL) s->record.late_us[at] = late_us;
    s->record.count = report.tick < s->capacity ? (size_t)report.tick + 1 : s->capacity;
    announce(s, &report);
}

static void run(session *s) {
    uint64_t period_ns = (uint64_t)(1e9 / s->spec->rate_hz);
    uint64_t ticks = (uint64_t)(s->spec->seconds * s->spec->rate_hz + 0.5);
    if (!s->bus->loop) can_drain(s->bus->fd);
    uint64_t next = monotonic_ns(NULL);
    for (uint64_t tick = 0; (ticks == 0 || tick < ticks) && interrupted == 0; tick++) {
        float late_us = 0;
        if (!s->spec->no_wait) {
            next += period_ns;
            late_us = (float)sleep_until(next) * 1e-3f;
            uint64_t now = monotonic_ns(NULL);
            /*
             * After an overrun whole periods are skipped, never made up for in a burst, and what
             * queued up meanwhile is too old to use. A simulated device waits with us.
             */
            uint64_t skipped = now > next ? (now - next) / period_ns : 0;
            next += skipped * period_ns;
            if (skipped > 0 && !s->bus->loop) {
                tick += skipped;
                palp_servo_skip(s->servo, (uint32_t)skipped);
                if (skipped > 2) can_drain(s->bus->fd);
            }
        }
        run_tick(s, tick, late_us);
    }
}

/* The ring of reports in the order of time. */
static void unroll(session *s) {
    run_record *r = &s->record;
    size_t start = 0;
    for (size_t i = 1; i < r->count; i++) {
        if (r->tick[i].tick < r->tick[i - 1].tick) start = i;
    }
    if (start == 0) return;
    palp_report *ordered = allocate(r->count, sizeof *ordered);
    for (size_t i = 0; i < r->count; i++) ordered[i] = r->tick[(start + i) % r->count];
    free(r->tick);
    r->tick = ordered;
}

int main(int argc, char **argv) {
    daemon_spec s = {
        .hand = "touch", .rate_hz = 1000, .seconds = 10, .touch = UINT32_MAX, .cpu = -1};
    program_name = "palpd";
    args_parse(argc, argv, options, help, set_option, &s);
    if (s.blob == NULL) die(EXIT_USAGE, "no blob named (--help shows the usage)");
    if (s.bus == NULL) die(EXIT_USAGE, "no bus: add --bus INTERFACE or --bus loop");
    if (s.device == NULL) die(EXIT_USAGE, "no device: add --device NAME|FILE");
    if (s.no_wait && strcmp(s.bus, "loop") != 0)
        die(EXIT_USAGE, "--no-wait goes with --bus loop only");
    device_file file = device_load(s.device);
    palp_blob blob = load_blob(s.blob);
    if (s.touch != UINT32_MAX &&
        (s.touch >= blob.meta->nodes || palp_node_is_fixed(&blob, s.touch) ||
         palp_node_slot(&blob, s.touch) >= blob.level[blob.meta->constraint_level].nodes)) {
        die(EXIT_USAGE,
            "--touch: node %" PRIu32 " is not a free node of the blob's constraint level", s.touch);
    }
    if (palp_blob_has(&blob, PALP_META_SCALAR))
        die(EXIT_WORK, "%s: a scalar problem: there is nothing to touch", s.blob);
    bus b = bus_open(&s, &file);
    session ses = {.spec = &s, .bus = &b, .device = &file.device};
    output log = {0}, page = {0}, view = {0};
    if (s.log != NULL) log = open_output(s.log);
    if (s.report != NULL) page = open_output(s.report);
    if (s.view != NULL) view = open_output(s.view);
    ses.log = log.file;

    realtime_setup(s.cpu, s.priority, s.strict);
    touch_frame touch = place_body(&blob, &file.device, s.touch);
    palp_servo_config config = {.device = file.device,
                                .placement = touch.placement,
                                .rate_hz = (float)s.rate_hz,
                                .limits = PALP_CONTACT_DEFAULTS,
                                .tool = palp_tool_sphere(touch.tool_radius_m),
                                .cost = {.margin = TICK_SHARE},
                                .port = {.now_ns = monotonic_ns}};
    config.tool.friction = (float)s.friction;
    config.limits.friction = s.friction > 0;
    config.cost.ns_per_operation = calibrate(&blob, config.limits, &config.tool, touch.node);
    ses.servo = open_servo(&blob, &config);
    ses.capacity =
        s.seconds > 0 ? (size_t)fmin(s.seconds * s.rate_hz + 1, MAX_RECORDED) : MAX_RECORDED;
    ses.peak.load = allocate(config.limits.max_active, sizeof *ses.peak.load);
    ses.record = (run_record){.tick = allocate(ses.capacity, sizeof *ses.record.tick),
                              .rate_hz = s.rate_hz,
                              .late_us = s.no_wait ? NULL : allocate(ses.capacity, sizeof(float)),
                              .blob_name = s.blob,
                              .device_name = file.name,
                              .bus_name = s.bus,
                              .blob = &blob,
                              .tool_radius_m = touch.tool_radius_m};
    printf("%s: %" PRIu32 " nodes, tool radius %.4g m at node %" PRIu32
           ", scale %.4g, %.3g ns per operation\n",
           s.blob, blob.meta->nodes, (double)touch.tool_radius_m, touch.node,
           (double)touch.placement.scale, (double)config.cost.ns_per_operation);
    fflush(stdout);
    signal(SIGINT, on_interrupt);
    signal(SIGTERM, on_interrupt);
    signal(SIGHUP, on_interrupt);
    signal(SIGQUIT, on_interrupt);
    signal(SIGPIPE, SIG_IGN);
    run(&ses);
    stop_drives(&b, &file.device);
    if (ses.record.count == 0) die(EXIT_WORK, "interrupted before the first tick");
    unroll(&ses);

    run_record *r = &ses.record;
    r->counters = *palp_servo_counters(ses.servo);
    r->frames_sent = b.sent;
    r->frames_lost = b.lost;
    r->frames_dropped = b.health.dropped;
    r->displacement_m = peak_displacement(&blob, &ses.peak);
    memcpy(r->tool_m, &ses.peak.tool_m, sizeof r->tool_m);
    report_text(stdout, r);
    if (s.log != NULL) commit_output(&log);
    if (s.report != NULL) {
        report_html(page.file, r);
        commit_output(&page);
    }
    if (s.view != NULL) {
        view_draw(view.file, &blob, r->displacement_m, r->tool_m, r->tool_radius_m, 960, 560);
        commit_output(&view);
    }
    const palp_report *last = &r->tick[r->count - 1];
    if (b.health.failed)
        warn("the bus failed: check the interface (ip -details link show %s)", s.bus);
    if (last->state != PALP_STATE_RUN) {
        char faults[128];
        report_faults(last->faults, faults, sizeof faults);
        warn("the run ended in state %s%s%s", report_state(last->state),
             last->faults != 0 ? ": " : "", faults);
    }
    return last->state == PALP_STATE_RUN && last->faults == 0 ? EXIT_SUCCESS : EXIT_WORK;
}
