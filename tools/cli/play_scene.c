/* SPDX-License-Identifier: MIT */
/* palp play of a scene with devices: bodies, tools and simulated hands in virtual time, by a clock that
 * counts operations, so that runs repeat. */
#include "port/host/openscene.h"
#include "port/host/report.h"
#include "port/host/run_tick.h"
#include "port/host/shape.h"
#include "port/host/util.h"
#include "sim/bus.h"
#include "tools/cli/play.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    const play_spec *spec;
    scene_setup *setup;
    palp_scene *scene;
    sim_bus *bus;                          /* [hands] */
    double ns_per_work[PALP_SCENE_BODIES]; /* of an operation that a body counts */
    double begun_ns, begun_work_ns;
    run_record record;
    output csv; /* without a file: none */
    tick_record *tick;
    shape *shape; /* for the page; NULL: none is asked for */
    motion motion;
} player;

/* What all bodies have done so far, on the machine that is assumed. */
static double work_ns(const player *p) {
    double sum = 0;
    for (uint32_t b = 0; b < p->setup->config.bodies; b++) {
        const palp_body *body = palp_scene_body(p->scene, b);
        sum += body->answer != NULL ? (double)palp_answer_work(body->answer) * p->ns_per_work[b]
                                    : (double)body->dynamic->work_ns;
    }
    return sum;
}

static uint64_t now_ns(void *context) {
    const player *p = context;
    if (p->scene == NULL) return 0;
    return (uint64_t)(p->begun_ns + work_ns(p) - p->begun_work_ns);
}

/* What an operation takes: what the target and the code's own counts say of the least answer. */
static void price_work(player *p, const machine *m, double margin) {
    palp_scene_config *c = &p->setup->config;
    float counted[PALP_SCENE_BODIES] = {0};
    c->cost = (palp_cost_table){
        .target = &palp_target_counted, .ns_per_instruction = 1e-3f, .margin = 1.0f};
    palp_scene *at_one = scene_open(p->setup);
    for (uint32_t b = 0; b < c->bodies; b++)
        counted[b] = 1e3f * palp_scene_body(at_one, b)->least_ns;
    free(at_one);
    c->cost = machine_table(m, margin);
    p->scene = scene_open(p->setup);
    for (uint32_t b = 0; b < c->bodies; b++)
        p->ns_per_work[b] = (double)palp_scene_body(p->scene, b)->least_ns / (double)counted[b];
}

static void open_player(player *p) {
    const scene_setup *s = p->setup;
    const double rate_hz = s->file->rate_hz;
    p->setup->config.port = (palp_port){.now_ns = now_ns, .context = p};
    price_work(p, &p->spec->machine, play_budget_us(p->spec, rate_hz) * 1e-6 * rate_hz);
    p->bus = allocate(s->config.hands, sizeof *p->bus);
    run_record *r = &p->record;
    r->hands = s->config.hands;
    r->bodies = s->config.bodies;
    r->rate_hz = rate_hz;
    r->title = s->file->name;
    r->count = (size_t)(s->file->seconds * rate_hz + 0.5);
    r->totalled = true;
    if (r->count == 0) die(EXIT_USAGE, "%s: not one tick in its time", s->file->name);
    if (r->count > MOST_TICKS)
        die(EXIT_USAGE, "%s: %zu ticks; at most %d are kept", s->file->name, r->count, MOST_TICKS);
    for (uint32_t b = 0; b < r->bodies; b++)
        r->body[b] = (run_body){.name = s->file->body[b].name, .kind = s->part[b].kind};
    run_joints_of(r, s);
    p->tick = allocate(1, record_bytes(r->hands));
    if (p->spec->report != NULL) {
        p->shape = shape_open(s, p->scene);
        shape_to_motion(p->shape, &p->motion, MOTION_PAGE_BYTES);
        r->motion = &p->motion;
    }
    for (uint32_t h = 0; h < r->hands; h++) {
        const char *script = s->file->device[h].hand;
        sim_bus_init(&p->bus[h], &s->device[h], hand_load(script[0] != '\0' ? script : "touch"),
                     (fault_list){.seed = h});
        sim_peer_init(&p->bus[h].peer, s->file, h);
        r->hand[h] = (run_hand){.tick = allocate(r->count, sizeof *r->hand[h].tick),
                                .events = allocate(r->count, sizeof *r->hand[h].events),
                                .device_name = s->device[h].name,
                                .bus_name = "loop",
                                .bus_load = "in virtual time"};
    }
}

static void write_line(FILE *f, double t_s, uint32_t device, const palp_report *r) {
    const float v[] = {r->tip_m.x,   r->tip_m.y,     r->tip_m.z,     r->force_N.x,  r->force_N.y,
                       r->force_N.z, r->moment_Nm.x, r->moment_Nm.y, r->moment_Nm.z};
    fprintf(f, "%.9g,%" PRIu32 ",%s", t_s, device, report_state(r->state));
    for (int i = 0; i < 9; i++) fprintf(f, ",%.9g", (double)v[i]);
    fprintf(f, ",%" PRIu32 ",%" PRIu32 ",%.9g,%.9g,%.3f\n", r->level, r->active,
            (double)r->stored_J, (double)r->given_J, (double)r->elapsed_ns * 1e-3);
}

static void tick(player *p, size_t number, uint32_t more_events[PALP_SCENE_HANDS]) {
    tick_record *t = p->tick;
    run_record *r = &p->record;
    uint64_t digest = 0;
    const double t_s = (double)number / r->rate_hz;
    run_begin(p->setup, t);
    for (uint32_t h = 0; h < r->hands; h++) {
        tick_hand *of = &t->hand[h];
        of->in_count = sim_bus_pass(&p->bus[h], 1 / r->rate_hz, of->in, RECORD_FRAMES, &of->events);
        of->events |= more_events[h];
        more_events[h] = 0;
    }
    p->begun_ns = t_s * 1e9;
    p->begun_work_ns = work_ns(p);
    run_tick(p->setup, p->scene, t_s, t, &digest);
    for (uint32_t h = 0; h < r->hands; h++) {
        const tick_hand *of = &t->hand[h];
        for (uint32_t i = 0; i < of->out_count; i++)
            if (!sim_bus_send(&p->bus[h], &of->out[i])) more_events[h] |= PALP_EVENT_BUS_FULL;
        r->hand[h].tick[number] = of->report;
        r->hand[h].events[number] = of->events;
        if (p->csv.file != NULL) write_line(p->csv.file, t_s, h, &of->report);
    }
    for (uint32_t b = 0; b < r->bodies; b++) run_body_add(&r->body[b], &t->body[b]);
    if (p->shape != NULL && motion_wants(&p->motion, t_s))
        shape_add_frame(p->shape, &p->motion, t_s, t->tool);
    palp_scene_spare(p->scene);
}

int play_scene(const play_spec *s, scene_file *file) {
    player *p = allocate(1, sizeof *p);
    uint32_t more_events[PALP_SCENE_HANDS] = {0};
    p->spec = s;
    p->setup = scene_set_up(file);
    open_player(p);
    run_record *r = &p->record;
    if (s->csv != NULL) {
        p->csv = open_output(s->csv);
        fputs("t_s,device,state,x,y,z,fx,fy,fz,mx,my,mz,level,active,stored_J,given_J,tick_us\n",
              p->csv.file);
    }
    for (size_t i = 0; i < r->count; i++) tick(p, i, more_events);
    for (uint32_t d = 0, j = 0; d < palp_scene_drives(p->scene); d++) {
        if (p->setup->drive[d].by == PALP_DRIVEN_BY_FRAMES)
            r->joint[j++].at = *palp_scene_setpoint(p->scene, d);
    }
    for (uint32_t h = 0; h < r->hands; h++)
        r->hand[h].totals = (run_totals){.counters = *palp_scene_counters(p->scene, h),
                                         .frames_sent = p->bus[h].sent,
                                         .frames_lost = p->bus[h].lost};
    play_print_machine(stdout, s);
    report_text(stdout, r);
    if (s->csv != NULL) commit_output(&p->csv);
    if (s->report != NULL) {
        output page = open_output(s->report);
        report_html(page.file, r);
        commit_output(&page);
    }
    const bool late = r->hand[0].totals.counters.overruns > 0;
    free(p->bus);
    free(p->tick);
    scene_tear_down(p->setup, p->scene);
    free(p);
    return late ? EXIT_WORK : EXIT_SUCCESS;
}
