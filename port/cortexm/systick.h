/* SPDX-License-Identifier: MIT */
/*
 * SysTick as the tick's clock: 24 bits that count down, read at least once per wrap (42 ms at
 * 400 MHz). On a board it counts cycles, and work is bounded in those that are stated for each
 * instruction. Under QEMU with -icount shift=6 an instruction takes 64 ns, and QEMU_TICK_PS says
 * what a count is there; the clock then runs as a core at CORE_MHZ would with CYCLES cycles for
 * every instruction, and work is bounded in instructions.
 */
#ifndef PALP_PORT_SYSTICK_H
#define PALP_PORT_SYSTICK_H

#include "core/budget/target.h"
#include <stdint.h>

#ifndef CORE_MHZ
#define CORE_MHZ 400u
#endif
#ifdef QEMU_TICK_PS
#ifndef CYCLES
#define CYCLES 2u
#endif
#define SYSTICK_UNIT "instructions"
#define SYSTICK_TARGET (&palp_target_cortex_m7)
#else
#define CYCLES 1u
#define SYSTICK_UNIT "cycles"
#define SYSTICK_TARGET (&palp_target_cortex_m7_cycles)
#endif
#define SYSTICK_NS (1e3f * (float)CYCLES / (float)CORE_MHZ) /* of a unit */

void systick_start(void);
uint64_t systick_count(void);          /* since the start */
uint64_t systick_work(void);           /* in units of SYSTICK_UNIT */
uint64_t systick_now_ns(void *unused); /* for palp_port */

#endif
