/* SPDX-License-Identifier: MIT */
/* The controller daemon: opens a scene, or one body and one device, and the buses, starts the real-time
 * loop, and follows it. */
#include "core/palp.h"
#include "port/host/args.h"
#include "port/host/blobfile.h"
#include "port/host/calibrate.h"
#include "port/host/openscene.h"
#include "port/host/util.h"
#include "port/host/view.h"
#include "port/linux/follow.h"
#include "port/linux/operate.h"
#include "port/linux/realtime.h"
#include "sim/bus.h"
#include <inttypes.h>
#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>

static const char help[] =
    "usage: palpd BLOB --bus can0|vcan0|loop --device NAME|FILE [OPTIONS]\n"
    "       palpd SCENE [--bus loop] [OPTIONS]\n"
    "\n"
    "Feels a body through a haptic device: reads the drives' frames, solves the contact, sends "
    "torques.\n"
    "A scene, FILE.scene, names bodies of every kind, devices with their buses, and tools "
    "(sim/README.md).\n"
    "\n"
    "  --bus NAME          a SocketCAN interface, or 'loop': device and hand simulated in this "
    "process\n"
    "  --device NAME|FILE  a file, or arm3, desk3, pantograph, delta3, arm3-cia402, arm3-moteus,\n"
    "                      arm3-mit, arm3-mit-fd, arm3-palp, arm3-palp-fd, arm6-palp-fd (a wrist "
    "of\n"
    "                      encoders) or arm7-palp-fd (motors in wrist and gripper)\n"
    "  --rate HZ           default 1000, or as the scene says\n"
    "  --seconds S         default 10, or as the scene says; 0 runs until interrupted\n"
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
    "  --control PATH      a Unix socket for the operator: state, reset, stop, hold, load FILE, "
    "record FILE, end\n"
    "  --check             open all but the buses, say what would be felt, and stop\n"
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
    {"--place", 3},     {"--control", 1},  {"--check", 0},    {NULL, 0}};

#define MAX_RECORDED 2000000u
#define FAR_SCALE 10.0  /* of a body in the workspace, from which units are doubted */
#define MOST_STIFF 5.0  /* times the coupling: then the body is hardly felt */
#define TICK_SHARE 0.8f /* of the period; before it a tenth to wake up, after it one for the bus */
#define MEASUREMENTS 4  /* of the speed, before a scene is refused */
#define RING_SLOTS 2048u
#define LOCKSTEP_NS 0.01f /* cost of an operation when no clock is looked at */

typedef struct {
    const char *control, *blob, *bus, *device, *hand, *log, *report, *view, *fault, *target, *tool;
    double tool_radius_m, place_m[3];
    bool placed;
    double rate_hz, seconds, friction, sliding;
    uint32_t touch, seed;
    realtime_spec realtime;
    bool seconds_given, simulated; /* devices in this process */
    bool no_wait, resume, hold, home, lockstep, dds, check;
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
    } text[] = {{"--bus", &s->bus},        {"--device", &s->device}, {"--hand", &s->hand},
                {"--log", &s->log},        {"--report", &s->report}, {"--view", &s->view},
                {"--fault", &s->fault},    {"--target", &s->target}, {"--tool", &s->tool},
                {"--control", &s->control}};
    const struct {
        const char *name;
        bool *value;
    } flag[] = {{"--no-wait", &s->no_wait}, {"--strict-rt", &s->realtime.strict},
                {"--resume", &s->resume},   {"--hold", &s->hold},
                {"--home", &s->home},       {"--lockstep", &s->lockstep},
                {"--dds", &s->dds},         {"--check", &s->check}};
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
    if (strcmp(o, "--seconds") == 0) {
        s->seconds = arg_between(a, -1e-9, 1e7);
        s->seconds_given = true;
    }
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
    if (s->blob == NULL) die(EXIT_USAGE, "no blob and no scene named (--help shows the usage)");
    if (s->tool != NULL && s->tool_radius_m > 0)
        die(EXIT_USAGE, "--tool and --tool-radius: the tool is a file or a ball, not both");
    if (s->placed && s->touch != UINT32_MAX)
        die(EXIT_USAGE, "--place and --touch: name the place by one of them");
    if (s->lockstep && s->seconds <= 0 && s->seconds_given)
        die(EXIT_USAGE, "--lockstep needs an end: add --seconds S");
    if (scene_is_here(s->blob)) {
        if (s->device != NULL || s->tool != NULL || s->tool_radius_m > 0 || s->placed ||
            s->touch != UINT32_MAX || s->friction > 0)
            die(EXIT_USAGE, "--device, --tool, --tool-radius, --place, --touch and --friction go "
                            "with a blob: a scene says these itself");
        return;
    }
    if (s->bus == NULL) die(EXIT_USAGE, "no bus: add --bus INTERFACE or --bus loop");
    if (s->device == NULL) die(EXIT_USAGE, "no device: add --device NAME|FILE");
}

/* One body, one device and one tool, as the options say. */
static scene_file *describe_one(const daemon_spec *s) {
    scene_file *f = scene_empty(s->blob);
    (void)scene_add_body(f, "BLOB", s->blob);
    scene_device *d = scene_add_device(f, "--device", s->device);
    scene_mount *t = scene_add_tool(f, "--tool");
    d->node = s->touch;
    if (s->touch != UINT32_MAX) d->where = SCENE_AT_NODE;
    if (s->placed) d->where = SCENE_NEAR;
    memcpy(d->place_m, s->place_m, sizeof d->place_m);
    if (s->tool != NULL) snprintf(t->path, sizeof t->path, "%s", s->tool);
    if (s->tool_radius_m > 0) t->tool = palp_tool_sphere((float)s->tool_radius_m);
    t->sized = s->tool != NULL || s->tool_radius_m > 0;
    t->tool.friction = (float)s->friction;
    t->tool.sliding = (float)s->sliding;
    f->seconds = 10;
    return f;
}

/* The scene, with what the options say of it. */
static scene_file *describe(daemon_spec *s) {
    scene_file *f = scene_is_here(s->blob) ? scene_read(s->blob) : describe_one(s);
    if (s->rate_hz > 0) f->rate_hz = s->rate_hz;
    if (s->seconds_given) f->seconds = s->seconds;
    uint32_t loops = 0;
    for (uint32_t h = 0; h < f->devices; h++) {
        scene_device *d = &f->device[h];
        const char *bus = s->bus != NULL ? s->bus : "loop";
        if (d->bus[0] == '\0' || (s->bus != NULL && strcmp(s->bus, "loop") == 0)) {
            if (strlen(bus) >= sizeof d->bus) die(EXIT_USAGE, "--bus: '%s' is no name", bus);
            snprintf(d->bus, sizeof d->bus, "%s", bus);
        }
        if (d->hand[0] == '\0') snprintf(d->hand, sizeof d->hand, "%s", s->hand);
        if (strcmp(d->bus, "loop") == 0 && loops++ > 0)
            snprintf(d->bus, sizeof d->bus, "loop%" PRIu32, h);
    }
    if (loops > 0 && loops < f->devices)
        die(EXIT_USAGE, "%s: devices on 'loop' and on other buses: all or none are simulated here",
            f->name);
    s->simulated = loops > 0;
    if (s->no_wait && !s->simulated) die(EXIT_USAGE, "--no-wait goes with --bus loop only");
    if (s->fault != NULL && !s->simulated)
        die(EXIT_USAGE, "--fault goes with --bus loop; on another bus give it to palp-sim");
    return f;
}

/* The simulated devices of --bus loop. */
static sim_bus simulated[PALP_SCENE_HANDS];
static device_file simulated_file[PALP_SCENE_HANDS]; /* scenes come and go */

static uint32_t pass(void *bus, double dt_s, palp_can_frame *frames, uint32_t room,
                     uint32_t *events) {
    return sim_bus_pass(bus, dt_s, frames, room, events);
}
static bool send(void *bus, const palp_can_frame *frame) { return sim_bus_send(bus, frame); }
static uint32_t overrun(void *bus, double dt_s) { return sim_bus_overrun(bus, dt_s); }

static void open_line(servo_loop *l, const daemon_spec *s, const scene_setup *setup,
                      uint32_t number) {
    const scene_device *d = &setup->file->device[number];
    const palp_device *device = &setup->device[number].device;
    if (s->simulated) {
        const uint64_t seed = s->seed + number;
        fault_list f = s->fault != NULL ? faults_read(s->fault, seed) : (fault_list){.seed = seed};
        simulated_file[number] = setup->device[number];
        sim_bus_init(&simulated[number], &simulated_file[number], hand_load(d->hand), f);
        sim_peer_init(&simulated[number].peer, setup->file, number);
        l->line[number].memory = (memory_bus){&simulated[number], pass, send, overrun};
        return;
    }
    palp_can_filter filter[LOOP_FILTERS];
    l->line[number].port = can_open(copy_string(d->bus), device->drives.fd, filter,
                                    loop_filters(setup, number, s->lockstep, filter));
}

/* Two devices on one bus must not answer to the same node. */
static void check_nodes(const scene_setup *s) {
    for (uint32_t a = 0; a < s->config.hands; a++) {
        for (uint32_t b = 0; b < a; b++) {
            if (strcmp(s->file->device[a].bus, s->file->device[b].bus) != 0) continue;
            const palp_device *p = &s->device[a].device, *q = &s->device[b].device;
            for (uint32_t i = 0; i < palp_axes(&p->kinematics); i++)
                for (uint32_t k = 0; k < palp_axes(&q->kinematics); k++)
                    if (p->node_id[i] == q->node_id[k])
                        die(EXIT_USAGE,
                            "%s: devices %" PRIu32 " and %" PRIu32 " both have node %d on %s: "
                            "give one of them a bus of its own, or other nodes",
                            s->file->name, b, a, p->node_id[i], s->file->device[a].bus);
        }
    }
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
static void run(const daemon_spec *s, follower *f) {
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    pthread_t thread = realtime_start(&s->realtime, "palp-loop", loop_run, f->loop);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    follow_run(f, &interrupted);
    pthread_join(thread, NULL);
}

/* Hands that never came near anything. */
static void warn_of_distance(const follower *f) {
    const run_record *r = &f->record;
    for (size_t i = 0; i < r->count; i++) {
        if (r->hand[0].tick[i].active > 0) return;
    }
    for (uint32_t h = 0; h < r->hands; h++) {
        if (f->counters[h].outside > 0)
            warn("nothing was touched, and the tool was beyond the workspace (%g m about the home "
                 "pose) in "
                 "%" PRIu64 " ticks",
                 (double)f->loop->setup->device[h].device.workspace_radius_m,
                 f->counters[h].outside);
    }
}

/* Joints that nobody has moved, though the scene says that somebody does. */
static void warn_of_silence(const run_record *r) {
    for (uint32_t j = 0; j < r->joints; j++) {
        if (r->joint[j].at.taken == 0)
            warn("joint %s: no set-point came in frames 0x%" PRIx32 " on %s: it stayed at %.4g",
                 r->joint[j].name, r->joint[j].id, r->joint[j].bus, (double)r->joint[j].at.value);
    }
}

static int conclude(const daemon_spec *s, const follower *f) {
    const run_record *r = &f->record;
    int code = EXIT_SUCCESS;
    if (s->lockstep)
        printf("lock step: %" PRIu64 " ticks, %" PRIu64
               " frames lost or out of turn, digest %016" PRIx64 "\n",
               f->loop->done, f->loop->lockstep_lost, f->digest);
    warn_of_distance(f);
    warn_of_silence(r);
    for (uint32_t h = 0; h < r->hands; h++) {
        const palp_report *last = &r->hand[h].tick[r->count - 1];
        if (last->state == PALP_STATE_RUN && last->faults == 0) continue;
        code = EXIT_WORK;
        if ((last->faults & PALP_FAULT_BUS) != 0 && !s->simulated)
            warn("the bus failed: check the interface (ip -details link show %s)",
                 r->hand[h].bus_name);
        if (last->state == PALP_STATE_INIT) follow_trouble(f, h, f->trouble[h]);
        char faults[128], which[32] = "";
        report_faults(last->faults, faults, sizeof faults);
        if (r->hands > 1) snprintf(which, sizeof which, " of device %" PRIu32, h);
        warn("the run%s ended in state %s%s%s", which, report_state(last->state),
             last->faults != 0 ? ": " : "", faults);
    }
    return code;
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

/* How fast the loop will run: as stated, or measured on its processor and with its priority; false
 * if there was nothing to measure. */
static bool find_speed(machine *speed, const daemon_spec *s, const scene_setup *setup) {
    const palp_blob *blob = scene_blob(setup);
    if (s->target != NULL || blob == NULL) { /* nothing to measure with: as shipped */
        machine_choose(speed, s->target, 0);
        return false;
    }
    calibration c = {speed, blob, &setup->tool[0].tool, setup->touch[0].node};
    if (c.node >= blob->meta->nodes) c.node = 0;
    pthread_join(realtime_start(&s->realtime, "palp-measure", run_calibration, &c), NULL);
    return true;
}

/* Opens the scene, at the speed found; measures that again before it refuses, since another task
 * may have been in the way. */
static palp_scene *open_in_time(machine *speed, const daemon_spec *s, scene_setup *setup) {
    char text[256];
    for (int measured = 1;; measured++) {
        const bool again = find_speed(speed, s, setup) && measured < MEASUREMENTS;
        setup->config.cost = machine_table(speed, TICK_SHARE);
        palp_status status;
        palp_scene *scene = scene_try_open(setup, &status, text, sizeof text);
        if (scene != NULL) return scene;
        if (!again || status != PALP_ERR_BUDGET) die(EXIT_WORK, "%s", text);
    }
}

/* What is about to be felt, and warnings where it will hardly be the body. */
static void introduce_one(const scene_setup *s) {
    const palp_blob *blob = &s->part[0].blob;
    const double scale = (double)s->touch[0].placement.scale;
    const double coupling = (double)palp_device_coupling(&s->device[0].device);
    const double softest = scale * scale * (double)blob->meta->stiffness_min_N_per_m;
    const double stiffest = scale * scale * (double)blob->meta->stiffness_max_N_per_m;
    char tool[128];
    tool_text(&s->tool[0].tool, tool, sizeof tool);
    printf("%s: %" PRIu32 " nodes of %.4g to %.4g N/m at the hand, %s at node %" PRIu32
           ", scale %.4g, coupling %.4g N/m, %.3g ns per instruction\n",
           s->file->body[0].path, blob->meta->nodes, softest, stiffest, tool, s->touch[0].node,
           scale, coupling, (double)s->config.cost.ns_per_instruction);
    if (scale > FAR_SCALE || scale < 1 / FAR_SCALE)
        warn("the body comes into the workspace %.3g times %s than it is: is it in metres?",
             scale > 1 ? scale : 1 / scale, scale > 1 ? "smaller" : "larger");
    if (softest > MOST_STIFF * coupling)
        warn("the body is stiffer at the hand (%.3g N/m and more) than the coupling (%.3g N/m), "
             "which is all that will be felt: bake it softer, or nearer to the workspace's size",
             softest, coupling);
}

static void introduce(const scene_setup *s) {
    const palp_scene_config *c = &s->config;
    if (c->bodies == 1 && c->hands == 1 && s->part[0].kind == PALP_BODY_ELASTIC) {
        introduce_one(s);
        return;
    }
    for (uint32_t b = 0; b < c->bodies; b++) {
        const scene_part *p = &s->part[b];
        const char *name = s->file->body[b].name;
        if (p->kind == PALP_BODY_ELASTIC)
            printf("%s: elastic, %" PRIu32 " nodes\n", name, p->blob.meta->nodes);
        else if (p->kind == PALP_BODY_ZONES)
            printf("%s: %" PRIu32 " zones, %" PRIu32 " joints, %" PRIu32 " nodes\n", name,
                   p->zones.meta->zones, p->zones.meta->joints, p->zones.nodes);
        else
            printf("%s: dynamic, %" PRIu32 " nodes on %" PRIu32 " levels\n", name,
                   p->tets.meta->nodes, p->tets.meta->levels);
    }
    for (uint32_t h = 0; h < c->hands; h++) {
        printf("device %" PRIu32 ": %s on %s, scale %.4g, coupling %.4g N/m\n", h,
               s->device[h].name, s->file->device[h].bus, (double)s->touch[h].placement.scale,
               (double)palp_device_coupling(&s->device[h].device));
        for (uint32_t t = 0; t < c->tools; t++) {
            char tool[128];
            tool_text(&s->tool[t].tool, tool, sizeof tool);
            if (s->tool[t].hand == h) printf("  %s\n", tool);
        }
    }
}

typedef struct {
    output log, page, view; /* without a file: not asked for */
} daemon_output;

/* What the loop is told, and the ring through which its ticks come. */
static void set_loop(servo_loop *loop, const daemon_spec *s, const scene_file *f) {
    loop->rate_hz = f->rate_hz;
    loop->ticks = (uint64_t)(f->seconds * f->rate_hz + 0.5);
    loop->simulated = s->simulated;
    loop->lockstep = s->lockstep;
    loop->hold = s->hold;
    loop->home = s->home;
    loop->paced = !s->no_wait && !s->lockstep;
    loop->ring.slots = RING_SLOTS;
    loop->ring.bytes = (record_bytes(f->devices) + 63u) / 64u * 64u;
    /* Every page is touched now, locked or not, so that the loop never faults. */
    loop->ring.memory =
        memset(allocate_aligned(RING_SLOTS, loop->ring.bytes), 1, RING_SLOTS * loop->ring.bytes);
    loop->scratch = allocate_aligned(1, loop->ring.bytes);
}

/* What the run came to, as text, log, page and picture. */
static void write_results(follower *f, daemon_output *out) {
    const scene_setup *s = f->loop->setup;
    run_record *r = &f->record;
    for (uint32_t h = 0; h < r->hands && f->loop->simulated; h++) {
        r->hand[h].totals.frames_sent = simulated[h].sent;
        r->hand[h].totals.frames_lost = simulated[h].lost;
    }
    report_text(stdout, r);
    picture *p = f->exchanged ? NULL : f->picture;
    float *displacement_m = NULL;
    if (p != NULL) {
        displacement_m = allocate(3 * (size_t)p->blob->meta->nodes, sizeof *displacement_m);
        picture_end(p, displacement_m);
        r->motion = &p->motion;
    }
    if (out->log.file != NULL) {
        run_totals totals[PALP_SCENE_HANDS];
        for (uint32_t h = 0; h < r->hands; h++) totals[h] = r->hand[h].totals;
        record_write_totals(out->log.file, (double)f->last_tick / r->rate_hz, totals, r->hands);
        commit_output(&out->log);
    }
    if (out->page.file != NULL) {
        report_html(out->page.file, r);
        commit_output(&out->page);
    }
    if (out->view.file != NULL && p != NULL) {
        const palp_vec3 at = palp_carry_back(&p->at, p->peak_tool[0].t);
        const float tool_m[3] = {at.x, at.y, at.z};
        view_draw(out->view.file, p->blob, displacement_m, tool_m, s->touch[0].tool_radius_m, 960,
                  560);
        commit_output(&out->view);
    }
}

/* The interface of a device, and what is sent to it in a tick. */
static void add_bus(realtime_spec *r, const scene_setup *setup, uint32_t device) {
    const char *bus = setup->file->device[device].bus;
    const uint32_t axes = palp_axes(&setup->device[device].device.kinematics);
    uint32_t b = 0;
    while (b < r->buses && strcmp(r->bus[b], bus) != 0) b++;
    if (b == STARTUP_BUSES) return;
    if (b == r->buses) r->bus[r->buses++] = bus;
    r->frames[b] += axes * PALP_DRIVE_FRAMES + PALP_SHARED_FRAMES;
}

int main(int argc, char **argv) {
    daemon_spec s = {.hand = "touch", .touch = UINT32_MAX, .realtime = {.cpu = -1}};
    program_name = "palpd";
    args_parse(argc, argv, options, help, set_option, &s);
    check_options(&s);
    scene_file *file = describe(&s);
    scene_setup *setup = scene_set_up(file);
    if (s.view != NULL && setup->part[0].kind != PALP_BODY_ELASTIC)
        die(EXIT_USAGE, "--view draws a scene whose first body is elastostatic");
    char load[PALP_SCENE_HANDS][128];
    for (uint32_t h = 0; h < file->devices; h++)
        device_check_load(&setup->device[h], load[h], sizeof load[h]);
    if (s.check) {
        introduce(setup);
        return EXIT_SUCCESS;
    }
    servo_loop *loop = allocate(1, sizeof *loop);
    loop->setup = setup;
    if (!s.simulated) check_nodes(setup);
    for (uint32_t h = 0; h < file->devices; h++) open_line(loop, &s, setup, h);
    daemon_output out = {.log = {0}};
    if (s.log != NULL) out.log = open_output(s.log);
    if (s.report != NULL) out.page = open_output(s.report);
    if (s.view != NULL) out.view = open_output(s.view);

    for (uint32_t h = 0; h < file->devices && !s.simulated && !s.lockstep; h++)
        add_bus(&s.realtime, setup, h);
    realtime_prepare(&s.realtime);
    for (uint32_t h = 0; h < file->devices; h++) setup->hand[h].resume = s.resume;
    machine speed;
    setup->config.port = (palp_port){.now_ns = loop_clock, .context = loop};
    set_loop(loop, &s, file);
    if (s.lockstep) {
        setup->config.cost = (palp_cost_table){.target = &palp_target_counted,
                                               .ns_per_instruction = LOCKSTEP_NS,
                                               .margin = TICK_SHARE};
        loop->scene = scene_open(setup);
    } else {
        loop->scene = open_in_time(&speed, &s, setup);
    }

    follower f = {.loop = loop, .log = out.log.file, .home = s.home};
    follow_begin(&f, file->seconds > 0
                         ? (size_t)fmin(file->seconds * file->rate_hz + 1, MAX_RECORDED)
                         : MAX_RECORDED);
    f.record.title = s.blob;
    if (s.report != NULL || s.view != NULL) f.picture = picture_open(setup);
    for (uint32_t h = 0; h < file->devices; h++) {
        f.record.hand[h].bus_load = load[h];
        if (s.dds) f.telemetry[h] = telemetry_open(&setup->device[h].device, h);
    }
    if (s.log != NULL) record_write_session(out.log.file, setup);
    introduce(setup);
    fflush(stdout);
    static operation operating;
    if (s.control != NULL) operate_begin(&operating, &f, s.control, s.blob);
    running = loop;
    handle_signals();
    run(&s, &f);
    operate_end(&operating);
    for (uint32_t h = 0; h < f.record.hands; h++) /* scenes have come and gone */
        if (f.telemetry[h] != NULL) telemetry_close(f.telemetry[h]);
    if (f.record.count == 0) die(EXIT_WORK, "interrupted before the first tick");
    follow_end(&f);
    write_results(&f, &out);
    return conclude(&s, &f);
}
