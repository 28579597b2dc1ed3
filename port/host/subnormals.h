/* SPDX-License-Identifier: MIT */
/* Subnormal numbers cost some processors fifty times as much: this thread treats them as zero. What
 * runs the tick and what repeats it must agree. */
#ifndef PALP_SIM_SUBNORMALS_H
#define PALP_SIM_SUBNORMALS_H

#include <stdint.h>
#if defined(__SSE2__)
#include <immintrin.h>
#endif

static inline void subnormals_off(void) {
#if defined(__SSE2__)
    _mm_setcsr(_mm_getcsr() | 0x8040u); /* results and operands */
#elif defined(__aarch64__)
    uint64_t fpcr;
    __asm__ volatile("mrs %0, fpcr" : "=r"(fpcr));
    __asm__ volatile("msr fpcr, %0" : : "r"(fpcr | 1ull << 24));
#endif
}

#endif
