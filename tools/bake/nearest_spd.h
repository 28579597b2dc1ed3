/* SPDX-License-Identifier: MIT */
/*
 * The nearest compliance that resists every push.
 *
 * Collocation on thin parts can leave the symmetrised compliance with a few slightly negative
 * eigenvalues: directions in which pushing would be rewarded. With S = D^-1/2 G D^-1/2, D =
 * diag(G), each eigenvalue of S below DEFINITE_FLOOR is raised to it, which is the smallest change
 * of S (in Frobenius norm) that does so.
 */
#ifndef PALP_TOOLS_NEAREST_SPD_H
#define PALP_TOOLS_NEAREST_SPD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define DEFINITE_FLOOR 1e-3

typedef struct {
    bool definite;   /* what comes out passes a factorisation with all pivots positive */
    uint32_t raised; /* eigenvalues that were raised */
    double change;   /* |G' - G|_F / |G|_F */
    size_t worst;    /* row that takes part most in the lowest of them */
    double lowest;   /* that eigenvalue of S */
} definite_report;

/* Works on the symmetric matrix g (n x n) in place. Cost: one factorisation when g is sound, else
 * about four. */
definite_report make_definite(double *g, size_t n, size_t stride);

#endif
