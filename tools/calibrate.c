/* SPDX-License-Identifier: MIT */
#include "calibrate.h"
#include "args.h"
#include "commands.h"
#include "build.h"
#include "core/contact/cost.h"
#include "press.h"
#include "semireg.h"
#include "util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define ROUNDS 8
#define STEPS 64
#define COLD_BYTES (64u << 20) /* beyond the last cache of what haptics runs on */

static double clock_ns(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

static int compare(const void *a, const void *b) {
    double p = *(const double *)a, q = *(const double *)b;
    return (p > q) - (p < q);
}

/* Of the same work done over and over, in rounds of `count` samples, the least is the machine's own
 * speed: nothing came between. Of different work the upper quartile is taken. */
static double typical(double *sample, size_t count, size_t rounds) {
    if (count == 0) return 0;
    for (size_t i = 0; i < count; i++) {
        for (size_t r = 1; r < rounds; r++) sample[i] = fmin(sample[i], sample[r * count + i]);
    }
    qsort(sample, count, sizeof *sample, compare);
    return sample[(size_t)(0.75 * (double)(count - 1))];
}

/* The steps of a tick of contact. */
enum { FILL, POINTS, ASSEMBLE, ITERATE, FINISH, PARTS };

/* Presses of the tool, sunk in step by step: ns per unit of the bound, of each step. */
typedef struct {
    palp_contact *contact;
    palp_contact_cost instructions, bytes;
    palp_vec3 x, n;
    float size;
    uint8_t *other;            /* what caches are filled with; NULL: left warm */
    double ns_per_instruction; /* 0: to be measured; then the bytes are */
    double *sample[PARTS];
    size_t samples[PARTS], most;
    double start_ns;
} bench;

static void begin(bench *b) {
    for (size_t i = 0; b->other != NULL && i < COLD_BYTES; i += 64) b->other[i]++;
    b->start_ns = clock_ns();
}

/* Time beyond the bound of instructions over the bytes; or, when their price is to be measured,
 * all of it over the instructions. */
static void end(bench *b, int part, float instructions, float bytes) {
    double ns = clock_ns() - b->start_ns, known = b->ns_per_instruction;
    if (b->samples[part] == b->most) return;
    b->sample[part][b->samples[part]++] =
        known > 0 ? fmax(ns - (double)instructions * known, 0) / (double)bytes
                  : ns / (double)instructions;
}

static void tick(bench *b, palp_vec3 at) {
    palp_contact *c = b->contact;
    const palp_contact_cost *i = &b->instructions, *y = &b->bytes;
    const palp_contact_level l = palp_contact_level_of(c->now, i->modes);
    const palp_contact_spring held = {.held_m = at, .stiffness_N_per_m = 1000.0f};
    bool more = true;
    palp_contact_begin(c, &at, &held);
    while (more) {
        begin(b);
        more = palp_contact_fill(c);
        end(b, FILL, palp_contact_cost_filled(i, c->done), palp_contact_cost_filled(y, c->done));
    }
    begin(b);
    uint32_t count = palp_contact_points(c);
    if (count == 0) return;
    end(b, POINTS, palp_contact_cost_points(i, l, count), palp_contact_cost_points(y, l, count));
    begin(b);
    while (palp_contact_assemble(c)) {}
    end(b, ASSEMBLE, palp_contact_cost_assemble(i, l, count),
        palp_contact_cost_assemble(y, l, count));
    do {
        uint32_t active = c->active_count;
        begin(b);
        more = palp_contact_iterate(c);
        active = c->active_count > active ? c->active_count : active;
        end(b, ITERATE, palp_contact_cost_iterate(i, count, active),
            palp_contact_cost_iterate(y, count, active));
    } while (more);
    begin(b);
    palp_contact_finish(c);
    end(b, FINISH, palp_contact_cost_finish(i, l, count, c->active_count),
        palp_contact_cost_finish(y, l, count, c->active_count));
}

/* Of the slowest step. */
static double slowest(bench *b, int rounds) {
    double most = 0;
    for (int p = 0; p < PARTS; p++) b->samples[p] = 0;
    for (int round = 0; round < rounds; round++) {
        palp_contact_clear(b->contact);
        for (int step = 0; step < STEPS; step++)
            tick(b, palp_madd(b->x, b->size * (1.0f - 0.01f * (float)step), b->n));
    }
    for (int p = 0; p < PARTS; p++) {
        const size_t each = b->samples[p] / (size_t)rounds;
        const bool same = each * (size_t)rounds == b->samples[p]; /* the work of every round */
        most = fmax(most,
                    typical(b->sample[p], same ? each : b->samples[p], same ? (size_t)rounds : 1));
    }
    return most;
}

void calibrate(machine *m, const palp_blob *blob, const palp_tool *tool, uint32_t node, bool cold) {
    const palp_target *target = machine_of_this_build();
    machine_find(m, target != NULL ? target->name : palp_target_counted.name);
    bench b = {.contact = press_open(blob, tool, 1, PALP_CONTACT_FINEST),
               .instructions = palp_contact_cost_of(blob, tool, 1, &m->target.instructions),
               .bytes = palp_contact_cost_of(blob, tool, 1, &palp_bytes_touched),
               .x = palp_vec3_at(blob->rest_m + 3 * node),
               .n = palp_vec3_at(blob->normal + 3 * node),
               .size = palp_tool_size(tool),
               .most = ROUNDS * STEPS * (PALP_CONTACT_ITERATIONS + 1)};
    for (int p = 0; p < PARTS; p++) b.sample[p] = allocate(b.most, sizeof *b.sample[p]);
    double warm = slowest(&b, ROUNDS);
    m->ns_per_instruction = (float)(CALIBRATE_SAFETY * warm);
    m->ns_per_byte = 0;
    if (cold) {
        b.other = allocate(COLD_BYTES, 1);
        b.ns_per_instruction = warm;
        m->ns_per_byte = (float)(CALIBRATE_SAFETY * slowest(&b, 2));
    }
    snprintf(m->basis, sizeof m->basis, "measured here, times %g", CALIBRATE_SAFETY);
    for (int p = 0; p < PARTS; p++) free(b.sample[p]);
    free(b.other);
    press_close(b.contact);
}

/* ---- palp calibrate ---- */

/* A rounded cube of 386 nodes, held below: a body to touch that needs no file. */
static palp_blob sample_blob(void) {
    static const uint32_t quad[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                        {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
    mesh m = {.vertices = 8, .triangles = 12};
    m.x = allocate(8, sizeof *m.x);
    m.t = allocate(12, sizeof *m.t);
    for (uint32_t i = 0; i < 8; i++) {
        for (uint32_t k = 0; k < 3; k++) m.x[i][k] = 0.05 * (double)(i >> k & 1u);
    }
    for (uint32_t i = 0; i < 12; i++) {
        for (uint32_t k = 0; k < 3; k++) m.t[i][k] = quad[i / 2][k == 0 ? 0 : k + i % 2];
    }
    for (uint32_t l = 0; l < 3; l++) {
        mesh finer = subdivide_loop(&m);
        mesh_free(&m);
        m = finer;
    }
    const bem_material material = {.young_Pa = 1e4, .poisson = 0.4, .tolerance = BEM_TOLERANCE};
    uint8_t *fixed = allocate(m.vertices, 1);
    double *area = allocate(m.vertices, sizeof *area);
    double(*normal)[3] = allocate(m.vertices, sizeof *normal);
    for (uint32_t i = 0; i < m.vertices; i++) fixed[i] = m.x[i][2] <= 0.01;
    mesh_nodal(&m, area, normal);
    build_options options = {
        .wavelet = {.lifted = true}, .compress = {.epsilon = 0.05}, .modes = BUILD_MODES};
    domains d = domains_build(&m, fixed, area, options.wavelet);
    options.constraint_level = d.domain[PALP_FREE].view.levels - 1;
    greens g = greens_from_bem(&m, fixed, &material, 1000);
    greens_reciprocity(&g, &m, true);
    palp_meta meta = {.young_Pa = 1e4f, .poisson = 0.4f, .density_kg_m3 = 1000};
    built made = blob_build(&m, &g, &d, area, normal, meta, &options);
    return open_blob("the sample body", made.bytes, made.size);
}

static const char help[] =
    "usage: palp calibrate [-o FILE]\n"
    "\n"
    "Measures how fast this machine does what the cost bounds count, warm and with cold caches, "
    "and\n"
    "writes a cost table for 'palp wcet --target FILE' (default: standard output). Instructions "
    "are\n"
    "those of the target that this program was built for; only the speed is measured.\n";
static const option options[] = {{"-o", 1}, {NULL, 0}};

static void set_option(void *context, const argument *a) {
    const char **path = context;
    if (a->option == NULL) die(EXIT_USAGE, "what is '%s'? (palp calibrate --help)", a->value[0]);
    *path = a->value[0];
}

int command_calibrate(int argc, char **argv) {
    const char *path = "-";
    machine m;
    args_parse(argc, argv, options, help, set_option, &path);
    palp_blob blob = sample_blob();
    palp_tool tool = palp_tool_sphere(6 * blob.meta->mean_edge_m);
    uint32_t node = blob.domain[PALP_FREE].node[blob.domain[PALP_FREE].slots / 2u];
    output out = open_output(path);
    calibrate(&m, &blob, &tool, node, true);
    if (machine_of_this_build() == NULL)
        warn("no instruction counts are shipped for this machine: the table counts operations");
    machine_write(out.file, &m);
    commit_output(&out);
    return EXIT_SUCCESS;
}
