/* SPDX-License-Identifier: MIT */
/* The debugger's ears and eyes: what an image prints under QEMU or a probe. */
#ifndef PALP_PORT_SEMIHOST_H
#define PALP_PORT_SEMIHOST_H

#include <stdint.h>

static inline uint32_t semihost_call(uint32_t operation, const void *argument) {
    register uint32_t r0 __asm("r0") = operation;
    register const void *r1 __asm("r1") = argument;
    __asm volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static inline void semihost_print(const char *text) { (void)semihost_call(0x04u, text); }

/* ADP_Stopped_ApplicationExit, or an error. */
static inline void semihost_exit(int status) {
    (void)semihost_call(0x18u, (const void *)(uintptr_t)(status == 0 ? 0x20026u : 0x20023u));
}

#endif
