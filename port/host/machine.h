/* SPDX-License-Identifier: MIT */
/* Cost tables: the shipped targets by name, and files that `palp calibrate` writes. */
#ifndef PALP_TOOLS_MACHINE_H
#define PALP_TOOLS_MACHINE_H

#include "core/servo/budget.h"
#include <stdio.h>

typedef struct {
    palp_target target;
    float ns_per_instruction, ns_per_byte;
    const palp_target *cycles; /* the same in cycles, as stated; NULL: not known */
    float ns_per_cycle;
    char basis[96]; /* where the speed comes from */
} machine;

/* The target that this program itself was built for; NULL if none is shipped. */
const palp_target *machine_of_this_build(void);

/* A shipped target or a file; exits 2 if it is neither, 1 if the file is no cost table. The table's
 * own target is used: keep `m` where it is. */
void machine_find(machine *m, const char *name_or_file);

/*
 * The machine that a command line asks for: by `name_or_file`; or, with ns_per_operation above 0,
 * an assumed one that does in so many ns each operation that the code itself counts; or, with
 * neither, the one that this program was built for. Exits 2 on both, or where there is no table.
 */
void machine_choose(machine *m, const char *name_or_file, double ns_per_operation);

/* By cycles where they are stated, else by instructions. */
palp_cost_table machine_table(const machine *m, double margin);

void machine_write(FILE *f, const machine *m);

/* "ball", "pad" ...: the word of a kind of work, and what one of it is. */
const char *machine_word(palp_work kind);
const char *machine_what(palp_work kind);

#endif
