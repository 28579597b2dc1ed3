/* SPDX-License-Identifier: MIT */
/* What buzzes in a signal. */
#ifndef PALP_SIM_SPECTRUM_H
#define PALP_SIM_SPECTRUM_H

#include <stdint.h>

/* Amplitude of the largest line at whole Hz from `low_hz` to `high_hz` of a signal about its mean,
 * sampled at rate_hz, by a Fourier sum under Hann's window. */
double spectrum_largest(const double *signal, uint32_t count, double rate_hz, int low_hz,
                        int high_hz);

#endif
