/* SPDX-License-Identifier: MIT */
/* Numbers and a hash, as an image prints them. */
#ifndef PALP_PORT_PRINT_H
#define PALP_PORT_PRINT_H

#include "port/cortexm/semihost.h"

static inline void print_number(const char *before, uint64_t number, const char *after) {
    char text[24];
    uint32_t at = sizeof text - 1u;
    text[at] = '\0';
    do {
        text[--at] = (char)('0' + number % 10u);
        number /= 10u;
    } while (number > 0u);
    semihost_print(before);
    semihost_print(text + at);
    semihost_print(after);
}

/* FNV-1a. */
#define HASH_BEGIN 1469598103934665603ull
static inline uint64_t hash_on(uint64_t hash, const void *data, uint32_t bytes) {
    const uint8_t *p = data;
    for (uint32_t i = 0; i < bytes; i++) hash = (hash ^ p[i]) * 1099511628211ull;
    return hash;
}

static inline void print_hash(uint64_t hash) {
    static const char digit[] = "0123456789abcdef";
    char line[23] = "hash ";
    for (uint32_t i = 0; i < 16u; i++) line[5u + i] = digit[hash >> (60u - 4u * i) & 15u];
    line[21] = '\n';
    line[22] = '\0';
    semihost_print(line);
}

#endif
