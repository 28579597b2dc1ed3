/* SPDX-License-Identifier: MIT */
/*
 * SysTick as the tick's clock: 24 bits that count down, read at least once per wrap (42 ms at
 * 400 MHz). Under QEMU with -icount shift=6 an instruction takes 64 ns, and QEMU_TICK_PS says what
 * a count is there; the clock then runs as a core at CORE_MHZ would with CYCLES cycles for every
 * instruction, which is what the cost table promises.
 */
#ifndef PALP_PORT_SYSTICK_H
#define PALP_PORT_SYSTICK_H

#include <stdint.h>

#ifndef CORE_MHZ
#define CORE_MHZ 400u
#endif
#ifndef CYCLES
#define CYCLES 2u /* most, for an instruction on average */
#endif

void systick_start(void);
uint64_t systick_count(void);          /* since the start */
uint64_t systick_instructions(void);   /* under QEMU; else cycles / CYCLES */
uint64_t systick_now_ns(void *unused); /* for palp_port */

#endif
