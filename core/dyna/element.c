/* SPDX-License-Identifier: MIT */
#include "element.h"
#include "core/base/real.h"

void palp_element_forces(palp_element_lanes *restrict e, const palp_material *m) {
    const float lambda = m->lambda_Pa, mu2 = 2.0f * m->mu_Pa;
    const float phi = m->phi_Pa_s, psi2 = 2.0f * m->psi_Pa_s;
    const float kappa = lambda + mu2, per_kappa = 1.0f / kappa;
    const float wall = PALP_WALL * kappa, per_limit = 1.0f / (PALP_YIELDING * kappa);
    for (uint32_t k = 0; k < PALP_LANES; k++) {
        const float b0 = e->b[0][k], b1 = e->b[1][k], b2 = e->b[2][k];
        const float b3 = e->b[3][k], b4 = e->b[4][k], b5 = e->b[5][k];
        const float b6 = e->b[6][k], b7 = e->b[7][k], b8 = e->b[8][k];
        float h[9], r[9]; /* displacement gradient D - I, and its rate */
        for (uint32_t a = 0; a < 3u; a++) {
            float p = e->u[1][a][k] - e->u[0][a][k], q = e->u[2][a][k] - e->u[0][a][k],
                  s = e->u[3][a][k] - e->u[0][a][k];
            h[3u * a] = p * b0 + q * b3 + s * b6;
            h[3u * a + 1u] = p * b1 + q * b4 + s * b7;
            h[3u * a + 2u] = p * b2 + q * b5 + s * b8;
            p = e->v[1][a][k] - e->v[0][a][k];
            q = e->v[2][a][k] - e->v[0][a][k];
            s = e->v[3][a][k] - e->v[0][a][k];
            r[3u * a] = p * b0 + q * b3 + s * b6;
            r[3u * a + 1u] = p * b1 + q * b4 + s * b7;
            r[3u * a + 2u] = p * b2 + q * b5 + s * b8;
        }
        const float d[9] = {h[0] + 1.0f, h[1], h[2], h[3],       h[4] + 1.0f,
                            h[5],        h[6], h[7], h[8] + 1.0f};
        /* eps = H + H^T + H^T H: xx, yy, zz, yz, zx, xy */
        const float xx = h[0] + h[0] + (h[0] * h[0] + h[3] * h[3] + h[6] * h[6]);
        const float yy = h[4] + h[4] + (h[1] * h[1] + h[4] * h[4] + h[7] * h[7]);
        const float zz = h[8] + h[8] + (h[2] * h[2] + h[5] * h[5] + h[8] * h[8]);
        const float yz = h[5] + h[7] + (h[1] * h[2] + h[4] * h[5] + h[7] * h[8]);
        const float zx = h[2] + h[6] + (h[0] * h[2] + h[3] * h[5] + h[6] * h[8]);
        const float xy = h[1] + h[3] + (h[0] * h[1] + h[3] * h[4] + h[6] * h[7]);
        const float trace = xx + yy + zz;
        const float nxx = 2.0f * (r[0] * d[0] + r[3] * d[3] + r[6] * d[6]);
        const float nyy = 2.0f * (r[1] * d[1] + r[4] * d[4] + r[7] * d[7]);
        const float nzz = 2.0f * (r[2] * d[2] + r[5] * d[5] + r[8] * d[8]);
        const float nyz =
            r[1] * d[2] + r[4] * d[5] + r[7] * d[8] + r[2] * d[1] + r[5] * d[4] + r[8] * d[7];
        const float nzx =
            r[0] * d[2] + r[3] * d[5] + r[6] * d[8] + r[2] * d[0] + r[5] * d[3] + r[8] * d[6];
        const float nxy =
            r[0] * d[1] + r[3] * d[4] + r[6] * d[7] + r[1] * d[0] + r[4] * d[3] + r[7] * d[6];
        /* det D and its cofactors */
        const float c[9] = {
            d[4] * d[8] - d[5] * d[7], d[5] * d[6] - d[3] * d[8], d[3] * d[7] - d[4] * d[6],
            d[2] * d[7] - d[1] * d[8], d[0] * d[8] - d[2] * d[6], d[1] * d[6] - d[0] * d[7],
            d[1] * d[5] - d[2] * d[4], d[2] * d[3] - d[0] * d[5], d[0] * d[4] - d[1] * d[3]};
        const float det = d[0] * c[0] + d[1] * c[1] + d[2] * c[2];
        const float under = palp_max(PALP_CRUSHED - det, 0.0f);
        const float twice = xx * xx + yy * yy + zz * zz + 2.0f * (yz * yz + zx * zx + xy * xy);
        const float density =
            0.125f * (lambda * trace * trace + mu2 * twice) + 0.5f * wall * under * under;
        const float root = palp_sqrt(1.0f + density * per_limit), taper = 1.0f / root;
        const float push = e->volume[k] * wall * under * taper;
        const float pressure = lambda * trace + phi * (nxx + nyy + nzz);
        const float half = 0.5f * e->volume[k] * taper;
        const float sxx = half * (pressure + mu2 * xx + psi2 * nxx);
        const float syy = half * (pressure + mu2 * yy + psi2 * nyy);
        const float szz = half * (pressure + mu2 * zz + psi2 * nzz);
        const float syz = half * (mu2 * yz + psi2 * nyz);
        const float szx = half * (mu2 * zx + psi2 * nzx);
        const float sxy = half * (mu2 * xy + psi2 * nxy);
        for (uint32_t a = 0; a < 3u; a++) {
            const float *w = d + 3u * a;
            const float px = w[0] * sxx + w[1] * sxy + w[2] * szx - push * c[3u * a];
            const float py = w[0] * sxy + w[1] * syy + w[2] * syz - push * c[3u * a + 1u];
            const float pz = w[0] * szx + w[1] * syz + w[2] * szz - push * c[3u * a + 2u];
            const float f1 = px * b0 + py * b1 + pz * b2;
            const float f2 = px * b3 + py * b4 + pz * b5;
            const float f3 = px * b6 + py * b7 + pz * b8;
            e->f[0][a][k] = f1 + f2 + f3;
            e->f[1][a][k] = -f1;
            e->f[2][a][k] = -f2;
            e->f[3][a][k] = -f3;
        }
        /* |D|^2 <= 1 + the largest row sum of |eps|, and the stress that stretching adds */
        const float ayz = palp_abs(yz), azx = palp_abs(zx), axy = palp_abs(xy);
        const float row = palp_max(palp_max(xx + axy + azx, yy + axy + ayz), zz + azx + ayz);
        const float over = palp_max(row, 0.0f), square = 1.0f + over;
        const float stress =
            (0.5f * lambda * palp_max(trace, 0.0f) + 0.5f * mu2 * over) * per_kappa;
        const float cofactors = c[0] * c[0] + c[1] * c[1] + c[2] * c[2] + c[3] * c[3] +
                                c[4] * c[4] + c[5] * c[5] + c[6] * c[6] + c[7] * c[7] + c[8] * c[8];
        const float crushed =
            under > 0.0f ? PALP_WALL * cofactors : 0.0f; /* det D is linear in each node */
        e->stretch[k] = palp_max(taper * (square + stress + crushed), 1.0f);
        e->energy_J[k] = 2.0f * e->volume[k] * density / (root + 1.0f);
    }
}
