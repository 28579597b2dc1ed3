/* SPDX-License-Identifier: MIT */
/*
 * Runs cases. With a BLOB, SEED and EPISODES prints each: operation, level, instructions, and the
 * named counts of its bound. `surface`: of contact on the surface and whole ticks alone. With a
 * TARGET, holds each against its bound there, and prints of each operation and level: cases, most
 * instructions counted, largest bound, the largest share of its bound that a case took, and how
 * many took more than their bound.
 */
#include "tests/wcet/cases.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void *cases_take(cases *c, size_t bytes) {
    uint8_t *p = c->memory + c->used;
    c->used += (bytes + 63u) / 64u * 64u;
    if (c->used > c->bytes) {
        fprintf(stderr, "cases: %lu bytes wanted\n", (unsigned long)c->used);
        exit(1);
    }
    return p;
}

/* What reading the counter takes by itself, at least; no case is without it. */
static uint64_t reading(void) {
    static uint64_t least = UINT64_MAX;
    static bool known;
    for (uint32_t k = 0; k < 8u && !known; k++) {
        const uint64_t before = instructions(), gone = instructions() - before;
        if (k == 0u || gone < least) least = gone;
    }
    known = true;
    return least;
}

static void print_case(cases *c, const char *operation, uint32_t level, const features *f,
                       float bound, uint64_t counted) {
    (void)c;
    (void)bound;
    counted -= reading();
    printf("%s %u %lu", operation, (unsigned)level, (unsigned long)counted);
    for (uint32_t k = 0; k < PALP_WORKS; k++) {
        if (f->count[k] > 0.0f) printf(" %u:%.7g", (unsigned)k, (double)f->count[k]);
    }
    printf("\n");
}

#define CLASSES 256u
static struct {
    const char *operation;
    uint32_t level, cases, beyond;
    uint64_t counted;
    float bound, share;
} class[CLASSES];

static void hold_case(cases *c, const char *operation, uint32_t level, const features *f,
                      float bound, uint64_t counted) {
    uint32_t i = 0;
    (void)c;
    (void)f;
    counted -= reading();
    while (i < CLASSES - 1u && class[i].operation != NULL &&
           (strcmp(class[i].operation, operation) != 0 || class[i].level != level))
        i++;
    class[i].operation = operation;
    class[i].level = level;
    class[i].cases++;
    class[i].beyond += (float)counted > bound;
    class[i].counted = counted > class[i].counted ? counted : class[i].counted;
    class[i].bound = palp_max(class[i].bound, bound);
    class[i].share = palp_max(class[i].share, (float)counted / bound);
}

static void print_classes(void) {
    for (uint32_t i = 0; i < CLASSES && class[i].operation != NULL; i++)
        printf("%s %u %u %lu %.0f %.4f %u\n", class[i].operation, (unsigned)class[i].level,
               (unsigned)class[i].cases, (unsigned long)class[i].counted, (double)class[i].bound,
               (double)class[i].share, (unsigned)class[i].beyond);
}

static const palp_target *find_target(const char *name) {
    static const palp_target *const all[] = {&palp_target_x86_64, &palp_target_x86_64_avx2,
                                             &palp_target_cortex_a53, &palp_target_cortex_m7};
    for (uint32_t i = 0; i < 4u; i++) {
        if (strcmp(all[i]->name, name) == 0) return all[i];
    }
    fprintf(stderr, "cases: no target '%s'\n", name);
    exit(2);
}

#ifdef CASES_AT /* memory that no linker script knows */
static uint8_t *const memory = (uint8_t *)CASES_AT;
#define MEMORY_BYTES (16u << 20)
#else
static _Alignas(64) uint8_t memory[64u << 20];
#define MEMORY_BYTES (sizeof memory)
#endif

/* Cases of whatever the blob at the beginning of the memory is; `only`: those of contact on the
 * surface and of ticks. */
static int run(cases *c, size_t bytes, uint64_t seed, uint32_t episodes, bool only) {
    palp_blob blob;
    palp_tets tets;
    palp_zones zones;
    palp_status status = palp_blob_open(&blob, c->memory, bytes);
    if (status == PALP_OK) {
        cases_of_surface(c, &blob, seed, episodes / (only ? 1u : 6u) + 1u);
        cases_of_ticks(c, &blob, seed, episodes);
        if (only) return 0;
        cases_of_green(c, &blob, seed, 20u * episodes);
    } else if (palp_tets_open(&tets, c->memory, bytes) == PALP_OK) {
        cases_of_dyna(c, &tets, seed, episodes);
    } else if (palp_zones_open(&zones, c->memory, bytes) == PALP_OK) {
        cases_of_zones(c, c->memory, bytes, seed, episodes);
    } else {
        fprintf(stderr, "not a blob: %s\n", palp_status_text(status));
        return 1;
    }
    return 0;
}

int main(int argc, char **argv) {
    if (argc < 4) {
        fprintf(stderr, "usage: cases BLOB SEED EPISODES [TARGET|- [surface]]\n");
        return 2;
    }
    FILE *f = fopen(argv[1], "rb");
    cases c = {memory, MEMORY_BYTES, 0, NULL, print_case};
    if (argc > 4 && strcmp(argv[4], "-") != 0) {
        c.price = &find_target(argv[4])->instructions;
        c.sink = hold_case;
    }
    if (f == NULL) {
        fprintf(stderr, "%s: cannot be opened\n", argv[1]);
        return 2;
    }
    size_t bytes = fread(memory, 1, MEMORY_BYTES, f);
    uint64_t seed = strtoull(argv[2], NULL, 10);
    uint32_t episodes = (uint32_t)atoi(argv[3]);
    fclose(f);
    (void)cases_take(&c, bytes);
    instructions_open();
    int status = run(&c, bytes, seed, episodes, argc > 5 && strcmp(argv[5], "surface") == 0);
    print_classes();
    for (uint32_t i = 0; i < CLASSES; i++) status |= class[i].beyond > 0;
    return status;
}
