/* SPDX-License-Identifier: MIT */
/*
 * Hands out aligned pieces of one caller-owned block. The same sequence of calls with base == NULL
 * measures how large the block must be, so memsize() and init() can never disagree.
 */
#ifndef PALP_BASE_ARENA_H
#define PALP_BASE_ARENA_H

#include "core/base/status.h"
#include <stddef.h>
#include <stdint.h>

#define PALP_ALIGN 64u

typedef struct {
    uint8_t *base; /* NULL: measuring only */
    size_t used;
} palp_arena;

/* `count` elements of `size` bytes, aligned to PALP_ALIGN; NULL while measuring. Constant time. */
static inline void *palp_take(palp_arena *arena, size_t count, size_t size) {
    size_t at = arena->used;
    size_t room = SIZE_MAX - at - PALP_ALIGN;
    if (at > SIZE_MAX - PALP_ALIGN || (size > 0u && count > room / size)) {
        arena->used = SIZE_MAX; /* more than the address space: no block is ever large enough */
        return NULL;
    }
    arena->used = (at + count * size + PALP_ALIGN - 1u) / PALP_ALIGN * PALP_ALIGN;
    return arena->base != NULL ? arena->base + at : NULL;
}

/* The same for `rows` rows of `columns` elements, whose product may be more than size_t holds. */
static inline void *palp_take_rows(palp_arena *arena, size_t rows, size_t columns, size_t size) {
    if (columns > SIZE_MAX / size) {
        arena->used = SIZE_MAX;
        return NULL;
    }
    return palp_take(arena, rows, columns * size);
}

/*
 * Whether a block is as its init needs it: MEMORY if it is NULL or shorter than `need` bytes,
 * ALIGNMENT if it does not begin at a multiple of PALP_ALIGN. Constant time.
 */
static inline palp_status palp_check_block(const void *memory, size_t bytes, size_t need) {
    if (memory == NULL || bytes < need) return PALP_ERR_MEMORY;
    return ((uintptr_t)memory & (PALP_ALIGN - 1u)) != 0u ? PALP_ERR_ALIGNMENT : PALP_OK;
}

#endif
