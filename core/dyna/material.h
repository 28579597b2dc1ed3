/* SPDX-License-Identifier: MIT */
/* The visco-elastic material (AD 2, 4). */
#ifndef PALP_DYNA_MATERIAL_H
#define PALP_DYNA_MATERIAL_H

typedef struct {
    float lambda_Pa, mu_Pa;   /* Lame's coefficients */
    float phi_Pa_s, psi_Pa_s; /* damping of the change of volume and of shape */
    float density_kg_m3;
    float drag_per_s; /* of the velocity itself, as in a bath: not in the paper; damps slow
                         vibrations, which phi and psi hardly reach, w (rad/s) by the ratio
                         drag / (2 w) */
} palp_material;

/* lambda = E nu / ((1 + nu)(1 - 2 nu)), mu = E / (2 (1 + nu)); phi and psi are `damping_s` times
 * these: a vibration of frequency w (rad/s) then has the damping ratio w damping_s / 2. */
static inline palp_material palp_material_of(float young_Pa, float poisson, float density_kg_m3,
                                             float damping_s, float drag_per_s) {
    float lambda = young_Pa * poisson / ((1.0f + poisson) * (1.0f - 2.0f * poisson));
    float mu = young_Pa / (2.0f * (1.0f + poisson));
    const palp_material out = {lambda,        mu,        damping_s * lambda, damping_s * mu,
                               density_kg_m3, drag_per_s};
    return out;
}

#endif
