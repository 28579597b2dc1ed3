/* SPDX-License-Identifier: MIT */
#include "port/host/calibrate.h"
#include "core/contact/cost.h"
#include "port/host/opencontact.h"
#include "port/host/util.h"
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

static void tick(bench *b, palp_vec3 place) {
    const palp_frame at = palp_frame_at(place);
    palp_contact *c = b->contact;
    const palp_contact_cost *i = &b->instructions, *y = &b->bytes;
    const palp_contact_level l = palp_contact_level_of(c->now, i->modes);
    const palp_contact_spring held = {.held = at, .stiffness_N_per_m = 1000.0f};
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
        end(b, ITERATE, palp_contact_cost_iterate(i, count, active, 1),
            palp_contact_cost_iterate(y, count, active, 1));
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
    bench b = {.contact = contact_open(blob, tool, 1, PALP_CONTACT_FINEST),
               .instructions = palp_contact_cost_of(blob, tool, 1, &m->target.instructions),
               .x = palp_vec3_at(blob->rest_m + 3 * node),
               .n = palp_vec3_at(blob->normal + 3 * node),
               .size = palp_tool_size(tool),
               .most = ROUNDS * STEPS * (PALP_CONTACT_ITERATIONS + 1)};
    b.bytes = palp_contact_cost_at(&b.instructions, tool, &palp_bytes_touched);
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
    contact_close(b.contact);
}
