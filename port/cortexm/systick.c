/* SPDX-License-Identifier: MIT */
#include "port/cortexm/systick.h"

#define CSR (*(volatile uint32_t *)0xE000E010u)
#define RVR (*(volatile uint32_t *)0xE000E014u)
#define CVR (*(volatile uint32_t *)0xE000E018u)
#define MASK 0xFFFFFFu

static uint32_t last;
static uint64_t counted;

void systick_start(void) {
    RVR = MASK;
    CVR = 0;
    CSR = 5; /* on, the core's clock, no interrupt */
    last = CVR & MASK;
    counted = 0;
}

uint64_t systick_count(void) {
    uint32_t now = CVR & MASK;
    counted += (last - now) & MASK;
    last = now;
    return counted;
}

uint64_t systick_work(void) {
#ifdef QEMU_TICK_PS
    return systick_count() * QEMU_TICK_PS / (1000u << 6);
#else
    return systick_count();
#endif
}

uint64_t systick_now_ns(void *unused) {
    (void)unused;
    return systick_work() * CYCLES * 1000u / CORE_MHZ;
}
