/* SPDX-License-Identifier: MIT */
#include "calibrate.h"
#include "args.h"
#include "commands.h"
#include "build.h"
#include "semireg.h"
#include "util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define ROUNDS 5
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

/* Interrupted samples are not the machine's speed: the 90th percentile leaves them out. */
static double typical(double *sample, size_t count) {
    qsort(sample, count, sizeof *sample, compare);
    return count > 0 ? sample[(size_t)(0.9 * (double)(count - 1))] : 0;
}

/* One press of the tool, sunk in step by step: ns per unit of the bound, of each admission and of
 * each solve. */
typedef struct {
    palp_node_contact contact;
    palp_touch_cost instructions, bytes;
    palp_fresh *fresh;
    const palp_tool *tool;
    palp_vec3 x, n;
    palp_rung rung;
    uint8_t *other; /* what caches are filled with */
    double *admit, *solve;
    size_t admits, solves, most;
} bench;

static void chill(bench *b) {
    for (size_t i = 0; b->other != NULL && i < COLD_BYTES; i += 64) b->other[i]++;
}

/* Time beyond the bound of instructions at `ns_per_instruction`, over the bytes; or, when that is
 * 0, over the instructions. */
static double share(double ns, double instructions, double bytes, double ns_per_instruction) {
    if (ns_per_instruction > 0) return fmax(ns - instructions * ns_per_instruction, 0) / bytes;
    return ns / instructions;
}

static void press(bench *b, double ns_per_instruction) {
    float size = palp_tool_size(b->tool);
    palp_node_contact *c = &b->contact;
    palp_node_contact_clear(c, b->rung.level);
    for (int step = 0; step < STEPS; step++) {
        palp_vec3 center = palp_madd(b->x, size * (1.0f - 0.01f * (float)step), b->n);
        uint32_t count = palp_node_contact_search(c, &center, b->fresh);
        for (uint32_t i = 0; i < count; i++) {
            uint32_t k = c->count, n = c->active_count;
            chill(b);
            double start = clock_ns();
            palp_node_contact_admit(c, b->fresh[i]);
            double ns = clock_ns() - start;
            if (b->admits == b->most) continue;
            b->admit[b->admits++] =
                share(ns, (double)palp_cost_admit(&b->instructions, b->rung, k, n),
                      (double)palp_cost_admit(&b->bytes, b->rung, k, n), ns_per_instruction);
        }
        palp_grip grip = {.held_m = center, .stiffness_N_per_m = 1000.0f};
        chill(b);
        double start = clock_ns();
        (void)palp_node_contact_solve(c, center, grip);
        double ns = clock_ns() - start, instructions, bytes;
        float pivots = (float)c->pivots;
        instructions =
            (double)(palp_cost_begin(&b->instructions, c->count) +
                     pivots * palp_cost_pivot(&b->instructions, c->count, c->active_count));
        bytes = (double)(palp_cost_begin(&b->bytes, c->count) +
                         palp_cost_pivot(&b->bytes, c->count, c->active_count));
        if (b->solves < b->most)
            b->solve[b->solves++] = share(ns, instructions, bytes, ns_per_instruction);
    }
}

static double slowest(bench *b, int rounds, double ns_per_instruction) {
    b->admits = b->solves = 0;
    for (int round = 0; round < rounds; round++) press(b, ns_per_instruction);
    return fmax(typical(b->admit, b->admits), typical(b->solve, b->solves));
}

void calibrate(machine *m, const palp_blob *blob, palp_node_contact_limits limits, const palp_tool *tool,
               uint32_t node, bool cold) {
    const palp_target *target = machine_of_this_build();
    uint32_t level = blob->meta->constraint_level;
    machine_find(m, target != NULL ? target->name : palp_target_counted.name);
    bench b = {.instructions = palp_touch_cost_of(blob, limits, tool, 1, &m->target.instructions),
               .bytes = palp_touch_cost_of(blob, limits, tool, 1, &palp_bytes_touched),
               .fresh = allocate(limits.max_candidates, sizeof *b.fresh),
               .tool = tool,
               .x = palp_vec3_at(blob->rest_m + 3 * node),
               .n = palp_vec3_at(blob->normal + 3 * node),
               .rung = {level, level},
               .most = ROUNDS * STEPS * (size_t)limits.max_candidates};
    b.admit = allocate(b.most, sizeof *b.admit);
    b.solve = allocate(b.most, sizeof *b.solve);
    size_t bytes = palp_node_contact_memsize(blob, limits);
    void *memory = allocate_aligned(bytes, 1);
    if (palp_node_contact_init(&b.contact, blob, blob->rest_m, tool, 1, limits, memory, bytes) !=
        PALP_OK)
        die(EXIT_WORK, "the contact limits are unsound");
    double warm = slowest(&b, ROUNDS, 0);
    m->ns_per_instruction = (float)(CALIBRATE_SAFETY * warm);
    m->ns_per_byte = 0;
    if (cold) {
        b.other = allocate(COLD_BYTES, 1);
        m->ns_per_byte = (float)(CALIBRATE_SAFETY * slowest(&b, 1, warm));
    }
    snprintf(m->basis, sizeof m->basis, "measured here, times %g", CALIBRATE_SAFETY);
    free(b.other);
    free(memory);
    free(b.solve);
    free(b.admit);
    free(b.fresh);
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
    build_options options = {.wavelet = {.lifted = true}, .compress = {.epsilon = 0.05}};
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
    calibrate(&m, &blob, PALP_NODE_CONTACT_DEFAULTS, &tool, node, true);
    if (machine_of_this_build() == NULL)
        warn("no instruction counts are shipped for this machine: the table counts operations");
    machine_write(out.file, &m);
    commit_output(&out);
    return EXIT_SUCCESS;
}
