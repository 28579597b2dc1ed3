/* SPDX-License-Identifier: MIT */
#include "sim/web/engine.h"
#include "core/green/cma.h"
#include "port/host/replay.h"
#include "port/host/report.h"
#include "port/host/shape.h"
#include "port/host/subnormals.h"
#include "port/host/util.h"
#include "sim/bus.h"
#include "tools/cli/commands.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#define SHARE 0.8          /* of a period that a tick may take */
#define LOOK_NS 100u       /* that each look at the clock takes */
#define FOLLOW_S 0.03      /* in which a hand covers 63 % of the way to its pointer, */
#define FASTEST_M_S 0.5    /* and how fast it gets at most */
#define PULL_CONDITIONS 3u /* unknowns of a node that is pulled */
#define START_M 0.02       /* above the body */
#define NUMBERS 64u
#define MOST_ARGUMENTS 60

/* What engine_part_data and engine_part_count are asked for. */
enum { PART_AT, PART_REST, PART_PRESSURE, PART_TRIANGLES, PART_FIXED };
/* What engine_text is asked for. */
enum { TEXT_STATE, TEXT_FAULTS, TEXT_JOINT, TEXT_DIGEST };
/* Where what stands in engine_numbers. */
enum {
    NUMBER_TICKS = 0,
    NUMBER_LIMIT,
    NUMBER_POINTS,
    NUMBER_FLAGS,
    NUMBER_STATE,
    NUMBER_JOINTS,
    NUMBER_BODIES,
    NUMBER_KIND, /* of the first body */
    NUMBER_RATE_HZ,
    NUMBER_SCALE,
    NUMBER_TOOLS,
    NUMBER_HANDS,
    NUMBER_EDGE_M,
    NUMBER_PULLED,
    NUMBER_HELD, /* went on as foreseen */
    NUMBER_TOOL =
        16, /* of each: kind, radius, half length, rotation's 9, place's 3; 15 each, of two */
    NUMBER_JOINT = 48 /* of each of the first 8: low, high */
};

typedef struct {
    sim_bus bus;
    hand_key key;
    hand_turn turn;
    double goal_m[3], goal_gripper;
    uint32_t late_events;
} page_hand;

static struct {
    scene_setup *setup;
    palp_scene *scene;
    replay *again; /* NULL: live */
    shape *shape;
    tick_record *tick;
    page_hand hand[PALP_SCENE_HANDS];
    FILE *log;
    uint64_t clock_ns, first_ns, ticks, digest;
    uint32_t events;
    float history[PAGE_HISTORY][PAGE_MEASURES], number[NUMBERS];
    float point[PALP_SCENE_BODIES * PALP_CONTACT_MAX_POINTS][6];
    /* of a node that is pulled */
    palp_cma cma;
    void *cma_memory;
    bool pulled;
    float *pull_u, *pull_f, pull_N[3];
    uint32_t pull_node;
    char text[256];
} page;

/* Time passes by looking, and each reading goes on record. */
static uint64_t read_clock(void *context) {
    (void)context;
    page.clock_ns += LOOK_NS;
    tick_record *t = page.tick;
    if (t->clock_count == 0) page.first_ns = page.clock_ns;
    if (t->clock_count < RECORD_CLOCKS)
        t->clock_ns[t->clock_count++] = (uint32_t)(page.clock_ns - page.first_ns);
    else
        t->clock_full = true;
    return page.clock_ns - page.first_ns;
}

/* ---- opening ---- */

static void open_hand(uint32_t h) {
    page_hand *p = &page.hand[h];
    hand script = hand_of_person();
    script.key = &p->key;
    script.turn = &p->turn;
    script.count = 1;
    p->key.x_m[2] = p->goal_m[2] = START_M;
    sim_bus_init(&p->bus, &page.setup->device[h], script, (fault_list){.seed = h + 1});
    sim_peer_init(&p->bus.peer, page.setup->file, h);
}

static void ready(void) {
    page.shape = shape_open(page.setup, page.scene);
    page.tick->time_s = 0;
    engine_look();
}

void engine_open(double ns_per_instruction) {
    scene_file *file = scene_read(PAGE_SCENE);
    for (uint32_t d = 0; d < file->devices; d++) /* a log names the bus of each */
        snprintf(file->device[d].bus, sizeof file->device[d].bus, "loop%" PRIu32, d);
    page.setup = scene_set_up(file);
    const palp_scene_config *c = &page.setup->config;
    page.tick = allocate(1, record_bytes(c->hands));
    page.setup->config.cost = (palp_cost_table){.target = &palp_target_counted,
                                                .ns_per_instruction = (float)ns_per_instruction,
                                                .margin = (float)SHARE};
    page.setup->config.port = (palp_port){.now_ns = read_clock, .context = NULL};
    subnormals_off();
    page.scene = scene_open(page.setup);
    for (uint32_t h = 0; h < c->hands; h++) open_hand(h);
    ready();
}

void engine_replay(void) {
    scene_file *named = scene_read(PAGE_SCENE);
    const bool one = named->bodies == 1 && named->tools <= 1;
    const char *tool =
        named->tools > 0 && named->tool[0].path[0] != '\0' ? named->tool[0].path : NULL;
    page.again = replay_open(PAGE_LOG, one ? named->body[0].path : PAGE_SCENE, one ? tool : NULL);
    page.setup = page.again->setup;
    page.scene = page.again->scene;
    page.tick = page.again->again;
    ready();
}

void engine_log(void) {
    page.log = fopen(PAGE_LOG, "wb");
    if (page.log == NULL) die(EXIT_WORK, "cannot write %s", PAGE_LOG);
    record_write_session(page.log, page.setup);
}

void engine_stop_log(void) {
    run_totals totals[PALP_SCENE_HANDS];
    if (page.log == NULL) return;
    memset(totals, 0, sizeof totals);
    for (uint32_t h = 0; h < page.setup->config.hands; h++) {
        totals[h].counters = *palp_scene_counters(page.scene, h);
        totals[h].frames_sent = page.hand[h].bus.sent;
    }
    record_write_totals(page.log, page.tick->time_s, totals, page.setup->config.hands);
    fclose(page.log);
    page.log = NULL;
}

/* ---- commands ---- */

uint32_t engine_command(char *arguments) {
    static char *argv[MOST_ARGUMENTS + 1];
    int argc = 0;
    for (char *at = arguments; at != NULL && argc < MOST_ARGUMENTS;) {
        argv[argc++] = at;
        at = strchr(at, '\n');
        if (at != NULL) *at++ = '\0';
    }
    if (argc > 0 && strcmp(argv[0], "bake") == 0) return (uint32_t)command_bake(argc, argv);
    if (argc > 0 && strcmp(argv[0], "tool") == 0) return (uint32_t)command_tool(argc, argv);
    return EXIT_USAGE;
}

/* ---- what comes from the page ---- */

void engine_reach(uint32_t device, double x, double y, double z, double gripper_rad) {
    if (page.again != NULL || device >= page.setup->config.hands) return;
    const palp_placement *p = &page.setup->touch[device].placement;
    const palp_vec3 off = {(float)x - p->origin_m.x, (float)y - p->origin_m.y,
                           (float)z - p->origin_m.z};
    const palp_vec3 at = palp_scale(1 / p->scale, palp_rotate_back(p->rotation, off));
    page_hand *h = &page.hand[device];
    const double goal[3] = {(double)at.x, (double)at.y, (double)at.z};
    memcpy(h->goal_m, goal, sizeof goal);
    h->goal_gripper = gripper_rad;
}

void engine_reset(void) { page.events |= PALP_EVENT_RESET; }

void engine_joint(uint32_t joint, double value) {
    for (uint32_t h = 0; page.again == NULL && h < page.setup->config.hands; h++) {
        sim_peer *peer = &page.hand[h].bus.peer;
        for (uint32_t i = 0, j = 0; i < page.setup->file->follows && j < peer->count; i++) {
            const scene_follow *f = &page.setup->file->follow[i];
            if (!f->listens || f->device != h) continue;
            if (page.setup->drive[i].joint == joint) peer->joint[j].track.key[0].value[0] = value;
            j++;
        }
    }
}

/* ---- ticks ---- */

static void follow_pointer(page_hand *h, double dt_s) {
    double step[3], length = 0;
    for (int k = 0; k < 3; k++) {
        step[k] = (h->goal_m[k] - h->key.x_m[k]) * dt_s / FOLLOW_S;
        length += step[k] * step[k];
    }
    const double most = FASTEST_M_S * dt_s * FASTEST_M_S * dt_s;
    const double share = length > most ? most / length : 1; /* of the square: no root is needed */
    for (int k = 0; k < 3; k++) h->key.x_m[k] += share * step[k];
    h->turn.gripper_rad += (h->goal_gripper - h->turn.gripper_rad) * dt_s / FOLLOW_S;
}

static void live_tick(void) {
    tick_record *t = page.tick;
    const double rate = page.setup->file->rate_hz, dt_s = 1 / rate;
    run_begin(page.setup, t);
    t->time_s = (double)page.ticks * dt_s;
    for (uint32_t h = 0; h < t->hands; h++) {
        page_hand *p = &page.hand[h];
        tick_hand *hand = &t->hand[h];
        follow_pointer(p, dt_s);
        hand->in_count = sim_bus_pass(&p->bus, dt_s, hand->in, RECORD_FRAMES, &hand->events);
        hand->events |= page.events | p->late_events | PALP_EVENT_HOME;
        p->late_events = 0;
        for (uint32_t i = 0; i < hand->in_count; i++) hand->in_time_s[i] = t->time_s;
    }
    page.events = 0;
    run_tick(page.setup, page.scene, t->time_s, t, &page.digest);
    for (uint32_t h = 0; h < t->hands; h++) {
        for (uint32_t i = 0; i < t->hand[h].out_count; i++) {
            if (!sim_bus_send(&page.hand[h].bus, &t->hand[h].out[i]))
                page.hand[h].late_events |= PALP_EVENT_BUS_FULL;
        }
    }
    palp_scene_spare(page.scene);
    if (page.log != NULL) record_write_tick(page.log, page.setup->file, t);
}

static void remember(void) {
    const tick_record *t = page.tick;
    const palp_report *r = &t->hand[0].report;
    const palp_placement *p = &page.setup->touch[0].placement;
    palp_vec3 force = palp_rotate(p->rotation, r->force_N);
    if (page.pulled) force = palp_vec3_at(page.pull_N);
    float *m = page.history[page.ticks % PAGE_HISTORY];
    const palp_vec3 held =
        palp_add(p->origin_m, palp_scale(p->scale, palp_rotate(p->rotation, r->tip_m)));
    m[PAGE_TIME_S] = (float)t->time_s;
    m[PAGE_FORCE_N] = palp_norm(force);
    m[PAGE_FORCE_X] = force.x;
    m[PAGE_FORCE_Y] = force.y;
    m[PAGE_FORCE_Z] = force.z;
    m[PAGE_STORED_MJ] = 1e3f * r->stored_J;
    m[PAGE_ABSORBED_MJ] = 1e3f * r->absorbed_J;
    m[PAGE_GIVEN_MJ] = 1e3f * r->given_J;
    m[PAGE_LEVEL] = (float)r->level;
    m[PAGE_ACTIVE] = (float)r->active;
    m[PAGE_BOUND_US] = 1e-3f * r->bound_ns;
    m[PAGE_DEPTH_MM] = 1e3f * palp_norm(palp_sub(held, r->tool.t));
    page.ticks++;
}

uint32_t engine_tick(uint32_t ticks) {
    uint32_t n = 0;
    for (; n < ticks; n++) {
        if (page.again == NULL)
            live_tick();
        else if (!replay_next(page.again))
            break;
        remember();
    }
    return n;
}

uint32_t engine_ended(void) { return page.again != NULL ? (uint32_t)page.again->end : 0; }

/* ---- pulling a node ---- */

static bool begin_pull(const palp_blob *b) {
    const size_t bytes = palp_cma_memsize(b, PULL_CONDITIONS);
    if (page.cma_memory != NULL) return true;
    if (palp_blob_has(b, PALP_META_SCALAR)) return false;
    page.cma_memory = allocate_aligned(bytes, 1);
    page.pull_u = allocate(3 * (size_t)b->meta->nodes, sizeof(float));
    page.pull_f = allocate(3 * (size_t)b->meta->nodes, sizeof(float));
    if (palp_cma_init(&page.cma, b, PULL_CONDITIONS, page.cma_memory, bytes) == PALP_OK)
        return true;
    free(page.cma_memory);
    page.cma_memory = NULL;
    return false;
}

/* The free node of a level nearest to another, where both are at rest. */
static uint32_t node_on_level(const palp_blob *b, uint32_t level, uint32_t node) {
    const palp_vec3 x = palp_vec3_at(b->rest_m + 3 * (size_t)node);
    uint32_t best = 0;
    float least = -1;
    for (uint32_t s = 0; s < b->level[level].nodes; s++) {
        const uint32_t n = b->domain[PALP_FREE].node[s];
        const float away = palp_norm(palp_sub(palp_vec3_at(b->rest_m + 3 * (size_t)n), x));
        if (least >= 0 && away >= least) continue;
        least = away;
        best = n;
    }
    return best;
}

uint32_t engine_pull(uint32_t node, double x, double y, double z) {
    const scene_part *part = &page.setup->part[0];
    if (part->kind != PALP_BODY_ELASTIC || page.again != NULL) return 0;
    const palp_blob *b = &part->blob;
    if (node >= b->meta->nodes || !begin_pull(b)) return 0;
    const uint32_t level = b->meta->constraint_level > 0 ? b->meta->constraint_level - 1 : 0;
    const uint32_t at = node_on_level(b, level, node);
    const palp_vec3 u =
        palp_rotate_back(page.setup->body[0].at.r, (palp_vec3){(float)x, (float)y, (float)z});
    palp_cma_clear(&page.cma);
    if (palp_cma_level(&page.cma, level, PALP_ENERGETIC) != PALP_OK ||
        palp_cma_prescribe(&page.cma, at, PALP_PRESCRIBE_DISPLACEMENT, u) != PALP_OK ||
        palp_cma_solve(&page.cma, page.pull_u, page.pull_f) != PALP_OK)
        return 0;
    palp_vec3 sum = {0.0f, 0.0f, 0.0f};
    for (uint32_t i = 0; i < b->meta->nodes; i++)
        if (!palp_node_is_fixed(b, i))
            sum = palp_add(sum, palp_vec3_at(page.pull_f + 3 * (size_t)i));
    sum = palp_scale(-1, palp_rotate(page.setup->body[0].at.r, sum));
    const float felt[3] = {sum.x, sum.y, sum.z};
    memcpy(page.pull_N, felt, sizeof felt);
    page.pull_node = at;
    page.pulled = true;
    return 1;
}

void engine_let_go(void) { page.pulled = false; }

/* ---- what is drawn ---- */

static void look_at_tool(uint32_t t) {
    const palp_tool *tool = &page.setup->tool[t].tool;
    const tool_look look = tool_look_of(tool);
    palp_frame turn = PALP_FRAME_IDENTITY;
    memcpy(turn.r, look.turn, sizeof turn.r);
    const palp_frame at = palp_frame_compose(&page.tick->tool[t], &turn);
    const float place[3] = {at.t.x, at.t.y, at.t.z};
    float *n = page.number + NUMBER_TOOL + 15 * t;
    n[0] = (float)tool->shape;
    n[1] = look.radius_m;
    n[2] = look.half_m;
    memcpy(n + 3, at.r, sizeof at.r);
    memcpy(n + 12, place, sizeof place);
}

static void pull_shape(void) {
    shape_part *p = &page.shape->part[0];
    const palp_frame *at = &page.setup->body[0].at;
    const palp_blob *b = &page.setup->part[0].blob;
    for (uint32_t i = 0; i < p->nodes; i++) {
        const palp_vec3 x = palp_carry(at, palp_add(palp_vec3_at(b->rest_m + 3 * (size_t)i),
                                                    palp_vec3_at(page.pull_u + 3 * (size_t)i)));
        const float place[3] = {x.x, x.y, x.z};
        memcpy(p->at_m + 3 * (size_t)i, place, sizeof place);
        p->pressure_Pa[i] = palp_norm(palp_vec3_at(page.pull_f + 3 * (size_t)i)) / b->area_m2[i];
        if (p->fixed[i] != 0) p->pressure_Pa[i] = 0;
    }
    memcpy(page.point[0], p->at_m + 3 * (size_t)page.pull_node, 3 * sizeof(float));
    memcpy(page.point[0] + 3, page.pull_N, sizeof page.pull_N);
    page.shape->points = 1;
}

void engine_look(void) {
    const palp_report *r = &page.tick->hand[0].report;
    const scene_setup *s = page.setup;
    float *n = page.number;
    shape_update(page.shape);
    for (uint32_t i = 0; i < page.shape->points; i++)
        memcpy(page.point[i], &page.shape->point[i], sizeof page.point[i]);
    if (page.pulled) pull_shape();
    n[NUMBER_TICKS] = (float)page.ticks;
    n[NUMBER_LIMIT] = (float)r->limit;
    n[NUMBER_POINTS] = (float)r->points;
    n[NUMBER_FLAGS] = (float)r->contact_flags;
    n[NUMBER_STATE] = (float)r->state;
    n[NUMBER_BODIES] = (float)s->config.bodies;
    n[NUMBER_KIND] = (float)s->part[0].kind;
    n[NUMBER_RATE_HZ] = (float)s->file->rate_hz;
    n[NUMBER_SCALE] = s->touch[0].placement.scale;
    n[NUMBER_TOOLS] = (float)s->config.tools;
    n[NUMBER_HANDS] = (float)s->config.hands;
    n[NUMBER_HELD] = r->held ? 1 : 0;
    n[NUMBER_PULLED] = page.pulled ? 1 : 0;
    n[NUMBER_JOINTS] = 0;
    n[NUMBER_EDGE_M] = s->part[0].kind == PALP_BODY_ELASTIC ? s->part[0].blob.meta->mean_edge_m : 0;
    if (s->part[0].kind == PALP_BODY_ZONES) {
        const palp_zones *z = &s->part[0].zones;
        n[NUMBER_JOINTS] = (float)(z->meta->joints < 8 ? z->meta->joints : 8);
        for (uint32_t j = 0; j < (uint32_t)n[NUMBER_JOINTS]; j++) {
            n[NUMBER_JOINT + 2 * j] = z->joint[j].low;
            n[NUMBER_JOINT + 2 * j + 1] = z->joint[j].high;
        }
    }
    for (uint32_t t = 0; t < s->config.tools && t < 2; t++) look_at_tool(t);
}

const float *engine_history(void) { return &page.history[0][0]; }
const float *engine_numbers(void) { return page.number; }
uint32_t engine_parts(void) { return page.shape->parts; }

uint32_t engine_part_count(uint32_t part, uint32_t what) {
    const shape_part *p = &page.shape->part[part];
    return what == PART_TRIANGLES ? p->triangles : p->nodes;
}

const void *engine_part_data(uint32_t part, uint32_t what) {
    const shape_part *p = &page.shape->part[part];
    switch (what) {
    case PART_AT:
        return p->at_m;
    case PART_REST:
        return p->rest_m;
    case PART_PRESSURE:
        return p->pressure_Pa;
    case PART_TRIANGLES:
        return p->triangle;
    default:
        return p->fixed;
    }
}

uint32_t engine_points(void) { return page.shape->points; }
const float *engine_point_data(void) { return &page.point[0][0]; }

const char *engine_text(uint32_t what, uint32_t which) {
    const palp_report *r = &page.tick->hand[0].report;
    page.text[0] = '\0';
    switch (what) {
    case TEXT_STATE:
        return report_state(r->state);
    case TEXT_FAULTS:
        report_faults(r->faults, page.text, sizeof page.text);
        break;
    case TEXT_JOINT:
        if (page.setup->part[0].kind == PALP_BODY_ZONES)
            return page.setup->part[0].zones.joint[which].name;
        break;
        return page.again != NULL ? page.again->why : "";
    default:
        snprintf(page.text, sizeof page.text, "%016" PRIx64, page.tick->digest);
        break;
    }
    return page.text;
}

/* A program, that joins port, sim and tools: the page calls what engine.h says in place of this. */
int main(void) { return EXIT_SUCCESS; }
