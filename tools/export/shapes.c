/* SPDX-License-Identifier: MIT */
#include "tools/export/shapes.h"
#include "port/host/util.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static double dot(const float *a, const float *b, size_t n) {
    double sum = 0;
    for (size_t i = 0; i < n; i++) sum += (double)a[i] * (double)b[i];
    return sum;
}

static double largest(const float *a, size_t n) {
    float most = 0;
    for (size_t i = 0; i < n; i++) most = fmaxf(most, fabsf(a[i]));
    return (double)most;
}

/* What of all frames is left when the newest shape, a unit vector, is taken out; the frame that is missed
 * most. */
static size_t take_out(float *rest, size_t frames, size_t values, const float *q, float *weight,
                       uint32_t number, double *missed) {
    size_t worst = 0;
    *missed = 0;
    for (size_t f = 0; f < frames; f++) {
        float *x = rest + f * values;
        if (q != NULL) {
            const double w = dot(q, x, values);
            for (size_t i = 0; i < values; i++) x[i] -= (float)(w * (double)q[i]);
            weight[number * frames + f] = (float)w;
        }
        const double most = largest(x, values);
        if (most <= *missed) continue;
        *missed = most;
        worst = f;
    }
    return worst;
}

shape_basis shapes_of(const float *const *x, size_t frames, const float *rest, size_t values) {
    shape_basis b = {.count = 0};
    float *left = allocate(frames * values + 1, sizeof *left);
    float *weight = allocate(frames * SHAPES_MOST + 1, sizeof *weight);
    b.shape = allocate(SHAPES_MOST * values + 1, sizeof *b.shape);
    for (size_t f = 0; f < frames; f++)
        for (size_t i = 0; i < values; i++) left[f * values + i] = x[f][i] - rest[i];
    size_t worst = take_out(left, frames, values, NULL, weight, 0, &b.missed);
    b.largest = b.missed;
    while (b.count < SHAPES_MOST && b.missed > SHAPES_GOAL * b.largest) {
        float *q = b.shape + b.count * values;
        memcpy(q, left + worst * values, values * sizeof *q);
        for (uint32_t k = 0; k < b.count; k++) { /* once more, against rounding */
            const float *p = b.shape + k * values;
            const double along = dot(p, q, values);
            for (size_t i = 0; i < values; i++) q[i] -= (float)(along * (double)p[i]);
        }
        const double norm = sqrt(dot(q, q, values));
        if (!(norm > 0)) break;
        for (size_t i = 0; i < values; i++) q[i] = (float)((double)q[i] / norm);
        worst = take_out(left, frames, values, q, weight, b.count++, &b.missed);
    }
    b.weight = allocate(frames * b.count + 1, sizeof *b.weight);
    for (uint32_t k = 0; k < b.count; k++) {
        const double most = largest(weight + k * frames, frames);
        float *q = b.shape + k * values;
        for (size_t i = 0; i < values; i++) q[i] = (float)((double)q[i] * most);
        for (size_t f = 0; f < frames; f++)
            b.weight[f * b.count + k] = (float)((double)weight[k * frames + f] / most);
    }
    free(left);
    free(weight);
    return b;
}

void shapes_free(shape_basis *b) {
    free(b->shape);
    free(b->weight);
}
