/* SPDX-License-Identifier: MIT */
/* palp wcet: what every step of a tick costs at most on a target, and whether that is in time. */
#include "port/host/args.h"
#include "port/host/blobfile.h"
#include "port/host/devfile.h"
#include "tools/wcet/tool_path.h"
#include "port/host/machine.h"
#include "port/host/util.h"
#include "core/servo/answer.h"
#include "tools/wcet/scene_bounds.h"
#include "tools/wcet/wcet.h"
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const char help[] =
    "usage: palp wcet BLOB|SCENE [--rate HZ] [--target NAME|FILE] [--limits K N NEW PIVOTS] "
    "[--friction]\n"
    "                      [--tool ball|pad|cylinder] [--margin SHARE] [--hunt SECONDS] [--keep "
    "FILE]\n"
    "                      [--replay FILE] [--json]\n"
    "\n"
    "What each step of a tick costs at most on each constraint level, in instructions, bytes "
    "touched and\n"
    "time, and whether a servo at this rate is opened (the least answer fits) or refused.\n"
    "\n"
    "  --rate HZ         default 1000, or as the scene says\n"
    "  --target          x86-64, x86-64-avx2, cortex-a53, cortex-m7, or a file of palp calibrate;\n"
    "                    default: what this program was built for\n"
    "  --ns-per-operation N   instead: an assumed machine, N ns for each operation that the code "
    "counts;\n"
    "                    palp play runs on the same\n"
    "  --limits          of contact at nodes, which older versions had: left aside\n"
    "  --friction        keep what friction needs\n"
    "  --tool            what touches (default ball)\n"
    "  --tool-radius M   its size (default: two mean edges; of a dynamic body a twentieth of its "
    "length)\n"
    "  --tools N         how many of them, 1 to 4 (default 1)\n"
    "  --device NAME|FILE  which gives the frames and axes of a servo with one tool (default "
    "arm3)\n"
    "  --margin SHARE    of the period that belongs to the tick (default 0.8)\n"
    "  --hunt SECONDS    search for the most expensive tick: how near to the bound work can come\n"
    "  --keep FILE       write the path of the most expensive tick found\n"
    "  --replay FILE     go along that path again and print what its ticks did\n"
    "  --json            for programs\n"
    "\n"
    "The verdict is the answer and no failure: exit 0 for 'fits' and for 'refused'.\n";

static const option options[] = {{"--rate", 1},     {"--target", 1},      {"--limits", 4},
                                 {"--friction", 0}, {"--tool", 1},        {"--margin", 1},
                                 {"--hunt", 1},     {"--keep", 1},        {"--replay", 1},
                                 {"--json", 0},     {"--tools", 1},       {"--ns-per-operation", 1},
                                 {"--device", 1},   {"--tool-radius", 1}, {NULL, 0}};

static void set_option(void *context, const argument *a) {
    static const char *const tools[] = {"ball", "pad", "cylinder", NULL};
    wcet_spec *s = context;
    if (a->option == NULL) {
        if (s->blob != NULL) die(EXIT_USAGE, "one blob, not also '%s'", a->value[0]);
        s->blob = a->value[0];
    } else if (strcmp(a->option, "--rate") == 0) {
        s->rate_hz = arg_between(a, 0, 1e9);
    } else if (strcmp(a->option, "--target") == 0) {
        s->target = a->value[0];
    } else if (strcmp(a->option, "--ns-per-operation") == 0) {
        s->ns_per_operation = arg_between(a, 0, 1e6);
    } else if (strcmp(a->option, "--tool-radius") == 0) {
        s->radius_m = arg_between(a, 0, 1);
    } else if (strcmp(a->option, "--device") == 0) {
        s->device = a->value[0];
    } else if (strcmp(a->option, "--tools") == 0) {
        s->tools = arg_u32(a, 0, 1, PALP_CONTACT_TOOLS);
    } else if (strcmp(a->option, "--limits") == 0) {
        s->limited = true;
        (void)arg_u32(a, 1, 1, arg_u32(a, 0, 1, 1000000));
        (void)arg_u32(a, 2, 1, 1000000);
        (void)arg_u32(a, 3, 1, 1000000);
    } else if (strcmp(a->option, "--friction") == 0) {
        s->friction = true;
    } else if (strcmp(a->option, "--tool") == 0) {
        s->tool = (wcet_tool)arg_word(a, tools);
    } else if (strcmp(a->option, "--margin") == 0) {
        s->margin = arg_upto(a, 1);
        if (!(s->margin > 0)) die(EXIT_USAGE, "--margin: above 0 and at most 1");
    } else if (strcmp(a->option, "--hunt") == 0) {
        s->search_s = arg_between(a, 0, 1e6);
    } else if (strcmp(a->option, "--keep") == 0) {
        s->keep = a->value[0];
    } else if (strcmp(a->option, "--replay") == 0) {
        s->replay = a->value[0];
    } else {
        s->json = true;
    }
}

/* ---- one row of the table ---- */

void wcet_add(wcet_table *t, const char *step, const char *counts, int level, int outer,
              double instructions, double bytes) {
    t->row = grow(t->row, &t->capacity, t->rows + 1, sizeof *t->row);
    wcet_row *r = &t->row[t->rows++];
    *r = (wcet_row){.level = level, .outer = outer, .instructions = instructions, .bytes = bytes};
    snprintf(r->step, sizeof r->step, "%s", step);
    snprintf(r->counts, sizeof r->counts, "%s", counts);
}

/* ---- one body ---- */

static palp_tool tool_of(const wcet_spec *s, float size) {
    palp_tool t = palp_tool_sphere(size);
    if (s->tool == WCET_BALL) return t;
    if (s->tool == WCET_PAD) {
        t.shape = PALP_TOOL_PAD;
        t.pad = (palp_pad){.axis = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                           .half_m = {size, size},
                           .edge_m = 0.3f * size};
    } else {
        t.shape = PALP_TOOL_CYLINDER;
        t.cylinder = (palp_cylinder){
            .axis = {0, 0, 1}, .radius_m = size, .half_m = size, .rim_m = 0.3f * size};
    }
    return t;
}

/* As many of them as asked for. */
static void choose_tools(const wcet_spec *s, float size, palp_tool tool[PALP_CONTACT_TOOLS]) {
    for (uint32_t t = 0; t < s->tools; t++) {
        tool[t] = tool_of(s, s->radius_m > 0 ? (float)s->radius_m : size);
        tool[t].friction = s->friction ? 0.3f : 0.0f;
    }
}

/* The steps of a tick on one level of contact, and all of them. */
typedef struct {
    palp_contact_level level;
    uint32_t number;
} body_level;

typedef float (*body_bound)(const palp_contact_cost *c, const body_level *l);

static float fill(const palp_contact_cost *c, const body_level *l) {
    return palp_contact_cost_fill(c, l->level);
}
static float points(const palp_contact_cost *c, const body_level *l) {
    return palp_contact_cost_points(c, l->level, l->level.points);
}
static float assemble(const palp_contact_cost *c, const body_level *l) {
    return palp_contact_cost_assemble(c, l->level, l->level.points);
}
static float iterate(const palp_contact_cost *c, const body_level *l) {
    return palp_contact_cost_iterate(c, l->level.points, l->level.contacts, 1);
}
static float finish(const palp_contact_cost *c, const body_level *l) {
    return palp_contact_cost_finish(c, l->level, l->level.points, l->level.contacts);
}
static float least(const palp_contact_cost *c, const body_level *l) {
    return palp_answer_cost_least(c, l->number);
}
static float tick(const palp_contact_cost *c, const body_level *l) {
    return palp_answer_cost_full(c, l->number);
}

/* Contact on each level, in instructions and bytes; what seams or a servo add to an answer that is
 * always in time, and to a whole tick. The last row is the least answer. */
static void bound_levels(const palp_contact_cost c[2], const palp_contact_cost at_least[2],
                         const double always[2], const double whole[2], wcet_table *t) {
    static const struct {
        const char *step;
        body_bound of;
    } steps[] = {{"fill", fill},       {"points", points}, {"assemble", assemble},
                 {"iterate", iterate}, {"finish", finish}, {"always", least},
                 {"tick", tick}};
    for (uint32_t n = 0; n <= PALP_CONTACT_FINEST; n++) {
        const palp_contact_level level = palp_contact_cost_level(&c[0], n);
        const body_level l = {level, n};
        char counts[64];
        snprintf(counts, sizeof counts, "%u points, %u in contact, %u modes", level.points,
                 level.contacts, level.modes);
        for (size_t i = 0; i < sizeof steps / sizeof steps[0]; i++) {
            double sum[2];
            for (int k = 0; k < 2; k++) {
                sum[k] = (double)steps[i].of(steps[i].of == least ? &at_least[k] : &c[k], &l);
                if (steps[i].of == least) sum[k] += always[k];
                if (steps[i].of == tick) sum[k] += whole[k];
            }
            wcet_add(t, steps[i].step, counts, (int)n, (int)n, sum[0], sum[1]);
        }
    }
    const body_level coarsest = {.number = 0};
    wcet_add(t, "least", "one filling, three iterations on the coarsest level", 0, 0,
             (double)least(&at_least[0], &coarsest) + always[0],
             (double)least(&at_least[1], &coarsest) + always[1]);
}

static void bound_body(const wcet_spec *s, const machine *m, const palp_blob *blob, wcet_table *t) {
    if (palp_blob_has(blob, PALP_META_SCALAR))
        die(EXIT_WORK, "%s: a scalar problem: there is nothing to touch", s->blob);
    if (blob->meta->modes == 0)
        die(EXIT_WORK, "%s: has no regular part, which contact needs: bake it again", s->blob);
    palp_tool tool[PALP_CONTACT_TOOLS];
    choose_tools(s, 2 * blob->meta->mean_edge_m, tool);
    const palp_contact_cost instructions =
        palp_contact_cost_of(blob, tool, s->tools, &m->target.instructions);
    const palp_contact_cost c[2] = {instructions,
                                    palp_contact_cost_at(&instructions, tool, &palp_bytes_touched)};
    const device_file file = device_load(s->device != NULL ? s->device : "arm3");
    double servo[2] = {0, 0}; /* which has one tool */
    for (int k = 0; k < 2 && s->tools == 1; k++)
        servo[k] = (double)(palp_servo_cost_before(&c[k].price, &file.device) +
                            palp_servo_cost_after(&c[k].price, &file.device));
    bound_levels(c, c, servo, servo, t);
    t->ram_bytes = s->tools == 1
                       ? palp_servo_memsize(blob, PALP_CONTACT_FINEST)
                       : palp_answer_memsize(&(palp_contact_config){
                             .blob = blob, .tool_count = s->tools, .finest = PALP_CONTACT_FINEST});
    t->stack_bytes = PALP_SERVO_STACK;
}

/* ---- a multizone model ---- */

static void bound_zones(const wcet_spec *s, const machine *m, const void *data, size_t bytes,
                        wcet_table *t) {
    static palp_zones z;
    static palp_assembly a;
    const palp_prices *price[2] = {&m->target.instructions, &palp_bytes_touched};
    const uint32_t finest = PALP_SEAM_LEVELS - 1u;
    palp_status status = palp_zones_open(&z, data, bytes);
    if (status != PALP_OK) die_of_blob(s->blob, status, bytes);
    size_t room = palp_assembly_memsize(&z, finest);
    status = palp_assembly_init(&a, &z, finest, allocate_aligned(room, 1), room);
    if (status != PALP_OK) die(EXIT_WORK, "%s: %s", s->blob, palp_status_text(status));
    for (uint32_t i = 0; i < z.meta->zones; i++) {
        if (z.blob[i].meta->modes == 0)
            die(EXIT_WORK, "%s: has no regular part, which contact needs: bake it again", s->blob);
    }
    palp_tool tool[PALP_CONTACT_TOOLS];
    choose_tools(s, 2 * z.blob[0].meta->mean_edge_m, tool);
    palp_contact contact = {.assembly = &a, .pairs = true};
    palp_contact_cost c[2], at_least[2]; /* on the finest seams; on approximate ones */
    palp_moving moving[2];
    for (int k = 0; k < 2; k++) {
        c[k] = palp_contact_cost_of_zones(&a, true, tool, s->tools, price[k]);
        palp_moving_init(&moving[k], &contact, price[k], 1.0f, 0.0f,
                         palp_contact_cost_level(&c[k], PALP_CONTACT_FINEST).contacts);
        const palp_seam_cost *q = &moving[k].seam_cost[PALP_SEAM_LEVELS];
        at_least[k] = c[k];
        at_least[k].unknowns = q->unknowns;
        at_least[k].solve = q->solve;
        at_least[k].forward = q->forward;
    }
    for (uint32_t i = 0; i <= PALP_SEAM_LEVELS; i++) { /* the approximation first */
        const uint32_t at = i == 0 ? PALP_SEAM_LEVELS : i - 1u;
        const palp_seam_cost *one = &moving[0].seam_cost[at], *two = &moving[1].seam_cost[at];
        wcet_add(t, "factor", "all seams", (int)i - 1, (int)i - 1, (double)one->factor,
                 (double)two->factor);
        wcet_add(t, "settle", "all seams", (int)i - 1, (int)i - 1, (double)one->settle,
                 (double)two->settle);
    }
    double always[2] = {(double)palp_moving_least(&moving[0]),
                        (double)palp_moving_least(&moving[1])};
    double seams[2];
    for (int k = 0; k < 2; k++) {
        const palp_seam_cost *q = &moving[k].seam_cost[finest];
        seams[k] = (double)(q->factor + 2.0f * q->settle + 2.0f * q->solve + moving[k].load_ns);
    }
    bound_levels(c, at_least, always, seams, t);
    t->ram_bytes =
        room +
        palp_answer_memsize(&(palp_contact_config){
            .assembly = &a, .pairs = true, .tool_count = s->tools, .finest = PALP_CONTACT_FINEST});
    t->stack_bytes = PALP_SERVO_STACK;
}

/* ---- a dynamic body ---- */

static uint64_t no_clock(void *context) {
    (void)context;
    return 0;
}

static void bound_tets(const wcet_spec *s, const machine *m, const void *data, size_t bytes,
                       wcet_table *t) {
    static palp_dynamic d;
    palp_tets tets;
    const uint32_t points = 64;
    palp_status status = palp_tets_open(&tets, data, bytes);
    if (status != PALP_OK) die_of_blob(s->blob, status, bytes);
    const palp_tets_meta *meta = tets.meta;
    palp_tool tool[PALP_CONTACT_TOOLS];
    choose_tools(s, 0.05f * meta->diagonal_m, tool);
    palp_target bytes_target = {.name = "bytes", .instructions = palp_bytes_touched};
    const palp_target *target[2] = {&m->target, &bytes_target};
    size_t room = palp_dynamic_memsize(&tets, points);
    void *memory = allocate_aligned(room, 1);
    double least[2], adapt[2], tick[2][PALP_STEP_CLASSES], coarse[2];
    for (int k = 0; k < 2; k++) {
        palp_dynamic_config c = {.tets = &tets,
                                 .material = palp_material_of(meta->young_Pa, meta->poisson,
                                                              meta->density_kg_m3, meta->damping_s,
                                                              meta->drag_per_s),
                                 .adapt = palp_adapt_defaults(&tets),
                                 .tools = tool,
                                 .tool_count = s->tools,
                                 .max_points = points,
                                 .most_class = PALP_STEP_CLASSES - 1u,
                                 .cost = {target[k], 1.0f, 0.0f, 1.0f},
                                 .port = {.now_ns = no_clock},
                                 .tick_s = (float)(1 / s->rate_hz)};
        palp_frame at[PALP_CONTACT_TOOLS];
        for (uint32_t i = 0; i < PALP_CONTACT_TOOLS; i++) at[i] = PALP_FRAME_IDENTITY;
        status = palp_dynamic_init(&d, &c, at, memory, room, NULL);
        if (status != PALP_OK && status != PALP_ERR_BUDGET)
            die(EXIT_WORK, "%s: %s", s->blob, palp_status_text(status));
        least[k] = (double)palp_dynamic_cost_least(&d);
        adapt[k] = (double)palp_dynamic_cost_adapt(&d);
        coarse[k] = (double)palp_dynamic_cost_tick(&d, 0);
        palp_dynamic_refine_all(&d);
        for (uint32_t q = 0; q < PALP_STEP_CLASSES; q++)
            tick[k][q] = (double)palp_dynamic_cost_tick(&d, q);
    }
    wcet_add(t, "adapt", "all families, all changes", 0, 0, adapt[0], adapt[1]);
    wcet_add(t, "tick", "coarsest mesh, one step", 0, 0, coarse[0], coarse[1]);
    for (uint32_t q = 0; q < PALP_STEP_CLASSES; q++) {
        char counts[64];
        snprintf(counts, sizeof counts, "finest mesh, %u steps", palp_dyna_steps(&d.dyna, q));
        if (q > 0 && palp_dyna_steps(&d.dyna, q) == palp_dyna_steps(&d.dyna, q - 1u)) break;
        wcet_add(t, "tick", counts, (int)meta->levels - 1, (int)meta->levels - 1, tick[0][q],
                 tick[1][q]);
    }
    wcet_add(t, "least", "coarsest mesh, one step, all merged", 0, 0, least[0], least[1]);
    t->ram_bytes = room;
    t->stack_bytes = PALP_SERVO_STACK;
    free(memory);
}

/* The cycles of each row, from the same table in cycles. */
static void add_cycles(wcet_table *t, const wcet_table *in_cycles) {
    for (size_t i = 0; i < t->rows; i++) t->row[i].cycles = in_cycles->row[i].instructions;
}

/* ---- a scene ---- */

static void bound_scene(wcet_spec *s, const machine *m, wcet_table *t) {
    if (s->tools > 1 || s->friction || s->tool != WCET_BALL || s->device != NULL || s->radius_m > 0)
        die(EXIT_USAGE, "--tool, --tools, --tool-radius, --friction and --device go with a blob: a "
                        "scene says these itself");
    if (s->search_s > 0 || s->replay != NULL)
        die(EXIT_USAGE, "--hunt and --replay are for single bodies at rest");
    scene_file *file = scene_read(s->blob);
    if (s->rate_hz > 0) file->rate_hz = s->rate_hz;
    s->rate_hz = file->rate_hz;
    const scene_setup *setup = scene_set_up(file);
    scene_bounds(setup, m, t);
    if (m->cycles == NULL) return;
    machine in_cycles = *m;
    in_cycles.target = *m->cycles;
    wcet_table of = {.rows = 0};
    scene_bounds(setup, &in_cycles, &of);
    add_cycles(t, &of);
}

/* ---- what comes of it ---- */

static double time_us(const machine *m, const wcet_row *r) {
    const double work = m->cycles != NULL ? r->cycles * (double)m->ns_per_cycle
                                          : r->instructions * (double)m->ns_per_instruction;
    return 1e-3 * (work + r->bytes * (double)m->ns_per_byte);
}

/* The finest level whose `step` is in time; -1 if none is. */
static int finest_in_time(const wcet_table *t, const machine *m, const char *step,
                          double budget_us) {
    int finest = -1;
    for (size_t i = 0; i < t->rows; i++) {
        const wcet_row *r = &t->row[i];
        if (strcmp(r->step, step) == 0 && r->level > finest && time_us(m, r) <= budget_us)
            finest = r->level;
    }
    return finest;
}

static void print_json(const wcet_spec *s, const machine *m, const wcet_table *t, int finest,
                       bool fits) {
    double period_us = 1e6 / s->rate_hz;
    printf(
        "{\"rate_hz\":%.9g,\"period_us\":%.9g,\"target\":\"%s\",\"basis\":\"%s\",\"margin\":%.9g,"
        "\"steps\":[",
        s->rate_hz, period_us, m->target.name, m->basis, s->margin);
    for (size_t i = 0; i < t->rows; i++) {
        const wcet_row *r = &t->row[i];
        printf("%s{\"step\":\"%s\",\"level\":%d,\"outer\":%d,\"counts\":\"%s\","
               "\"instructions_max\":%.0f,\"time_us_max\":%.6g,\"bytes_max\":%.0f,\"share\":%.4g",
               i > 0 ? "," : "", r->step, r->level, r->outer, r->counts, ceil(r->instructions),
               time_us(m, r), ceil(r->bytes), time_us(m, r) / period_us);
        if (m->cycles != NULL) printf(",\"cycles_stated\":%.0f", ceil(r->cycles));
        printf("}");
    }
    printf("],\"ram_bytes\":%zu,\"stack_bytes\":%zu,\"finest_level_in_time\":%d,"
           "\"verdict\":\"%s\"}\n",
           t->ram_bytes, t->stack_bytes, finest, fits ? "fits" : "refused");
}

static void print_text(const wcet_spec *s, const machine *m, const wcet_table *t, int finest,
                       bool fits) {
    double period_us = 1e6 / s->rate_hz;
    const bool cycles = m->cycles != NULL;
    printf("%s at %g Hz on %s: %.3g ns %s, %.3g ns a byte (%s)\n\n", s->blob, s->rate_hz,
           m->target.name, (double)(cycles ? m->ns_per_cycle : m->ns_per_instruction),
           cycles ? "a cycle, of which each instruction takes as many as are stated"
                  : "an instruction",
           (double)m->ns_per_byte, m->basis);
    printf("%-6s %-9s %14s ", "level", "step", "instructions");
    if (cycles) printf("%13s ", "cycles stated");
    printf("%11s %8s %11s  %s\n", "us", "share", "bytes", "with");
    for (size_t i = 0; i < t->rows; i++) {
        const wcet_row *r = &t->row[i];
        char level[16];
        snprintf(level, sizeof level, r->outer != r->level ? "%d/%d" : "%d", r->level, r->outer);
        if (r->level < 0) snprintf(level, sizeof level, "approx");
        printf("%-6s %-9s %14.0f ", level, r->step, ceil(r->instructions));
        if (cycles) printf("%13.0f ", ceil(r->cycles));
        printf("%11.4g %7.1f%% %11.0f  %s\n", time_us(m, r), 100 * time_us(m, r) / period_us,
               ceil(r->bytes), r->counts);
    }
    printf("\nmemory %zu bytes, stack %zu bytes\n", t->ram_bytes, t->stack_bytes);
    if (!fits) {
        printf("refused: the least answer needs %.6g us, %.6g of %.6g us are the tick's\n",
               time_us(m, &t->row[t->rows - 1]), s->margin * period_us, period_us);
    } else if (finest < 0) {
        printf("fits: an answer is always in time; with all that the limits allow it may be cut "
               "short on every level\n");
    } else {
        int always = finest_in_time(t, m, "always", s->margin * period_us);
        if (always > finest)
            printf("fits: an answer is always in time up to level %d, and whole up to level %d\n",
                   always, finest);
        else
            printf("fits: an answer is always in time, and whole up to level %d\n", finest);
    }
}

/* The bounds of what a blob holds. */
static void bound_data(const wcet_spec *s, const machine *m, void *data, size_t bytes,
                       wcet_table *t) {
    if (palp_zones_are_here(data, bytes)) {
        bound_zones(s, m, data, bytes, t);
    } else if (palp_tets_are_here(data, bytes)) {
        bound_tets(s, m, data, bytes, t);
    } else {
        const palp_blob blob = open_blob(s->blob, data, bytes);
        bound_body(s, m, &blob, t);
    }
}

/* What is in a blob; true if its path was replayed instead. */
static bool bound_blob(wcet_spec *s, const machine *m, wcet_table *t) {
    size_t bytes;
    void *data = read_file(s->blob, &bytes);
    const bool zones = palp_zones_are_here(data, bytes), tets = palp_tets_are_here(data, bytes);
    if (!(s->rate_hz > 0)) s->rate_hz = 1000;
    if (s->search_s > 0 && (s->tool != WCET_BALL || s->tools > 1))
        die(EXIT_USAGE, "--hunt goes with a ball");
    if ((zones || tets) && (s->search_s > 0 || s->replay != NULL))
        die(EXIT_USAGE, "--hunt and --replay are for single bodies at rest");
    if (!zones && !tets && s->replay != NULL) {
        const palp_blob blob = open_blob(s->blob, data, bytes);
        const int code = wcet_replay(s, m, &blob);
        if (code != EXIT_SUCCESS) exit(code);
        return true;
    }
    bound_data(s, m, data, bytes, t);
    if (m->cycles != NULL) {
        machine in_cycles = *m;
        in_cycles.target = *m->cycles;
        wcet_table of = {.rows = 0};
        bound_data(s, &in_cycles, data, bytes, &of);
        add_cycles(t, &of);
    }
    if (s->search_s > 0) {
        const palp_blob blob = open_blob(s->blob, data, bytes);
        wcet_search(s, m, &blob);
    }
    return false;
}

int command_wcet(int argc, char **argv) {
    wcet_spec s = {.margin = 0.8, .tools = 1};
    machine m;
    wcet_table t = {.rows = 0};
    args_parse(argc, argv, options, help, set_option, &s);
    if (s.blob == NULL) die(EXIT_USAGE, "which blob? (palp wcet --help)");
    if (s.keep != NULL && !(s.search_s > 0)) die(EXIT_USAGE, "--keep goes with --hunt");
    machine_choose(&m, s.target, s.ns_per_operation);
    if (s.limited) warn("--limits: left aside: contact has levels instead");
    if (s.replay != NULL && (s.search_s > 0 || s.json))
        die(EXIT_USAGE, "--replay prints a table of its own: not with --hunt or --json");
    if (scene_is_here(s.blob))
        bound_scene(&s, &m, &t);
    else if (bound_blob(&s, &m, &t))
        return EXIT_SUCCESS;
    double budget_us = s.margin * 1e6 / s.rate_hz;
    bool fits = time_us(&m, &t.row[t.rows - 1]) <= budget_us;
    (s.json ? print_json : print_text)(&s, &m, &t, finest_in_time(&t, &m, "tick", budget_us), fits);
    return EXIT_SUCCESS;
}
