/* SPDX-License-Identifier: MIT */
/* Cases of every operation, random and found by search, each counted and held against its bound. */
#ifndef PALP_TESTS_CASES_H
#define PALP_TESTS_CASES_H

#include "core/green/cost.h"
#include "core/palp.h"
#include "tests/wcet/instructions.h"
#include "tools/wcet/tool_path.h"

/* What a bound is made of: how many of each kind of work (the bound at unit prices). */
typedef struct {
    float count[PALP_WORKS];
} features;

/*
 * One run of cases. Every case is told as operation, level (constraint level, or what stands for
 * it), instructions counted, and either its bound at `price` or, without one, the features of its
 * bound. Memory is taken from one block and given back by setting `used`.
 */
typedef struct cases {
    uint8_t *memory;
    size_t bytes, used;
    const palp_prices *price;
    void (*sink)(struct cases *c, const char *operation, uint32_t level, const features *f,
                 float bound, uint64_t counted);
} cases;
void *cases_take(cases *c, size_t bytes);

/* How many prices bounds are to be had at, and which: the one given, or one of each kind. */
static inline uint32_t cases_prices(const cases *c) { return c->price != NULL ? 1u : PALP_WORKS; }
static inline palp_prices cases_price(const cases *c, uint32_t k) {
    palp_prices one = {{0}};
    if (c->price != NULL) return *c->price;
    one.of[k] = 1.0f;
    return one;
}
/* Tells of a case by its bound at each of those. */
typedef float (*bound_at)(const void *what, uint32_t k);
static inline void cases_tell(cases *c, const char *operation, uint32_t level, bound_at bound,
                              const void *what, uint64_t counted) {
    features f = {{0}};
    if (c->price != NULL) {
        c->sink(c, operation, level, NULL, bound(what, 0), counted);
        return;
    }
    for (uint32_t k = 0; k < PALP_WORKS; k++) f.count[k] = bound(what, k);
    c->sink(c, operation, level, &f, 0.0f, counted);
}
/* The same of features written down. */
static inline void cases_tell_features(cases *c, const char *operation, uint32_t level,
                                       const features *f, uint64_t counted) {
    float bound = 0.0f;
    for (uint32_t k = 0; c->price != NULL && k < PALP_WORKS; k++)
        bound += f->count[k] * c->price->of[k];
    c->sink(c, operation, level, f, bound, counted);
}

/* A tick of contact, step by step, tools at[] on their springs; `unit`: its costs at unit prices.
 */
void cases_of_tick(cases *c, palp_contact *contact, const palp_contact_cost *unit,
                   const palp_frame *at, const palp_contact_spring *spring);

/* Contact on the surface: tools, levels and places of all kinds. */
void cases_of_surface(cases *c, const palp_blob *blob, uint64_t seed, uint32_t episodes);
/* Whole ticks of the bounded answer and of the servo. */
void cases_of_ticks(cases *c, const palp_blob *blob, uint64_t seed, uint32_t episodes);
/* Columns, rows and transforms of a blob. */
void cases_of_green(cases *c, const palp_blob *blob, uint64_t seed, uint32_t rounds);
/* Factors, solves and contact of a multizone model; a body that moves. */
void cases_of_zones(cases *c, const void *data, size_t bytes, uint64_t seed, uint32_t rounds);
void cases_of_dyna(cases *c, const palp_tets *tets, uint64_t seed, uint32_t episodes);

#endif
