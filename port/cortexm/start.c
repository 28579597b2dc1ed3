/* SPDX-License-Identifier: MIT */
/* Start-up of a bare Cortex-M: vectors, FPU, memory, main, and out by semihosting. */
#include "port/cortexm/semihost.h"

extern uint32_t stack_top, bss_begin, bss_end, data_load, data_begin, data_end;
int main(void);
void start(void);

#define CPACR (*(volatile uint32_t *)0xE000ED88u)
#define FPCCR (*(volatile uint32_t *)0xE000EF34u)

__attribute__((noreturn)) static void leave(int status) {
    semihost_exit(status);
    for (;;) {}
}

/* Any exception here is a defect of the image: say so and stop. */
static void fault(void) {
    semihost_print("fault\n");
    leave(1);
}

/* Before floating point and statics may be used. */
void start(void) {
    CPACR |= 0xFu << 20;  /* FPU on */
    FPCCR &= ~(3u << 30); /* no lazy stacking: interrupts cost the same always */
    __asm volatile("dsb\n\tisb");
    uint32_t *from = &data_load;
    for (uint32_t *to = &data_begin; to < &data_end;) *to++ = *from++;
    for (uint32_t *to = &bss_begin; to < &bss_end;) *to++ = 0;
    leave(main());
}

__attribute__((section(".vectors"), used)) static void (*const vectors[16])(void) = {
    (void (*)(void))(uintptr_t)&stack_top, start, fault, fault, fault, fault, fault};
