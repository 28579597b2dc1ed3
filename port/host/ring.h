/* SPDX-License-Identifier: MIT */
/*
 * A ring of equal slots between one producer and one consumer, without locks. The producer never
 * waits: what finds no room is dropped and counted.
 */
#ifndef PALP_PORT_RING_H
#define PALP_PORT_RING_H

#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

typedef struct {
    unsigned char *memory; /* [slots][bytes] */
    size_t slots, bytes;
    _Atomic size_t head, tail; /* counts of slots filled and emptied; they only grow */
    _Atomic uint64_t dropped;
} ring;

/* The slot to fill next, or NULL (and counted) when all are full. */
static inline void *ring_begin(ring *r) {
    size_t head = atomic_load_explicit(&r->head, memory_order_relaxed);
    if (head - atomic_load_explicit(&r->tail, memory_order_acquire) == r->slots) {
        atomic_fetch_add_explicit(&r->dropped, 1, memory_order_relaxed);
        return NULL;
    }
    return r->memory + head % r->slots * r->bytes;
}

/* Publishes it. */
static inline void ring_end(ring *r) {
    atomic_fetch_add_explicit(&r->head, 1, memory_order_release);
}

/* The oldest full slot, or NULL. */
static inline void *ring_peek(ring *r) {
    size_t tail = atomic_load_explicit(&r->tail, memory_order_relaxed);
    if (atomic_load_explicit(&r->head, memory_order_acquire) == tail) return NULL;
    return r->memory + tail % r->slots * r->bytes;
}

/* Gives it back. */
static inline void ring_release(ring *r) {
    atomic_fetch_add_explicit(&r->tail, 1, memory_order_release);
}

#endif
