/* SPDX-License-Identifier: MIT */
/* Boundary conditions from a file: node,kind,x,y,z, one per line. */
#ifndef PALP_TOOLS_CONDITIONS_H
#define PALP_TOOLS_CONDITIONS_H

#include "core/green/cma.h"

typedef struct {
    uint32_t node;
    palp_condition condition;
    palp_vec3 value;
    size_t line;
} condition_line;

/* The node that a word names, of `nodes`; false if it names none. */
typedef bool (*node_finder)(const void *context, const char *word, uint32_t *node);

/* Reads the file; exits 2 with the offending line. `find` may be NULL: a number below `nodes`. */
condition_line *read_conditions(const char *path, uint32_t nodes, node_finder find,
                                const void *context, size_t *count);

#endif
