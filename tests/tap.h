/* SPDX-License-Identifier: MIT */
/* TAP output for unit tests: one line per check, exit 1 when one failed. */
#ifndef PALP_TESTS_TAP_H
#define PALP_TESTS_TAP_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

static int tap_count, tap_failed;

#define CHECK(condition, ...)                                                                      \
    do {                                                                                           \
        bool tap_ok = (condition);                                                                 \
        tap_failed += tap_ok ? 0 : 1;                                                              \
        printf("%sok %d - ", tap_ok ? "" : "not ", ++tap_count);                                   \
        printf(__VA_ARGS__);                                                                       \
        printf("\n");                                                                              \
    } while (0)

/* Passes when 0 <= value <= limit; prints both. */
#define AT_MOST(value, limit, ...)                                                                 \
    do {                                                                                           \
        double tap_value = (value), tap_limit = (limit);                                           \
        bool tap_ok = tap_value <= tap_limit && tap_value >= 0;                                    \
        tap_failed += tap_ok ? 0 : 1;                                                              \
        printf("%sok %d - ", tap_ok ? "" : "not ", ++tap_count);                                   \
        printf(__VA_ARGS__);                                                                       \
        printf(": %.3g (at most %.3g)\n", tap_value, tap_limit);                                   \
    } while (0)

static inline int tap_done(void) {
    printf("1..%d\n", tap_count);
    return tap_failed > 0 ? 1 : 0;
}

/* Whether to run what is only long, too: make soak sets FULL. */
static inline bool tap_full(void) { return getenv("FULL") != NULL; }

/* Deterministic numbers in [-1, 1); `seed` is printed by tests that fail. */
static inline double tap_random(uint64_t *seed) {
    *seed = *seed * 6364136223846793005ull + 1442695040888963407ull;
    return (double)(*seed >> 11) / 4503599627370496.0 - 1.0;
}

#endif
