/* SPDX-License-Identifier: MIT */
/* Cases of every operation, random and hunted, each counted and held against its bound. */
#ifndef PALP_TESTS_CASES_H
#define PALP_TESTS_CASES_H

#include "core/palp.h"
#include "instructions.h"

/* What a bound is made of: how many of each kind of work (the bound at unit prices). */
typedef struct {
    float count[PALP_WORKS];
} features;

/* Told of every case: the operation, the constraint level (or what stands for it), the features of
 * its bound, and the instructions counted. */
typedef void (*case_sink)(const char *operation, uint32_t level, const features *f,
                          uint64_t counted);

/* A generator that is the same everywhere. */
typedef struct {
    uint64_t state;
} dice;
static inline uint32_t dice_roll(dice *d) {
    d->state = d->state * 6364136223846793005ull + 1442695040888963407ull;
    return (uint32_t)(d->state >> 33);
}
static inline uint32_t dice_below(dice *d, uint32_t n) { return dice_roll(d) % n; }
/* -1..1 */
static inline float dice_float(dice *d) { return (float)dice_below(d, 20001) / 10000.0f - 1.0f; }

/* Kept by one run of cases: memory is taken from one block and given back by setting `used`. */
typedef struct {
    uint8_t *memory;
    size_t bytes, used;
    case_sink sink;
} cases;
void *cases_take(cases *c, size_t bytes);

/* `episodes` of contact on a blob, from `seed`: tools, limits, levels and paths of all kinds. */
void cases_of_contact(cases *c, const palp_blob *blob, uint64_t seed, uint32_t episodes);
/* Whole ticks of the bounded answer and of the servo. */
void cases_of_ticks(cases *c, const palp_blob *blob, uint64_t seed, uint32_t episodes);
/* Columns, rows and transforms of a blob. */
void cases_of_green(cases *c, const palp_blob *blob, uint64_t seed, uint32_t rounds);
/* Factors, solves and contact of a multizone model; a body that moves. */
void cases_of_zones(cases *c, const void *data, size_t bytes, uint64_t seed, uint32_t rounds);
void cases_of_dyna(cases *c, const palp_tets *tets, uint64_t seed, uint32_t episodes);

#endif
