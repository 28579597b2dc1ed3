/* SPDX-License-Identifier: MIT */
/* A cube of soft material that is let go, simulated in double with one of three force laws: the
 * comparison of Debunne et al. (2001), section 3.1. */
#ifndef PALP_TOOLS_OSCILLATE_H
#define PALP_TOOLS_OSCILLATE_H

#include "tools/tet/tetmesh.h"

typedef enum { LAW_SPRINGS, LAW_CAUCHY, LAW_GREEN, LAWS } force_law;
extern const char *const law_name[LAWS];

typedef struct {
    double lambda_Pa, mu_Pa, damping_s, density;
    double gravity_m_s2[3], step_s;
    double below; /* nodes with x at most this are held */
} swing_setup;

/*
 * Height of the watched node at times k * every * step_s, k < count; x[nodes][3] (may be NULL) gets
 * the places at the end. Springs lie along the edges, each as stiff as the sum of E V / L^2 over
 * its tetrahedra (Van Gelder 1998). Cauchy's strain is (H + H^T) / 2 with forces -V sigma b.
 */
void oscillate(const tetmesh *m, force_law law, const swing_setup *s, uint32_t watched,
               uint32_t every, double *z, uint32_t count, double (*x)[3]);

/* Frequency (Hz) of z by its crossings of the mean, from below; 0 if there are fewer than three. */
double frequency_of(const double *z, uint32_t count, double interval_s);

#endif
