/* SPDX-License-Identifier: MIT */
#include "sim/spectrum.h"
#include <math.h>

double spectrum_largest(const double *signal, uint32_t count, double rate_hz, int low_hz,
                        int high_hz) {
    const double turn = 2 * acos(-1.0);
    double mean = 0, most = 0;
    for (uint32_t i = 0; i < count; i++) mean += signal[i] / count;
    for (int hz = low_hz; hz <= high_hz; hz++) {
        double in = 0, across = 0;
        for (uint32_t i = 0; i < count; i++) {
            const double x = (signal[i] - mean) * (1 - cos(turn * i / count));
            in += x * cos(turn * hz * i / rate_hz);
            across += x * sin(turn * hz * i / rate_hz);
        }
        most = fmax(most, 2 * hypot(in, across) / count);
    }
    return most;
}
