/* SPDX-License-Identifier: MIT */
/* palp play: a multizone model follows a scene, a new configuration each tick, in bounded time. */
#include "core/dyna/dyna.h"
#include "core/green/field.h"
#include "core/contact/loads.h"
#include "core/servo/answer.h"
#include "tools/cli/play.h"
#include "port/host/openscene.h"
#include "port/host/args.h"
#include "tools/cli/commands.h"
#include "port/host/page.h"
#include "port/host/util.h"
#include "tools/zone/zonesolve.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const char help[] =
    "usage: palp play BLOB --scene FILE [-o OUT.csv] [--report OUT.html] [OPTIONS]\n"
    "       palp play SCENE [-o OUT.csv] [--report OUT.html] [OPTIONS]\n"
    "\n"
    "Plays a scene with devices (sim/README.md) in virtual time, which palpd --bus loop feels by "
    "the "
    "clock;\n"
    "or, with --scene, one without:\n"
    "\n"
    "Moves a multizone model along a scene's joint trajectories and touches it with a rigid "
    "cylinder "
    "and\n"
    "a ball that hang on springs; or touches a dynamic body with them, which moves and "
    "oscillates.\n"
    "Every tick is answered within a budget.\n"
    "  --budget-us B           share of each period for the tick (default: 80 %)\n"
    "  --target NAME|FILE      the machine whose prices the budget is kept by, as in palp wcet "
    "(default: what\n"
    "                          this program was built for)\n"
    "  --ns-per-operation N    instead: an assumed machine, N ns for each operation that the code "
    "counts\n"
    "  --clock work|wall       work: by operations counted, the same everywhere (default);\n"
    "                          wall: this machine's clock\n"
    "  --finest L              finest level of the seams, 0 to 5 (default 4)\n"
    "  --no-pairs              zones do not touch each other\n"
    "Of dynamic bodies:\n"
    "  --material NAME         jelly, fat, liver, muscle, gel, rubber or hard-rubber in place of "
    "the "
    "blob's\n"
    "  --young PA, --poisson NU, --damping S, --drag 1/S   one of its numbers\n"
    "  --uniform               the finest mesh everywhere, for comparison\n"
    "  --finest C              steps of 1/2^C of a tick at the least, 0 to 7 (default 7)\n"
    "  --refine SHARE          how far from linear displacements may be, of the diagonal (default "
    "0.008)\n"
    "The scene's keys: seconds, rate, stiffness, gravity X Y Z, pose T JOINT VALUE, cylinder "
    "RADIUS HALF X Y Z,\n"
    "object T X Y Z, probe RADIUS, touch T X Y Z. Dynamic bodies: no pose, tools without "
    "springs.\n";

static const option options[] = {{"--scene", 1},     {"-o", 1},         {"--report", 1},
                                 {"--budget-us", 1}, {"--clock", 1},    {"--ns-per-operation", 1},
                                 {"--finest", 1},    {"--no-pairs", 0}, {"--material", 1},
                                 {"--young", 1},     {"--poisson", 1},  {"--damping", 1},
                                 {"--drag", 1},      {"--uniform", 0},  {"--refine", 1},
                                 {"--target", 1},    {NULL, 0}};

static void set_option(void *context, const argument *a) {
    static const char *const clocks[] = {"work", "wall", NULL};
    play_spec *s = context;
    const char *o = a->option;
    if (o == NULL) {
        if (s->blob != NULL) die(EXIT_USAGE, "one blob, not also '%s'", a->value[0]);
        s->blob = a->value[0];
    } else if (strcmp(o, "--scene") == 0) {
        s->scene = a->value[0];
    } else if (strcmp(o, "-o") == 0) {
        s->csv = a->value[0];
    } else if (strcmp(o, "--report") == 0) {
        s->report = a->value[0];
    } else if (strcmp(o, "--budget-us") == 0) {
        s->budget_us = arg_between(a, 0, 1e6);
    } else if (strcmp(o, "--ns-per-operation") == 0) {
        s->ns_per_operation = arg_between(a, 0, 1e6);
    } else if (strcmp(o, "--target") == 0) {
        s->target = a->value[0];
    } else if (strcmp(o, "--clock") == 0) {
        s->wall = arg_word(a, clocks) == 1;
    } else if (strcmp(o, "--finest") == 0) {
        s->finest = arg_u32(a, 0, 0, PALP_STEP_CLASSES - 1);
        s->finest_given = true;
    } else if (strcmp(o, "--material") == 0) {
        s->material = a->value[0];
    } else if (strcmp(o, "--young") == 0) {
        s->young_Pa = arg_between(a, 0, 1e12);
    } else if (strcmp(o, "--poisson") == 0) {
        s->poisson = arg_between(a, -0.9999, 0.4999);
    } else if (strcmp(o, "--damping") == 0) {
        s->damping_s = arg_upto(a, 100);
    } else if (strcmp(o, "--drag") == 0) {
        s->drag_per_s = arg_upto(a, 1000);
    } else if (strcmp(o, "--refine") == 0) {
        s->refine_share = arg_between(a, 1e-6, 1);
    } else if (strcmp(o, "--uniform") == 0) {
        s->uniform = true;
    } else {
        s->alone = true;
    }
}

/* ---- the run ---- */

#define MOST_LOADS 1024u /* of a zone, for the picture */

typedef struct {
    double t_s, value[PALP_MAX_JOINTS], wall_us, budget_us_used;
    palp_answer_report answer;
    palp_vec3 force_N[SCENE_TRACKS], tool_m[SCENE_TRACKS];
} play_tick;

typedef struct {
    const play_spec *spec;
    scene_file *s;
    const scene_track *joint[PALP_MAX_JOINTS]; /* of the scene; NULL: at rest */
    palp_zones *z;
    palp_assembly *a;
    palp_answer *b;
    palp_tool tool[SCENE_TRACKS];
    uint32_t tools, which[SCENE_TRACKS]; /* track of each tool */
    uint64_t begun_ns, begun_work;
    double ns_per_operation; /* of the clock 'work' */
    size_t ticks;
    play_tick *tick;
    size_t strongest; /* tick */
    motion motion;    /* for a report */
    float *rest_m[PALP_MAX_ZONES], *place_m[PALP_MAX_ZONES];
} player;

static uint64_t now_ns(void *context) {
    const player *p = context;
    if (p->spec->wall) return (uint64_t)(now_s() * 1e9);
    double work = (double)(palp_answer_work(p->b) - p->begun_work);
    return p->begun_ns + (uint64_t)(work * p->ns_per_operation);
}

static palp_vec3 vec(const double x[3]) {
    return (palp_vec3){(float)x[0], (float)x[1], (float)x[2]};
}

/* What an operation that the code counts takes: on an assumed machine as it says, on a target by
 * what both say of the least answer. */
static double ns_per_operation(player *p, const palp_answer_config *config, void *memory,
                               size_t bytes) {
    palp_answer_config counted = *config;
    float at_target_ns = 0, at_one_ns = 0;
    if (p->spec->ns_per_operation > 0) return p->spec->ns_per_operation;
    counted.cost = (palp_cost_table){
        .target = &palp_target_counted, .ns_per_instruction = 1, .margin = config->cost.margin};
    (void)palp_answer_init(p->b, config, memory, bytes, &at_target_ns);
    (void)palp_answer_init(p->b, &counted, memory, bytes, &at_one_ns);
    return (double)(at_target_ns / fmaxf(at_one_ns, 1.0f));
}

static void open_player(player *p) {
    const play_spec *s = p->spec;
    for (uint32_t i = 0; i < p->z->meta->zones; i++) {
        if (p->z->blob[i].meta->modes == 0)
            die(EXIT_WORK,
                "%s: zone '%s' has no regular part, which contact needs: bake it again, without "
                "--modes 0",
                s->blob, p->z->zone[i].name);
    }
    size_t bytes = palp_assembly_memsize(p->z, s->finest);
    p->a = allocate(1, sizeof *p->a);
    p->b = allocate(1, sizeof *p->b);
    palp_status status =
        palp_assembly_init(p->a, p->z, s->finest, allocate_aligned(bytes + 1, 1), bytes);
    if (status != PALP_OK) die(EXIT_WORK, "%s: %s", s->blob, palp_status_text(status));
    palp_vec3 gravity = vec(p->s->body[0].gravity_m_s2);
    if (palp_norm(gravity) > 0.0f && palp_assembly_gravity(p->a, gravity) != PALP_OK)
        die(EXIT_WORK, "%s: a zone has no gravity response", s->blob);
    scene_tools(p->s, p->tool, p->which, &p->tools);
    double period_us = 1e6 / p->s->rate_hz;
    double budget = play_budget_us(s, p->s->rate_hz);
    palp_answer_config config = {.contact = {.assembly = p->a,
                                             .pairs = !s->alone,
                                             .tools = p->tool,
                                             .tool_count = p->tools,
                                             .finest = PALP_CONTACT_FINEST},
                                 .cost = machine_table(&s->machine, budget / period_us),
                                 .port = {.now_ns = now_ns, .context = p},
                                 .dt_s = (float)(1 / p->s->rate_hz)};
    bytes = palp_answer_memsize(&config.contact);
    void *memory = allocate_aligned(bytes, 1);
    float bound_ns = 0;
    p->ns_per_operation = ns_per_operation(p, &config, memory, bytes);
    status = palp_answer_init(p->b, &config, memory, bytes, &bound_ns);
    if (status == PALP_ERR_BUDGET)
        die(EXIT_WORK,
            "%s: the least answer may take %.0f us on %s (palp wcet), the budget is %.0f us: a "
            "longer "
            "--budget-us, a lower rate, fewer modes by --finest, or another machine by --target or "
            "--ns-per-operation",
            s->blob, (double)bound_ns * 1e-3, s->machine.target.name, budget);
    if (status != PALP_OK) die(EXIT_WORK, "%s: %s", s->blob, palp_status_text(status));
    for (uint32_t t = 0; t < p->tools; t++)
        p->b->coupling.tool[t].stiffness_N_per_m = (float)p->s->stiffness_N_per_m;
}

/* The deformed surface in the world. */
static void take_picture(player *p) {
    palp_contact *c = &p->b->contact;
    palp_contact_load_seams(c);
    const float *total = palp_assembly_total(p->a);
    for (uint32_t i = 0; i < p->z->meta->zones; i++) {
        const palp_blob *b = &p->z->blob[i];
        const size_t nodes = b->meta->nodes, bytes = palp_field_memsize(b);
        palp_field field;
        void *memory = allocate_aligned(bytes, 1);
        (void)palp_field_init(&field, b, memory, bytes);
        palp_load load[MOST_LOADS];
        palp_load_list list = {.load = load, .capacity = MOST_LOADS};
        for (uint32_t k = 0; k < c->patches; k++)
            palp_contact_loads(c, k, i, (palp_vec3){0.0f, 0.0f, 0.0f}, &list);
        palp_field_update(&field, load, list.count);
        const float *local = palp_field_reconstruct(&field, b->meta->levels - 1);
        float *modes = allocate(3 * (size_t)p->z->zone[i].modes + 1, sizeof *modes);
        palp_seams_zone(&p->a->seams, p->a->configuration, PALP_SEAM_LEVELS - 1, i, total, modes);
        for (uint32_t n = 0; n < nodes; n++) {
            palp_vec3 u = palp_zone_modal_displacement(p->z, p->spec->finest, i, n, modes);
            if (!palp_node_is_fixed(b, n))
                u = palp_add(u,
                             palp_vec3_at(local + PALP_FIELD_LANES * (size_t)palp_node_slot(b, n)));
            palp_vec3 x =
                palp_carry(&p->a->world[i], palp_add(palp_vec3_at(b->rest_m + 3 * (size_t)n), u));
            const float at[3] = {x.x, x.y, x.z};
            memcpy(p->place_m[i] + 3 * (size_t)n, at, sizeof at);
        }
        free(modes);
        free(memory);
    }
}

static void open_motion(player *p) {
    motion *m = &p->motion;
    m->parts = p->z->meta->zones;
    for (uint32_t i = 0; i < m->parts; i++) {
        const palp_blob *b = &p->z->blob[i];
        const size_t nodes = b->meta->nodes;
        p->rest_m[i] = allocate(3 * nodes, sizeof(float));
        p->place_m[i] = allocate(3 * nodes, sizeof(float));
        for (size_t n = 0; n < nodes; n++) {
            const palp_vec3 x = palp_carry(&p->a->world[i], palp_vec3_at(b->rest_m + 3 * n));
            const float at[3] = {x.x, x.y, x.z};
            memcpy(p->rest_m[i] + 3 * n, at, sizeof at);
        }
        m->part[i] = (motion_part){.nodes = b->meta->nodes,
                                   .triangles = b->meta->triangles,
                                   .triangle = b->triangle,
                                   .rest_m = p->rest_m[i],
                                   .far_off = true};
    }
    m->tools = p->tools;
    for (uint32_t t = 0; t < m->tools; t++) m->tool[t] = &p->tool[t];
    motion_begin(m, MOTION_PAGE_BYTES);
}

static void run(player *p) {
    const palp_frame rest = PALP_FRAME_IDENTITY;
    double most = -1;
    p->ticks = (size_t)(p->s->seconds * p->s->rate_hz);
    if (p->ticks > MOST_TICKS)
        die(EXIT_USAGE, "%s: %zu ticks; at most %d are kept", p->spec->scene, p->ticks, MOST_TICKS);
    p->tick = allocate(p->ticks + 1, sizeof *p->tick);
    open_motion(p);
    for (size_t i = 0; i < p->ticks; i++) {
        play_tick *k = &p->tick[i];
        float value[PALP_MAX_JOINTS];
        palp_frame at[PALP_CONTACT_TOOLS];
        palp_coupling_result result[PALP_CONTACT_TOOLS];
        k->t_s = (double)i / p->s->rate_hz;
        for (uint32_t j = 0; j < p->z->meta->joints; j++) {
            double x[3] = {0};
            if (p->joint[j] != NULL) scene_at(p->joint[j], k->t_s, x);
            value[j] = (float)x[0];
            k->value[j] = x[0];
        }
        scene_tools_at(p->s, p->which, p->tools, k->t_s, at);
        p->begun_ns = (uint64_t)(k->t_s * 1e9);
        p->begun_work = palp_answer_work(p->b);
        double start = now_s();
        uint64_t start_ns = now_ns(p);
        palp_answer_pose(p->b, value, &rest);
        palp_answer_tick(p->b, start_ns, at, result, &k->answer);
        k->budget_us_used = (double)(now_ns(p) - start_ns) * 1e-3;
        k->wall_us = (now_s() - start) * 1e6;
        check_closures(p->spec->scene, p->z, p->a->configuration);
        double pressed = 0;
        for (uint32_t t = 0; t < p->tools && p->which[t] < SCENE_TRACKS; t++) {
            k->force_N[p->which[t]] = result[t].force_N;
            k->tool_m[p->which[t]] = result[t].tool.t;
            pressed += (double)palp_norm(result[t].force_N);
        }
        if (pressed > most) {
            most = pressed;
            p->strongest = i;
        }
        palp_answer_spare(p->b);
        if (p->spec->report == NULL || !motion_wants(&p->motion, k->t_s)) continue;
        palp_frame where[PALP_CONTACT_TOOLS];
        for (uint32_t t = 0; t < p->tools; t++) where[t] = result[t].tool;
        take_picture(p);
        motion_add(&p->motion, k->t_s, (const float *const *)p->place_m, where);
    }
}

/* ---- what it was like ---- */

static percentiles times(const player *p, bool wall) {
    double *x = allocate(p->ticks + 1, sizeof *x);
    for (size_t i = 0; i < p->ticks; i++)
        x[i] = wall ? p->tick[i].wall_us : p->tick[i].budget_us_used;
    percentiles s = percentiles_of(x, p->ticks);
    free(x);
    return s;
}

static size_t late_ticks(const player *p) {
    size_t late = 0;
    for (size_t i = 0; i < p->ticks; i++) late += p->tick[i].budget_us_used > 1e6 / p->s->rate_hz;
    return late;
}

static void summary(FILE *f, const void *context) {
    const player *p = context;
    double force[SCENE_TRACKS] = {0};
    size_t at[PALP_SEAM_LEVELS + 1] = {0}, aborted = 0, renewed = 0, active = 0;
    for (size_t i = 0; i < p->ticks; i++) {
        const play_tick *k = &p->tick[i];
        at[k->answer.moving.level == PALP_DIAGONAL ? PALP_SEAM_LEVELS : k->answer.moving.level]++;
        aborted += k->answer.moving.aborted;
        renewed += k->answer.moving.renewed;
        if (k->answer.active > active) active = k->answer.active;
        for (int t = 0; t < SCENE_TRACKS; t++)
            force[t] = fmax(force[t], (double)palp_norm(k->force_N[t]));
    }
    percentiles work = times(p, false), wall = times(p, true);
    double budget = (double)p->b->config.cost.margin * 1e6 / p->s->rate_hz;
    fprintf(f, "ticks                 %zu at %g Hz, %zu late by the clock that is asked (%s)\n",
            p->ticks, p->s->rate_hz, late_ticks(p), p->spec->wall ? "wall" : "work");
    play_print_machine(f, p->spec);
    fprintf(f, "tick                  p50 %.1f, p99 %.1f, max %.1f us, budget %.0f us\n", work.p50,
            work.p99, work.max, budget);
    fprintf(f, "wall clock here       p50 %.1f, p99 %.1f, max %.1f us\n", wall.p50, wall.p99,
            wall.max);
    fprintf(f, "seam level           ");
    for (uint32_t l = 0; l < PALP_SEAM_LEVELS; l++) {
        if (at[l] > 0) fprintf(f, " %" PRIu32 ": %zu", l, at[l]);
    }
    if (at[PALP_SEAM_LEVELS] > 0) fprintf(f, " block diagonal: %zu", at[PALP_SEAM_LEVELS]);
    fprintf(f, " ticks; factors made %zu, levels given up %zu\n", renewed, aborted);
    fprintf(
        f,
        "contact               at most %zu points; largest force %.3g N on the object, %.3g N on "
        "the probe\n",
        active, force[SCENE_OBJECT], force[SCENE_PROBE]);
}

static void write_csv(const player *p, const char *path) {
    output out = open_output(path);
    fputs("t_s", out.file);
    for (uint32_t j = 0; j < p->z->meta->joints; j++) fprintf(out.file, ",%s", p->z->joint[j].name);
    fputs(",level,aborted,renewed,points,active,object_fx,object_fy,object_fz,probe_fx,probe_fy,"
          "probe_fz,tick_us,wall_us\n",
          out.file);
    for (size_t i = 0; i < p->ticks; i++) {
        const play_tick *k = &p->tick[i];
        fprintf(out.file, "%.9g", k->t_s);
        for (uint32_t j = 0; j < p->z->meta->joints; j++) fprintf(out.file, ",%.9g", k->value[j]);
        if (k->answer.moving.level == PALP_DIAGONAL) {
            fputs(",diagonal", out.file);
        } else {
            fprintf(out.file, ",%" PRIu32, k->answer.moving.level);
        }
        fprintf(out.file, ",%" PRIu32 ",%d,%" PRIu32 ",%" PRIu32, k->answer.moving.aborted,
                k->answer.moving.renewed ? 1 : 0, k->answer.points, k->answer.active);
        for (int t = 0; t < SCENE_TRACKS; t++)
            fprintf(out.file, ",%.9g,%.9g,%.9g", (double)k->force_N[t].x, (double)k->force_N[t].y,
                    (double)k->force_N[t].z);
        fprintf(out.file, ",%.3f,%.3f\n", k->budget_us_used, k->wall_us);
    }
    commit_output(&out);
}

/* What a curve shows. */
typedef struct {
    const player *p;
    double (*value)(const play_tick *, uint32_t);
    uint32_t number;
} curve;

static double curve_value(const void *context, size_t i) {
    const curve *c = context;
    return c->value(&c->p->tick[i], c->number);
}

typedef struct {
    const char *title, *word, *unit;
    double (*value)(const play_tick *, uint32_t);
    const char *(*name)(const player *, uint32_t);
    uint32_t count;
    page_axis axis;
} graph;

static double joint_value(const play_tick *k, uint32_t j) { return k->value[j]; }
static const char *joint_name(const player *p, uint32_t j) { return p->z->joint[j].name; }
static double force_value(const play_tick *k, uint32_t t) {
    return (double)palp_norm(k->force_N[t]);
}
static const char *force_name(const player *p, uint32_t t) {
    (void)p;
    return t == SCENE_OBJECT ? "object" : "probe";
}
static double level_value(const play_tick *k, uint32_t unused) {
    (void)unused;
    return k->answer.moving.level == PALP_DIAGONAL ? -1 : (double)k->answer.moving.level;
}
static const char *level_name(const player *p, uint32_t unused) {
    (void)p;
    (void)unused;
    return "seam level (-1: block diagonal)";
}
static double time_value(const play_tick *k, uint32_t which) {
    return which == 0 ? k->budget_us_used : k->wall_us;
}
static const char *time_name(const player *p, uint32_t which) {
    return which == 1 ? "wall clock" : p->spec->wall ? "asked" : "by operations counted";
}
static double active_value(const play_tick *k, uint32_t unused) {
    (void)unused;
    return (double)k->answer.active;
}
static const char *active_name(const player *p, uint32_t unused) {
    (void)p;
    (void)unused;
    return "points in contact";
}

static void draw(page *to, const player *p, const graph *g) {
    page_chart(to, g->title, g->word, g->unit, g->axis);
    for (uint32_t k = 0; k < g->count; k++) {
        if (g->value == force_value && !p->s->has[k]) continue;
        const curve c = {p, g->value, k};
        const page_curve_spec spec = {g->name(p, k), 0, 1 / p->s->rate_hz, p->ticks,
                                      g->axis == PAGE_WHOLE};
        page_curve(to, &spec, curve_value, &c);
    }
}

static void write_report(const player *p, const char *path) {
    const graph graphs[] = {
        {"Force", "On each tool", "N", force_value, force_name, SCENE_TRACKS, PAGE_ZERO},
        {"Joint values", "As the scene says", "rad or m", joint_value, joint_name,
         p->z->meta->joints, PAGE_FREE},
        {"Level of the seams", "How many of their modes are solved for; -1: block diagonal", "",
         level_value, level_name, 1, PAGE_WHOLE},
        {"Contact", "Points that carry force", "points", active_value, active_name, 1, PAGE_WHOLE},
        {"Time of a tick", "By the clock that budgets it, and by this machine's", "us", time_value,
         time_name, 2, PAGE_ZERO}};
    output out = open_output(path);
    page to;
    page_begin(&to, out.file, p->spec->blob);
    page_lines(&to, summary, p);
    page_curves(&to);
    for (size_t i = 0; i < sizeof graphs / sizeof graphs[0]; i++) draw(&to, p, &graphs[i]);
    page_events(&to);
    page_end(&to, &(page_rest){.motion = &p->motion});
    commit_output(&out);
}

static int ascending(const void *a, const void *b) {
    double p = *(const double *)a, q = *(const double *)b;
    return (p > q) - (p < q);
}

percentiles percentiles_of(double *x, size_t count) {
    qsort(x, count, sizeof *x, ascending);
    return (percentiles){x[count / 2], x[(count - 1) * 99 / 100], x[count - 1]};
}

double play_budget_us(const play_spec *s, double rate_hz) {
    double period = 1e6 / rate_hz, budget = s->budget_us > 0 ? s->budget_us : 0.8 * period;
    if (budget > period)
        die(EXIT_USAGE, "--budget-us: %g us is longer than the period, %g us", budget, period);
    return budget;
}

void play_print_machine(FILE *f, const play_spec *s) {
    fprintf(f, "machine               %s: %.3g ns an instruction, %.3g ns a byte (%s)\n",
            s->machine.target.name, (double)s->machine.ns_per_instruction,
            (double)s->machine.ns_per_byte, s->machine.basis);
}

/* Which options go with which kind of model. */
static void check_options(play_spec *s, bool dynamic) {
    bool of_dynamic = s->material != NULL || s->young_Pa >= 0 || s->poisson > -1 ||
                      s->damping_s >= 0 || s->drag_per_s >= 0 || s->uniform || s->refine_share > 0;
    if (of_dynamic && !dynamic)
        die(EXIT_USAGE,
            "--material, --young, --poisson, --damping, --drag, --uniform and --refine are for "
            "dynamic bodies; %s is a multizone model",
            s->blob);
    if (s->alone && dynamic)
        die(EXIT_USAGE, "--no-pairs is for multizone models; %s is a dynamic body", s->blob);
    if (!dynamic && s->finest >= PALP_SEAM_LEVELS)
        die(EXIT_USAGE, "--finest: seams have the levels 0 to %u", PALP_SEAM_LEVELS - 1);
    machine_choose(&s->machine, s->target, s->ns_per_operation);
    s->most_class = s->finest_given ? s->finest : PALP_STEP_CLASSES - 1;
}

int command_play(int argc, char **argv) {
    play_spec s = {.finest = 4, .young_Pa = -1, .poisson = -1, .damping_s = -1, .drag_per_s = -1};
    args_parse(argc, argv, options, help, set_option, &s);
    if (s.blob == NULL) die(EXIT_USAGE, "no blob named (--help shows the usage)");
    if (scene_is_here(s.blob)) {
        if (s.scene != NULL || s.wall || s.alone || s.finest_given || s.material != NULL ||
            s.uniform)
            die(EXIT_USAGE, "--scene, --clock wall, --no-pairs, --finest, --material and --uniform "
                            "go with a blob: a scene says these itself");
        machine_choose(&s.machine, s.target, s.ns_per_operation);
        return play_scene(&s, scene_read(s.blob));
    }
    if (s.scene == NULL) die(EXIT_USAGE, "no scene: add --scene FILE");
    size_t bytes;
    char *data = read_file(s.blob, &bytes);
    bool dynamic = palp_tets_are_here(data, bytes);
    if (!dynamic && !palp_zones_are_here(data, bytes))
        die(EXIT_WORK, "%s: neither a multizone model nor a dynamic body", s.blob);
    check_options(&s, dynamic);
    if (dynamic) return play_dynamic(&s, data, bytes);
    player *p = allocate(1, sizeof *p);
    p->spec = &s;
    p->z = open_zones(s.blob, data, bytes);
    p->s = scene_read(s.scene);
    scene_joints(&p->s->body[0], p->z, p->joint);
    open_player(p);
    run(p);
    if (p->ticks == 0) die(EXIT_USAGE, "%s: not one tick in its time", s.scene);
    summary(stdout, p);
    if (s.csv != NULL) write_csv(p, s.csv);
    if (s.report != NULL) write_report(p, s.report);
    return late_ticks(p) > 0 && !s.wall ? EXIT_WORK : EXIT_SUCCESS;
}
