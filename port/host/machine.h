/* SPDX-License-Identifier: MIT */
/* Cost tables: the shipped targets by name, and files that `palp calibrate` writes. */
#ifndef PALP_TOOLS_MACHINE_H
#define PALP_TOOLS_MACHINE_H

#include "core/servo/budget.h"
#include <stdio.h>

typedef struct {
    palp_target target;
    float ns_per_instruction, ns_per_byte;
    char basis[96]; /* where the speed comes from */
} machine;

/* The target that this program itself was built for; NULL if none is shipped. */
const palp_target *machine_of_this_build(void);

/* A shipped target or a file; exits 2 if it is neither, 1 if the file is no cost table. The table's
 * own target is used: keep `m` where it is. */
void machine_find(machine *m, const char *name_or_file);
palp_cost_table machine_table(const machine *m, double margin);

void machine_write(FILE *f, const machine *m);

/* "ball", "pad" ...: the word of a kind of work, and what one of it is. */
const char *machine_word(palp_work kind);
const char *machine_what(palp_work kind);

#endif
