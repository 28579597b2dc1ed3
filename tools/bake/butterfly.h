/* SPDX-License-Identifier: MIT */
/* The modified butterfly predictor (Zorin, Schroeder and Sweldens 1996) on every level of a
 * semi-regular mesh. */
#ifndef PALP_TOOLS_BUTTERFLY_H
#define PALP_TOOLS_BUTTERFLY_H

#include "tools/mesh/semireg.h"

#define BUTTERFLY_MAX 128 /* members of one stencil */

typedef struct {
    uint32_t count;
    uint32_t node[BUTTERFLY_MAX];
    double weight[BUTTERFLY_MAX]; /* sums to 1 */
} butterfly_stencil;

/* Calls `take` for every odd vertex, finest level first. */
typedef void (*butterfly_taker)(void *context, uint32_t vertex, const butterfly_stencil *stencil);
void butterfly_stencils(const mesh *m, const semireg *s, butterfly_taker take, void *context);

#endif
