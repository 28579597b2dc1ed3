/* SPDX-License-Identifier: MIT */
/* How many instructions this program has executed: from counter.c under QEMU, or from SysTick on a
 * bare Cortex-M under QEMU's -icount. Exact to a few for the reading itself, never too few. */
#ifndef PALP_TESTS_INSTRUCTIONS_H
#define PALP_TESTS_INSTRUCTIONS_H

#include <stdint.h>

/* Once, before all else; exits when there is nothing that counts. */
void instructions_open(void);
uint64_t instructions(void);

#endif
