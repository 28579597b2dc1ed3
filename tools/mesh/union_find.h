/* SPDX-License-Identifier: MIT */
/* Sets that are joined: parent[i] = i to begin with; the least number stands for its set. */
#ifndef PALP_TOOLS_UNION_FIND_H
#define PALP_TOOLS_UNION_FIND_H

#include <stdint.h>

static inline uint32_t set_of(uint32_t *parent, uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
}

static inline void set_join(uint32_t *parent, uint32_t a, uint32_t b) {
    a = set_of(parent, a);
    b = set_of(parent, b);
    parent[a > b ? a : b] = a > b ? b : a;
}

#endif
