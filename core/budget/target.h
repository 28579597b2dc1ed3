/* SPDX-License-Identifier: MIT */
/*
 * Targets: what one of each kind of work (budget/price.h) costs at most, in instructions, of this
 * code as the Makefile builds it with gcc 12. Derived from the machine code, but for the seams
 * between zones, which are counted with room (tests/wcet). Another compiler or other flags want a
 * table of their own: tests/wcet/README.md says how to make one.
 */
#ifndef PALP_BUDGET_TARGET_H
#define PALP_BUDGET_TARGET_H

#include "core/budget/price.h"

typedef struct {
    char name[24];
    palp_prices instructions;
} palp_target;

extern const palp_target palp_target_x86_64, palp_target_x86_64_avx2, palp_target_cortex_a53,
    palp_target_cortex_m7;

/* The same work in cycles, which are stated and not proved: every instruction at its worst
 * (tests/wcet/ipet/cycles.py), code and data in tightly coupled memory. Its time is cycles over the
 * clock. */
extern const palp_target palp_target_cortex_m7_cycles;

/* Not a machine: one for each operation that the code itself counts (`work_done`), so that time in
 * tests and on the desk can be the work that was done, the same on every host. */
extern const palp_target palp_target_counted;

/* Memory that one of each kind of work touches, at most: the same everywhere. */
extern const palp_prices palp_bytes_touched;

#endif
