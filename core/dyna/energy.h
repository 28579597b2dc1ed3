/* SPDX-License-Identifier: MIT */
/*
 * An energy monitor for dynamic bodies. What moves, is stored and can fall may grow by what tools
 * put in, and otherwise only shrink; what exceeds that by half (a change of resolution under
 * strain, or an interface that feeds itself) is taken out of the velocities, and counted.
 */
#ifndef PALP_DYNA_ENERGY_H
#define PALP_DYNA_ENERGY_H

#include "core/dyna/dyna.h"

typedef struct {
    float allowed_J;          /* what there may be */
    float kinetic_J, total_J; /* as of the last look: total with what is stored and can fall */
    uint32_t energy_limited;  /* ticks in which something was taken out */
} palp_energy;

/*
 * After a tick in which tools did work_J; `changed`: the mesh is another one than the tick before,
 * so that what is stored is taken as found. True if something was taken out. Cost: 14 per active
 * node.
 */
bool palp_energy_watch(palp_energy *energy, palp_dyna *dyna, float work_J, bool changed);

#endif
