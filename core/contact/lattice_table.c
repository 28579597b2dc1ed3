/* SPDX-License-Identifier: MIT */
/* Which point lies at each site of a lattice. */
#include "core/contact/lattice_internal.h"

void palp_lattice_clear(palp_lattice_table *table) {
    for (uint32_t k = 0; k < PALP_LATTICE_SLOTS; k++) table->key[k] = 0u;
}

uint32_t palp_lattice_slot(const palp_lattice_table *t, uint32_t key) {
    uint32_t slot = (key * 2654435761u) >> 22u;
    for (uint32_t k = 0; k < PALP_LATTICE_PROBES; k++, slot++) {
        slot &= PALP_LATTICE_SLOTS - 1u;
        if (t->key[slot] == key || t->key[slot] == 0u) return slot;
    }
    return slot - 1u;
}

uint32_t palp_lattice_find(const palp_lattice_table *table, int16_t i, int16_t j) {
    uint32_t key = palp_lattice_key(i, j), slot = palp_lattice_slot(table, key);
    const bool found = table->key[slot] == key && table->point[slot] != PALP_LATTICE_MARKED;
    return found ? table->point[slot] : PALP_LATTICE_MISS;
}
