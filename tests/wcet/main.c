/* SPDX-License-Identifier: MIT */
/* Runs cases and prints each: operation, level, instructions, and the named counts of its bound. */
#include "cases.h"
#include <stdio.h>
#include <stdlib.h>

void *cases_take(cases *c, size_t bytes) {
    uint8_t *p = c->memory + c->used;
    c->used += (bytes + 63u) / 64u * 64u;
    if (c->used > c->bytes) {
        fprintf(stderr, "cases: %lu bytes wanted\n", (unsigned long)c->used);
        exit(1);
    }
    return p;
}

static void print_case(const char *operation, uint32_t level, const features *f, uint64_t counted) {
    printf("%s %u %lu", operation, (unsigned)level, (unsigned long)counted);
    for (uint32_t k = 0; k < PALP_WORKS; k++) {
        if (f->count[k] > 0.0f) printf(" %u:%.7g", (unsigned)k, (double)f->count[k]);
    }
    printf("\n");
}

static _Alignas(64) uint8_t memory[24u << 20];

int main(int argc, char **argv) {
    if (argc < 4) {
        fprintf(stderr, "usage: cases BLOB SEED EPISODES\n");
        return 2;
    }
    FILE *f = fopen(argv[1], "rb");
    cases c = {memory, sizeof memory, 0, print_case};
    palp_blob blob;
    if (f == NULL) return 2;
    size_t bytes = fread(memory, 1, sizeof memory, f);
    fclose(f);
    (void)cases_take(&c, bytes);
    palp_status status = palp_blob_open(&blob, memory, bytes);
    if (status != PALP_OK) {
        fprintf(stderr, "%s: %s\n", argv[1], palp_status_text(status));
        return 1;
    }
    instructions_open();
    cases_of_green(&c, &blob, strtoull(argv[2], NULL, 10), 20u * (uint32_t)atoi(argv[3]));
    cases_of_contact(&c, &blob, strtoull(argv[2], NULL, 10), (uint32_t)atoi(argv[3]));
    return 0;
}
