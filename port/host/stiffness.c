/* SPDX-License-Identifier: MIT */
#include "port/host/stiffness.h"
#include "core/base/real.h"
#include "core/green/split.h"
#include "port/host/util.h"
#include <stdlib.h>
#include <string.h>

void node_stiffness(const palp_blob *b, float *stiffness) {
    const palp_domain *d = &b->domain[PALP_FREE];
    float *field = allocate_aligned(4 * (size_t)d->slots, sizeof *field);
    memset(stiffness, 0, b->meta->nodes * sizeof *stiffness);
    for (uint32_t s = 0; s < b->level[b->meta->constraint_level].nodes; s++) {
        const uint32_t node = d->node[s];
        const float *n = b->normal + 3 * (size_t)node;
        palp_nodal_response(b, s, n, field);
        const float u = palp_dot(palp_vec3_at(field + 4 * (size_t)s), palp_vec3_at(n));
        stiffness[node] = u > 0 ? 1 / u : 0;
    }
    free(field);
}
