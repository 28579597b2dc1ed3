/* SPDX-License-Identifier: MIT */
/* The controller daemon: opens a blob, a device and a bus, starts the real-time loop, and looks
 * after what it publishes: log, report, telemetry. */
#include "core/base/crc32c.h"
#include "core/palp.h"
#include "port/linux/loop.h"
#include "port/linux/realtime.h"
#include "port/host/placement.h"
#include "port/host/toolfile.h"
#include "sim/bus.h"
#include "port/host/report.h"
#include "port/host/trouble.h"
#include "port/host/view.h"
#include "port/linux/telemetry.h"
#include "port/host/args.h"
#include "port/host/blobfile.h"
#include "port/host/calibrate.h"
#include "port/host/util.h"
#include <inttypes.h>
#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static const char help[] =
    "usage: palpd BLOB --bus can0|vcan0|loop --device NAME|FILE [OPTIONS]\n"
    "\n"
    "Feels a body through a haptic device: reads the drives' frames, solves the contact, sends "
    "torques.\n"
    "\n"
    "  --bus NAME          a SocketCAN interface, or 'loop': device and hand simulated in this "
    "process\n"
    "  --device NAME|FILE  a file, or arm3, desk3, pantograph, delta3, arm3-cia402, arm3-moteus,\n"
    "                      arm3-mit, arm3-mit-fd, arm3-palp, arm3-palp-fd, arm6-palp-fd (a wrist "
    "of\n"
    "                      encoders) or arm7-palp-fd (motors in wrist and gripper)\n"
    "  --rate HZ           default 1000\n"
    "  --seconds S         default 10; 0 runs until interrupted\n"
    "  --touch NODE        the node to bring under the tool (default: a high flat place)\n"
    "  --place X Y Z       the point of the body (m) whose nearest free node to bring there\n"
    "  --tool FILE         what the hand holds, made of a mesh by palp tool (default: a ball)\n"
    "  --tool-radius M     of the ball (default: the device's, at least half an edge)\n"
    "  --friction MU[,S]   Coulomb friction of the tool, 0 to 10 (default 0), and S, not above "
    "it,\n"
    "                      while it slides\n"
    "  --resume            leave DAMPING without an operator when all is well again\n"
    "  --hold              no force until the operator's first SIGUSR1\n"
    "  --home              the mechanism stands at its home pose: drives that do not know their\n"
    "                      zero (homing pose) are homed without the operator's SIGUSR1\n"
    "  --log FILE          everything that enters and leaves each tick, in candump format\n"
    "  --report FILE.html  a page with force, latency and energy\n"
    "  --view FILE.svg     the body at the largest force\n"
    "  --dds               publish pose, joints and force over DDS, 100 times a second\n"
    "\n"
    "  --target NAME|FILE  the machine's speed by a table of palp calibrate, instead of measuring\n"
    "                      it at the start: the same levels each time\n"
    "  --cpu N             run on this processor\n"
    "  --priority P        SCHED_FIFO priority\n"
    "  --strict-rt         refuse to run without real-time guarantees\n"
    "\n"
    "with --bus loop:\n"
    "  --hand SCRIPT       'touch' (default) or a file of lines t x y z [rx ry rz [gripper]]\n"
    "  --no-wait           do not wait for the clock between ticks\n"
    "  --fault LIST        KIND[@T[+D]][=V],...: loss duplicate reorder corrupt delay stuck jump "
    "glitch\n"
    "                      nan drive refuse ignore mute busoff enobufs down overrun, at T s for D "
    "s "
    "(0.01), V as in "
    "sim/README.md\n"
    "  --seed N            of what is random in them\n"
    "\n"
    "  --lockstep          take turns with the device and do not look at the clock: for "
    "comparisons\n"
    "\n"
    "SIGUSR1 is the operator's reset, and says in HOMING that the mechanism stands at its home "
    "pose;\nSIGUSR2 is the stop. Exit 0 only when the run reached its "
    "working "
    "state and\nno fault is latched.\n";

static const option options[] = {
    {"--bus", 1},       {"--device", 1},   {"--rate", 1},     {"--seconds", 1},
    {"--hand", 1},      {"--touch", 1},    {"--friction", 1}, {"--no-wait", 0},
    {"--cpu", 1},       {"--priority", 1}, {"--log", 1},      {"--report", 1},
    {"--strict-rt", 0}, {"--view", 1},     {"--dds", 0},      {"--resume", 0},
    {"--hold", 0},      {"--home", 0},     {"--fault", 1},    {"--seed", 1},
    {"--lockstep", 0},  {"--target", 1},   {"--tool", 1},     {"--tool-radius", 1},
    {"--place", 3},     {NULL, 0}};

#define MAX_RECORDED 2000000u
#define FAR_SCALE 10.0  /* of a body in the workspace, from which units are doubted */
#define MOST_STIFF 5.0  /* times the coupling: then the body is hardly felt */
#define TICK_SHARE 0.8f /* of the period; the rest is for the bus and for waking up */
#define RING_SLOTS 2048u
#define POLL_NS 2000000 /* between looks at the ring */
#define DDS_HZ 100.0
#define LOCKSTEP_NS 0.01f /* cost of an operation when no clock is looked at */

typedef struct {
    const char *blob, *bus, *device, *hand, *log, *report, *view, *fault, *target, *tool;
    double tool_radius_m, place_m[3];
    bool placed;
    double rate_hz, seconds, friction, sliding;
    uint32_t touch, seed;
    realtime_spec realtime;
    bool no_wait, resume, hold, home, lockstep, dds;
} daemon_spec;

static volatile sig_atomic_t interrupted;
static servo_loop *running; /* for signals: the operator's buttons */

static void on_interrupt(int number) {
    (void)number;
    interrupted = 1;
}

static void on_operator(int number) {
    uint32_t event = number == SIGUSR1 ? PALP_EVENT_RESET | PALP_EVENT_HOME : PALP_EVENT_ESTOP;
    if (running != NULL) atomic_fetch_or(&running->operator_events, event);
}

/* MU or MU,SLIDING */
static void set_friction(daemon_spec *s, const argument *a) {
    char rest;
    const int n = sscanf(a->value[0], "%lf,%lf%c", &s->friction, &s->sliding, &rest);
    const bool both = strchr(a->value[0], ',') != NULL;
    if (n != (both ? 2 : 1))
        die(EXIT_USAGE, "%s: need a number, or two with a comma between, not '%s'", a->where,
            a->value[0]);
    if (!(s->friction >= 0 && s->friction <= 10))
        die(EXIT_USAGE, "%s: %s is out of range: need 0 to 10", a->where, a->value[0]);
    if (both && !(s->sliding > 0 && s->sliding <= s->friction))
        die(EXIT_USAGE, "%s: sliding friction %g: need more than 0 and at most the static %g",
            a->where, s->sliding, s->friction);
}

static void set_option(void *context, const argument *a) {
    daemon_spec *s = context;
    const char *o = a->option;
    const struct {
        const char *name;
        const char **value;
    } text[] = {{"--bus", &s->bus},     {"--device", &s->device}, {"--hand", &s->hand},
                {"--log", &s->log},     {"--report", &s->report}, {"--view", &s->view},
                {"--fault", &s->fault}, {"--target", &s->target}, {"--tool", &s->tool}};
    const struct {
        const char *name;
        bool *value;
    } flag[] = {{"--no-wait", &s->no_wait}, {"--strict-rt", &s->realtime.strict},
                {"--resume", &s->resume},   {"--hold", &s->hold},
                {"--home", &s->home},       {"--lockstep", &s->lockstep},
                {"--dds", &s->dds}};
    if (o == NULL) {
        if (s->blob != NULL) die(EXIT_USAGE, "one blob, not also '%s'", a->value[0]);
        s->blob = a->value[0];
        return;
    }
    for (size_t i = 0; i < sizeof text / sizeof text[0]; i++)
        if (strcmp(text[i].name, o) == 0) *text[i].value = a->value[0];
    for (size_t i = 0; i < sizeof flag / sizeof flag[0]; i++)
        if (strcmp(flag[i].name, o) == 0) *flag[i].value = true;
    if (strcmp(o, "--rate") == 0) s->rate_hz = arg_between(a, 49.9, 20000.1);
    if (strcmp(o, "--seconds") == 0) s->seconds = arg_between(a, -1e-9, 1e7);
    if (strcmp(o, "--touch") == 0) s->touch = arg_u32(a, 0, 0, UINT32_MAX - 1);
    if (strcmp(o, "--tool-radius") == 0) s->tool_radius_m = arg_between(a, 1e-6, 10);
    if (strcmp(o, "--place") == 0) {
        for (int k = 0; k < 3; k++) s->place_m[k] = arg_double(a, k);
        s->placed = true;
    }
    if (strcmp(o, "--seed") == 0) s->seed = arg_u32(a, 0, 0, UINT32_MAX);
    if (strcmp(o, "--cpu") == 0) s->realtime.cpu = (int)arg_u32(a, 0, 0, 1023);
    if (strcmp(o, "--priority") == 0) s->realtime.priority = (int)arg_u32(a, 0, 1, 98);
    if (strcmp(o, "--friction") != 0) return;
    set_friction(s, a);
}

static void check_options(const daemon_spec *s) {
    if (s->blob == NULL) die(EXIT_USAGE, "no blob named (--help shows the usage)");
    if (s->bus == NULL) die(EXIT_USAGE, "no bus: add --bus INTERFACE or --bus loop");
    if (s->device == NULL) die(EXIT_USAGE, "no device: add --device NAME|FILE");
    if (s->tool != NULL && s->tool_radius_m > 0)
        die(EXIT_USAGE, "--tool and --tool-radius: the tool is a file or a ball, not both");
    if (s->placed && s->touch != UINT32_MAX)
        die(EXIT_USAGE, "--place and --touch: name the place by one of them");
    bool loop = strcmp(s->bus, "loop") == 0;
    if (s->no_wait && !loop) die(EXIT_USAGE, "--no-wait goes with --bus loop only");
    if (s->fault != NULL && !loop)
        die(EXIT_USAGE, "--fault goes with --bus loop; on another bus give it to palp-sim");
    if (s->lockstep && s->seconds <= 0) die(EXIT_USAGE, "--lockstep needs an end: add --seconds S");
}

/* The contacts at the largest force so far, kept for the picture. */
typedef struct {
    palp_load load[RECORD_LOADS];
    uint32_t count;
    float force_N;
    palp_vec3 tool_m;
} peak;

static void keep_peak(peak *p, const tick_record *t) {
    float force = palp_norm(t->report.force_N);
    if (force <= p->force_N) return;
    p->force_N = force;
    p->tool_m = t->report.tool.t;
    p->count = t->load_count;
    memcpy(p->load, t->load, t->load_count * sizeof t->load[0]);
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
    size_t bytes = palp_servo_memsize(blob, config->finest);
    void *memory = memset(allocate_aligned(bytes, 1), 1, bytes); /* touched, as the ring */
    palp_servo *servo;
    float bound_ns = 0;
    palp_status status = palp_servo_open(&servo, blob, config, memory, bytes, &bound_ns);
    if (status == PALP_ERR_BUDGET) {
        float have = config->cost.margin * 1e6f / config->device.drives.rate_hz;
        die(EXIT_WORK,
            "the coarsest answer may take %.0f us, %.0f us more than the %.0f us that %.0f Hz "
            "leave: lower --rate",
            (double)bound_ns * 1e-3, (double)bound_ns * 1e-3 - (double)have, (double)have,
            (double)config->device.drives.rate_hz);
    }
    if (status != PALP_OK) die(EXIT_WORK, "cannot open the servo: %s", palp_status_text(status));
    return servo;
}

/* Everything that is not real time: it follows the loop through its ring. */
typedef struct {
    const daemon_spec *spec;
    servo_loop *loop;
    const palp_device *device;
    FILE *log;
    telemetry *telemetry;
    peak peak;
    run_record record;
    size_t capacity;
    uint64_t digest, taken, last_tick;
    palp_counters counters;
    palp_state last_state;
    bool state_shown;
    palp_drive_trouble trouble[PALP_AXES]; /* of the last tick */
} consumer;

/* Which drive it was, and what of it. */
static void announce_trouble(const consumer *f, const palp_drive_trouble *trouble) {
    for (uint32_t i = 0; i < palp_axes(&f->device->kinematics); i++) {
        char text[320];
        trouble_text(&trouble[i], f->device->drives.protocol, text, sizeof text);
        if (text[0] != '\0') warn("%s", text);
    }
}

/* Says at once when the state changes, so that nobody waits for a device that is not there. */
static void announce(consumer *f, const tick_record *t) {
    const palp_report *r = &t->report;
    if (f->state_shown && r->state == f->last_state) return;
    f->state_shown = true;
    f->last_state = r->state;
    char faults[128];
    report_faults(r->faults, faults, sizeof faults);
    bool quiet = f->loop->memory != NULL || f->spec->lockstep;
    if (r->state == PALP_STATE_HOMING && !f->spec->home) {
        warn("HOMING: hold the mechanism at its home pose ('joint-home' of the device), then send "
             "SIGUSR1");
        return;
    }
    if (quiet && !palp_state_is_stopped(r->state)) return;
    if (r->state == PALP_STATE_INIT) {
        warn("waiting for heartbeats of nodes %d %d %d on %s", f->device->node_id[0],
             f->device->node_id[1], f->device->node_id[2], f->spec->bus);
    } else {
        warn("%s%s%s", report_state(r->state), r->faults != 0 ? ": " : "", faults);
    }
    if ((r->faults & (PALP_FAULT_CONFIG | PALP_FAULT_ENABLE | PALP_FAULT_DRIVE)) != 0)
        announce_trouble(f, t->trouble);
}

static void consume_tick(consumer *f, const tick_record *t) {
    const palp_report *r = &t->report;
    uint64_t lost = f->taken > 0 ? r->tick - f->last_tick - 1 : r->tick;
    if (f->log != NULL) {
        if (lost > 0) record_write_gap(f->log, t->time_s, lost);
        record_write_tick(f->log, f->loop->memory != NULL ? "loop" : f->spec->bus, t);
    }
    f->last_tick = r->tick;
    f->digest = t->digest;
    memcpy(f->trouble, t->trouble, sizeof f->trouble);
    f->counters = t->counters;
    keep_peak(&f->peak, t);
    size_t at = (size_t)(f->taken++ % f->capacity); /* a longer run keeps its last ticks */
    f->record.tick[at] = *r;
    if (f->record.late_us != NULL) f->record.late_us[at] = t->late_us;
    if (f->record.count < f->capacity) f->record.count++;
    uint64_t every = (uint64_t)(f->spec->rate_hz / DDS_HZ + 0.5);
    if (f->telemetry != NULL && r->tick % (every > 0 ? every : 1) == 0)
        telemetry_publish(f->telemetry, t);
    announce(f, t);
}

static void consume(consumer *f) {
    const struct timespec moment = {.tv_nsec = POLL_NS};
    for (;;) {
        bool last = f->loop->finished;
        for (tick_record *t; (t = ring_peek(&f->loop->ring)) != NULL;) {
            consume_tick(f, t);
            ring_release(&f->loop->ring);
        }
        if (last) return;
        if (interrupted != 0) f->loop->stop = true;
        nanosleep(&moment, NULL);
    }
}

/* Both rings in the order of time. */
static void unroll(consumer *f) {
    run_record *r = &f->record;
    size_t start = (size_t)(f->taken % f->capacity);
    if (f->taken <= f->capacity || start == 0) return;
    palp_report *tick = allocate(r->count, sizeof *tick);
    float *late_us = r->late_us != NULL ? allocate(r->count, sizeof *late_us) : NULL;
    for (size_t i = 0; i < r->count; i++) {
        tick[i] = r->tick[(start + i) % r->count];
        if (late_us != NULL) late_us[i] = r->late_us[(start + i) % r->count];
    }
    free(r->tick);
    free(r->late_us);
    r->tick = tick;
    r->late_us = late_us;
}

/* The simulated device of --bus loop. */
static sim_bus simulated;

static uint32_t pass(void *bus, double dt_s, palp_can_frame *frames, uint32_t room,
                     uint32_t *events) {
    return sim_bus_pass(bus, dt_s, frames, room, events);
}
static bool send(void *bus, const palp_can_frame *frame) { return sim_bus_send(bus, frame); }
static uint32_t overrun(void *bus, double dt_s) { return sim_bus_overrun(bus, dt_s); }
static const memory_bus in_this_process = {&simulated, pass, send, overrun};

static void open_bus(servo_loop *l, const daemon_spec *s, const device_file *file) {
    const palp_device *d = &file->device;
    if (strcmp(s->bus, "loop") == 0) {
        fault_list f =
            s->fault != NULL ? faults_read(s->fault, s->seed) : (fault_list){.seed = s->seed};
        sim_bus_init(&simulated, file, hand_load(s->hand), f);
        l->memory = &in_this_process;
        return;
    }
    palp_can_filter filter[PALP_AXES * PALP_DRIVE_FILTERS + 1];
    uint32_t n = 0;
    for (uint32_t i = 0; i < palp_axes(&d->kinematics); i++)
        n += palp_drive_filters(&d->drives, d->node_id[i], filter + n);
    if (s->lockstep) filter[n++] = (palp_can_filter){.id = LOCKSTEP_ID, .mask = 0x7ff};
    l->port = can_open(s->bus, d->drives.fd, filter, n);
}

static void check_node(const daemon_spec *s, const palp_blob *blob) {
    if (palp_blob_has(blob, PALP_META_SCALAR))
        die(EXIT_WORK, "%s: a scalar problem: there is nothing to touch", s->blob);
    if (blob->meta->modes == 0)
        die(EXIT_WORK,
            "%s: has no regular part, which contact needs (baked by an older palp, with --modes 0 "
            "or "
            "--reciprocity raw): bake it again",
            s->blob);
    if (s->touch != UINT32_MAX &&
        (s->touch >= blob->meta->nodes || palp_node_is_fixed(blob, s->touch)))
        die(EXIT_USAGE,
            "--touch: node %" PRIu32 " is not a free one of the blob's nodes 0 to %" PRIu32,
            s->touch, blob->meta->nodes - 1);
}

static void log_session(FILE *log, const daemon_spec *s, const palp_servo_config *config,
                        const tool_file *tool) {
    size_t bytes;
    char *data = read_file(s->blob, &bytes);
    session_record session = {.config = *config,
                              .blob_bytes = (uint32_t)bytes,
                              .blob_crc = palp_crc32c(0, data, bytes),
                              .tool_bytes = tool->bytes,
                              .tool_crc = tool->crc,
                              .device = device_text(s->device)};
    snprintf(session.bus, sizeof session.bus, "%s", s->bus);
    record_write_session(log, &session);
    free(session.device);
    free(data);
}

static void handle_signals(void) {
    static const int ends[] = {SIGINT, SIGTERM, SIGHUP, SIGQUIT};
    struct sigaction end = {.sa_handler = on_interrupt}, button = {.sa_handler = on_operator};
    for (size_t i = 0; i < sizeof ends / sizeof ends[0]; i++) sigaction(ends[i], &end, NULL);
    sigaction(SIGUSR1, &button, NULL);
    sigaction(SIGUSR2, &button, NULL);
    signal(SIGPIPE, SIG_IGN);
}

/* The loop's thread takes no signals: they would wake it early. */
static void run(consumer *f) {
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    pthread_t thread = realtime_start(&f->spec->realtime, "palp-loop", loop_run, f->loop);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    consume(f);
    pthread_join(thread, NULL);
}

/* A hand that never came near the body. */
static void warn_of_distance(const consumer *f) {
    const run_record *r = &f->record;
    size_t touching = 0;
    for (size_t i = 0; i < r->count; i++) touching += r->tick[i].active > 0;
    if (touching == 0 && f->counters.outside > 0)
        warn("nothing was touched, and the tool was beyond the workspace (%g m about the home "
             "pose) in "
             "%" PRIu64 " ticks",
             (double)f->device->workspace_radius_m, f->counters.outside);
}

static int conclude(const daemon_spec *s, const consumer *f) {
    const run_record *r = &f->record;
    const palp_report *last = &r->tick[r->count - 1];
    if (s->lockstep)
        printf("lock step: %" PRIu64 " ticks, %" PRIu64
               " frames lost or out of turn, digest %016" PRIx64 "\n",
               f->loop->done, f->loop->lockstep_lost, f->digest);
    warn_of_distance(f);
    if (last->state == PALP_STATE_RUN && last->faults == 0) return EXIT_SUCCESS;
    if ((last->faults & PALP_FAULT_BUS) != 0 && f->loop->memory == NULL)
        warn("the bus failed: check the interface (ip -details link show %s)", s->bus);
    if (last->state == PALP_STATE_INIT) announce_trouble(f, f->trouble);
    char faults[128];
    report_faults(last->faults, faults, sizeof faults);
    warn("the run ended in state %s%s%s", report_state(last->state), last->faults != 0 ? ": " : "",
         faults);
    return EXIT_WORK;
}

typedef struct {
    machine *speed;
    const palp_blob *blob;
    const palp_tool *tool;
    uint32_t node;
} calibration;

static void *run_calibration(void *context) {
    const calibration *c = context;
    calibrate(c->speed, c->blob, c->tool, c->node, false);
    return NULL;
}

/* How fast the loop will run: as stated, or measured on its processor and with its priority. */
static void find_speed(machine *speed, const daemon_spec *s, const palp_blob *blob,
                       const palp_tool *tool, uint32_t node) {
    if (s->target != NULL) {
        machine_find(speed, s->target);
        return;
    }
    calibration c = {speed, blob, tool, node};
    pthread_join(realtime_start(&s->realtime, "palp-measure", run_calibration, &c), NULL);
}

/* What is about to be felt, and warnings where it will hardly be the body. */
static void introduce(const daemon_spec *s, const palp_blob *blob, const touch_frame *touch,
                      const palp_servo_config *config) {
    const double scale = (double)touch->placement.scale;
    const double coupling = (double)palp_device_coupling(&config->device);
    const double softest = scale * scale * (double)blob->meta->stiffness_min_N_per_m;
    const double stiffest = scale * scale * (double)blob->meta->stiffness_max_N_per_m;
    char tool[128];
    tool_text(&config->tool, tool, sizeof tool);
    printf("%s: %" PRIu32 " nodes of %.4g to %.4g N/m at the hand, %s at node %" PRIu32
           ", scale %.4g, coupling %.4g N/m, %.3g ns per instruction\n",
           s->blob, blob->meta->nodes, softest, stiffest, tool, touch->node, scale, coupling,
           (double)config->cost.ns_per_instruction);
    if (scale > FAR_SCALE || scale < 1 / FAR_SCALE)
        warn("the body comes into the workspace %.3g times %s than it is: is it in metres?",
             scale > 1 ? scale : 1 / scale, scale > 1 ? "smaller" : "larger");
    if (softest > MOST_STIFF * coupling)
        warn("the body is stiffer at the hand (%.3g N/m and more) than the coupling (%.3g N/m), "
             "which is all that will be felt: bake it softer, or nearer to the workspace's size",
             softest, coupling);
}

typedef struct {
    output log, page, view; /* without a file: not asked for */
} daemon_output;

/* What the loop is told, and the ring through which its ticks come. */
static void set_loop(servo_loop *loop, const daemon_spec *s) {
    loop->rate_hz = s->rate_hz;
    loop->ticks = (uint64_t)(s->seconds * s->rate_hz + 0.5);
    loop->lockstep = s->lockstep;
    loop->hold = s->hold;
    loop->home = s->home;
    loop->paced = !s->no_wait && !s->lockstep;
    loop->ring.slots = RING_SLOTS;
    loop->ring.bytes = sizeof(tick_record);
    loop->ring.memory = allocate(RING_SLOTS, sizeof(tick_record));
    /* Every page is touched now, locked or not, so that the loop never faults. */
    memset(loop->ring.memory, 1, RING_SLOTS * sizeof(tick_record));
}

static palp_servo_config configure(const daemon_spec *s, const device_file *file,
                                   const touch_frame *touch, const tool_file *tool,
                                   servo_loop *loop) {
    palp_servo_config config = {.device = file->device,
                                .placement = touch->placement,
                                .finest = PALP_CONTACT_FINEST,
                                .tool = tool->tool,
                                .cost = {.target = &palp_target_counted,
                                         .ns_per_instruction = LOCKSTEP_NS,
                                         .margin = TICK_SHARE},
                                .port = {.now_ns = loop_clock, .context = loop},
                                .resume = s->resume};
    config.tool.friction = (float)s->friction;
    config.tool.sliding = (float)s->sliding;
    return config;
}

/* What the run came to, as text, log, page and picture. */
static void write_results(consumer *f, const palp_blob *blob, daemon_output *out) {
    const servo_loop *loop = f->loop;
    run_record *r = &f->record;
    r->totals = (run_totals){.counters = f->counters,
                             .frames_sent = loop->memory != NULL ? simulated.sent : loop->port.sent,
                             .frames_lost = loop->memory != NULL ? simulated.lost : loop->port.lost,
                             .frames_dropped = loop->port.dropped,
                             .unrecorded = loop->paced ? atomic_load(&loop->ring.dropped) : 0,
                             .minor_faults = loop->minor_faults};
    r->totalled = true;
    r->displacement_m = peak_displacement(blob, &f->peak);
    memcpy(r->tool_m, &f->peak.tool_m, sizeof r->tool_m);
    report_text(stdout, r);
    if (out->log.file != NULL) {
        record_write_totals(out->log.file, (double)f->last_tick / r->rate_hz, &r->totals);
        commit_output(&out->log);
    }
    if (out->page.file != NULL) {
        report_html(out->page.file, r);
        commit_output(&out->page);
    }
    if (out->view.file != NULL) {
        view_draw(out->view.file, blob, r->displacement_m, r->tool_m, r->tool_radius_m, 960, 560);
        commit_output(&out->view);
    }
}

int main(int argc, char **argv) {
    daemon_spec s = {.hand = "touch",
                     .rate_hz = 1000,
                     .seconds = 10,
                     .touch = UINT32_MAX,
                     .realtime = {.cpu = -1}};
    program_name = "palpd";
    args_parse(argc, argv, options, help, set_option, &s);
    check_options(&s);
    device_file file = device_load(s.device);
    file.device.drives.rate_hz = (float)s.rate_hz;
    char load[128];
    device_check_load(&file, load, sizeof load);
    palp_blob blob = load_blob(s.blob);
    check_node(&s, &blob);
    servo_loop *loop = allocate(1, sizeof *loop);
    open_bus(loop, &s, &file);
    daemon_output out = {.log = {0}};
    if (s.log != NULL) out.log = open_output(s.log);
    if (s.report != NULL) out.page = open_output(s.report);
    if (s.view != NULL) out.view = open_output(s.view);

    realtime_prepare(&s.realtime);
    if (s.placed) s.touch = nearest_free_node(&blob, s.place_m);
    tool_file tool = {.bytes = 0};
    if (s.tool != NULL) tool = tool_load(s.tool);
    touch_frame touch = place_body(&blob, &file.device, s.touch, s.tool != NULL ? &tool.tool : NULL,
                                   s.tool_radius_m);
    if (s.tool == NULL) tool.tool = palp_tool_sphere(touch.tool_radius_m);
    palp_servo_config config = configure(&s, &file, &touch, &tool, loop);
    machine speed;
    if (!s.lockstep) {
        find_speed(&speed, &s, &blob, &config.tool, touch.node);
        config.cost = machine_table(&speed, TICK_SHARE);
    }
    loop->servo = open_servo(&blob, &config);
    set_loop(loop, &s);

    consumer f = {.spec = &s, .loop = loop, .device = &file.device, .log = out.log.file};
    f.capacity =
        s.seconds > 0 ? (size_t)fmin(s.seconds * s.rate_hz + 1, MAX_RECORDED) : MAX_RECORDED;
    f.record = (run_record){.tick = allocate(f.capacity, sizeof *f.record.tick),
                            .rate_hz = s.rate_hz,
                            .late_us = loop->paced ? allocate(f.capacity, sizeof(float)) : NULL,
                            .blob_name = s.blob,
                            .device_name = file.name,
                            .bus_name = s.bus,
                            .bus_load = load,
                            .blob = &blob,
                            .tool_radius_m = touch.tool_radius_m};
    if (s.dds) f.telemetry = telemetry_open(&file.device);
    if (s.log != NULL) log_session(out.log.file, &s, &config, &tool);
    introduce(&s, &blob, &touch, &config);
    fflush(stdout);
    running = loop;
    handle_signals();
    run(&f);
    if (f.telemetry != NULL) telemetry_close(f.telemetry);
    if (f.record.count == 0) die(EXIT_WORK, "interrupted before the first tick");
    unroll(&f);

    write_results(&f, &blob, &out);
    return conclude(&s, &f);
}
