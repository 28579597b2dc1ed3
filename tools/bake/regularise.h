/* SPDX-License-Identifier: MIT */
/*
 * Keeps contact passive after thresholding.
 *
 * Contact works with the normal compliances N_ij = n_i^T (G_ij + G_ji^T) n_j / 2 of the compressed
 * columns. On thin parts, whose columns are mostly bending, the dropped details can exceed the
 * local compliance, and N is no longer positive definite: some push would be rewarded. Adding mu
 * a_i to each N_ii, a_i the largest entry of column i, by which details are dropped, mends that; mu
 * is the least that does, to ten per cent.
 */
#ifndef PALP_TOOLS_REGULARISE_H
#define PALP_TOOLS_REGULARISE_H

#include "core/blob/blob.h"

typedef struct {
    double mu;
    double largest; /* largest mu a_i / N_ii */
} regularisation_report;

/* Writes regularisation[nodes] (m/N, 0 off the constraint level) for an opened blob, from the
 * columns of its constraint level. Cost: m columns, about ten LU of order m. */
regularisation_report regularise(const palp_blob *blob, float *regularisation);

#endif
