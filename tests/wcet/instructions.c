/* SPDX-License-Identifier: MIT */
#include "instructions.h"

#ifdef __linux__
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

static const volatile uint64_t *count;

uint64_t instructions(void) { return *count; }

void instructions_open(void) {
    const char *path = getenv("PALP_COUNT");
    int f = path != NULL ? open(path, O_RDONLY) : -1;
    void *p = f >= 0 ? mmap(NULL, 4096, PROT_READ, MAP_SHARED, f, 0) : MAP_FAILED;
    if (p == MAP_FAILED) {
        fprintf(stderr, "PALP_COUNT must name the file of the plugin (tests/wcet/counter.c)\n");
        exit(2);
    }
    close(f);
    count = p;
}
#else
/* Counts down from 2^24 in ticks of TICK_PS; an instruction takes 2^ICOUNT_SHIFT ns. To be read
 * before it wraps: every ten million instructions. */
#define SYST_CSR (*(volatile uint32_t *)0xE000E010u)
#define SYST_RVR (*(volatile uint32_t *)0xE000E014u)
#define SYST_CVR (*(volatile uint32_t *)0xE000E018u)
#ifndef TICK_PS
#define TICK_PS 40000u /* mps2-an500 */
#endif
#define ICOUNT_SHIFT 6u
#define MASK 0xFFFFFFu

static uint32_t last = MASK;
static uint64_t ticks;

void instructions_open(void) {
    SYST_RVR = MASK;
    SYST_CVR = 0;
    SYST_CSR = 5;
}

uint64_t instructions(void) {
    uint32_t now = SYST_CVR & MASK;
    ticks += (last - now) & MASK;
    last = now;
    return ticks * TICK_PS / (1000u << ICOUNT_SHIFT);
}
#endif
