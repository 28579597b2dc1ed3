/* SPDX-License-Identifier: MIT */
/* How stiff a tetrahedral mesh is against its own block diagonal, for the limits of time steps. */
#ifndef PALP_TOOLS_TETSTIFF_H
#define PALP_TOOLS_TETSTIFF_H

#include "core/blob/format.h"
#include "tools/tet/tetmesh.h"

/*
 * Largest theta with K x = theta J x, K the stiffness at rest and J the bound of its block diagonal
 * that the tick uses (palp_dyna_bound), over Poisson's ratios up to 0.49: by power iteration, which
 * comes from below, and raised by 10 % for that.
 */
double tet_coupling(const tetmesh *m, const palp_tet_node *node);

#endif
