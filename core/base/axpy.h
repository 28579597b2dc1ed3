/* SPDX-License-Identifier: MIT */
/* One vector less a multiple of another, several entries side by side; inside base only. */
#ifndef PALP_BASE_AXPY_H
#define PALP_BASE_AXPY_H

#include "core/base/linalg.h"
#include <stddef.h>

/* y[0..n) -= s * x[0..n) */
static inline void axpy_minus(float *restrict y, const float *restrict x, float s, size_t n) {
    const size_t whole = n / PALP_BESIDE;
    for (size_t q = 0; q < whole; q++) {
        for (size_t e = 0; e < PALP_BESIDE; e++)
            y[PALP_BESIDE * q + e] -= s * x[PALP_BESIDE * q + e];
    }
    for (size_t k = PALP_BESIDE * whole; k < n; k++) y[k] -= s * x[k]; /* at most 3 */
}

#endif
